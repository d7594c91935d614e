"""The kernels of the gait put together over an ideal clip on level ground: the printed numbers of 9.5.

The clip: 1.2 m and 1 s, liftoff at 0.25 and strike at 0.75 of the cycle, two legs half a cycle apart, 60 Hz.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from kernels import footprint, leg_cycle
from tests.kernels.checks import in_double

SPEEDS = np.array([0.8, 1.2, 2.4, 0.6, 0.3, 0.14, 0.10, 0.13])
STOPS = 20  # more characters: they stop dead from 1.2 m/s, each at another time of the cycle
STOP_AT, FRAMES, RATE = 240, 1800, 60
STRIDE, LIFTOFF, STRIKE, LONGEST, LEAST = 1.2, 0.25, 0.75, 1.5, 0.2


def walk(speeds: Any, phase: Any, stops: Any) -> dict[str, Any]:
    """Every frame's [frames, L, n] cycle times, parked legs, and places along the way of both prints, m."""
    count, dtype = speeds.shape[0], speeds.dtype
    stance = jnp.array([[0.0], [0.5]], dtype) * jnp.ones(count, dtype)
    strike, dt = jnp.full((2, count), STRIKE, dtype), 1.0 / RATE
    zero, one = jnp.zeros(count, dtype), jnp.ones(count, dtype)

    def at(z: Any) -> Any:
        return jnp.stack([0.0 * z, 0.0 * z, z])

    def frame(carry: Any, number: Any) -> Any:
        x, clock, designated, time, parked, behind, ahead, goal = carry
        speed = jnp.where(stops & (number >= STOP_AT), 0.0, speeds)
        x = x + speed * dt
        cycle_s = leg_cycle.duration(
            one, STRIDE * one, speed, zero, zero, LONGEST * one, 2.8 * one, 5.0 * one
        )  # fmt: skip
        clock = jnp.where(parked.all(0), clock, clock + dt / cycle_s)
        cycle = leg_cycle.advance(clock, stance, designated, time, parked, strike)
        left = (1.0 - cycle.designated) * cycle_s
        way = footprint.swept(jnp.stack([zero, speed])[:, None], 0.0 * left, left)[1]
        behind = jnp.where(cycle.begins & ~parked, ahead, behind)
        flown = leg_cycle.ilerp(LIFTOFF + 0.0 * strike, strike, cycle.time)
        seek = jnp.maximum(3.0 * speed, 0.9)
        moved, aim, _ = footprint.smoothed(
            at(ahead), at(goal), at(x + way), cycle.time, strike, flown, cycle.begins, seek, cycle_s,
            cycle.designated, dt,
        )  # fmt: skip
        aims = cycle.time < strike
        ahead, goal = jnp.where(aims, moved[2], ahead), jnp.where(aims, aim[2], goal)
        parked, time = leg_cycle.parking(
            cycle, parked, jnp.abs(ahead - behind), 0.0 * left, LEAST * one, 1.4 * one, strike
        )
        out = dict(x=x, cycle=cycle_s, time=time, designated=cycle.designated, parked=parked, behind=behind,
                   ahead=ahead, clock=clock)  # fmt: skip
        return (x, clock, cycle.designated, time, parked, behind, ahead, goal), out

    # standing at the origin, but that the clock is somewhere
    start = jnp.zeros((2, count), dtype)
    designated = phase - stance - jnp.floor(phase - stance)
    carry = (zero, phase, designated, start, jnp.ones((2, count), bool), start, start, start)
    return jax.lax.scan(frame, carry, jnp.arange(FRAMES))[1]


@pytest.fixture(scope="module")
def walked() -> dict[str, np.ndarray]:
    speeds = np.concatenate([SPEEDS, np.full(STOPS, 1.2)])
    phase = np.concatenate([np.full(len(SPEEDS), 0.2), np.arange(STOPS) / STOPS])
    return in_double(walk, speeds, phase, np.arange(len(speeds)) >= len(SPEEDS))


def steps(walked: dict[str, np.ndarray], who: int, leg: int) -> np.ndarray:
    """Places of the prints that were stood on, after ten seconds."""
    behind = walked["behind"][600:, leg, who]
    return behind[1:][behind[1:] != behind[:-1]]


@pytest.mark.parametrize("who", range(6))
def test_printed_spacing_and_duration(walked: dict[str, np.ndarray], who: int) -> None:
    """Property 7: 1.2 m at 0.8, 1.2 and 2.4 m/s, then 0.9, 0.45 and 0.21."""
    expected = [1.2, 1.2, 1.2, 0.9, 0.45, 0.21][who]
    np.testing.assert_allclose(walked["cycle"][600:, who], min(1.5, 1.2 / SPEEDS[who]), atol=1e-9)
    for leg in range(2):
        prints = steps(walked, who, leg)
        assert len(prints) >= 12
        np.testing.assert_allclose(np.diff(prints), expected, atol=1e-9)
    np.testing.assert_array_equal(walked["time"][600:, :, who], walked["designated"][600:, :, who])


@pytest.mark.parametrize("who", [6, 7])
def test_printed_creeping(walked: dict[str, np.ndarray], who: int) -> None:
    """At 0.10 and 0.13 m/s legs rest, and step when the gap has reached 0.2000 to 0.2017 m (a frame's way more)."""
    for leg in range(2):
        assert walked["parked"][600:, leg, who].any()
        gaps = np.diff(steps(walked, who, leg))
        assert len(gaps) >= 5
        assert gaps.min() > LEAST - 1e-9
        assert gaps.max() < LEAST + SPEEDS[who] / RATE + 1e-4


def test_property_13_prediction_stands_still(walked: dict[str, np.ndarray]) -> None:
    for who in range(6):
        ahead, begins = walked["ahead"][600:, :, who], np.diff(walked["designated"][600:, :, who], axis=0) < -0.5
        moved = np.abs(np.diff(ahead, axis=0))
        assert moved[~begins].max() < 1e-9


def test_printed_dead_stop(walked: dict[str, np.ndarray]) -> None:
    """From 1.2 m/s all legs rest within a cycle and a half, and no foot is a step away from its place (property 12)."""
    stopped = slice(len(SPEEDS), None)
    rest: np.ndarray = np.all(walked["parked"][STOP_AT:, :, stopped], axis=1)
    assert rest[-1].all()
    first = np.argmax(rest, axis=0) / RATE
    assert (first <= 2 * LONGEST + 1 / RATE).all()
    assert first.min() <= 0.75 + 1 / RATE
    assert (walked["clock"][-1, stopped] == walked["clock"][STOP_AT + 180, stopped]).all()
    residual = np.abs(walked["behind"][-1, :, stopped] - walked["x"][-1, stopped])
    assert residual.max() <= LEAST
    assert residual.max(0).min() <= 0.0267
