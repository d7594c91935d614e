"""Properties of the semi-procedural gait (its specification, section 10), over one run of 128 people.

Numbers are those of section 10. Elsewhere, at the kernels or the analysis:
1, 5, 6, 24 tests/crowd/analysis; 2, 3, 4 tests/kernels/test_blending.py; 8, 9 (late legs), 25 (events at any frame
time) tests/kernels/test_leg_cycle.py; 14, 15, 16, 17 (turns) tests/kernels/test_flight.py; 17 (normals), 23
tests/kernels/test_footprint.py; 18 tests/kernels/test_ik.py; 20, 22 tests/kernels/test_foot_alignment.py; 19
tests/kernels/test_chain_ik.py.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from crowd import scene
from crowd.stride_assets import stride_control
from tests.crowd import stride_run
from tests.crowd.stride_run import (
    CREEP,
    JUMP,
    LEFT,
    RATE,
    RIGHT,
    SLOPE,
    SLOW,
    SPEED,
    SPIN,
    SPIN_BACK,
    STAIRS,
    STOP,
    STOP_AT,
    STRAIGHT,
    TURN,
    TWIN,
)

Arrays = dict[str, np.ndarray]
MIRROR = np.array([-1.0, 1.0, 1.0])
NEAR, FAR = 2e-6, 1.2e-5  # m, three units of single precision at 16 m and at 60 m from the origin
LONGEST = 1.5


@pytest.fixture(scope="module")
def run() -> Arrays:
    return stride_run.walked()


@pytest.fixture(scope="module")
def least_step() -> float:
    return float(stride_control(scene.load(stride_run.model()).herds[0], compat=False).least_step)


def begins(run: Arrays) -> np.ndarray:
    """[frames - 1, n, L] the clock passed the leg's stance."""
    return np.diff(run["cycle_designated"], axis=0) < -0.5


def taken(run: Arrays) -> np.ndarray:
    """[frames - 1, n, L] the print ahead became the one behind."""
    return np.diff(run["steps"], axis=0) > 0


def durations(run: Arrays, who: int) -> np.ndarray:
    """[frames - 1] s, of a cycle; infinite while the clock stands."""
    moved = np.diff(run["phase"][:, who]) % 1.0
    rests = run["parked"][:-1, who].all(-1)  # it waits for the leg that will go first, and does not run
    return np.where(rests | (moved == 0), np.inf, 1 / RATE / np.where(moved > 0, moved, 1.0))


def strides(run: Arrays, who: int, first: int = 120) -> list[np.ndarray]:
    """Places [frames, 3] of the print ahead during each step, from its begin to the next one's."""
    out = []
    for leg in range(2):
        at = np.flatnonzero(taken(run)[:, who, leg]) + 1
        at = at[at >= first]
        out += [run["footprint_to"][a:b, who, leg] for a, b in pairwise(at)]
    return out


def spacings(run: Arrays, who: int, first: int = 120) -> np.ndarray:
    """m from each print to the next of the same foot."""
    out = []
    for leg in range(2):
        at = np.flatnonzero(taken(run)[:, who, leg])
        at = at[at >= first]
        out += list(np.linalg.norm(run["footprint_to"][at, who, leg] - run["footprint_from"][at, who, leg], axis=-1))
    return np.array(out)


# --- clock and steps -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("who", "speed"), [(STRAIGHT, SPEED), (SLOW, 0.6), (TWIN, SPEED)])
def test_property_7_spacing_is_speed_times_duration(run: Arrays, who: int, speed: float) -> None:
    cycle = durations(run, who)[200:]
    np.testing.assert_allclose(cycle, cycle[0], rtol=2e-5)
    np.testing.assert_allclose(spacings(run, who, 200), speed * cycle[0], atol=1e-4)
    assert len(spacings(run, who, 200)) > 10


