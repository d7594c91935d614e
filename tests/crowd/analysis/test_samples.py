"""The reference analysis: against plain loops, ideal foot paths, closed forms, and its symmetries."""

from __future__ import annotations

import numpy as np
import pytest

from crowd.analysis import MotionAnalysis, analyse_samples
from crowd.errors import InputError
from tests.crowd.analysis.ideal_feet import HEEL, LENGTH, TOE_TIP, N, foot, ideal_walk, rolling_walk
from tests.crowd.analysis.naive_reference import leg as naive_leg
from tests.crowd.analysis.naive_reference import motion as naive_motion

GROUND = -0.001


def analysed(*feet: tuple[np.ndarray, np.ndarray], ground: float = GROUND, **options: bool) -> MotionAnalysis:
    ankle, toe = (np.stack(parts) for parts in zip(*feet, strict=True))
    return analyse_samples(ankle, toe, HEEL, TOE_TIP, LENGTH, ground, 1.25, **options)


@pytest.mark.parametrize("seed", range(12))
def test_same_as_plain_loops(seed: int) -> None:
    feet = [rolling_walk(2 * seed), rolling_walk(2 * seed + 1)]
    found = analysed(*feet)
    legs = [naive_leg(a.tolist(), t.tolist(), HEEL.tolist(), TOE_TIP.tolist(), LENGTH, GROUND) for a, t in feet]
    total = naive_motion(legs, 1.25, GROUND)
    for mine, theirs, path in zip(found.legs, legs, total["paths"], strict=True):
        assert mine.stance_index == theirs["s"]
        assert mine.keytimes == pytest.approx(theirs["keys"], abs=1e-12)
        assert mine.y_range == pytest.approx(theirs["y_range"])
        assert mine.axis == pytest.approx(theirs["axis"]) and mine.axis_scaling == pytest.approx(theirs["scaling"])
        assert mine.balance == pytest.approx(np.array(theirs["balance"]))
        assert mine.footbase == pytest.approx(np.array(theirs["base"]))
        assert mine.foot_vector == pytest.approx(theirs["h"])
        assert mine.stance_position == pytest.approx(theirs["position"])
        assert mine.distance == pytest.approx(theirs["distance"])
        assert mine.direction == pytest.approx(theirs["direction"])
        assert mine.normalised_footbase == pytest.approx(np.array(path), abs=1e-12)
    assert found.distance == pytest.approx(total["distance"]) and found.speed == pytest.approx(total["speed"])
    assert found.direction == pytest.approx(total["direction"])
    assert found.velocity == pytest.approx(np.array(total["direction"]) * total["speed"])


def test_ideal_walk_has_the_known_key_times() -> None:
    """Steady planted feet: distance, direction and stance are exact; lift-off is where the pace over 0.4 of a cycle
    has changed by half, which for stances of half a cycle is when 10 samples reach well into the flight."""
    found = analysed(ideal_walk(0.2), ideal_walk(0.7), ground=0.0)
    for leg, stance in zip(found.legs, (0.2, 0.7), strict=True):
        assert leg.stance_time == pytest.approx(stance)
        assert leg.distance == pytest.approx(1.2)
        assert leg.direction == pytest.approx([0, 0, 1])
        assert leg.foot_vector == pytest.approx([0, 0, LENGTH])
        assert leg.axis_scaling == pytest.approx(0.6, abs=0.015)  # the turning points lie between samples
        lift, liftoff, postlift, preland, strike, land = leg.keytimes
        assert liftoff == pytest.approx(1 - strike) and 0.14 <= liftoff <= 0.25  # a path symmetrical in time
        assert (postlift, preland) == pytest.approx((max(liftoff, lift + 0.2), min(strike, land - 0.2)))
        assert leg.normalised_footbase[: round(liftoff * N) + 1] == pytest.approx(0.0, abs=1e-12)
        assert leg.normalised_footbase[round(strike * N) :] == pytest.approx(
            np.tile([0, 0, 1.0], (N - round(strike * N), 1)), abs=1e-12
        )
    assert found.distance == pytest.approx(1.2) and found.speed == pytest.approx(0.96)
    assert found.velocity == pytest.approx([0, 0, 0.96])


def test_normalised_path_starts_at_zero_and_ends_near_one() -> None:
    """Property 5."""
    found = analysed(rolling_walk(31), rolling_walk(32))
    fixed = analysed(rolling_walk(31), rolling_walk(32), fix_foot_skating=True)
    for leg, still in zip(found.legs, fixed.legs, strict=True):
        assert leg.normalised_footbase[0, [0, 2]] == pytest.approx([0, 0], abs=1e-12)
        assert leg.normalised_by_sample[:, 1] == pytest.approx(leg.footbase[:, 1] - GROUND)
        times = np.arange(N) / N
        assert np.all(still.normalised_footbase[times <= still.liftoff, 2] == 0.0)
        assert np.all(still.normalised_footbase[times >= still.strike, 2] == 1.0)
        between = (times > still.liftoff) & (times < still.strike)
        own = leg.distance * leg.direction @ np.array([0, 0, 1.0])
        assert own != 0 and np.ptp(still.normalised_footbase[between, 2]) > 0.5


