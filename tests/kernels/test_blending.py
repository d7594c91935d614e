"""Gradient bands against the specification's text in 3-vectors, its printed numbers, and where it leaves holes."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from kernels import blending
from kernels.wall import apart
from tests.kernels.checks import (
    BATCHES,
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    in_double,
    in_single,
)

FAN = np.array([(0, 0), (0, 1.5), (0, 4), (0, -1.5), (-1.5, 0), (1.5, 0)], float).T  # idle, F1, F2, B, Lf, Rt
HUMAN = np.array(
    [(0, 0), (-0.0056, 0.6971), (-0.0278, 2.7917), (0.0602, -1.1712), (-0.0546, -2.6334), (-1.0492, -0.0071),
     (-1.9147, 0.0354), (1.2783, 0.0145), (1.8698, 0.0277)]
).T  # fmt: skip
CORNER = np.array([(0, 0), (0, 1.5), (1.5, 0)], float).T  # nothing for half of all directions
RING = FAN[:, 1:]  # no idle sample
KINDS = {"polar": blending.polar, "cartesian": blending.cartesian}


def compat(samples, query):
    return blending.polar(samples, query, compat=True)


# --- the specification's text ----------------------------------------------------------------------------------------


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Of vectors [n, 3] or [3], between 0 and pi; 0 for a zero vector."""
    root = np.sqrt((a * a).sum(-1) * (b * b).sum(-1))
    angle = np.arccos(np.clip((a * b).sum(-1) / np.where(root < 1e-15, 1.0, root), -1, 1))
    return np.where(root < 1e-15, 0.0, angle)


def pair(p: np.ndarray, p_i: np.ndarray, p_j: np.ndarray) -> np.ndarray:
    """h_ij of 3.2, cases A to D, for queries p [n, 3]."""
    seen, k = p, 2
    if p_i @ p_i < 1e-10:
        theta_ij, theta_io, k = angle_between(p, p_j), np.zeros(len(p)), 1
    elif p_j @ p_j < 1e-10:
        theta_ij = theta_io = angle_between(p, p_i)
        k = 1
    else:
        theta_ij = np.full(len(p), angle_between(p_i, p_j))
        n = np.cross(p_i, p_j)
        if theta_ij[0] == 0:
            theta_io = np.zeros(len(p))
        else:
            if n @ n > 0:
                seen = p - np.outer(p @ n / (n @ n), n)
            theta_io = angle_between(p_i, seen)
            if theta_ij[0] < 0.99 * np.pi:
                theta_io = np.where(np.cross(p_i, seen) @ n < 0, -theta_io, theta_io)
            theta_io = np.where((p * p).sum(-1) < 1e-10, theta_ij, theta_io)
    length_i, length_j = np.linalg.norm(p_i), np.linalg.norm(p_j)
    mean = (length_i + length_j) / 2
    ij = k * theta_ij, (length_j - length_i) / mean
    io = k * theta_io, (np.linalg.norm(seen, axis=-1) - length_i) / mean
    return 1 - (ij[0] * io[0] + ij[1] * io[1]) / (ij[0] ** 2 + ij[1] ** 2)


def by_text(samples: np.ndarray, query: np.ndarray) -> np.ndarray:
    """Polar weights [m, n] of 3.2 for samples [2, m] and queries [2, n]."""
    lift = np.array([[1.0, 0], [0, 0], [0, 1]])
    points, p = (lift @ samples).T, (lift @ query).T
    band = []
    for i in range(len(points)):
        h = [pair(p, points[i], points[j]) for j in range(len(points)) if j != i]
        band.append(np.where(np.min(h, 0) < 0, 0.0, np.minimum(1.0, np.min(h, 0))))
    total = np.sum(band, 0)
    return np.where(total > 0, band / np.where(total > 0, total, 1.0), 0.0)


def straight_by_text(samples: np.ndarray, query: np.ndarray) -> np.ndarray:
    """Cartesian weights [m, n] of 3.1."""
    band = []
    for i in range(samples.shape[1]):
        to = [samples[:, j] - samples[:, i] for j in range(samples.shape[1]) if j != i]
        h = [1 - (query - samples[:, i, None]).T @ way / (way @ way) for way in to]
        band.append(np.maximum(0.0, np.min(h, 0)))
    return np.array(band) / np.sum(band, 0)


