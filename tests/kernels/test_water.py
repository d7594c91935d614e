"""Waves against Airy's: dispersion, energy, volume, Kelvin's wake; bodies that push and block; mirrored pools."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from kernels import water
from tests.kernels.checks import arrays, assert_gradient_finite, assert_gradients_agree, assert_matches

G = water.GRAVITY
STILL = np.zeros(2)


def made(shape: tuple[int, int], cell: float, dt: float, depth: float, current: np.ndarray = STILL) -> Any:
    return water.waves(
        shape, jnp.asarray(cell), dt, jnp.asarray(depth), jnp.asarray(0.25 * depth), jnp.asarray(current)
    )


def nothing(height: Any) -> Any:
    """The spectrum of no bodies at all."""
    return jnp.fft.rfft2(jnp.zeros_like(height))


def along(height: np.ndarray) -> np.ndarray:
    """A motion [..., 2, rows, columns] without eddies: of a random field."""
    z, x = np.fft.fftfreq(height.shape[-2])[:, None], np.fft.rfftfreq(height.shape[-1])
    toward = 1j * np.stack([x + 0 * z, z + 0 * x]) / np.maximum(np.hypot(x, z), 1e-12)
    return np.fft.irfft2(toward * np.fft.rfft2(height)[..., None, :, :], height.shape[-2:])


def bumps(seed: int, *shape: int) -> np.ndarray:
    """Smooth random fields: a few long waves each."""
    rows, columns = (np.arange(size) / size for size in shape[-2:])
    rng, out = np.random.default_rng(seed), np.zeros(shape)
    for _ in range(6):
        m, n = rng.integers(-4, 5, 2)
        phase = rng.uniform(0, 2 * np.pi, shape[:-2])[..., None, None]
        out += np.cos(2 * np.pi * (m * rows[:, None] + n * columns) + phase)
    return 0.02 * out


def run(fields: Any, wave: Any, steps: int, calm: Any = 0.0, blocked: Any = 0.0, dt: float = 1 / 60) -> list[Any]:
    """Height and motion after each step without bodies that move: [steps, ...]."""
    none, still = jnp.zeros_like(fields[0]), nothing(fields[0])

    def one(carry: Any, _: Any) -> Any:
        height, motion = water.propagate(carry[0], carry[1], still, still, wave)
        carry = water.damped(height, motion, calm + none, blocked + none, dt)
        return carry, carry

    return list(jax.jit(lambda f: jax.lax.scan(one, f, None, steps))(fields)[1])


@pytest.mark.parametrize("dt", [1 / 240, 1 / 60, 0.31])
@pytest.mark.parametrize("depth", [0.1, 0.9, 50.0])
@pytest.mark.parametrize("cycles", [(0, 1), (0, 5), (-3, 4)])
def test_plane_waves_travel_as_airy_says(cycles: tuple[int, int], depth: float, dt: float) -> None:
    """The phase speed is sqrt(g tanh(k h) / k), whatever the step; both fields keep the amplitude."""
    rows, columns, cell = 24, 40, 0.25
    kz, kx = 2 * np.pi * cycles[0] / (rows * cell), 2 * np.pi * cycles[1] / (columns * cell)
    k = np.hypot(kx, kz)
    z, x = np.meshgrid(np.arange(rows) * cell, np.arange(columns) * cell, indexing="ij")
    speed = np.sqrt(G * np.tanh(k * depth) / k)

    def crest(time: float) -> tuple[np.ndarray, np.ndarray]:
        phase = kx * x + kz * z - k * speed * time
        crests = 0.1 * np.cos(phase)
        return crests, np.stack([crests * kx / k, crests * kz / k])

    def three(height: Any, motion: Any) -> Any:
        wave, none = made((rows, columns), cell, dt, depth), nothing(height)
        for _ in range(3):
            height, motion = water.propagate(height, motion, none, none, wave)
        return height, motion

    assert_matches(three, crest(3 * dt), *crest(0.0), double=1e-9, single=1e-5)


def test_a_current_carries_waves_along() -> None:
    """Over water that moves, the pattern in still water is found shifted by the way the water has gone."""
    cell, dt, depth = 0.25, 0.1, 0.7
    height, motion = jnp.asarray(bumps(0, 16, 32)), jnp.asarray(along(bumps(1, 16, 32)))
    current = np.array([2 * cell, -cell]) / dt
    none = nothing(height)
    still = water.propagate(height, motion, none, none, made((16, 32), cell, dt, depth))
    moved = water.propagate(height, motion, none, none, made((16, 32), cell, dt, depth, current))
    for a, b in zip(still, moved, strict=True):
        np.testing.assert_allclose(np.roll(a, (-1, 2), (-2, -1)), b, atol=1e-6)


@pytest.mark.parametrize("batch", [(), (1,), (3, 2)])
def test_energy_is_kept_and_batches_do_not_mix(batch: tuple[int, ...]) -> None:
    shape = (*batch, 20, 27)
    height, motion = jnp.asarray(bumps(2, *shape)), jnp.asarray(along(bumps(3, *shape)))
    wave = made((20, 27), 0.2, 1 / 60, 0.8)
    after = run((height, motion), wave, 600)
    energy = np.asarray(water.energy(after[0], after[1], cell=0.2))
    assert energy.shape == (600, *batch)
    np.testing.assert_allclose(energy, np.broadcast_to(water.energy(height, motion, 0.2), energy.shape), rtol=2e-4)
    if batch:
        alone = run((height[0], motion[0]), wave, 600)
        np.testing.assert_allclose(alone[0], after[0][:, 0], atol=1e-6)


def test_the_border_takes_waves_in() -> None:
    """Energy never grows; of a drop's rings less than a thousandth comes back or round."""
    shape, cell, dt, depth = (96, 96), 0.2, 1 / 60, 0.9
    z, x = np.mgrid[:96, :96] - 47.5
    drop = jnp.asarray(0.1 * np.exp(-(x**2 + z**2) / 18.0))
    calm = water.border(shape, 20.0, 9.0 * np.sqrt(G * depth) / 4.0)
    height, motion = run((drop, jnp.zeros((2, *shape))), made(shape, cell, dt, depth), 1200, calm)
    energy = np.asarray(water.energy(height, motion, cell))
    assert (np.diff(energy) <= 1e-6 * energy[0]).all()
    assert energy[-1] < 1e-3 * energy[0]


