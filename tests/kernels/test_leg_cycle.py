"""Leg cycles against the specification's text (3.5 to 3.7, 4.3, 4.6, 4.13, 4.15) in plain scalar code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from kernels import leg_cycle
from tests.kernels.checks import (
    assert_gradient_finite,
    assert_gradients_agree,
    assert_matches,
    assert_matches_in_batches,
    in_double,
    in_single,
)

# named tuples of arrays, here of NumPy's
Cycle: Any = leg_cycle.Cycle
KeyTimes: Any = leg_cycle.KeyTimes

DEGREE = np.pi / 180
LEGS = 3


def elementwise(rule: Callable[..., Any], *arguments: Any) -> Any:
    """The rule's numbers for every element of arrays of one shape."""
    shape = np.broadcast_shapes(*map(np.shape, arguments))
    flat = [np.broadcast_to(a, shape).ravel() for a in arguments]
    rows = [rule(*(a.item() for a in each)) for each in zip(*flat, strict=True)]
    if isinstance(rows[0], tuple):
        return tuple(np.array(column).reshape(shape) for column in zip(*rows, strict=True))
    return np.array(rows).reshape(shape)


def random_keys(rng: np.random.Generator, *shape: int) -> Any:
    """In order, as analysis makes them (2.8)."""
    lift = rng.uniform(0.02, 0.2, shape)
    liftoff = lift + rng.uniform(0.0, 0.1, shape)
    strike = rng.uniform(0.6, 0.85, shape)
    land = strike + rng.uniform(0.0, 0.12, shape)
    return KeyTimes(
        lift, liftoff, np.maximum(liftoff, lift + 0.2), np.minimum(strike, land - 0.2), strike, land
    )  # fmt: skip


# --- duration (3.6) --------------------------------------------------------------------------------------------------

MOST = {"longest": 1.5, "most_turn": 160 * DEGREE, "most_acceleration": 5.0}


def duration_by_text(
    frequency: float, clip_speed: float, speed: float, turn: float, acceleration: float,
    longest: float, most_turn: float, most_acceleration: float,
) -> float:  # fmt: skip
    dur = 1 / frequency if frequency > 0 else longest
    if speed > 0 and clip_speed > 0:
        dur *= clip_speed / speed
    if turn > 0:
        dur = min(dur, most_turn / turn)
    if acceleration > 0:
        dur = min(max(most_acceleration / acceleration, dur / 2), dur)
    return min(dur, longest)


def durations(*inputs: Any) -> np.ndarray:
    shape = np.broadcast_shapes(*map(np.shape, inputs))
    return in_double(
        leg_cycle.duration, *(np.broadcast_to(np.asarray(a, float), shape) for a in inputs), *MOST.values()
    )


def random_motion(rng: np.random.Generator, count: int) -> list[np.ndarray]:
    """Some of everything standing still."""
    inputs = [rng.uniform(0, most, count) for most in (2.0, 4.0, 6.0, 4.0, 20.0)]
    return [np.where(rng.uniform(size=count) < 0.15, 0.0, a) for a in inputs]


def test_duration() -> None:
    rng = np.random.default_rng(0)
    for count in (6, 500):
        inputs = [*random_motion(rng, count), *(np.full(count, v) for v in MOST.values())]
        expected = elementwise(duration_by_text, *inputs)
        check = assert_matches_in_batches if count == 6 else assert_matches
        check(leg_cycle.duration, expected, *inputs)


def test_printed_durations() -> None:
    """9.5: a clip of 1.2 m and 1 s; the stride stays, the cadence follows, whatever share the idle clip has."""
    for share in (1.0, 0.5, 0.01):
        found = durations(share, share * 1.2, np.array([0.8, 1.2, 2.4, 0.6, 0.3, 0.14]), 0.0, 0.0)
        np.testing.assert_allclose(found, [1.5, 1.0, 0.5, 1.5, 1.5, 1.5], rtol=1e-9)
        spacing = found * [0.8, 1.2, 2.4, 0.6, 0.3, 0.14]
        np.testing.assert_allclose(spacing, [1.2, 1.2, 1.2, 0.9, 0.45, 0.21], rtol=1e-9)
    np.testing.assert_allclose(durations(0.0, 0.0, 0.0, 120 * DEGREE, 0.0), 4 / 3, atol=1e-9)


def test_duration_keeps_its_bounds() -> None:
    """Property 8."""
    inputs = random_motion(np.random.default_rng(1), 3000)
    found = durations(*inputs)
    assert (found <= MOST["longest"] + 1e-9).all()
    assert (found * inputs[3] <= MOST["most_turn"] + 1e-9).all()
    walks = inputs[0] > 0
    calm = in_double(leg_cycle.duration, *inputs[:4], np.zeros(3000), 1e9, MOST["most_turn"], 5.0)  # before the cap
    assert (found >= np.minimum(0.5 * calm, MOST["longest"]) - 1e-9)[walks].all()
    assert (found > 0).all()