def random_samples(rng: np.random.Generator, count: int, idle: bool) -> np.ndarray:
    """Speeds 0.4 to 4 m/s in any direction, none near another."""
    while True:
        speed, angle = rng.uniform(0.4, 4.0, count), rng.uniform(-np.pi, np.pi, count)
        samples = speed * np.stack([np.sin(angle), np.cos(angle)])
        if idle:
            samples[:, 0] = 0.0
        apart = np.linalg.norm(samples[:, :, None] - samples[:, None], axis=0) + np.eye(count)
        if apart.min() > 0.3:
            return samples


def queries(rng: np.random.Generator, count: int) -> np.ndarray:
    return rng.uniform(0.0, 5.0, count) * (lambda a: np.stack([np.sin(a), np.cos(a)]))(rng.uniform(-9, 9, count))


SETS = [(count, idle) for count in (2, 3, 4, 6, 9) for idle in (False, True)]


@pytest.mark.parametrize(("count", "idle"), SETS)
def test_random_samples_follow_the_text(count: int, idle: bool) -> None:
    """With `compat` everywhere; without, wherever the text has no hole."""
    rng = np.random.default_rng(count + 10 * idle)
    for _ in range(3):
        samples, query = random_samples(rng, count, idle), queries(rng, 200)
        expected = by_text(samples, query)
        assert_close(in_double(compat, samples, query), expected, 1e-9)
        mended, single = in_double(blending.polar, samples, query), in_single(blending.polar, samples, query)
        assert_close(single, mended, 2e-4)
        moving = samples[:, np.linalg.norm(samples, axis=0) > 0]
        across = np.abs(np.angle(np.exp(1j * np.subtract.outer(angle_of(moving), angle_of(query))))).max(0)
        slow = np.linalg.norm(query, axis=0) < blending.FADE * np.linalg.norm(moving, axis=0).min()
        plain = (across < np.pi - blending.SEAM) & (idle | ~slow)
        assert plain.any() or count > 4
        assert_close(mended[:, plain], expected[:, plain], 1e-9)
        straight = straight_by_text(samples, query)
        assert_close(in_double(blending.cartesian, samples, query), straight, 1e-9)
        assert_close(in_single(blending.cartesian, samples, query), straight, 2e-4)


def angle_of(v: np.ndarray) -> np.ndarray:
    return np.arctan2(v[0], v[1])


@pytest.mark.parametrize("name", ["fan", "human"])
def test_samples_all_round_need_no_mending(name: str) -> None:
    samples, query = {"fan": FAN, "human": HUMAN}[name], queries(np.random.default_rng(1), 1000)
    expected = by_text(samples, query)
    assert_close(in_double(blending.polar, samples, query), expected, 1e-9)
    assert_close(expected.sum(0), np.ones(1000), 1e-9)


# --- printed numbers (9.4) -------------------------------------------------------------------------------------------

HALF = 1.5 / np.sqrt(2)
PRINTED = {
    (0, 0.75): (0.5, 0.5, 0, 0, 0, 0),
    (0, 2.75): (0, 0.5, 0.5, 0, 0, 0),
    (0, 6): (0, 0, 1, 0, 0, 0),
    (0.5, 0.5): (0.420030, 0.289985, 0, 0, 0, 0.289985),
    (HALF, HALF): (0.117861, 0.441069, 0, 0, 0, 0.441069),
    (1, 2): (0, 0.544513, 0.227458, 0, 0, 0.228029),
    (-2, -1): (0, 0, 0, 0.295167, 0.704833, 0),
}
PRINTED_STRAIGHT = {
    (1, 2): (0, 0.685714, 0.171429, 0, 0, 0.142857),
    (-2, -1): (0, 0, 0, 0.166667, 0.833333, 0),
    (0.5, 0.5): (0.5, 0.25, 0, 0, 0, 0.25),
}


@pytest.mark.parametrize("query", PRINTED)
def test_printed_polar_weights(query: tuple[float, float]) -> None:
    np.testing.assert_allclose(in_double(blending.polar, FAN, np.array(query, float)), PRINTED[query], atol=5.1e-7)
    np.testing.assert_allclose(in_single(blending.polar, FAN, np.array(query, float)), PRINTED[query], atol=2e-6)


