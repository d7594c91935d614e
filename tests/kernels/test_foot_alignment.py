"""From the footbase to hips and ankles, against the specification's text (2.1, 4.11, 4.13, 4.14)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from kernels import foot_alignment, quat
from tests.kernels.checks import (
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    assert_matches,
    assert_matches_in_batches,
    in_double,
    in_single,
    unit_vectors,
)
from tests.kernels.test_footprint import UP, arc, columns, rotation

within_reach: Any = foot_alignment.within_reach
LEGS = 3


def flat(v: np.ndarray, n: np.ndarray) -> np.ndarray:
    return v - n * (v @ n)


def near_up(rng: np.random.Generator, *shape: int) -> np.ndarray:
    n = UP.reshape(3, *(1,) * len(shape)) + 0.3 * rng.normal(size=(3, *shape))
    return n / np.linalg.norm(n, axis=0)


# --- balance (2.1) and the plate under a posed foot (4.11) -----------------------------------------------------------


def test_printed_balance() -> None:
    """9.6, for a foot of 0.3 m."""
    rise = np.array([0.0, 0.015, 0.3, -0.3])
    found = in_double(foot_alignment.balance, rise, np.full(4, 0.3))
    np.testing.assert_allclose(found, [0.5, 0.75, 0.98410, 0.01590], atol=5e-6)


def test_balance() -> None:
    rng = np.random.default_rng(0)
    rise, length = 0.1 * rng.normal(size=6), rng.uniform(0.1, 0.4, 6)
    expected = np.arctan(20 * rise / length) / np.pi + 0.5
    assert_matches_in_batches(foot_alignment.balance, expected, rise, length, double=1.5e-6, single=3e-6)


def offset_by_text(heel: np.ndarray, toe: np.ndarray, plate: np.ndarray, normal: np.ndarray, length: float) -> Any:
    bal = np.arctan(20 * ((heel - toe) @ normal) / length) / np.pi + 0.5
    return (bal * (plate + heel - toe),)


def test_plate_offset() -> None:
    rng = np.random.default_rng(1)
    heel, toe, plate = 0.2 * rng.normal(size=(3, 3, 6))
    normal, length = near_up(rng, 6), rng.uniform(0.1, 0.4, 6)
    (expected,) = columns(offset_by_text, heel, toe, plate, normal, length)
    case = heel, toe, plate, normal, length
    assert_matches_in_batches(foot_alignment.plate_offset, expected, *case, double=2e-6, single=3e-6)
    assert_gradients_agree(foot_alignment.plate_offset, *case)
    assert_gradient_finite(foot_alignment.plate_offset, heel, heel, plate, normal, length)


def test_a_level_foot_lies_on_its_plate() -> None:
    heel, plate = np.array([0.1, 0.02, 0.3]), np.array([0.0, 0.0, 0.3])
    found = in_double(foot_alignment.plate_offset, heel, heel + plate, plate, UP, np.array(0.3))
    np.testing.assert_allclose(found, 0.0, atol=1e-12)
    # on its toes: the plate's toe end is where the toe is
    toe = heel + np.array([0.0, -0.2, 0.2])
    found = in_double(foot_alignment.plate_offset, heel, toe, plate, UP, np.array(0.3))
    np.testing.assert_allclose(heel - found + plate, toe, atol=0.01)


# --- the foot's rotation (4.13) --------------------------------------------------------------------------------------


def test_foot_orientation() -> None:
    """Property 22: planted the ground's rotation, in mid-flight the leg's; the short way and evenly in between."""
    rng = np.random.default_rng(2)
    carried, grounded = unit_vectors(rng, 4, 6), unit_vectors(rng, 4, 6)
    same = np.sign((carried * grounded).sum(0))
    found = [in_double(foot_alignment.foot_orientation, carried, grounded, np.full(6, w)) for w in (0.0, 0.5, 1.0)]
    assert_close(found[0], grounded, 1e-9)
    assert_close(found[2], carried * same, 1e-9)
    half = carried * same + grounded
    assert_close(found[1], half / np.linalg.norm(half, axis=0), 1e-9)
    lifted = rng.uniform(size=6)
    mixed = grounded + (carried * same - grounded) * lifted
    expected = mixed / np.linalg.norm(mixed, axis=0)
    assert_matches_in_batches(foot_alignment.foot_orientation, expected, carried, grounded, lifted)
    assert_gradients_agree(foot_alignment.foot_orientation, carried, grounded, lifted)
    assert_gradient_finite(foot_alignment.foot_orientation, carried, -carried, lifted)


def turned(angle: float, v: np.ndarray, axis: np.ndarray) -> np.ndarray:
    return rotation(axis, angle) @ v


def test_leg_yaw() -> None:
    """About the leg's own axis by half of the angle between the two directions seen along it."""
    rng = np.random.default_rng(3)
    axis, ahead, foot = rng.normal(size=(3, 3, 200))
    found = in_double(foot_alignment.leg_yaw, axis, ahead, foot)
    for i in range(200):
        along = axis[:, i] / np.linalg.norm(axis[:, i])
        a, b = flat(ahead[:, i], along), flat(foot[:, i], along)
        angle = np.arctan2(np.cross(a, b) @ along, a @ b)
        q = found[:, i]
        whole = np.array(in_double(quat.matrix, q)).T if i == 0 else None
        if whole is not None:
            np.testing.assert_allclose(whole, rotation(along, angle / 2), atol=1e-6)
        if abs(angle) < 3.1:
            expected = np.concatenate([[np.cos(angle / 4)], np.sin(angle / 4) * along])
            np.testing.assert_allclose(q, expected, atol=2e-5)
    few = [v[:, :6] for v in (axis, ahead, foot)]
    assert_matches_in_batches(foot_alignment.leg_yaw, found[:, :6], *few, single=1e-5)
    assert_gradients_agree(foot_alignment.leg_yaw, *few)