def test_a_barrier_reflects() -> None:
    """A packet of 0.9 m waves meets 0.8 m of blocked water: most comes back, no volume is lost, energy never grows."""
    shape, cell, dt = (4, 384), 0.1, 1 / 60
    x = (np.arange(384) + 0.5) * cell
    packet = 0.05 * np.exp(-(((x - 12.0) / 0.6) ** 2)) * np.cos(2 * np.pi * (x - 12.0) / 0.9)
    start = np.broadcast_to(packet, shape), np.stack([np.broadcast_to(packet, shape), np.zeros(shape)])  # to the right
    wall = jnp.asarray(np.broadcast_to((x > 18.0) & (x < 18.8), shape) * 30.0)
    height, motion = run(tuple(map(jnp.asarray, start)), made(shape, cell, dt, 0.8), 480, blocked=wall)
    energy = np.asarray(water.energy(height, motion, cell))
    assert (np.diff(energy) <= 1e-6 * energy[0]).all()
    np.testing.assert_allclose(height.sum((1, 2)), float(height[0].sum()), atol=1e-4)
    at_end = [float(water.energy(height[-1][:, part], motion[-1][..., part], cell)) for part in (x > 19.0, x < 17.8)]
    assert at_end[0] < 0.05 * energy[0]
    assert at_end[1] > 0.5 * energy[0]


def test_only_steep_waves_break() -> None:
    """Up to a slope of 0.4 nothing is lost; beyond it energy falls, no volume does, and the rate is bounded."""
    x = np.arange(64) * 0.1
    k = 2 * np.pi * 4 / 6.4
    wave = np.broadcast_to(np.cos(k * x), (8, 64))
    gentle, steep, wild = (
        np.asarray(water.breaking(jnp.asarray(a / k * wave), jnp.asarray(0.1))) for a in (0.4, 0.8, 9)
    )
    assert not gentle.any()
    assert 20.0 < steep.max() < 10.0 * (2.0**2 - 1.0) + 1e-3
    np.testing.assert_allclose(wild.max(), 100.0)