@pytest.mark.parametrize(("rise", "balance"), [(0.0, 0.5), (LENGTH / 20, 0.75), (LENGTH, 0.984097)])
def test_balance_closed_forms(rise: float, balance: float) -> None:
    """9.6: heel higher than the toe by nothing, a twentieth of the foot, and the foot."""
    pitch = np.full(N + 1, np.arcsin(rise / LENGTH))
    ankle, toe = foot(np.tile([0.0, rise, 0.0], (N + 1, 1)), pitch)
    found = analyse_samples(ankle, toe, HEEL, TOE_TIP, LENGTH, 0.0, 1.0, grounded=True)
    assert found.legs[0].balance == pytest.approx(balance, abs=1e-6)


def test_turning_the_clip_turns_the_result() -> None:
    feet = [rolling_walk(5), rolling_walk(8)]
    yaw = 1.1
    turn = np.eye(4)
    turn[0, 0] = turn[2, 2] = np.cos(yaw)
    turn[0, 2], turn[2, 0] = np.sin(yaw), -np.sin(yaw)
    plain, turned = analysed(*feet), analysed(*[(turn @ a, turn @ t) for a, t in feet])
    assert turned.direction == pytest.approx(turn[:3, :3] @ plain.direction)
    assert turned.distance == pytest.approx(plain.distance)
    for a, b in zip(plain.legs, turned.legs, strict=True):
        assert b.keytimes == pytest.approx(a.keytimes)
        assert b.footbase == pytest.approx(a.footbase @ turn[:3, :3].T)
        assert b.normalised_footbase == pytest.approx(a.normalised_footbase, abs=1e-12)


def test_scaling_the_clip_scales_the_result() -> None:
    feet = [rolling_walk(6), rolling_walk(9)]
    size = 3.7
    scale = np.diag([size, size, size, 1.0])
    inverse = np.linalg.inv(scale)
    plain = analysed(*feet)
    ankle, toe = (np.stack([scale @ m @ inverse for m in parts]) for parts in zip(*feet, strict=True))
    found = analyse_samples(ankle, toe, HEEL * size, TOE_TIP * size, LENGTH * size, GROUND * size, 1.25)
    assert found.distance == pytest.approx(plain.distance * size)
    for a, b in zip(plain.legs, found.legs, strict=True):
        assert b.keytimes == pytest.approx(a.keytimes) and b.balance == pytest.approx(a.balance)
        assert b.normalised_footbase == pytest.approx(a.normalised_footbase * [size, size, 1.0], abs=1e-12)


def test_stance_index_50_is_legal() -> None:
    """The last sample counts in the stance search as it is, and is the first one from then on."""
    ankle, toe = ideal_walk(0.0)
    for m in (ankle, toe):
        m[N, 1, 3] -= 0.001  # a little lower than sample 0
    leg = analysed((ankle, toe), ground=-0.01).legs[0]
    assert leg.stance_index == N and leg.stance_time == 1.0
    assert leg.heel[N] == pytest.approx(leg.heel[0])
    same = analysed(ideal_walk(0.0), ground=-0.01).legs[0]
    assert same.stance_index == 0  # the first of equals
    assert leg.keytimes == pytest.approx(same.keytimes) and leg.normalised_footbase == pytest.approx(
        same.normalised_footbase
    )


def test_grounded_motions_tell_where_the_feet_are_and_nothing_else() -> None:
    found = analysed(rolling_walk(3), rolling_walk(4), grounded=True)
    assert found.distance == found.speed == 0 and not found.velocity.any()
    for leg in found.legs:
        assert leg.stance_index == 0 and not leg.keytimes.any() and not leg.axis.any()
        assert leg.normalised_footbase == pytest.approx(leg.footbase[:N] - leg.stance_position)
        assert leg.stance_position[1] == GROUND


def test_one_leg_needs_no_leading_axis() -> None:
    ankle, toe = ideal_walk(0.3)
    found = analyse_samples(ankle, toe, HEEL, TOE_TIP, LENGTH, 0.0, 1.0)
    assert len(found.legs) == 1 and found.legs[0].stance_time == pytest.approx(0.3)


def test_feet_that_do_not_move_divide_by_nothing() -> None:
    ankle, toe = foot(np.tile([0.1, 0.0, 0.0], (N + 1, 1)), np.zeros(N + 1))
    with np.errstate(all="raise"):
        found = analyse_samples(ankle, toe, HEEL, TOE_TIP, LENGTH, 0.0, 1.0)
    leg = found.legs[0]
    assert found.distance == 0 and np.isfinite(leg.normalised_footbase).all() and np.isfinite(leg.keytimes).all()


def test_bad_shapes_are_told() -> None:
    ankle, toe = ideal_walk()
    with pytest.raises(InputError, match=r"must both be \[L, 51, 4, 4\]"):
        analyse_samples(ankle[:50], toe[:50], HEEL, TOE_TIP, LENGTH, 0.0, 1.0)
    with pytest.raises(InputError, match="must be > 0"):
        analyse_samples(ankle, toe, HEEL, TOE_TIP, 0.0, 0.0, 1.0)