def test_leg_yaw_where_it_has_no_direction() -> None:
    """A leg along the body's own direction, of no length, a foot that looks back: finite, and a rotation."""
    zero = np.zeros((3, 1))
    for axis, ahead, foot in ((AHEAD, AHEAD, AHEAD), (zero, AHEAD, AHEAD), (DOWN, AHEAD, -AHEAD), (DOWN, zero, zero)):
        assert_gradient_finite(foot_alignment.leg_yaw, axis, ahead, foot)
        found = in_single(foot_alignment.leg_yaw, axis, ahead, foot)
        np.testing.assert_allclose(np.linalg.norm(found, axis=0), 1.0, atol=1e-5)


AHEAD, DOWN = np.array([[0.0], [0.0], [1.0]]), np.array([[0.0], [-1.0], [0.0]])

# --- reach and hips (4.14) -------------------------------------------------------------------------------------------


def reach_by_text(
    hip: np.ndarray, target: np.ndarray, up: np.ndarray, pose_reach: float, longest: float
) -> tuple[np.ndarray]:
    k = target - hip
    kg = flat(k, up)
    ex = np.linalg.norm(kg) - pose_reach
    if ex <= 0:
        return (target,)
    buf = max(longest - pose_reach, 1e-4)
    return (target - kg + kg / np.linalg.norm(kg) * (pose_reach + ex * buf / (ex + buf)),)


def reaching(rng: np.random.Generator, count: int) -> list[np.ndarray]:
    hip, target = rng.normal(size=(2, 3, count))
    return [hip, target, near_up(rng, count), rng.uniform(0, 1, count), rng.uniform(0.5, 1.2, count)]


def test_within_reach() -> None:
    rng = np.random.default_rng(4)
    for count in (6, 500):
        case = reaching(rng, count)
        (expected,) = columns(reach_by_text, *case)
        check = assert_matches_in_batches if count == 6 else assert_matches
        check(lambda *now: within_reach(*now, 1.0), expected, *case, double=1e-8, single=1e-5)
    few, soft = [a[..., :6] for a in case], np.linspace(0, 1, 6)
    part = few[1] + (expected[:, :6] - few[1]) * soft
    assert_matches_in_batches(foot_alignment.within_reach, part, *few, soft, double=1e-8, single=1e-5)
    assert_gradients_agree(foot_alignment.within_reach, *few, soft)
    assert_gradient_finite(foot_alignment.within_reach, few[0], few[0], few[2], 0 * few[3], 0 * few[4], soft)


def test_printed_soft_reach() -> None:
    """9.6: 0.1 m too far, 0.5 m of room: 0.083333."""
    hip, target = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.2, 0.5])
    args = hip, target, UP, np.array(0.4), np.array(0.9)
    found = in_double(lambda *now: within_reach(*now, 1.0), *args)
    np.testing.assert_allclose(found, [0.0, 0.2, 0.4 + 0.083333], atol=1e-6)
    np.testing.assert_allclose(in_double(lambda *now: within_reach(*now, 0.0), *args), target, atol=0)


