"""Waves against Airy's potential in NumPy, and against what any such flow must be: free of divergence and curl."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

from crowd.wave_components import wavenumber
from kernels import waves
from tests.kernels.checks import (
    BATCHES,
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    in_double,
    in_single,
)

POINTS = 5


def sea(seed: int = 0, count: int = 4, current: Any = (0.0, 0.0)) -> waves.Waves:
    """Components of all directions in water of 0.3 to 30 m."""
    rng = np.random.default_rng(seed)
    k, toward, depth = rng.uniform(0.3, 4, count), rng.uniform(-4, 4, count), 10.0 ** rng.uniform(-0.5, 1.5, count)
    number = k * np.stack([np.sin(toward), np.cos(toward)])
    sigma = np.sqrt(9.81 * k * np.tanh(k * depth))
    apparent = sigma + np.asarray(current) @ number
    parts: list[Any] = [rng.uniform(0.02, 0.2, count), number, sigma, apparent, rng.uniform(0, 7, count), depth]
    return waves.Waves(*parts)


def places(batch: tuple[int, ...], seed: int = 1) -> tuple[np.ndarray, ...]:
    """place, time, points about it, still level over it: some points in the air, some below the bottom."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (3, POINTS, *batch)) * np.array([1, 2, 1]).reshape(3, *(1,) * (1 + len(batch)))
    return rng.uniform(-9, 9, (2, *batch)), rng.uniform(0, 20, batch), points, rng.uniform(0.5, 1.5, batch)


def everything(table: waves.Waves, place: Any, time: Any, points: Any, still: Any) -> tuple[Any, Any]:
    """Rise over the place, and rise and velocity at the points."""
    phase = waves.phases(table, place, time)
    amplitude = table.amplitude.reshape(-1, *(1,) * time.ndim) + 0 * phase
    return waves.rise(amplitude, phase), waves.motion(table, amplitude, phase, points, still)


def airy(table: waves.Waves, place: np.ndarray, time: Any, points: np.ndarray, still: Any) -> np.ndarray:
    """[4, P] of one character: with the hyperbolic functions as they are in books."""
    out = np.zeros((4, points.shape[1]))
    for a, (kx, kz), sigma, omega, phase, h in zip(
        table.amplitude, table.number.T, table.frequency, table.apparent, table.phase, table.depth, strict=True
    ):
        k = np.hypot(kx, kz)
        theta = kx * (place[0] + points[0]) + kz * (place[1] + points[2]) - omega * time + phase
        y = np.clip(points[1] - still, -h, 0)
        along = a * sigma * np.cosh(k * (y + h)) / np.sinh(k * h) * np.cos(theta)
        upward = a * sigma * np.sinh(k * (y + h)) / np.sinh(k * h) * np.sin(theta)
        out += np.stack([a * np.cos(theta), along * kx / k, upward, along * kz / k])
    return out


@pytest.mark.parametrize("batch", BATCHES)
def test_motion(batch: tuple[int, ...]) -> None:
    table, at = sea(current=(0.5, -0.3)), places(batch)
    expected = np.zeros((4, POINTS, *batch))
    over = np.zeros(batch)
    for i in np.ndindex(batch):
        place, time, points, still = (x[(..., *i)] for x in at)
        expected[(..., *i)] = airy(table, place, time, points, still)
        over[i] = airy(table, place, time, np.zeros((3, 1)), still)[0, 0]
    assert_close(in_double(everything, table, *at), (over, expected), 1e-7)
    assert_close(in_single(everything, table, *at), (over, expected), 2e-5)


def test_gradients() -> None:
    place, time, points, still = places((2,), seed=3)
    points[1] = -np.abs(points[1]) * 0.1  # off the surface and the bottom, where the decay has a corner
    assert_gradients_agree(everything, sea(2), place, time, points, still)


@pytest.mark.parametrize("case", ["shallow", "very deep", "very long", "at the bottom", "no amplitude"])
def test_degenerate(case: str) -> None:
    table = sea()
    place, time, points, still = places((2,))
    if case == "shallow":
        table = table._replace(depth=np.full(4, 1e-3))
    elif case == "very deep":
        table = table._replace(depth=np.full(4, 1e4), number=100 * table.number)
        points[1] = -1e3
    elif case == "very long":
        table = table._replace(number=1e-3 * table.number)
    elif case == "at the bottom":
        points[1] = -1e4
    else:
        table = table._replace(amplitude=np.zeros(4))
        still = np.full(2, -np.inf)
    assert_gradient_finite(everything, table, place, time, points, np.maximum(still, -1e30))
    _, found = in_single(everything, table, place, time, points, still)
    assert np.isfinite(found).all()
    if case == "no amplitude":
        assert (found == 0).all()


def test_no_divergence_and_no_curl() -> None:
    """Below the still level the flow is a potential flow of an incompressible fluid."""
    with jax.enable_x64(True):
        table = waves.Waves(*(jnp.asarray(x) for x in sea(5)))

        def velocity(x: jax.Array) -> jax.Array:
            place, time = jnp.array([1.0, 2.0]), jnp.array(3.0)
            return everything(table, place, time, x[:, None], jnp.array(0.0))[1][1:, 0]

        for x in np.random.default_rng(0).uniform(-0.25, -0.01, (6, 3)):
            slope = np.asarray(jax.jacfwd(velocity)(jnp.asarray(x)))
            assert np.abs(slope).max() > 0.1
            np.testing.assert_allclose(np.trace(slope), 0.0, atol=1e-8)
            np.testing.assert_allclose(slope, slope.T, atol=1e-8)


def test_surface_goes_with_the_water() -> None:
    """At the still level the water rises as fast as the surface does (without a current)."""
    with jax.enable_x64(True):
        table = waves.Waves(*(jnp.asarray(x) for x in sea(6)))

        def surface(time: jax.Array) -> jax.Array:
            return everything(table, jnp.zeros(2), time, jnp.zeros((3, 1)), jnp.array(0.0))[0]

        upward = everything(table, jnp.zeros(2), jnp.array(1.7), jnp.zeros((3, 1)), jnp.array(0.0))[1][2, 0]
        np.testing.assert_allclose(jax.grad(surface)(jnp.array(1.7)), upward, rtol=1e-9)


@pytest.mark.parametrize("depth", [0.05, 0.7, 3.0, 1e4])
def test_dispersion(depth: float) -> None:
    """Against the root found by bisection; limits: sqrt(g k) in deep water, k sqrt(g h) in shallow."""
    for sigma in (0.2, 1.0, 5.0, 30.0):
        k = float(wavenumber(np.array(sigma), depth))
        expected: Any = brentq(lambda k, s=sigma: 9.81 * k * np.tanh(k * depth) - s**2, 1e-9, 1e4, xtol=1e-14)
        np.testing.assert_allclose(k, expected, rtol=1e-9)
        np.testing.assert_allclose(in_double(waves.dispersion, np.array(k), np.array(depth)), sigma, rtol=1e-9)
    at = np.array(1e-3), np.array(1.0)
    np.testing.assert_allclose(in_double(waves.dispersion, *at), 1e-3 * np.sqrt(9.81), rtol=1e-6)