@pytest.mark.parametrize("query", PRINTED_STRAIGHT)
def test_printed_cartesian_weights(query: tuple[float, float]) -> None:
    np.testing.assert_allclose(
        in_double(blending.cartesian, FAN, np.array(query, float)), PRINTED_STRAIGHT[query], atol=5.1e-7
    )


def test_printed_weights_of_other_sets() -> None:
    walk = in_double(blending.polar, np.array([[0, 0], [0, 1.5]]).T, np.array([0.75, 0.0]))
    np.testing.assert_allclose(walk, [1 - 0.309243, 0.309243], atol=5.1e-7)
    human = in_double(blending.polar, HUMAN, np.array([0.0, 1.0]))
    expected = [0, 0.816571, 0.137958, 0, 0, 0.008545, 0.0153, 0.021626, 0]
    np.testing.assert_allclose(human, expected, atol=4e-5)  # the printed velocities have four digits


def test_printed_slope_on_a_circle() -> None:
    """At 2 m/s less than 2.2e-4 for each 0.01 degrees."""
    angle = np.radians(np.arange(0, 360, 0.01))
    weights = in_double(blending.polar, FAN, 2.0 * np.stack([np.sin(angle), np.cos(angle)]))
    assert 1e-4 < np.abs(np.diff(weights)).max() < 2.2e-4