def hips_by_text(
    hip: np.ndarray, target: np.ndarray, up: np.ndarray, pose_length: np.ndarray, longest: np.ndarray
) -> tuple[float]:
    wants, allows = [], []
    for k in range(LEGS):
        c = target[:, k] - hip[:, k]
        for radius, found in ((pose_length[k], wants), (longest[k], allows)):
            square = radius**2 - c @ c + (c @ up) ** 2
            found.append(c @ up + (np.sqrt(square) if square > 0 else 0.0))
    mx = min(allows)
    lo = min(min(wants), mx)
    a, b = max(np.mean(wants) - lo, 0.0), max(mx - lo, 0.0)
    return (lo + (a * b / (a + b) if a + b > 0 else 0.0),)


def hips(rng: np.random.Generator, count: int) -> list[np.ndarray]:
    hip = 0.2 * rng.normal(size=(3, LEGS, count)) + np.array([0.0, 0.9, 0.0])[:, None, None]
    target = rng.normal(size=(3, LEGS, count)) * np.array([0.4, 0.2, 0.4])[:, None, None]
    longest = rng.uniform(0.8, 1.1, (LEGS, count))
    return [hip, target, near_up(rng, count), longest * rng.uniform(0.7, 1.0, (LEGS, count)), longest]


def test_hip_lift() -> None:
    rng = np.random.default_rng(5)
    for count in (6, 1000):
        case = hips(rng, count)
        (expected,) = columns(hips_by_text, *case)
        check = assert_matches_in_batches if count == 6 else assert_matches
        # where a root is all but zero the guard under it shows: a micrometre
        check(foot_alignment.hip_lift, expected, *case, double=2e-6, single=1e-3 if count > 6 else 1e-4)
    assert_gradients_agree(foot_alignment.hip_lift, *hips(np.random.default_rng(8), 3))
    assert_gradient_finite(foot_alignment.hip_lift, *case)


def test_printed_hip_height() -> None:
    """9.6: lowest -0.2, mean -0.1, at most 0.05: -0.128571."""
    hip, target = np.zeros((3, 2)), np.array([[0.0, 0.0], [-0.9, -0.9], [0.0, 0.0]])
    found = in_double(foot_alignment.hip_lift, hip, target, UP, np.array([0.7, 0.9]), np.array([0.95, 0.95]))
    np.testing.assert_allclose(found, -0.128571, atol=1e-6)


def test_every_leg_reaches_after_the_hips_moved() -> None:
    """Property 20: where all can, all do; no hip is above what the lowest leg allows."""
    hip, target, up, pose_length, longest = hips(np.random.default_rng(6), 2000)
    lift = in_double(foot_alignment.hip_lift, hip, target, up, pose_length, longest)
    c = target - hip
    rise = (c * up[:, None]).sum(0)
    level2 = (c * c).sum(0) - rise**2
    square = longest**2 - level2
    allows, low = rise + np.sqrt(np.maximum(square, 0)), rise - np.sqrt(np.maximum(square, 0))
    assert (lift <= allows.min(0) + 1e-5).all()
    can = (square > 0).all(0) & (lift >= low.max(0))
    away = np.linalg.norm(target - hip - up[:, None] * lift, axis=0)
    assert (away <= longest + 1e-5)[:, can].all()
    assert 200 < can.sum() < 2000


def test_hips_stay_where_the_clip_has_them() -> None:
    """Feet where the clip's are: nothing moves."""
    hip, target, up, *_ = hips(np.random.default_rng(7), 100)
    target = target - np.array([0.0, 0.5, 0.0])[:, None, None]
    length = np.linalg.norm(target - hip, axis=0)
    lift = in_double(foot_alignment.hip_lift, hip, target, up, length, length * 1.02)
    np.testing.assert_allclose(lift, 0.0, atol=1e-6)


def folded_by_text(
    lift: float, hip: np.ndarray, target: np.ndarray, up: np.ndarray, nearest: np.ndarray, longest: np.ndarray
) -> tuple[float]:
    needs, allows = [lift], []
    for k in range(LEGS):
        c = target[:, k] - hip[:, k]
        level2 = c @ c - (c @ up) ** 2
        if level2 < nearest[k] ** 2 and c @ up <= lift:
            needs.append(c @ up + np.sqrt(nearest[k] ** 2 - level2))
        allows.append(c @ up + np.sqrt(max(longest[k] ** 2 - level2, 0.0)))
    return (max(lift, min(max(needs), min(allows))),)


def test_folded() -> None:
    rng = np.random.default_rng(12)
    for count in (6, 800):
        hip, target, up, _, longest = hips(rng, count)
        nearest = longest * rng.uniform(0, 1, longest.shape)
        case = [0.3 * rng.normal(size=count) - 0.3, hip, target, up, nearest, longest]
        (expected,) = columns(folded_by_text, *case)
        check = assert_matches_in_batches if count == 6 else assert_matches
        check(foot_alignment.folded, expected, *case, double=2e-6, single=1e-3)
    assert (expected > case[0] + 0.01).sum() > 50
    assert_gradients_agree(foot_alignment.folded, *(a[..., :6] for a in case))
    assert_gradient_finite(foot_alignment.folded, *case)