def test_property_8_no_cycle_is_longer_than_allowed(run: Arrays) -> None:
    for who in range(stride_run.COUNT):
        cycle = durations(run, who)
        assert cycle[np.isfinite(cycle)].max(initial=0.0) <= LONGEST + 1e-3


def test_property_9_legs_on_schedule_keep_to_it(run: Arrays) -> None:
    """To the last bit, once they have caught up from their start; no leg is ever ahead of the clock."""
    time, designated = run["cycle_time"], run["cycle_designated"]
    for who in (STRAIGHT, SLOW, LEFT, RIGHT, SLOPE, STAIRS):
        np.testing.assert_array_equal(time[120:, who], designated[120:, who])
    assert (time <= designated).all()


def test_property_10_planted_feet_stand_still(run: Arrays) -> None:
    """Straight, in turns, on a slope, on stairs, stopping, on the spot, at random; while adjustment is not limited.

    Where the velocity jumps by metres a second, or the ground by metres, the clip may be further from the print than
    the feet may be taken (0.5 m, property 17), and the foot is then dragged: a few frames in a thousand.
    """
    stands = run["contact"][1:] & run["contact"][:-1]
    drift = np.linalg.norm(np.diff(run["handle"], axis=0), axis=-1)
    on_print = np.zeros(run["contact"].shape, bool)
    for name in ("footprint_from", "footprint_to"):
        off = run["handle"] - (run[name] + 0.5 * run[name + "_direction"])
        on_print |= np.linalg.norm(off, axis=-1) < 1e-3
    stands &= (run["alignment"] == 1)[1:, :, None] & (run["alignment"] == 1)[:-1, :, None]
    held = stands & on_print[1:] & on_print[:-1]
    assert held.sum() > 0.998 * stands.sum()
    named = [who for who in range(12) if who not in (JUMP, SLOPE, STAIRS)]
    assert (held == stands)[:, [*named, SLOPE, STAIRS]].all()
    assert drift[:, named][held[:, named]].max() <= NEAR
    assert drift[held].max() <= FAR


def test_property_11_prints_are_frozen_and_handed_on(run: Arrays) -> None:
    """From its strike on a print does not change by one bit, and becomes the print behind by the next step."""
    new = taken(run)
    ahead, behind = run["footprint_to"], run["footprint_from"]
    for name in ("footprint_{}", "footprint_{}_direction"):
        np.testing.assert_array_equal(run[name.format("from")][1:][new], run[name.format("to")][:-1][new])
    np.testing.assert_array_equal(behind[1:][~new], behind[:-1][~new])
    landed = run["contact"] & (run["cycle_time"] > 0.5)
    stays = landed[1:] & landed[:-1]
    np.testing.assert_array_equal(ahead[1:][stays], ahead[:-1][stays])
    assert stays.sum() > 30_000
    assert new.sum() > 3000


def test_property_12_only_steps_worth_it_are_taken(run: Arrays, least_step: float) -> None:
    """When a step begins, and when a resting leg sets out."""
    parked = run["parked"]
    sets_out = (begins(run) | parked[:-1]) & ~parked[1:]
    way = (run["footprint_to"] - run["footprint_from"])[1:]
    length: np.ndarray = np.hypot(way[..., 0], way[..., 2])
    heading = [np.arctan2(run[n][1:, ..., 0], run[n][1:, ..., 2]) for n in
               ("footprint_from_direction", "footprint_to_direction")]  # fmt: skip
    turn: np.ndarray = np.abs(np.degrees(np.angle(np.exp(1j * (heading[1] - heading[0])))))
    # the plate's direction also holds the change of the foot's own angle: some degrees
    assert np.all((length[sets_out] > least_step - FAR) | (turn[sets_out] > 70))
    rests = begins(run) & parked[1:]
    assert np.all(length[rests] <= least_step + FAR)
    assert sets_out.sum() > 3000
    assert rests.sum() > 20