def test_duration_gradients() -> None:
    rng = np.random.default_rng(2)
    assert_gradients_agree(leg_cycle.duration, *(rng.uniform(0.5, 1.5, 20) for _ in range(5)), 2.0, 0.8, 0.6)
    zero = np.array([0.0, 1e-30, 1e-7, 1.0])
    every = [a.ravel() for a in np.meshgrid(zero, zero, zero, zero, zero)]
    assert_gradient_finite(leg_cycle.duration, *every, *MOST.values())


def test_hurry() -> None:
    """1 up to half of what a foot may turn, twice as fast from 1.3 times of it; the foot that is worst off decides."""
    most = np.array(0.8)
    twist = np.linspace(-1.5, 1.5, 301)[None] * most
    found = in_double(leg_cycle.hurry, twist, most)
    assert (found[np.abs(twist[0]) <= 0.5 * most] == 1.0).all()
    np.testing.assert_allclose(found[np.abs(twist[0]) >= 1.3 * most], 2.0, atol=1e-12)
    assert (np.diff(found[150:]) >= 0).all()
    np.testing.assert_allclose(found, found[::-1], atol=1e-12)
    both = np.concatenate([twist, twist[:, ::-1] * 0.5, 0 * twist])
    np.testing.assert_allclose(in_double(leg_cycle.hurry, both, most), found, atol=1e-12)
    assert_gradient_finite(leg_cycle.hurry, both, most)


# --- the leg's clock (4.3) -------------------------------------------------------------------------------------------


def advanced_by_text(
    clock: float, stance: float, designated: float, time: float, parked: bool, strike: float
) -> tuple[float, float, bool, bool]:
    now = (clock - stance) % 1.0
    if now < designated - 0.5:
        return now, 0.0 if parked else now, parked, True
    if now >= strike or time == designated:
        return now, now, parked, False
    own = time + (strike - time) * (now - designated) / (strike - designated) if designated < strike else now
    return now, min(own, now), parked, False


def random_legs(rng: np.random.Generator, *shape: int) -> list[Any]:
    """Clock, stance, designated, time, parked and strike, one frame of up to 0.1 cycles apart."""
    stance, clock = rng.uniform(size=shape), rng.uniform(size=shape[1:])
    before = (clock - stance) % 1.0
    clock = clock + rng.uniform(0.0, 0.1, clock.shape)
    time = np.where(rng.uniform(size=shape) < 0.4, before, before * rng.uniform(size=shape))
    parked = rng.uniform(size=shape) < 0.3
    return [clock % 1.0, stance, before, np.where(parked, 0.0, time), parked, rng.uniform(0.5, 0.9, shape)]


def test_advance() -> None:
    rng = np.random.default_rng(3)
    for count in (6, 1000):
        legs = random_legs(rng, LEGS, count)
        expected = Cycle(*elementwise(advanced_by_text, *legs))
        check = assert_matches_in_batches if count == 6 else assert_matches
        check(leg_cycle.advance, expected, *legs)
    assert 10 < expected.begins.sum() < 300


def test_a_leg_on_schedule_stays_on_it_to_the_last_bit() -> None:
    """Property 9, first part, in float32, at uneven frame times and with key times that change under way."""
    rng = np.random.default_rng(4)
    stance = rng.uniform(size=(LEGS, 40)).astype(np.float32)
    clock = rng.uniform(size=40).astype(np.float32)
    designated = time = ((clock - stance) % 1.0).astype(np.float32)
    parked, seen = np.zeros((LEGS, 40), bool), 0
    for _ in range(60):
        clock = (clock + rng.uniform(0.001, 0.08, 40).astype(np.float32)) % 1.0
        stance = stance + rng.uniform(-0.01, 0.01, stance.shape).astype(np.float32)
        cycle = in_single(leg_cycle.advance, clock, stance, designated, time, parked, rng.uniform(0.6, 0.9, (LEGS, 40)))
        np.testing.assert_array_equal(cycle.time, cycle.designated)
        designated, time, seen = cycle.designated, cycle.time, seen + cycle.begins.sum()
    assert seen > 100


