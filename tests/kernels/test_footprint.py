"""Footprints against the specification's text (4.4, 4.5, 4.7) in plain code, with rotation matrices and arcs."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from kernels import footprint
from tests.kernels.checks import (
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    assert_matches,
    assert_matches_in_batches,
    in_double,
    in_single,
)

# named tuples of arrays, here of NumPy's
Footprint: Any = footprint.Footprint
Hit: Any = footprint.Hit
smoothed: Any = footprint.smoothed

UP = np.array([0.0, 1.0, 0.0])
DEGREE = np.pi / 180


def rotation(axis: np.ndarray, angle: Any) -> np.ndarray:
    """[3, 3] about a unit axis, by Rodrigues."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def arc(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """[3, 3], the shortest rotation that takes direction a to b."""
    axis = np.cross(a, b)
    size = np.linalg.norm(axis)
    return np.eye(3) if size < 1e-12 else rotation(axis / size, np.arctan2(size, a @ b))


def yawed(angle: float) -> np.ndarray:
    return rotation(UP, angle)


def columns(rule: Any, *arguments: np.ndarray) -> list[np.ndarray]:
    """Results of a rule for every last index, stacked last; a rule's tuple gives several arrays."""
    rows = [rule(*(a[..., i] for a in arguments)) for i in range(arguments[0].shape[-1])]
    return [np.stack(column, -1) for column in zip(*rows, strict=True)]


def random_normals(rng: np.random.Generator, count: int, steepest: float = 1.0) -> np.ndarray:
    slope = rng.uniform(-steepest, steepest, (2, count))
    n = np.stack([-slope[0], np.ones(count), -slope[1]])
    return n / np.linalg.norm(n, axis=0)


def level(foot: np.ndarray) -> np.ndarray:
    """[3, ...] of (x, z)."""
    return np.stack([foot[0], 0 * foot[0], foot[1]])


# --- the way of a turning body (4.4) ---------------------------------------------------------------------------------


def way_by_text(velocity: np.ndarray, angle: float, time: float) -> tuple[np.ndarray]:
    """C = (up x v) / rate; C + rotated by the angle (-C)."""
    v = np.array([velocity[0], 0.0, velocity[1]])
    if abs(angle) < 1e-9 or time == 0:
        return (velocity * time,)
    c = np.cross(UP, v) / (angle / time)
    return ((c - yawed(angle) @ c)[[0, 2]],)


def test_swept() -> None:
    rng = np.random.default_rng(0)
    velocity, time = rng.normal(size=(2, 600)), rng.uniform(0, 1.5, 600)
    angle = np.concatenate([rng.uniform(-4, 4, 500), rng.uniform(-4e-3, 4e-3, 80), np.zeros(20)])
    (expected,) = columns(way_by_text, velocity, angle, time)
    assert_matches(footprint.swept, expected, velocity, angle, time)
    some = [a[..., ::100] for a in (velocity, angle, time)]
    assert_matches_in_batches(footprint.swept, expected[..., ::100], *some)
    assert_gradients_agree(footprint.swept, *some)
    assert_gradient_finite(footprint.swept, 0 * some[0], 0 * some[1], 0 * some[2])


def test_swept_is_a_sum_of_small_steps() -> None:
    """Turning evenly both ways, and mirrored turns give mirrored ways."""
    angle = np.array([1.5, -1.5, 0.3, -0.3])
    velocity, time = np.array([0.2, 1.2]), np.full(4, 0.9)
    share = (np.arange(20000) + 0.5) / 20000
    turned = angle[:, None] * share
    x = velocity[0] * np.cos(turned) + velocity[1] * np.sin(turned)
    z = velocity[1] * np.cos(turned) - velocity[0] * np.sin(turned)
    found = in_double(footprint.swept, velocity[:, None] * np.ones(4), angle, time)
    assert_close(found, 0.9 * np.stack([x.mean(1), z.mean(1)]), 1e-8)
    mirrored = in_double(footprint.swept, velocity[:, None] * [[-1.0], [1.0]] * np.ones(4), -angle, time)
    assert_close(mirrored, found * [[-1.0], [1.0]], 1e-12)


def test_the_original_goes_straight_in_turns_to_one_side() -> None:
    rng = np.random.default_rng(1)
    velocity, turn = rng.normal(size=(2, 300)), rng.uniform(-2, 2, 300)
    time, cycle = rng.uniform(0, 1.0, 300), rng.uniform(0.05, 1.5, 300)
    bends = turn * cycle / DEGREE >= 5
    (bent,) = columns(way_by_text, velocity, turn * time, time)
    expected = np.where(bends, bent, velocity * time)
    assert_matches(footprint.swept_one_sided, expected, velocity, turn, time, cycle)
    assert 50 < bends.sum() < 250
    assert_gradient_finite(footprint.swept_one_sided, velocity * 0, turn * 0, time * 0, cycle * 0)


