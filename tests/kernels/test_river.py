"""River profiles against their formulas; turbulence against its sum, its statistics, and a divergence of zero."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from crowd import river_flow
from crowd.scenario_world import FluidRegion
from kernels import river, turbulence
from tests.kernels.checks import (
    BATCHES,
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    assert_matches,
    in_double,
    in_single,
)


def stream(batch: tuple[int, ...], log: bool, seed: int = 0) -> river.River:
    rng = np.random.default_rng(seed)
    toward = rng.uniform(-4, 4, batch)
    parts: list[Any] = [
        np.stack([np.sin(toward), np.cos(toward)]),
        rng.uniform(-5, 5, (2, *batch)),
        rng.uniform(0.2, 2, batch),
        rng.uniform(2, 9, batch),
        10.0 ** rng.uniform(-3, -1, batch),
        np.full(batch, float(log)),
        np.full(batch, float(log)),
    ]
    return river.River(*parts)


@pytest.mark.parametrize("log", [False, True], ids=["parabolic", "log"])
@pytest.mark.parametrize("batch", BATCHES)
def test_profiles(batch: tuple[int, ...], log: bool) -> None:
    rng = np.random.default_rng(1)
    one, place = stream(batch, log), rng.uniform(-12, 12, (2, *batch))
    (dx, dz), (x, z) = one.direction, place - one.through
    bank = np.maximum(one.half_width - np.abs(x * dz - z * dx), 0.0)
    s = 1 - bank / one.half_width
    expected = np.log(1 + bank / one.roughness) / np.log(1 + one.half_width / one.roughness) if log else 1 - s**2
    assert_matches(river.across, expected, one, place)
    height, depth = rng.uniform(-0.2, 2, batch), rng.uniform(0.1, 1.5, batch)
    expected = np.log(1 + np.clip(height, 0, depth) / one.roughness) / np.log(1 + depth / one.roughness)
    assert_matches(river.down, expected if log else np.ones(batch), one, height, depth)


def test_profile_gradients() -> None:
    def run(one: Any, place: Any, height: Any, depth: Any) -> Any:
        return river.across(one, place) + river.down(one, height, depth)

    one = stream((4,), True)
    place = one.through + 0.6 * one.half_width * np.random.default_rng(0).uniform(0.2, 1, (2, 4))
    assert_gradients_agree(run, one, place, np.full(4, 0.3), np.full(4, 0.8), tolerance=1e-4)
    for at in (one.through, one.through + 100.0):  # on the middle line, and on land
        assert_gradient_finite(run, one, at, np.full(4, -1.0), np.zeros(4))


def eddies(count: int = 12, intensity: float = 0.3) -> turbulence.Eddies:
    model = {"intensity_m_s": intensity, "modes": count, "length_m": 1.5}
    region = FluidRegion.model_validate(
        {"fluid": "water", "surface_m": 0.0, "flow_m_s": (0.4, 0.0, 0.8), "turbulence": model}
    )
    found = river_flow.modes(region, 5)
    assert found is not None
    parts: list[Any] = [found.amplitude, found.number, found.frequency, found.phase]
    return turbulence.Eddies(*parts)


def flow(table: turbulence.Eddies, place: Any, time: Any, points: Any) -> Any:
    phase = turbulence.phases(table, place, time)
    return turbulence.velocity(table, table.amplitude.reshape(-1, *(1,) * time.ndim) + 0 * phase, phase, points)


def summed(table: turbulence.Eddies, x: np.ndarray, z: np.ndarray, time: np.ndarray) -> np.ndarray:
    total = np.zeros((2, *x.shape))
    for a, (kx, kz), omega, phase in zip(table.amplitude, table.number.T, table.frequency, table.phase, strict=True):
        size = a * np.cos(kx * x + kz * z - omega * time + phase) / np.hypot(kx, kz)
        total += np.stack([-kz * size, kx * size])
    return total


@pytest.mark.parametrize("batch", BATCHES)
def test_turbulence(batch: tuple[int, ...]) -> None:
    rng, table = np.random.default_rng(2), eddies()
    place, time, points = rng.uniform(-9, 9, (2, *batch)), rng.uniform(0, 30, batch), rng.normal(size=(3, 5, *batch))
    expected = summed(table, place[0] + points[0], place[1] + points[2], time)
    assert_close(in_double(flow, table, place, time, points), expected, 1e-9)
    assert_close(in_single(flow, table, place, time, points), expected, 1e-4)
    if batch == BATCHES[-1]:
        assert_gradients_agree(flow, table, place, time, points)


def test_turbulence_has_no_divergence() -> None:
    with jax.enable_x64(True):
        table = turbulence.Eddies(*(jnp.asarray(x) for x in eddies()))

        def at(x: jax.Array) -> jax.Array:
            return flow(table, jnp.zeros(2), jnp.array(2.0), jnp.stack([x[0], 0 * x[0], x[1]])[:, None])[:, 0]

        for x in np.random.default_rng(0).normal(size=(6, 2)):
            slope = np.asarray(jax.jacfwd(at)(jnp.asarray(x)))
            assert np.abs(slope).max() > 0.01
            np.testing.assert_allclose(np.trace(slope), 0.0, atol=1e-12)


@pytest.mark.parametrize("count", [4, 32])
def test_turbulence_is_as_strong_as_asked_for(count: int) -> None:
    """Root mean square of each component over space and time, with no mean."""
    rng = np.random.default_rng(3)
    x, z, time = rng.uniform(-300, 300, (3, 200_000))
    found = summed(eddies(count), x, z, time)
    np.testing.assert_allclose(np.sqrt((found**2).mean(1)), 0.3, rtol=0.02)
    np.testing.assert_allclose(found.mean(1), 0.0, atol=0.005)
