"""High steps: how far by depth, and the arch over the water."""

from __future__ import annotations

import numpy as np

from kernels import high_step
from tests.kernels.checks import (
    assert_gradient_finite,
    assert_gradients_agree,
    assert_matches_in_batches,
    in_double,
)


def step(x: np.ndarray) -> np.ndarray:
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)


def test_share_of_depth() -> None:
    depth, most = np.array([-np.inf, 0.0, 0.02, 0.2, 0.3, 0.41]), np.full(6, 0.32)
    expected = step(depth / 0.032) * (1 - step((depth - 0.32) / 0.16))
    assert_matches_in_batches(high_step.share, expected, depth, most)
    at = in_double(high_step.share, np.array([-np.inf, 0.0, 0.1, 0.32, 0.48, 2.0]), np.full(6, 0.32))
    np.testing.assert_allclose(at, [0, 0, 1, 1, 0, 0], atol=1e-12)


def test_feet_pass_over_the_water_and_end_on_the_ground() -> None:
    flight = np.linspace(0, 1, 201)
    clip = 0.05 * np.sin(np.pi * flight)
    whole = in_double(high_step.raised, clip, np.full(201, 0.3), flight, np.ones(201))
    np.testing.assert_allclose(whole[[0, -1]], 0.0, atol=1e-12)
    assert whole[100] == 0.3 and np.all(whole >= clip) and np.abs(np.diff(whole)).max() < 0.013
    assert np.all(whole[(flight > 0.2) & (flight < 0.8)] > 0.25), "out of the water for most of the swing"
    high = in_double(high_step.raised, np.full(3, 0.5), np.full(3, 0.3), np.full(3, 0.5), np.ones(3))
    np.testing.assert_array_equal(high, 0.5, err_msg="a clip that steps higher stays")
    none = in_double(high_step.raised, clip, np.full(201, 0.3), flight, np.zeros(201))
    np.testing.assert_array_equal(none, clip)


def test_shapes_and_gradients() -> None:
    rng = np.random.default_rng(4)
    height, needed, flight, share = rng.uniform(0, 0.1, 6), rng.uniform(0.2, 0.4, 6), rng.random(6), rng.random(6)
    arch = 1 - (2 * flight - 1) ** 4
    expected = height + share * np.maximum(needed * arch - height, 0)
    assert_matches_in_batches(high_step.raised, expected, height, needed, flight, share)
    assert_gradients_agree(high_step.raised, height, needed, flight, share)
    depth = np.array([-np.inf, 0.0, 0.32, 0.48])
    assert_gradient_finite(high_step.share, np.maximum(depth, -1e3), np.full(4, 0.32))