def test_hips_rise_over_a_foot_that_is_too_near() -> None:
    """0.3 m from the hip seen from above, a leg that folds to 0.5 m: 0.4 m higher, unless the other leg forbids it."""
    hip, target = np.zeros((3, 2)), np.array([[0.3, 0.6], [0.0, 0.0], [0.0, 0.0]])
    args = np.array(0.1), hip, target, UP, np.array([0.5, 0.2])
    np.testing.assert_allclose(in_double(foot_alignment.folded, *args, np.array([2.0, 2.0])), 0.4, atol=1e-6)
    np.testing.assert_allclose(in_double(foot_alignment.folded, *args, np.array([2.0, 0.65])), 0.25, atol=1e-6)


def drawn_by_text(
    hip: np.ndarray, target: np.ndarray, shift: np.ndarray, nearest: np.ndarray, longest: np.ndarray
) -> tuple[np.ndarray]:
    missed, total = np.zeros(3), 0.0
    for k in range(LEGS):
        way = target[:, k] - hip[:, k] - shift
        far = np.linalg.norm(way)
        missing = max(far - longest[k], 0.0) - max(nearest[k] - far, 0.0)
        missed = missed + abs(missing) * missing * way / far
        total += abs(missing)
    mean = missed / (total + 1e-6)
    size = np.linalg.norm(mean)
    return (shift + mean * min(1.0, 0.25 * longest.mean() / size if size > 0 else 1.0),)


def test_drawn() -> None:
    rng = np.random.default_rng(11)
    for count in (6, 800):
        hip, target, _, _, longest = hips(rng, count)
        case = [hip, target, 0.2 * rng.normal(size=(3, count)), longest * rng.uniform(0, 1, longest.shape), longest]
        (expected,) = columns(drawn_by_text, *case)
        check = assert_matches_in_batches if count == 6 else assert_matches
        check(foot_alignment.drawn, expected, *case, double=1e-6, single=1e-4)
    assert_gradients_agree(foot_alignment.drawn, *(a[..., :6] for a in case))
    assert_gradient_finite(foot_alignment.drawn, hip, hip, 0 * case[2], *case[3:])


def test_what_hips_are_drawn_to() -> None:
    """One leg out of reach gets all of it, opposite legs nothing, a leg that reaches none; no more than a quarter."""
    nearest, longest = np.array([0.3, 0.3]), np.array([1.0, 1.0])
    hip, ahead = np.zeros((3, 2)), np.array([0.0, 0.0, 1.0])

    def shift(*far: float) -> np.ndarray:
        target = np.stack([ahead * f for f in far], 1)
        return in_double(foot_alignment.drawn, hip, target, np.zeros(3), nearest, longest)

    np.testing.assert_allclose(shift(1.1, 0.8), 0.1 * ahead, atol=1e-5)
    np.testing.assert_allclose(shift(1.1, -1.1), 0.0, atol=1e-9)
    np.testing.assert_allclose(shift(0.8, -0.4), 0.0, atol=1e-9)
    np.testing.assert_allclose(shift(0.1, 0.8), -0.2 * ahead, atol=1e-5)
    np.testing.assert_allclose(shift(1.9, 0.8), 0.25 * ahead, atol=1e-9)


@pytest.mark.parametrize("most", [0.0, 0.5])
def test_limited(most: float) -> None:
    """Property 17: no further than allowed from the reference; unchanged where it is nearer."""
    rng = np.random.default_rng(9)
    wanted, reference, limit = rng.normal(size=(3, 6)), rng.normal(size=(3, 6)), np.full(6, most)
    reference[:, 0] = wanted[:, 0] + 0.01
    size = np.linalg.norm(wanted - reference, axis=0)
    expected = reference + (wanted - reference) * np.minimum(1, most / size)
    assert_matches_in_batches(foot_alignment.limited, expected, wanted, reference, limit)
    assert_gradient_finite(foot_alignment.limited, wanted, wanted, limit)
    assert np.linalg.norm(expected - reference, axis=0).max() <= most + 1e-9


def test_arc_of_the_references() -> None:
    """The rotation that these tests lean on takes one direction to the other."""
    a, b = unit_vectors(np.random.default_rng(10), 3, 2).T
    np.testing.assert_allclose(arc(a, b) @ a, b, atol=1e-12)
