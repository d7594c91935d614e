"""The footstep controller: exact steps at every frame rate, still feet, and the printed relations of Eq. 3 to 5."""

from __future__ import annotations

from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from kernels import stepping
from tests.kernels.checks import (
    BATCHES,
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    assert_matches,
    in_double,
    in_single,
)

RATES = (15, 30, 50, 60, 144, 240)


def covered(progress: np.ndarray) -> np.ndarray:
    """Integral of the triangle of speeds 0 -> 2 -> 0, by 20000 midpoints."""
    at = (np.arange(20000) + 0.5) / 20000
    speed = np.where(at < 0.5, 4 * at, 4 * (1 - at))
    return np.array([(speed * (at < p)).mean() for p in np.ravel(progress)]).reshape(np.shape(progress))


def swing(handle, target, progress: np.ndarray, single: bool = True) -> np.ndarray:
    """Handles [k, n] after every frame; progress [frames + 1, n] may pass 1."""
    run = in_single if single else in_double
    out = [np.asarray(handle)]
    for before, after in pairwise(progress):
        out.append(run(stepping.move_handle, out[-1], target, before, after))
    return np.stack(out)


# --- the swing -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("batch", BATCHES)
def test_travelled_is_the_integral_of_the_speed(batch: tuple[int, ...]) -> None:
    progress = np.random.default_rng(0).uniform(size=batch)
    assert_matches(stepping.travelled, covered(progress), progress, double=1e-4, single=1e-4)
    if batch == BATCHES[-1]:
        assert_gradients_agree(stepping.travelled, progress)


def test_travelled_at_its_ends() -> None:
    assert in_double(stepping.travelled, np.array([0.0, 0.5, 1.0])).tolist() == [0.0, 0.5, 1.0]
    assert_gradient_finite(stepping.travelled, np.array([0.0, 0.5, 1.0]))


def test_a_step_covers_its_way_at_every_rate() -> None:
    """0.4 s of swing that begins somewhere inside a frame: places between follow Fig. 3, and the end is exact."""
    rng = np.random.default_rng(1)
    rates = np.array(RATES, float)
    late = rng.uniform(size=len(rates)) / rates  # of the first frame only this much is swing
    time = np.concatenate([np.zeros((1, len(rates))), late + np.arange(11)[:, None] / rates])
    time = np.concatenate([time, np.full((1, len(rates)), 0.5)])  # the rest of the swing in one leap
    progress = np.clip(time / 0.4, 0.0, 1.0)
    start, target = rng.normal(size=(2, 3, len(rates)))
    places = swing(start, target, progress)
    assert (places[-1] == target.astype(np.float32)).all()
    expected = start + (target - start) * in_double(stepping.travelled, progress)[:, None]
    assert_close(places, expected, 2e-6)


def test_a_planted_foot_does_not_drift() -> None:
    """Not by one bit, wherever its target goes and however the clock runs on."""
    rng = np.random.default_rng(2)
    handle = rng.normal(size=(3, 50)).astype(np.float32)
    at = handle
    for _ in range(5):
        target = rng.normal(size=(3, 50)) * 10
        at = in_single(stepping.move_handle, at, target, np.full(50, 1.0), rng.uniform(1.0, 1.5, 50))
    assert (at == handle).all()


def test_a_moving_target_is_reached() -> None:
    """Aimed anew in every frame of the first 70 %: no jump then, and planted on the last aim exactly."""
    rng = np.random.default_rng(3)
    progress = np.linspace(0, 1, 25)
    at, target = np.zeros((2, 4), np.float32), rng.normal(size=(2, 4))
    drift = 0.02 * rng.normal(size=(2, 4))
    for before, after in pairwise(progress):
        if before < stepping.REAIM_UNTIL:
            target = target + drift
        left = np.linalg.norm(target - at, axis=0)
        moved = in_single(stepping.move_handle, at, target, np.full(4, before), np.full(4, after))
        assert (np.linalg.norm(moved - at, axis=0) <= left + 1e-6).all()
        if after < 1:
            share = (covered(after) - covered(before)) / (1 - covered(before))
            assert_close(moved, at + (target - at) * share, 1e-3)
        at = moved
    assert (at == target.astype(np.float32)).all()