def predictions(turn: float, one_sided: bool) -> np.ndarray:
    """[frames, steps] m, how far the print of a step has moved since liftoff: 9.5, 1.2 m/s and 60 Hz.

    The velocity is that of the frame before, as the original's tracker has it.
    """
    t = np.arange(0, 600) / 60
    place = 1.2 / turn * np.stack([1 - np.cos(turn * t), np.sin(turn * t)])
    now, before = place[:, 1:], place[:, :-1]
    velocity, left = (now - before) * 60, 1.0 - (t[1:] % 1.0)
    angle = np.full(599, turn)
    if one_sided:
        way = in_double(footprint.swept_one_sided, velocity, angle, left, np.ones(599))
    else:
        way = in_double(footprint.swept, velocity, angle * left, left)
    found = []
    for step in range(9):
        inside = (t[1:] >= step + 0.25 - 1e-9) & (t[1:] < step + 0.75 - 1e-9)
        prints = (now + way)[:, inside]
        found.append(np.linalg.norm(prints - prints[:, :1], axis=0))
    return np.array(found)


def test_printed_drift_of_predictions() -> None:
    """9.5: 5.0 mm at most in turns of 60 degrees a second, mended both ways; 304 mm to one side as it was."""
    for turn in (60 * DEGREE, -60 * DEGREE):
        assert 0.004 < predictions(turn, False).max() < 0.0055
    assert 0.004 < predictions(60 * DEGREE, True).max() < 0.0055
    np.testing.assert_allclose(predictions(-60 * DEGREE, True).max(), 0.304, atol=0.03)


def test_turned_towards() -> None:
    rng = np.random.default_rng(2)
    old, wanted = rng.uniform(-9, 9, (2, 300))
    most = np.concatenate([rng.uniform(0, 1, 200), np.full(100, np.inf)])

    def rule(old: float, wanted: float, most: float) -> tuple[float]:
        error = np.angle(np.exp(1j * (wanted - old)))
        return (old + np.clip(error, -most, most),)

    (expected,) = columns(rule, old, wanted, most)
    assert_matches(footprint.turned_towards, expected, old, wanted, most)
    assert_matches_in_batches(footprint.turned_towards, expected[:6], old[:6], wanted[:6], most[:6])


def test_about() -> None:
    rng = np.random.default_rng(3)
    place, yaw = rng.normal(size=(3, 6)), rng.uniform(-9, 9, 6)
    (expected,) = columns(lambda v, a: (yawed(a) @ v,), place, yaw)
    assert_matches_in_batches(footprint.about, expected, place, yaw)
    assert_gradients_agree(footprint.about, place, yaw)


def test_tilted_and_normals() -> None:
    rng = np.random.default_rng(4)
    slope, vector = rng.uniform(-1.5, 1.5, (2, 6)), level(rng.normal(size=(2, 6)))
    normal = np.stack([-slope[0], np.ones(6), -slope[1]]) / np.sqrt(1 + (slope**2).sum(0))
    assert_matches_in_batches(footprint.normal_of, normal, slope)
    (expected,) = columns(lambda v, n: (arc(UP, n) @ v,), vector, normal)
    assert_matches_in_batches(footprint.tilted, expected, vector, normal)
    upright = np.repeat(UP[:, None], 6, 1)
    assert_matches_in_batches(footprint.tilted, vector, vector, upright)
    assert_gradients_agree(footprint.tilted, vector, normal)
    assert_gradient_finite(footprint.tilted, vector, upright)


# --- the print follows its prediction (4.5) --------------------------------------------------------------------------


def smoothed_by_text(
    dt: float, current: np.ndarray, goal: np.ndarray, predicted: np.ndarray, time: float, strike: float, ft: float,
    begins: bool, seek: float, cycle: float, designated: float,
) -> tuple[np.ndarray, np.ndarray, Any]:  # fmt: skip
    if begins:
        return predicted, predicted, True
    u = max(time / strike, 1e-3)
    fresh = np.linalg.norm(predicted - current) < seek * (1 / u - 1)
    goal = predicted if fresh else goal
    e, left = goal - current, (strike - designated) * cycle
    size = np.linalg.norm(e)
    if size == 0 or left <= 0:
        return current, goal, fresh
    step = min(size, max(seek * dt / max(0.1, ft), (1 + 2 * (u - 1) ** 2) * dt / left * size))
    return current + step * e / size, goal, fresh


