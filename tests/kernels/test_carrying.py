"""Carrying: equilibrium by bisection, moments by cross products, metabolic power against Pandolf's formula."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from kernels import carrying
from tests.kernels.checks import assert_gradient_finite, assert_gradients_agree, assert_matches_in_batches, in_single

RNG = np.random.default_rng(5)
MASS = RNG.uniform(5.0, 30.0, 6)
AHEAD = np.array([-0.4, -0.25, -0.1, 0.0, 0.2, 0.35])
ABOVE = RNG.uniform(-0.2, 0.8, 6)
TRUNK = RNG.uniform(10.0, 20.0, 6)


def moment(lean: np.ndarray) -> np.ndarray:
    """N m forward about the hips of trunk and load, from places and weights in space."""
    total = np.zeros_like(lean)
    for mass, ahead, above in ((MASS, AHEAD, ABOVE), (TRUNK, 0 * TRUNK, np.ones(6))):
        z = ahead * np.cos(lean) + above * np.sin(lean)
        y = above * np.cos(lean) - ahead * np.sin(lean)
        place, weight = np.stack([0 * z, y, z], -1), np.stack([0 * z, -mass * 9.81, 0 * z], -1)
        total += np.cross(place, weight)[:, 0]  # about +x, which turns +y towards +z: forward
    return total


def test_balanced_is_where_nothing_turns_the_body() -> None:
    low, high = np.full(6, -1.0), np.full(6, 1.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        falls = moment(middle) > 0  # forward of its balance an upside-down pendulum falls further forward
        low, high = np.where(falls, low, middle), np.where(falls, middle, high)
    expected = np.clip(low, -carrying.MOST_LEAN, carrying.MOST_LEAN)
    assert 0.05 < np.abs(expected).max() < carrying.MOST_LEAN
    assert_matches_in_batches(carrying.balanced, expected, MASS, AHEAD, ABOVE, TRUNK)


def test_torque_is_the_moment_of_the_weight() -> None:
    pitch = np.linspace(-0.5, 0.5, 6)
    trunk = 9.81 * TRUNK * np.sin(pitch)
    assert_matches_in_batches(carrying.torque, moment(pitch) - trunk, MASS, AHEAD, ABOVE, pitch, single=1e-6)


def power(speed: np.ndarray, mass: np.ndarray, load: np.ndarray) -> np.ndarray:
    """W, Pandolf, Givoni and Goldman 1977, on hard level ground."""
    whole = mass + load
    return 1.5 * mass + 2.0 * whole * (load / mass) ** 2 + 1.5 * whole * speed**2


def test_slowed_costs_as_much_as_without_the_load() -> None:
    mass, load, speed = np.full(6, 70.0), np.array([1.0, 5.0, 10.0, 20.0, 30.0, 35.0]), np.linspace(1.0, 2.0, 6)
    found = in_single(carrying.slowed, speed, mass, load, np.ones(6))
    np.testing.assert_allclose(power(found, mass, load), power(speed, mass, 0 * load), rtol=1e-5)
    assert (found < speed).all()
    assert found[3] / speed[3] == pytest.approx(0.86, abs=0.02)  # 20 of 70 kg


def test_slowed_at_its_ends() -> None:
    speed, mass, load = np.array([1.3, 0.0, 1.3]), np.full(3, 70.0), np.array([0.0, 20.0, 200.0])
    found = in_single(carrying.slowed, speed, mass, load, np.ones(3))
    assert found[0] == np.float32(1.3)
    np.testing.assert_allclose(found[1:], [0.0, carrying.LEAST_SPEED * 1.3], atol=2e-6)


def test_gradients() -> None:
    assert_gradients_agree(carrying.balanced, MASS[:3], AHEAD[:3], ABOVE[:3], TRUNK[:3])
    assert_gradients_agree(carrying.torque, MASS, AHEAD, ABOVE, np.linspace(-0.5, 0.5, 6))
    assert_gradients_agree(carrying.slowed, np.full(6, 1.3), np.full(6, 70.0), MASS, np.ones(6))


def test_gradients_stay_finite() -> None:
    zero, one = np.zeros(2), np.ones(2)
    assert_gradient_finite(carrying.balanced, zero, zero, zero, zero)
    assert_gradient_finite(carrying.balanced, 1e3 * one, -one, -one, one)
    assert_gradient_finite(carrying.slowed, zero, one, np.array([0.0, 5.0]), one)
    assert_gradient_finite(lambda mass: carrying.slowed(jnp.ones(2), jnp.ones(2), mass, jnp.ones(2)), zero)