def test_splat_keeps_amount_and_place() -> None:
    rng = np.random.default_rng(4)
    u, v, amount = rng.uniform(3, 20, 50), rng.uniform(3, 14, 50), rng.uniform(0, 2, 50)
    grid = np.asarray(water.splat((18, 24), *arrays((u, v, amount), np.float32)))
    np.testing.assert_allclose(grid.sum(), amount.sum(), rtol=1e-5)
    np.testing.assert_allclose((grid.sum(0) * np.arange(24)).sum(), (amount * u).sum(), rtol=1e-5)
    np.testing.assert_allclose((grid.sum(1) * np.arange(18)).sum(), (amount * v).sum(), rtol=1e-5)
    off = water.splat((18, 24), jnp.array([-40.0, 1e9]), jnp.array([5.0, -1e9]), jnp.ones(2))
    assert not np.asarray(off).any()


def layers(upper: Any, lower: Any, wave: Any) -> Any:
    return water.pushed(jnp.stack([upper, lower]), wave)


def test_sources_conserve_volume() -> None:
    """Bodies that move leave the volume as it is; one that comes in raises it by what it displaces."""
    shape, cell, depth = (40, 48), 0.1, 0.9
    u, v = jnp.array([12.3, 30.2]), jnp.array([20.0, 11.7])
    amount = jnp.array([0.03, 0.02])  # m3
    wave = made(shape, cell, 1 / 60, depth, np.array([0.3, 0.0]))
    at = [water.splat(shape, u + way, v, amount / (cell * cell * depth)) for way in (0.0, 0.4)]
    now, then = (layers(share, share, wave) for share in at)
    none = jnp.zeros(shape)
    moved, _ = water.propagate(none, jnp.zeros((2, *shape)), now, then, wave)
    entered, _ = water.propagate(none, jnp.zeros((2, *shape)), nothing(none), now, wave)
    assert abs(float(moved.sum())) * cell * cell < 1e-7
    np.testing.assert_allclose(float(entered.sum()) * cell * cell, 0.05, rtol=1e-4)
    assert float(moved[:, 14:20].max()) > 0 > float(moved[:, 8:12].min()), "high ahead, low behind"


@pytest.mark.parametrize("depth", [0.3, 0.9, 40.0])
def test_sources_lift_the_surface_as_their_depth_allows(depth: float) -> None:
    """Against the integral over the layers of cosh(k (z + h)) / cosh(k h), by quadrature."""
    wave, cell, upper = made((16, 32), 0.2, 1 / 60, depth), 0.2, 0.25 * depth
    for column in (1, 4, 15):
        k = 2 * np.pi * column / (32 * cell)
        down = np.linspace(-depth, 0.0, 200_001)
        share = np.exp(k * down) * (1 + np.exp(-2 * k * (down + depth))) / (1 + np.exp(-2 * k * depth))
        pieces = [np.trapezoid(share[part], down[part]) for part in (down >= -upper, down <= -upper)]
        np.testing.assert_allclose(wave.reach[:, 0, column], pieces, rtol=2e-3, atol=1e-6)
        np.testing.assert_allclose(wave.reach[:, 0, column].sum(), np.tanh(k * depth) / k, rtol=1e-5)
    np.testing.assert_allclose(wave.reach[:, 0, 0], [upper, depth - upper], rtol=1e-5)


def wake(speed: float, row: float = 64.0, sign: float = 1.0) -> np.ndarray:
    """Height behind a body that has gone 60 m over deep water, in cells of 0.25 m; it stands in column 320."""
    shape, cell, dt, steps = (128, 384), 0.25, 1 / 30, 600
    wave = made(shape, cell, dt, 100.0)
    calm = water.border(shape, 16, 10.0)

    def one(carry: Any, frame: Any) -> Any:
        height, motion, before = carry
        column = 320.0 - speed * (steps - 1 - frame) * dt / cell
        column = jnp.where(sign > 0, column, 383.0 - column)
        spread = jnp.arange(-1.0, 2.0)
        u, v = (column + spread[:, None] + 0 * spread).reshape(-1), (row + spread + 0 * spread[:, None]).reshape(-1)
        body = water.splat(shape, u, v, jnp.full(9, 0.1))
        now = layers(body, body, wave)
        height, motion = water.propagate(height, motion, jnp.where(frame > 0, before, now), now, wave)
        return (*water.damped(height, motion, calm, jnp.zeros(shape), dt), now), None

    none = jnp.zeros(shape)
    return np.asarray(
        jax.jit(lambda: jax.lax.scan(one, (none, jnp.zeros((2, *shape)), nothing(none)), jnp.arange(steps)))()[0][0]
    )