def test_property_12_after_a_dead_stop_all_legs_rest(run: Arrays, least_step: float) -> None:
    rest: np.ndarray = np.all(run["parked"][:, STOP], axis=1)
    settled = STOP_AT + round((2 * LONGEST) * RATE) + 1
    assert not rest[150:STOP_AT].any()
    assert rest[settled:].all()
    assert np.ptp(run["phase"][settled:, STOP]) == 0
    assert run["contact"][settled:, STOP].all()
    assert np.ptp(run["handle"][settled:, STOP], axis=0).max() == 0
    idle = run["handle"][0, STOP] - run["position"][0, STOP]
    off = run["handle"][-1, STOP] - run["position"][-1, STOP] - idle
    assert np.linalg.norm(off, axis=-1).max() <= least_step


def test_creeping_feet_rest_until_the_step_is_worth_it(run: Arrays, least_step: float) -> None:
    """9.5: at 0.13 m/s each foot steps when its gap has grown to the least step."""
    found = spacings(run, CREEP, 240)
    assert len(found) > 8
    assert (found > least_step).all()
    assert (found < least_step + 0.01).all()
    assert run["parked"][120:, CREEP].any(0).all()


# --- prediction ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("who", [STRAIGHT, SLOW])
def test_property_13_straight_prints_do_not_move(run: Arrays, who: int) -> None:
    """From the begin of the step to its end; 2e-5 m are ten units of single precision at 18 m."""
    for places in strides(run, who, 200):
        assert np.linalg.norm(places - places[0], axis=-1).max() <= 2.1e-5


@pytest.mark.parametrize("who", [LEFT, RIGHT])
def test_property_13_prints_of_even_turns_hardly_move(run: Arrays, who: int) -> None:
    """At 60 degrees a second: by less than 1 % of a stride, both ways (the original: 304 mm to one side)."""
    stride = SPEED * durations(run, who)[300]
    steps = strides(run, who, 240)
    assert len(steps) > 15
    for places in steps:
        assert np.linalg.norm(places - places[0], axis=-1).max() <= 0.01 * stride


def test_property_13_mirrored_orders_give_mirrored_feet(run: Arrays) -> None:
    """After 15 s; posed feet as nearly as the clips of both sides mirror each other while they blend."""
    for name in ("handle", "footprint_to", "footprint_from", "heel", "toe", "ankle"):
        left, right = run[name][:, LEFT], run[name][:, RIGHT, ::-1] * MIRROR
        posed = name in ("heel", "toe", "ankle")
        np.testing.assert_allclose(left, right, atol=1.2e-3 if posed else 1e-5, err_msg=name)
        np.testing.assert_allclose(left[120:], right[120:], atol=1e-4 if posed else 1e-5, err_msg=name)
    np.testing.assert_allclose(run["cycle_time"][:, LEFT], run["cycle_time"][:, RIGHT, ::-1], atol=1e-5)
    np.testing.assert_array_equal(run["contact"][:, LEFT], run["contact"][:, RIGHT, ::-1])


def test_turning_on_the_spot_steps_round(run: Arrays) -> None:
    """120 degrees a second both ways: both feet keep stepping, and neither drifts away from the body.

    9.5: cycles of 1.3333 s while no foot lags. The rate is the body's at the end of a frame, 0.3 % under its mean.
    """
    for who in (SPIN, SPIN_BACK):
        yaw = np.degrees(np.unwrap(run["yaw"][:, who]))
        np.testing.assert_allclose(np.abs(yaw[-1] - yaw[300]), 120.0 * (len(yaw) - 301) / RATE, atol=2.0)
        cycle = durations(run, who)[300:]
        np.testing.assert_allclose(cycle.max(), 160.0 / 120.0, rtol=4e-3)
        assert (np.diff(run["steps"][[120, -1], who], axis=0) >= 9).all()
        away = run["handle"][120:, who] - run["position"][120:, who, None]
        assert np.hypot(away[..., 0], away[..., 2]).max() < 0.4
        assert np.hypot(*run["velocity"][120:, who, [0, 2]].T).max() < 1e-3