def test_swing_gradients() -> None:
    rng = np.random.default_rng(4)
    handle, target = rng.normal(size=(2, 2, 3))
    assert_gradients_agree(stepping.move_handle, handle, target, np.array([0.1, 0.4, 0.8]), np.array([0.2, 0.6, 0.9]))
    edges = np.array([0.0, 1.0, 0.99999]), np.array([0.0, 1.2, 1.0])
    assert_gradient_finite(stepping.move_handle, handle, target, *edges)


# --- the clock -------------------------------------------------------------------------------------------------------


def test_every_leg_lifts_off_once_a_cycle() -> None:
    """Over 30 cycles at rates that do and do not divide the cycle, with the clock wrapped in float32."""
    rates = np.array([15.0, 24.0, 30.0, 33.3, 60.0, 61.7, 144.0, 240.0])
    lift = np.array([0.0, 0.25, 0.5, 0.999])[:, None] * np.ones(len(rates))
    advance = (1 / rates).astype(np.float32)
    duty = 0.62
    phase = np.full(len(rates), 0.3, np.float32)
    progress = np.ones_like(lift)
    count = np.zeros_like(lift)
    done = np.zeros(len(rates))
    walking = np.ones(len(rates), bool)
    lift_off = compiled_lift_off()
    for _ in range(int(30 * rates.max())):
        running = done < 30 - 0.5 * advance
        step = np.where(running, advance, 0).astype(np.float32)
        phase = phase + step
        phase = phase - np.floor(phase)
        off = lift_off(phase, step, lift, progress, walking)
        since = (phase - lift) % 1.0
        assert (since[off] <= np.broadcast_to(step, since.shape)[off] + 1e-6).all()  # the remainder of the frame
        progress = np.where(off, since / (1 - duty), np.minimum(progress + step / (1 - duty), 1.0))
        count += off
        done += step
    assert (np.abs(count - 30) <= 1).all(), count


def compiled_lift_off():
    """The kernel with its arguments widened to one shape, compiled once."""
    run = jax.jit(stepping.lift_off)

    def call(phase, advance, lift, progress, walking) -> np.ndarray:
        wide = [np.broadcast_to(x, lift.shape) for x in (phase, advance, lift, progress)]
        at = [jnp.asarray(x, jnp.float32) for x in wide]
        return np.asarray(run(*at, jnp.asarray(np.broadcast_to(walking, lift.shape))))

    return call


LIFTS = {
    # clock at the frame's end, advance, lift, progress, walking
    "inside the frame": (0.52, 0.05, 0.5, 1.0, True, True),
    "not yet": (0.49, 0.05, 0.5, 1.0, True, False),
    "long past": (0.60, 0.05, 0.5, 1.0, True, False),
    "exactly now": (0.5, 0.05, 0.5, 1.0, True, True),
    "over the wrap": (0.01, 0.05, 0.98, 1.0, True, True),
    "lift beyond one cycle": (0.02, 0.05, 1.01, 1.0, True, True),
    "lift below zero": (0.99, 0.05, -0.02, 1.0, True, True),
    "still swinging": (0.52, 0.05, 0.5, 0.9, True, False),
    "standing": (0.52, 0.05, 0.5, 1.0, False, False),
    "clock at rest": (0.5, 0.0, 0.5, 1.0, True, False),
}


def test_lift_off_table() -> None:
    phase, advance, lift, progress, walking, expected = (np.array(x) for x in zip(*LIFTS.values(), strict=True))
    lifted = in_single(stepping.lift_off, phase, advance, lift, progress, walking)
    assert dict(zip(LIFTS, lifted.tolist(), strict=True)) == dict(zip(LIFTS, expected.tolist(), strict=True))


# --- cadence and direction -------------------------------------------------------------------------------------------

SCHEDULES = {
    "paper": lambda ratio, desired: np.clip(desired, 0.1, 2.0),
    "scaled": lambda ratio, desired: np.ones_like(ratio),
    "actual": lambda ratio, desired: np.clip(ratio, 0.1, 2.0),
    "mixed": lambda ratio, desired: np.clip(ratio, 0.1, 2.0) ** 0.25,
}


