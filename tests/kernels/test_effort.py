"""Effort: balance of controller and drag by bisection; changes of gear only where resistance changes for good."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from kernels import effort
from kernels.effort import FREE, RESTS, WALKS
from tests.kernels.checks import assert_gradient_finite, assert_gradients_agree, assert_matches_in_batches, in_single

WANTED = np.array([1.3, 2.6, 1.3, 0.4, 2.0, 1.0])
CURRENT = np.array([0.0, 0.0, 0.4, -0.2, 1.0, 0.0])
QUADRATIC = np.array([300.0, 900.0, 0.0, 50.0, 2000.0, 400.0])
OFFSET = np.array([0.0, 60.0, 30.0, 10.0, 0.0, 20.0])
GAIN = np.array([900.0, 165.0, 900.0, 165.0, 500.0, 250.0])


def test_attainable_balances_controller_and_drag() -> None:
    low, high = -CURRENT, WANTED.copy()
    for _ in range(80):
        middle = 0.5 * (low + high)
        drag = QUADRATIC * (middle + CURRENT) ** 2 + OFFSET
        faster = GAIN * (WANTED - middle) > drag
        low, high = np.where(faster, middle, low), np.where(faster, high, middle)
    assert_matches_in_batches(effort.attainable, low, WANTED, CURRENT, QUADRATIC, OFFSET, GAIN, double=1e-8)


def test_attainable_at_its_ends() -> None:
    """No drag: as wanted; an offset of more than the controller has: at rest in the fluid."""
    found = in_single(
        effort.attainable,
        np.array([1.3, 1.3, 1.3]),
        np.array([0.0, 0.0, 0.3]),
        np.array([0.0, 500.0, 500.0]),
        np.array([0.0, 2000.0, 2000.0]),
        np.full(3, 900.0),
    )
    np.testing.assert_allclose(found, [1.3, 0.0, -0.3], atol=1e-6)


def test_pressure_is_quadratic_with_an_offset() -> None:
    speed, drag, offset = np.linspace(0.0, 2.0, 6), np.full(6, 1080.0), np.full(6, 40.0)
    assert_matches_in_batches(effort.pressure, drag * speed**2 + offset / 0.2, speed, drag, offset)


def test_gradients() -> None:
    assert_gradients_agree(effort.attainable, WANTED, CURRENT, QUADRATIC, OFFSET, GAIN)
    nothing = np.zeros(2)
    assert_gradient_finite(effort.attainable, nothing, nothing, nothing, nothing, nothing)
    assert_gradient_finite(effort.attainable, nothing, nothing, nothing, np.ones(2), np.ones(2))


def geared(jog: np.ndarray, walk: np.ndarray, asked: float = 2.6) -> np.ndarray:
    """Gears over time of who starts free, for attainable speeds over time."""

    def frame(before: jax.Array, speeds: jax.Array) -> tuple[jax.Array, jax.Array]:
        after = effort.gear(
            before, speeds[0], speeds[1], jnp.float32(asked), jnp.float32(1.3), *map(jnp.float32, (1.11, 0.3, 0.25))
        )
        return after, after

    speeds = jnp.asarray(np.stack([jog, walk], 1), jnp.float32)
    return np.asarray(jax.lax.scan(frame, jnp.int32(FREE), speeds)[1])


def test_each_threshold_is_passed_once_each_way() -> None:
    """Speeds that fall and rise slowly, and waver by a tenth on the way as steps make them."""
    sweep = np.concatenate([np.linspace(1.0, 0.0, 500), np.linspace(0.0, 1.0, 500)])
    wavering = 1.0 + 0.1 * np.sin(np.arange(1000))
    jog, walk = 2.0 * sweep * wavering, 1.0 * sweep * wavering
    gears = geared(jog, walk)
    changes = np.flatnonzero(np.diff(gears))
    assert gears[np.append(changes, -1)].tolist() == [FREE, WALKS, RESTS, WALKS, FREE]
    down, stop, go, up = sweep[changes + 1]
    np.testing.assert_allclose([2.0 * down, stop], [1.11, 0.3], rtol=0.13)
    np.testing.assert_allclose([go, 2.0 * up], [1.25 * 0.3, 1.25 * 1.11], rtol=0.13)


def test_who_asks_for_a_walk_or_less() -> None:
    """A walk is never 'instead of a jog'; a slow one ends at half of what was asked for, not at the threshold."""
    slow = np.full(5, 0.25)
    assert (geared(np.full(5, 1.0), np.full(5, 1.0), asked=1.3) == FREE).all()
    assert (geared(slow, slow, asked=0.3) == FREE).all()
    assert (geared(slow, slow, asked=1.3) == RESTS).all()