def test_a_moving_body_makes_kelvins_wake() -> None:
    """Waves lie behind, inside 19.5 degrees and highest near that edge; little is ahead; mirrored tracks mirror it."""
    height = wake(3.0)
    ahead, behind = np.abs(height[:, 336:370]).max(), np.abs(height[:, 200:300]).max()
    assert ahead < 0.03 * behind
    for distance in (15.0, 20.0, 25.0):
        at = 320 - round(distance / 0.25)
        strength = np.sqrt((height[:, at - 8 : at + 8] ** 2).mean(1))
        angle = np.degrees(np.arctan2((np.arange(128) - 64.0) * 0.25, distance))
        assert 13.0 < abs(angle[np.argmax(strength)]) < 21.0
        assert (strength[np.abs(angle) > 25.0] ** 2).sum() < 0.06 * (strength**2).sum()
    np.testing.assert_allclose(wake(3.0, sign=-1.0), height[:, ::-1], atol=2e-4 * behind)
    np.testing.assert_allclose(wake(3.0, row=63.0), height[::-1], atol=2e-4 * behind)


def test_surface_flow_is_that_of_the_wave() -> None:
    """Under a crest of a progressive wave the water goes with it, at omega a / tanh(k h)."""
    rows, columns, cell, depth = 16, 32, 0.2, 0.5
    k = 2 * np.pi * 3 / (columns * cell)
    phase = np.broadcast_to(k * np.arange(columns) * cell, (rows, columns))
    omega = np.sqrt(G * k * np.tanh(k * depth))
    flow = 0.1 * omega / np.tanh(k * depth) * np.cos(phase)
    assert_matches(
        lambda motion: water.surface_flow(motion, made((rows, columns), cell, 0.02, depth)),
        np.stack([flow, np.zeros_like(flow)]),
        np.stack([0.1 * np.cos(phase), np.zeros_like(phase)]),
        single=1e-5,
    )


def test_sample_is_bilinear() -> None:
    z, x = np.mgrid[:6, :9].astype(float)
    fields = np.stack([x + 2 * z, 3 - x])
    u, v = np.array([[0.0, 2.25], [7.5, 30.0]]), np.array([[0.5, 1.0], [4.75, -3.0]])
    inside_u, inside_v = np.clip(u, 0, 8), np.clip(v, 0, 5)
    assert_matches(water.sample, np.stack([inside_u + 2 * inside_v, 3 - inside_u]), fields, u, v)


def whole_step(height: Any, motion: Any, u: Any, v: Any, amount: Any, depth: Any, current: Any) -> Any:
    """All that happens in a frame, as a function of all that may be swept or tuned."""
    shape = (12, 14)
    wave = water.waves(shape, jnp.asarray(0.2), 0.05, depth, 0.3 * depth, current)
    was, body = water.splat(shape, u - 0.3, v, amount), water.splat(shape, u, v, amount)
    before, now = layers(was, 0.5 * was, wave), layers(body, 0.5 * body, wave)
    height, motion = water.propagate(height, motion, before, now, wave)
    lost = 20.0 * body + water.breaking(height, jnp.asarray(0.2))
    height, motion = water.damped(height, motion, water.border(shape, 3.0, 5.0), lost, 0.05)
    felt = water.sample(jnp.concatenate([height[None], water.surface_flow(motion, wave)]), u + 1.0, v - 1.0)
    return height, motion, felt


def test_gradients() -> None:
    given = (
        bumps(5, 12, 14),
        along(bumps(6, 12, 14)),
        np.array([5.2, 8.6]),
        np.array([4.3, 6.1]),
        np.array([0.2, 0.4]),
    )
    assert_gradients_agree(whole_step, *given, np.array(0.8), np.array([0.4, -0.2]))
    still = (np.zeros((12, 14)), np.zeros((2, 12, 14)), np.array([5.0, 8.0]), np.array([4.0, 6.0]), np.zeros(2))
    assert_gradient_finite(whole_step, *still, np.array(0.8), STILL)