@pytest.mark.parametrize("frame", [0.01, 0.06])
def test_a_late_leg_catches_up_on_a_straight_line(frame: float) -> None:
    """Property 9, second part: whatever the frame time, and also when it changes under way."""
    begin, strike = np.array([[0.0, 0.2, 0.4, 0.66]]), np.full((1, 4), 0.75)
    designated, time, clock = begin, np.zeros((1, 4)), begin[0].copy()
    stance, parked = np.zeros((1, 4)), np.zeros((1, 4), bool)
    rng = np.random.default_rng(5)
    while clock.min() < 0.9:
        clock = np.minimum(clock + frame * rng.uniform(0.5, 1.0), 0.95)
        _, time, _, begins = cycle = in_double(leg_cycle.advance, clock, stance, designated, time, parked, strike)
        designated = cycle.designated
        line = strike * (designated - begin) / (strike - begin)
        np.testing.assert_allclose(time, np.where(designated >= strike, designated, line), atol=1e-9)
        assert not begins.any()
    np.testing.assert_array_equal(time, designated)


def test_advance_gradients() -> None:
    rng = np.random.default_rng(6)
    *floats, _, parked, strike = random_legs(rng, LEGS, 8)
    floats.append(0.5 * floats[2])  # late; on schedule there is a kink

    def moved(clock: Any, stance: Any, designated: Any, time: Any, strike: Any) -> Any:
        return leg_cycle.advance(clock, stance, designated, time, jnp.asarray(parked), strike)[:2]

    assert_gradients_agree(moved, *floats, strike)
    same = np.full((LEGS, 8), 0.7)
    assert_gradient_finite(moved, same[0], 0 * same, same, same, same)
    assert_gradient_finite(moved, same[0], 0 * same, same, 0.5 * same, same)


# --- parking (4.6) ---------------------------------------------------------------------------------------------------


def parked_by_text(
    designated: float, time: float, begins: bool, was: bool, distance: float, turn: float, strike: float
) -> tuple[bool, float]:
    """With steps that the original would take in the instant of a strike that has passed left out."""
    worth = distance > 0.2 or turn > 80 * DEGREE
    parked = was and not begins
    if begins and not worth:
        parked = True
    if parked and not begins and designated < min(0.67, max(0.5, strike - leg_cycle.CATCH_UP)) and worth:
        parked = False
    return parked, 0.0 if parked else time


def test_parking() -> None:
    rng = np.random.default_rng(7)
    for count in (6, 2000):
        shape = (LEGS, count)
        designated, time = rng.uniform(size=(2, *shape))
        begins, was = rng.uniform(size=(2, *shape)) < 0.5
        distance, turn = rng.uniform(0, 0.4, shape), rng.uniform(0, 160 * DEGREE, shape)
        strike = rng.uniform(0.5, 0.9, shape)
        expected = elementwise(parked_by_text, designated, time, begins, was, distance, turn, strike)

        def found(designated, time, begins, was, distance, turn, strike):
            least = jnp.array(0.2, turn.dtype), jnp.array(80 * DEGREE, turn.dtype)
            return leg_cycle.parking(Cycle(designated, time, was, begins), was, distance, turn, *least, strike)

        check = assert_matches_in_batches if count == 6 else assert_matches
        check(found, expected, designated, time, begins, was, distance, turn, strike)
    assert 0.2 < expected[0].mean() < 0.6


def test_a_leg_never_jumps_from_its_rest_into_its_strike() -> None:
    """Also of clips that strike early: it sets out while there is time, or waits for the next cycle."""
    before = np.linspace(0.0, 0.99, 100)[None] * np.ones((3, 1))
    strike = np.array([[0.58], [0.62], [0.8]]) * np.ones((1, 100))

    def out(before, strike):
        parked, zero = jnp.ones(before.shape, bool), jnp.zeros_like(before)
        cycle = leg_cycle.advance(before[0] + 0.01, zero, before, zero, parked, strike)
        return cycle, leg_cycle.parking(cycle, parked, zero + 1.0, zero, zero[0, 0], zero[0, 0], strike)

    cycle, (rests, time) = in_double(out, before, strike)
    leaves = ~rests & ~cycle.begins
    assert leaves.any(1).all()
    assert (time[leaves] < 0.15).all()
    assert (time[rests] == 0).all()


# --- events (4.15) and lifted (4.13) ---------------------------------------------------------------------------------


def phase_by_text(phase: int, t: float, lift: float, liftoff: float, strike: float, land: float) -> int:
    if phase == 0 and lift <= t < land:
        return 1
    if phase == 1 and (t >= liftoff or t < lift):
        return 2
    if phase == 2 and (t >= strike or t < liftoff):
        return 3
    if phase == 3 and (t >= land or t < strike):
        return 0
    return phase


def test_foot_phase() -> None:
    rng = np.random.default_rng(8)
    for count in (6, 1000):
        keys, time = random_keys(rng, LEGS, count), rng.uniform(size=(LEGS, count))
        phase = rng.integers(0, 4, (LEGS, count)).astype(np.int32)
        expected = elementwise(phase_by_text, phase, time, keys.lift, keys.liftoff, keys.strike, keys.land)
        check = assert_matches_in_batches if count == 6 else assert_matches
        check(leg_cycle.foot_phase, expected, phase, time, keys)