def following(rng: np.random.Generator, count: int) -> list[Any]:
    strike, places = rng.uniform(0.6, 0.9, count), 0.4 * rng.normal(size=(3, 3, count))
    places[:, :, ::7] = places[:1, :, ::7]  # arrived
    designated = strike * rng.uniform(0.0, 0.999, count)
    time = np.where(rng.uniform(size=count) < 0.5, designated, designated * rng.uniform(size=count))
    seek, cycle = rng.uniform(0.1, 5.0, count), rng.uniform(0.3, 1.5, count)
    return [*places, time, strike, rng.uniform(size=count), rng.uniform(size=count) < 0.1, seek, cycle, designated]


@pytest.mark.parametrize("dt", [1 / 240, 1 / 60, 0.3])
def test_smoothed(dt: float) -> None:
    found = following(np.random.default_rng(5), 700)
    expected = columns(lambda *one: smoothed_by_text(dt, *one), *found)

    def kernel(*now: Any) -> Any:
        return smoothed(*now, dt)

    assert_matches(kernel, expected, *found, double=1e-6, single=1e-4)
    assert 100 < expected[2].sum() < 650


def test_smoothed_shapes_and_gradients() -> None:
    found = following(np.random.default_rng(6), 6)
    expected = columns(lambda *one: smoothed_by_text(1 / 60, *one), *found)

    def kernel(*now: Any) -> Any:
        return smoothed(*now, 1 / 60)

    assert_matches_in_batches(kernel, expected, *found, double=1e-6, single=1e-4)
    begins, rest = found[6], found[:6] + found[7:]

    def moved(*now: Any) -> Any:
        return smoothed(*now[:6], jnp.asarray(begins), *now[6:], 1 / 60)[:2]

    assert_gradients_agree(moved, *rest)
    still = [np.zeros((3, 6))] * 3 + [np.zeros(6), np.full(6, 0.7), *[np.zeros(6)] * 4]
    assert_gradient_finite(moved, *still)
    assert_gradient_finite(moved, *still[:3], np.full(6, 0.7), *still[4:-1], np.full(6, 0.7))  # at its strike


def test_a_print_arrives_and_then_stands_still() -> None:
    """To the last bit; while the goal is held it arrives by the strike."""
    goal, current = np.array([[0.3], [0.0], [1.1]], np.float32), np.zeros((3, 1), np.float32)
    for frame in range(1, 46):
        time = np.array([0.75 * frame / 45])
        current, aim, _ = in_single(
            lambda *now: smoothed(*now[:6], jnp.zeros(1, bool), *now[6:], 1 / 60),
            current, goal, goal, time, np.array([0.75]), np.array([0.5]), np.array(1.0), np.array(1.0), time,
        )  # fmt: skip
    np.testing.assert_array_equal(current, goal)
    np.testing.assert_array_equal(aim, goal)


# --- on the ground (4.7) ---------------------------------------------------------------------------------------------

LEAST_Y = np.cos(60 * DEGREE)