# --- events, limits, everything at once ------------------------------------------------------------------------------


def test_property_25_events_in_order_once_a_step(run: Arrays) -> None:
    phase = run["foot_phase"]
    changed = phase[1:] != phase[:-1]
    np.testing.assert_array_equal(phase[1:][changed], (phase[:-1][changed] + 1) % 4)
    count = np.stack([(changed & (phase[1:] == state)).sum(0) for state in range(4)])
    assert np.ptp(count, axis=0).max() <= 1
    assert np.abs(count[1] - run["steps"][-1]).max() <= 1
    assert not (changed & run["parked"][1:] & run["parked"][:-1]).any()
    assert (phase[run["parked"]] == 0).all()


def test_property_25_the_order_of_characters_does_not_matter(run: Arrays) -> None:
    """The same orders at another place of the herd give the same bits."""
    for name, values in run.items():
        np.testing.assert_array_equal(values[:, STRAIGHT], values[:, TWIN], err_msg=name)


def test_property_17_no_print_is_steeper_than_feet_may_stand(run: Arrays) -> None:
    for name in ("footprint_from_direction", "footprint_to_direction"):
        sole = run[name]
        assert (np.abs(sole[..., 1]) <= np.sin(np.radians(60)) * np.linalg.norm(sole, axis=-1) + 1e-6).all()


def test_property_20_legs_reach_their_feet(run: Arrays) -> None:
    """In every order above, and in all that happens at random but where prints lie a leg's length apart in height."""
    cliff = np.abs(run["footprint_from"][..., 1] - run["footprint_to"][..., 1]) > 0.8
    met = cliff.any((0, 2))
    assert run["over_reach"][:, ~met].max() <= 1e-4
    assert run["over_reach"][:, :12].max() <= 1e-4
    assert met.mean() < 0.25


def test_property_21_nothing_is_ever_not_a_number(run: Arrays) -> None:
    """1.15e5 character-frames: random velocities, headings and stops, on level ground, a slope, stairs and cliffs."""
    assert run["position"].shape[0] * run["position"].shape[1] >= 1e5
    for name, values in run.items():
        if name != "center_of_pressure":  # of no drag: there is none
            assert np.isfinite(values.astype(float)).all(), name
    assert not run["fault"].any()
    assert np.abs(run["weights"].sum(-1) - run["alignment"]).max() < 1e-4


def test_property_21_adjustment_fades_with_other_clips(run: Arrays) -> None:
    """A jump: from 1 to 0 and back evenly, within the 0.1 s of its fades; feet do not jump."""
    share = run["alignment"][:, JUMP]
    assert share[: 6 * RATE].min() == 1.0
    assert share[6 * RATE + 8] == 0.0
    assert share[-60:].min() == 1.0
    assert np.abs(np.diff(share)).max() <= 1 / (0.1 * RATE) + 1e-5
    others = np.delete(run["alignment"], JUMP, axis=1)
    assert (others == 1.0).all()
    moved = np.linalg.norm(np.diff(run["ankle"][:, JUMP], axis=0), axis=-1)
    assert moved[340:].max() < 1.35 * moved[200:340].max()


def test_runs_turn_as_told(run: Arrays) -> None:
    """What the properties are about did happen."""
    for who, turn in ((LEFT, TURN), (RIGHT, -TURN)):
        rate = np.diff(np.unwrap(run["yaw"][300:, who])) * RATE
        np.testing.assert_allclose(rate, turn, atol=1e-3)
        np.testing.assert_allclose(np.hypot(*run["velocity"][300:, who, [0, 2]].T), SPEED, rtol=0.15)
    assert run["position"][-1, STAIRS, 1] > 4.0
    assert run["position"][-1, SLOPE, 1] > 2.0