# --- properties (10.2 to 10.4) ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("count", "idle"), [(1, False), (1, True), *SETS])
def test_weights_are_shares_and_one_at_a_sample(kind: str, count: int, idle: bool) -> None:
    rng = np.random.default_rng(count)
    samples = random_samples(rng, count, idle)
    query = np.concatenate([queries(rng, 500), samples, samples * 1e-9], 1)
    weights = in_single(KINDS[kind], samples, query)
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(0), 1.0, atol=1e-6)
    assert_close(in_double(KINDS[kind], samples, samples), np.eye(count), 1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_midway_in_speed_is_half_and_half(kind: str) -> None:
    samples = np.array([(0, 0), (0.6, 0.8), (1.8, 2.4)]).T
    weights = in_double(KINDS[kind], samples, np.array([(0.3, 0.4), (1.2, 1.6)]).T)
    assert_close(weights, np.array([(0.5, 0.5, 0), (0, 0.5, 0.5)]).T, 1e-9)


@pytest.mark.parametrize("samples", [FAN, HUMAN, CORNER, RING])
def test_nothing_beyond_the_fastest(samples: np.ndarray) -> None:
    fastest = np.argmax(np.linalg.norm(samples, axis=0))
    weights = in_double(blending.polar, samples, samples[:, fastest, None] * np.linspace(1.0, 9.0, 50))
    assert_close(weights[fastest], np.ones(50), 1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("count", "idle"), SETS)
def test_turned_and_scaled_together(kind: str, count: int, idle: bool) -> None:
    rng = np.random.default_rng(7 * count)
    samples, query = random_samples(rng, count, idle), queries(rng, 300)
    expected = in_double(KINDS[kind], samples, query)
    for angle, size in ((1.0, 1.0), (-2.5, 1.0), (0.0, 0.1), (3.0, 20.0)):
        turn = size * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        assert_close(in_double(KINDS[kind], turn @ samples, turn @ query), expected, 1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_shapes_order_and_walls(kind: str) -> None:
    rng = np.random.default_rng(2)
    flat = queries(rng, 6)
    expected = in_single(KINDS[kind], FAN, flat)
    for batch in BATCHES:
        query = flat[:, : int(np.prod(batch))].reshape(2, *batch)
        assert_close(in_single(KINDS[kind], FAN, query), expected[:, : query[0].size].reshape(6, *batch), 1e-6)
    assert_close(in_single(KINDS[kind], FAN[:, ::-1], flat), expected[::-1], 1e-6)
    mapped = jax.jit(jax.vmap(KINDS[kind], (None, 1), 1))(jnp.asarray(FAN), jnp.asarray(flat))
    assert_close(mapped, expected, 1e-6)
    if kind == "polar":
        walled = in_single(lambda s, q: blending.weights(blending.bands(s), q, wall=apart), FAN, flat)
    else:
        walled = in_single(lambda s, q: blending.cartesian(s, q, apart), FAN, flat)
    assert_close(walled, expected, 1e-6)


# --- holes -----------------------------------------------------------------------------------------------------------


def steepest(function, samples: np.ndarray, query: np.ndarray) -> float:
    """Largest change of a weight per m/s between neighbouring queries."""
    change = np.abs(np.diff(in_double(function, samples, query)))
    return float((change / np.linalg.norm(np.diff(query), axis=0)).max())


def circle(radius: float) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, 20001)
    return radius * np.stack([np.sin(angle), np.cos(angle)])


def test_no_jump_opposite_to_a_sample() -> None:
    """Walking backwards with a forward and a sideways clip only: the text jumps there."""
    for radius in (0.3, 1.0, 3.0):
        assert steepest(compat, CORNER, circle(radius)) > 100
        assert steepest(blending.polar, CORNER, circle(radius)) < 6.0
    off_axis = np.array([(0, 0), (0.02, 1.0), (-0.05, 3.0)]).T
    assert steepest(compat, off_axis, circle(2.0)) > 100
    assert steepest(blending.polar, off_axis, circle(2.0)) < 6.0


def test_no_jump_through_standstill() -> None:
    """Across 0 m/s, past 1 mm/s off it too: with `compat` a set without an idle sample jumps."""
    way, aside = np.linspace(-1.5, 1.5, 30001), np.array([[0.0], [1e-3]])
    c, s = (f(np.array([0.0, 0.7, 3.0]))[:, None, None] for f in (np.cos, np.sin))
    query = np.stack([s * way + c * aside, c * way - s * aside])
    for samples in (FAN, CORNER, RING):
        assert steepest(blending.polar, samples, query) < 20.0
    assert steepest(compat, RING, query) > 100


def test_standstill_without_an_idle_sample() -> None:
    """The slow ones share; who has a slower one in its own direction gets nothing; directions do not count."""
    zero = np.zeros(2)
    assert in_double(compat, RING, zero).tolist() == [0] * 5
    assert_close(in_double(blending.polar, RING, zero), np.array([0.25, 0, 0.25, 0.25, 0.25]), 1e-9)
    assert_close(in_double(blending.polar, np.array([(0, 1.0), (0, 3)]).T, zero), np.array([1.0, 0]), 1e-9)
    around = in_double(blending.polar, RING, circle(1e-3))
    assert np.ptp(around, axis=1).max() < 1e-3


@pytest.mark.parametrize("kind", KINDS)
def test_samples_at_one_place_share(kind: str) -> None:
    double = np.concatenate([FAN, FAN[:, :2] + 1e-7], 1)  # a second idle, a second walk
    query = queries(np.random.default_rng(5), 500)
    weights, single = in_single(KINDS[kind], double, query), in_single(KINDS[kind], FAN, query)
    assert_close(weights[:2], weights[6:], 1e-6)
    assert_close(np.concatenate([2 * weights[:2], weights[2:6]]), single, 2e-4)
    same = np.tile([[0.0], [1.3]], (1, 3))
    assert_close(in_single(KINDS[kind], same, query), np.full((3, 500), 1 / 3), 1e-6)


# --- gradients -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("samples", [CORNER, RING])
def test_gradients(kind: str, samples: np.ndarray) -> None:
    """To the queries and to the samples, away from kinks."""
    moves = (samples != 0).any(0)  # an idle sample stays
    moved = samples + 0.05 * np.random.default_rng(3).normal(size=samples.shape) * moves
    query = queries(np.random.default_rng(4), 7)
    assert_gradients_agree(lambda d, q: KINDS[kind](moved + d * moves, q), np.zeros_like(moved), query)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("samples", [FAN, CORNER, RING, np.zeros((2, 3)), np.ones((2, 3)), FAN[:, :1], FAN[:, 1:2]])
def test_gradients_are_finite(kind: str, samples: np.ndarray) -> None:
    """At standstill, next to it, at the samples and opposite to them."""
    near = np.array([(0, 0), (1e-30, 0), (1e-6, 1e-6), (2e-5, 0)]).T
    query = np.concatenate([near, samples, -samples, 1.001 * samples, 100 * samples], 1)
    assert_gradient_finite(lambda s, q: KINDS[kind](s, q) * np.arange(1.0, len(s[0]) + 1)[:, None], samples, query)
