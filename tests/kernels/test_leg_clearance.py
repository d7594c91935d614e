"""Clearance between legs: nearest points against a fine search, and what must hold of feet that give way."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from kernels import leg_clearance
from tests.kernels.checks import (
    assert_gradient_finite,
    assert_gradients_agree,
    assert_matches,
    assert_matches_in_batches,
    in_double,
    unit_vectors,
)


def segments(seed: int, count: int) -> list[np.ndarray]:
    """Ends of two segments, (x, z); of every sort: crossing, apart, parallel, points."""
    ends = list(np.random.default_rng(seed).uniform(-1, 1, (4, 2, count)))
    ends[1][:, 1] = ends[0][:, 1]  # a point
    ends[3][:, 2] = ends[2][:, 2]
    ends[1][:, 3] = ends[0][:, 3] + (ends[3][:, 3] - ends[2][:, 3])  # parallel
    return ends


def test_nearest_points_of_segments() -> None:
    ends = segments(1, 40)
    t = np.linspace(0, 1, 401)
    one, other = (a[..., None] + (b - a)[..., None] * t for a, b in (ends[:2], ends[2:]))
    apart = one[:, :, :, None] - other[:, :, None, :]
    least = np.sqrt((apart**2).sum(0)).min((1, 2))
    found = np.linalg.norm(in_double(leg_clearance.between, *ends), axis=0)
    assert np.all(found <= least + 1e-5) and np.all(found >= least - 5e-3)
    assert np.any(found < 1e-5), "some segments cross"


def test_beside_keeps_the_gap_on_the_own_side() -> None:
    rng = np.random.default_rng(2)
    place, other, left = rng.normal(size=(2, 6)), rng.normal(size=(2, 6)), unit_vectors(rng, 2, 6)
    side, gap = np.array([1.0, -1, 1, -1, 0, 0]), np.full(6, 0.7)
    across = ((place - other) * left).sum(0)
    expected = place + left * side * np.maximum(gap - side * across, 0)
    assert_matches_in_batches(leg_clearance.beside, expected, place, other, left, side, gap)
    after = ((expected - other) * left).sum(0) * side
    assert np.all(after[:4] >= 0.7 - 1e-12), "apart"
    np.testing.assert_allclose(expected[:, 4:], place[:, 4:])


def test_giving_way_ends_at_the_gap_and_is_continuous() -> None:
    out, gap = np.array([[1.0], [0.0]]), np.array([0.2])
    ways = np.stack([np.linspace(-0.3, 0.3, 601), np.full(601, 0.02)])
    moved = in_double(leg_clearance.given_way, ways, np.broadcast_to(out, ways.shape), gap)
    distance = np.linalg.norm(ways, axis=0)
    np.testing.assert_array_equal(moved[:, distance > 0.2], 0.0)
    np.testing.assert_allclose(np.linalg.norm(moved, axis=0), np.maximum(0.2 - distance, 0), atol=1e-9)
    assert np.abs(np.diff(moved, axis=1)).max() < 0.02, "no jump where it passes the other foot"
    crossing = in_double(leg_clearance.given_way, np.zeros((2, 1)), out, gap)
    np.testing.assert_allclose(crossing[:, 0], [0.2, 0.0], atol=1e-5, err_msg="to its own side")


def test_gradients() -> None:
    def way(*ends: jnp.ndarray) -> jnp.ndarray:
        out = jnp.broadcast_to(jnp.array([[1.0], [0.0]]), ends[0].shape)
        return leg_clearance.given_way(leg_clearance.between(*ends), out, jnp.asarray(0.9))

    assert_gradients_agree(way, *(end[:, 4:] for end in segments(3, 12)))
    same = np.zeros((2, 3))
    assert_gradient_finite(way, same, same, same, same)


def test_a_foot_far_away_is_left_alone() -> None:
    far = np.full((2, 4), 5.0)
    assert_matches(leg_clearance.given_way, np.zeros((2, 4)), far, np.ones((2, 4)), np.full(4, 0.3))