@pytest.mark.parametrize("schedule", SCHEDULES)
def test_cadence(schedule) -> None:
    ratio = np.array([0.0, 0.05, 0.1, 0.58, 1.0, 1.7, 2.0, 9.0])
    desired = ratio[::-1].copy()
    expected = SCHEDULES[schedule](ratio, desired)
    assert_matches(lambda *at: stepping.cadence(schedule, *at), expected, ratio, desired)
    assert_gradient_finite(lambda *at: stepping.cadence(schedule, *at), ratio, desired)


def test_mixed_shortens_steps_as_people_do() -> None:
    """At 0.58 of the speed steps are 34 % shorter: r^0.75."""
    rate = in_double(lambda *at: stepping.cadence("mixed", *at), np.array(0.58), np.array(1.0))
    assert_close(0.58 / rate, np.array(0.58**0.75), 1e-9)
    assert round(float(1 - 0.58 / rate), 2) == 0.34


def test_step_velocity() -> None:
    """Forward as it is; backward and sideways beyond the threshold; odd in the sideways part; no jumps."""
    forward = np.array([1.3, 0.0, -0.1, -0.15, -0.4, 0.0])
    left = np.array([0.0, 0.1, -0.15, 0.2, -0.5, 0.0])
    expected = np.array([1.3, 0.0, 0.0, 0.0, -0.25, 0.0]), np.array([0.0, 0.0, 0.0, 0.05, -0.35, 0.0])
    assert_matches(stepping.step_velocity, expected, forward, left, np.full(1, 0.15), single=1e-6)
    line = np.linspace(-1, 1, 2001)
    ahead, aside = in_double(stepping.step_velocity, line, line, np.full(1, 0.15))
    assert np.diff(ahead).max() < 1.1e-3
    assert_close(aside, -aside[::-1], 1e-12)


# --- landing ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("duty", [0.5, 0.62, 0.8])
def test_landing_gives_the_printed_lengths(duty: float) -> None:
    """Two legs of step length s: l = (2 - D) s at lift-off, epsilon = D s at landing, d_plan = (1 - D) s."""
    s = 0.65
    stride, zero = np.array([0.0, 2 * s]), np.zeros(2)

    def ahead(progress: float) -> float:
        at = zero, zero, stride, np.array(progress), np.array(duty)
        return float(in_double(stepping.landing, *at)[1])

    assert abs(ahead(0.0) - (2 - duty) * s) < 1e-12
    assert abs(ahead(1.0) - duty * s) < 1e-12
    # the other foot landed half a cycle less a swing ago; the root went on since
    since = 0.5 - (1 - duty)
    assert abs(ahead(1.0) - since * 2 * s - (1 - duty) * s) < 1e-12
    # half a stance after landing the foot is at rest under the root
    assert abs(ahead(1.0) - 0.5 * duty * 2 * s) < 1e-12


def test_steady_walking_never_changes_the_aim() -> None:
    """While the root moves at the stride's speed, the landing place stands still during the whole swing."""
    progress = np.linspace(0, 1, 9)
    duty = np.full(9, 0.62)
    stride, rest = np.array([[0.3], [1.2]]), np.array([[0.08], [0.02]])
    root = np.array([[1.0], [2.0]]) + stride * (1 - duty) * progress
    wide = [np.broadcast_to(x, (2, 9)) for x in (rest, stride)]
    places = in_double(stepping.landing, root, wide[0], wide[1], progress, duty)
    assert_close(places, np.broadcast_to(places[:, :1], (2, 9)), 1e-12)


def test_landing_over_legs_and_gradients() -> None:
    rng = np.random.default_rng(5)
    root, stride, rest = rng.normal(size=(2, 1, 5)), rng.normal(size=(2, 1, 5)), rng.normal(size=(2, 4, 5))
    progress, duty = rng.uniform(size=(2, 4, 5))
    expected = root + rest + stride * ((1 - progress) * (1 - duty) + duty / 2)
    assert_matches(stepping.landing, expected, root, rest, stride, progress, duty)
    assert_gradients_agree(stepping.landing, root, rest, stride, progress, duty)