@pytest.mark.parametrize("frame", [0.02, 0.2])
def test_events_in_order_once_a_cycle(frame: float) -> None:
    """Property 25: also where frames skip whole phases, none is left out and none comes twice."""
    rng = np.random.default_rng(9)
    keys = random_keys(rng, LEGS, 50)
    phase, time = np.zeros((LEGS, 50), np.int32), np.zeros((LEGS, 50))
    count, cycles = np.zeros((4, LEGS, 50), int), np.zeros((LEGS, 50))
    for _ in range(round(5 / frame)):
        after = time + frame * rng.uniform(0.5, 1.0)
        cycles, time = cycles + (after >= 1.0), after % 1.0
        was, phase = phase, in_double(leg_cycle.foot_phase, phase, time, keys)
        for state in range(4):
            count[state] += (phase != was) & (phase == state)
    assert count.min() >= 2 or frame > 0.1
    assert np.ptp(count, axis=0).max() <= 1
    if frame < 0.1:
        assert (np.abs(count[0] - cycles) <= 1).all()


def test_a_resting_leg_has_no_events() -> None:
    keys, phase = random_keys(np.random.default_rng(10), LEGS, 20), np.zeros((LEGS, 20), np.int32)
    assert (in_single(leg_cycle.foot_phase, phase, np.zeros((LEGS, 20)), keys) == 0).all()


def lifted_by_text(t: float, lift: float, postlift: float, preland: float, land: float) -> float:
    if t <= lift or t >= land:
        return 0.0
    up = 1.0 if t >= postlift else (t - lift) / (postlift - lift)
    down = 1.0 if t <= preland else (land - t) / (land - preland)
    return min(up, down)  # the text has no word on postlift > preland


def test_lifted() -> None:
    rng = np.random.default_rng(11)
    for count in (6, 1000):
        keys, time = random_keys(rng, LEGS, count), rng.uniform(size=(LEGS, count))
        expected = elementwise(lifted_by_text, time, keys.lift, keys.postlift, keys.preland, keys.land)
        check = assert_matches_in_batches if count == 6 else assert_matches
        check(leg_cycle.lifted, expected, time, keys)
    assert_gradients_agree(leg_cycle.lifted, time, keys)
    flat = KeyTimes(*(np.full((LEGS, 2), 0.3) for _ in range(6)))
    assert_gradient_finite(leg_cycle.lifted, np.full((LEGS, 2), 0.3), flat)


def test_ilerp() -> None:
    a, b = np.array([0.0, 1.0, 2.0, 0.5, 0.5, 1.0]), np.array([1.0, 0.0, 6.0, 0.5, 0.5, 2.0])
    v = np.array([0.25, 0.25, 3.0, 0.5, 9.0, 9.0])
    assert_matches_in_batches(leg_cycle.ilerp, np.array([0.25, 0.75, 0.25, 0.0, 0.0, 1.0]), a, b, v)
    assert_gradient_finite(leg_cycle.ilerp, a, b, v)


# --- phases on the circle (3.5) --------------------------------------------------------------------------------------


def test_circular_mean() -> None:
    rng = np.random.default_rng(12)
    phase, weight = rng.uniform(size=(4, LEGS, 6)), rng.uniform(size=(4, 6))
    cosine, sine = np.cos(2 * np.pi * phase), np.sin(2 * np.pi * phase)
    total = np.einsum("mn,mln->ln", weight, np.exp(2j * np.pi * phase))
    expected = np.angle(total) / (2 * np.pi) % 1.0
    assert_matches_in_batches(leg_cycle.circular_mean, expected, cosine, sine, weight, single=1e-5)
    assert_gradients_agree(leg_cycle.circular_mean, cosine, sine, weight)
    # either side of the seam: 0.98 and 0.04 have their mean at 0.01
    seam = 2 * np.pi * np.array([0.98, 0.04]).reshape(2, 1, 1)
    found = in_double(leg_cycle.circular_mean, np.cos(seam), np.sin(seam), np.full((2, 1), 0.5))
    np.testing.assert_allclose(found, 0.01, atol=1e-9)


def test_phases_that_cancel() -> None:
    cosine, sine = np.array([1.0, -1.0]).reshape(2, 1, 1), np.zeros((2, 1, 1))
    for weight in (np.full((2, 1), 0.5), np.zeros((2, 1))):
        assert in_single(leg_cycle.circular_mean, cosine, sine, weight).tolist() == [[0.0]]
        assert_gradient_finite(leg_cycle.circular_mean, cosine, sine, weight)