def placed_by_text(
    p: np.ndarray, yaw: float, foot: np.ndarray, height_a: float, slope_a: np.ndarray, height_b: float,
    slope_b: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Heel end and toe end of the print. Where heel and toe both carry it, along both: the mended part."""
    sole = yawed(yaw) @ level(foot)
    a, b = np.array([p[0], height_a, p[2]]), np.array([p[0] + sole[0], height_b, p[2] + sole[2]])
    normals = [np.array([-s[0], 1.0, -s[1]]) / np.sqrt(1 + s @ s) for s in (slope_a, slope_b)]
    hits = [abs(h - p[1]) <= 0.7 for h in (height_a, height_b)]
    good = [h and n[1] > LEAST_Y for h, n in zip(hits, normals, strict=True)]
    if not any(hits):
        return p, p + sole
    shift, turn, on_toe = 0.0, np.eye(3), not hits[0]
    if all(good):
        mean = (normals[0] + normals[1]) / np.linalg.norm(normals[0] + normals[1])
        on_toe = b @ mean > a @ mean
        # slopes of the plane along both: from heel to toe, and across as the mean normal's
        along, across = sole / np.linalg.norm(sole), np.cross(sole, UP) / np.linalg.norm(sole)
        gradient = along * (b - a)[1] / np.linalg.norm(sole) - across * (mean @ across) / mean[1]
        plane = (UP - gradient) / np.linalg.norm(UP - gradient)
        if abs((b - a) @ mean) <= np.linalg.norm(foot) / 4 and plane[1] > LEAST_Y:
            return a, a + arc(UP, plane) @ sole
        shift, turn = 0.5, arc(UP, normals[int(on_toe)])
    elif any(good):
        on_toe = good[1]
        shift, turn = 0.5, arc(UP, normals[int(on_toe)])
    ahead = turn @ sole
    heel = b - ahead + shift * ahead if on_toe else a - shift * ahead
    return heel, heel + ahead


def on_grounds(rng: np.random.Generator, count: int) -> list[np.ndarray]:
    """Heights and slopes of all sorts: even, stepped, steep, missed."""
    p, foot = rng.normal(size=(3, count)), rng.normal(size=(2, count))
    foot *= rng.uniform(0.15, 0.35, count) / np.linalg.norm(foot, axis=0)
    slope = rng.uniform(-1, 1, (2, 2, count)) * rng.choice([0.0, 0.2, 2.5], count)
    slope[1] = np.where(rng.uniform(size=count) < 0.5, slope[0], slope[1])
    height = (
        p[1] + rng.uniform(-0.3, 0.3, count) + rng.uniform(-1, 1, (2, count)) * rng.choice([0, 0.05, 0.4, 1.0], count)
    )
    return [p, rng.uniform(-9, 9, count), foot, height[0], slope[0], height[1], slope[1]]


def placed(p: Any, yaw: Any, foot: Any, height_a: Any, slope_a: Any, height_b: Any, slope_b: Any) -> Any:
    least, window = jnp.array(LEAST_Y, p.dtype), jnp.array(0.7, p.dtype)
    hits = Hit(height_a, slope_a), Hit(height_b, slope_b)
    return footprint.placed(p, yaw, foot, *hits, least, window)


def ends(*now: Any) -> Any:
    """Heel end, toe end and whether the normal is at right angles to the sole."""
    print_ = placed(*now)
    return print_.position, print_.position + print_.sole


def test_placed() -> None:
    found = on_grounds(np.random.default_rng(7), 1500)
    expected = columns(placed_by_text, *found)
    assert_matches(ends, tuple(expected), *found, single=1e-5)
    few = [a[..., ::250] for a in found]
    assert_matches_in_batches(ends, tuple(e[..., ::250] for e in expected), *few, single=1e-5)
    print_ = in_double(placed, *found)
    np.testing.assert_allclose(np.linalg.norm(print_.normal, axis=0), 1.0, atol=1e-9)
    sole = expected[1] - expected[0]
    np.testing.assert_allclose((print_.normal * sole).sum(0), 0.0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(sole, axis=0), np.linalg.norm(found[2], axis=0), atol=1e-9)
    assert_gradient_finite(ends, *few)
    assert_gradient_finite(ends, *(0 * a for a in few))


def test_prints_on_a_plane_lie_in_it() -> None:
    """Whatever its slope, below 60 degrees; property 17: the normal is the plane's."""
    rng = np.random.default_rng(8)
    count = 500
    slope = rng.uniform(0, 1.7, count) * (lambda a: np.stack([np.sin(a), np.cos(a)]))(rng.uniform(-9, 9, count))
    p, yaw, foot = rng.normal(size=(3, count)), rng.uniform(-9, 9, count), rng.uniform(-0.2, 0.2, (2, count))
    p[1] = (slope * p[[0, 2]]).sum(0)
    sole = columns(lambda f, a: (yawed(a) @ level(f),), foot, yaw)[0]
    at_toe = (slope * (p + sole)[[0, 2]]).sum(0)
    print_ = in_double(placed, p, yaw, foot, p[1], slope, at_toe, slope)
    normal = np.stack([-slope[0], np.ones(count), -slope[1]]) / np.sqrt(1 + (slope**2).sum(0))
    assert_close(print_.normal, normal, 1e-6)
    assert_close(print_.position, p, 1e-9)
    assert (print_.normal[1] > LEAST_Y).all()


def test_accepted_normals_stay_within_the_steepest_slope() -> None:
    """Property 17 on any pair of hits, bent hollows too."""
    rng = np.random.default_rng(9)
    found = on_grounds(rng, 4000)
    assert in_double(placed, *found).normal[1].min() > LEAST_Y - 1e-9


def test_ledge_rule() -> None:
    """Property 23: heel .3 m over the toe, a foot of .3 m: shifted back by .15 m, level. Equal hits: no shift."""
    p, foot, flat = np.array([1.0, 0.1, 2.0]), np.array([0.0, 0.3]), np.zeros(2)
    print_ = in_double(placed, p, np.array(0.0), foot, np.array(0.3), flat, np.array(0.0), flat)
    np.testing.assert_allclose(print_.position, [1.0, 0.3, 1.85], atol=1e-9)
    np.testing.assert_allclose(print_.normal, UP, atol=1e-9)
    print_ = in_double(placed, p, np.array(0.0), foot, np.array(0.0), flat, np.array(0.3), flat)
    np.testing.assert_allclose(print_.position, [1.0, 0.3, 2.15], atol=1e-9)  # the toe's level: ahead by as much
    print_ = in_double(placed, p, np.array(0.0), foot, np.array(0.2), flat, np.array(0.2), flat)
    np.testing.assert_allclose(print_.position, [1.0, 0.2, 2.0], atol=1e-9)


# --- what sticks through the sole ------------------------------------------------------------------------------------


def print_at(rng: np.random.Generator, count: int) -> Any:
    foot = 0.3 * (lambda a: np.stack([np.sin(a), np.cos(a)]))(rng.uniform(-9, 9, count))
    return Footprint(rng.normal(size=(3, count)), rng.uniform(-9, 9, count), random_normals(rng, count, 0.5), foot)


def settled_by_docstring(
    position: np.ndarray, sole: np.ndarray, points: np.ndarray, ground: np.ndarray
) -> tuple[np.ndarray]:
    """Bumps lift; walls before or behind the middle are stepped back from to the nearest clear sample."""
    inside = list(ground - points[1])
    wall = [h > 0.25 * np.linalg.norm(sole) for h in inside]
    ahead, behind = wall[3] or wall[4], wall[0] or wall[1]
    if wall[2] or (ahead and behind):
        return (position + UP * max(0.0, *inside),)
    shift = 0.0
    if ahead:
        shift = -0.5 if wall[3] else -0.25
    if behind:
        shift = 0.5 if wall[1] else 0.25
    lift = max([0.0] + [h for h, w in zip(inside, wall, strict=True) if not w])
    return (position + sole * shift + UP * lift,)


def test_sole_points_and_settled() -> None:
    rng = np.random.default_rng(11)
    print_ = print_at(rng, 600)
    sole = columns(lambda f, a, n: (arc(UP, n) @ yawed(a) @ level(f),), print_.foot, print_.yaw, print_.normal)[0]
    room = footprint.ROOM  # the points reach over both ends by this share
    shares = [(1 + 2 * room) * k / 4 - room for k in range(5)]
    points = np.stack([print_.position + sole * share for share in shares], 1)
    assert_matches(footprint.sole_points, points, print_)
    ground = points[1] + rng.uniform(-0.1, 0.07, (5, 600))
    ground += np.where(rng.uniform(size=(5, 600)) < 0.15, 0.2, 0.0)
    (expected,) = columns(settled_by_docstring, print_.position, sole, points, ground)
    assert_matches(lambda p, q, g: footprint.settled(p, q, g).position, expected, print_, points, ground)
    few = [Footprint(*(a[..., :6] for a in print_)), points[..., :6], ground[..., :6]]
    assert_matches_in_batches(lambda p, q, g: footprint.settled(p, q, g).position, expected[..., :6], *few)
    assert_gradient_finite(lambda p, q, g: footprint.settled(p, q, g).position, *few)
    found = in_double(footprint.settled, print_, points, points[1] - 0.01)
    assert_close(found, print_, 1e-12)  # clear ground: as it was


def test_a_riser_before_the_toe_is_stepped_back_from() -> None:
    """On a stair whose next riser is anywhere under the foot nothing is left inside it by more than a sample."""
    edge = np.linspace(0.02, 0.29, 28)  # of 0.3 m of foot, from the heel
    count = len(edge)
    print_ = Footprint(
        np.zeros((3, count)), np.zeros(count), np.repeat(UP[:, None], count, 1), np.full((2, count), 0.0)
    )
    print_.foot[1] = 0.3

    def clear(print_: Any) -> Any:
        points = footprint.sole_points(print_)
        return footprint.settled(print_, points, jnp.where(points[2] > jnp.asarray(edge), 0.17, 0.0))

    found = in_double(clear, print_)
    toe = found.position[2] + 0.3
    ahead = edge > 0.15
    assert (toe <= edge + 1e-9)[ahead].all()  # before its middle: the toe is back behind the riser
    assert (found.position[1] == 0)[ahead].all()
    assert (found.position[1] == 0.17)[~ahead].all()  # else it stands on the next tread
