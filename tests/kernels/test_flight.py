"""The footbase in flight against the specification's text (4.8, 4.10), point by point with rotation matrices."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from kernels import flight, footprint, leg_cycle
from tests.kernels.checks import (
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    assert_matches,
    assert_matches_in_batches,
    in_double,
    in_single,
)
from tests.kernels.test_footprint import UP, arc, level, random_normals, yawed
from tests.kernels.test_leg_cycle import random_keys

# named tuples of arrays, here of NumPy's
Footprint: Any = footprint.Footprint
KeyTimes: Any = leg_cycle.KeyTimes
Footbase: Any = flight.Footbase
Support: Any = flight.Support
footbase: Any = flight.footbase

LEGS = 2
MOST_TURN = np.pi / 4


def hat(v: np.ndarray) -> np.ndarray:
    size = np.linalg.norm(v)
    return v / size if size > 1e-5 else 0 * v


def flat(v: np.ndarray, n: np.ndarray) -> np.ndarray:
    return v - n * (v @ n) / (n @ n)


def share(a: float, b: float, v: float) -> float:
    return 0.0 if a == b else float(np.clip((v - a) / (b - a), 0, 1))


def wrapped(angle: float) -> float:
    return float(np.angle(np.exp(1j * angle)))


def random_print(rng: np.random.Generator, count: int, steepest: float) -> Any:
    position = rng.normal(size=(3, LEGS, count)) * np.array([0.3, 0.1, 0.5])[:, None, None]
    normal = random_normals(rng, LEGS * count, steepest).reshape(3, LEGS, count)
    return Footprint(position, rng.uniform(-4, 4, (LEGS, count)), normal, 0.2 * rng.normal(size=(2, LEGS, count)))


# --- trajectories (2.12) ---------------------------------------------------------------------------------------------


def test_trajectory() -> None:
    rng = np.random.default_rng(0)
    table, weight = rng.normal(size=(3, LEGS, 17, 3)), rng.uniform(size=(3, 6))
    at = rng.uniform(size=(LEGS, 6))
    at[0, :3] = [0.0, 1.0, 0.5]
    expected = np.zeros((3, LEGS, 6))
    for leg in range(LEGS):
        for k in range(3):
            curves = [np.interp(at[leg] * 16, np.arange(17), table[m, leg, :, k]) for m in range(3)]
            expected[k, leg] = (weight * curves).sum(0)

    def kernel(table: Any, weight: Any, at: Any) -> Any:
        return flight.trajectory(table, 17, weight, at)

    flat_table = table.reshape(-1, 3)

    def of_table(weight: Any, at: Any) -> Any:
        return flight.trajectory(jnp.asarray(flat_table, at.dtype), 17, weight, at)

    assert_matches_in_batches(of_table, expected, weight, at, single=5e-6)
    inside = rng.uniform(0.01, 0.99, (LEGS, 6))
    assert_gradients_agree(kernel, flat_table, weight, inside)
    assert_gradient_finite(kernel, flat_table, weight, np.array([[0.0] * 6, [1.0] * 6]))
    beyond = in_double(of_table, weight, np.array([[-1.0] * 6, [2.0] * 6]))
    assert_close(beyond, in_double(of_table, weight, np.array([[0.0] * 6, [1.0] * 6])), 1e-12)


# --- what carries the body (4.8) -------------------------------------------------------------------------------------


def support_by_text(
    stance: np.ndarray, before: list[Any], after: list[Any], time: np.ndarray, lift: np.ndarray,
    land: np.ndarray, direction: np.ndarray, way: float,
) -> tuple[float, np.ndarray, np.ndarray]:  # fmt: skip
    ahead, footing, height, total, travel = level(direction) * way, [], 0.0, 0.0, np.zeros(3)
    for k, t in enumerate(time):
        weight = np.cos(2 * np.pi * t) / 2 + 0.5
        s = (1 - np.cos(np.pi * share(lift[k], land[k], t))) / 2
        here = before[k].position + arc(UP, before[k].normal) @ ahead * t
        there = after[k].position + arc(UP, after[k].normal) @ ahead * (t - 1)
        footing.append(here * (1 - s) + there * s)
        height += (footing[-1] - stance[:, k])[1] * (weight + 1e-3)
        total += weight + 1e-3
        travel += (after[k].position - before[k].position) * (1 - weight + 1e-3)
    return height / total, np.stack(footing, -1), travel


def one(print_: Any, i: int) -> list[Any]:
    """A print of each leg of character i."""
    return [Footprint(*(a[..., leg, i] for a in print_)) for leg in range(LEGS)]


def standing(rng: np.random.Generator, count: int, steepest: float = 0.6) -> dict[str, Any]:
    keys = random_keys(rng, LEGS, count)
    return dict(
        stance=0.2 * rng.normal(size=(3, LEGS, count)), before=random_print(rng, count, steepest),
        after=random_print(rng, count, steepest), time=rng.uniform(size=(LEGS, count)), keys=keys,
    )  # fmt: skip


def test_support() -> None:
    rng = np.random.default_rng(1)
    for count in (6, 300):
        case = standing(rng, count)
        angle, way = rng.uniform(-9, 9, count), rng.uniform(0, 2, count)
        direction = np.stack([np.sin(angle), np.cos(angle)])
        keys = case["keys"]
        rows = [
            support_by_text(
                case["stance"][..., i], one(case["before"], i), one(case["after"], i), case["time"][:, i],
                keys.lift[:, i], keys.land[:, i], direction[:, i], way[i],
            )
            for i in range(count)
        ]  # fmt: skip
        expected = Support(*(np.stack(column, -1) for column in zip(*rows, strict=True)))
        check = assert_matches_in_batches if count == 6 else assert_matches
        check(flight.support, expected, *case.values(), direction, way)
    case = standing(rng, 3)
    assert_gradients_agree(flight.support, *case.values(), direction[:, :3], way[:3])
    assert_gradient_finite(flight.support, *case.values(), 0 * direction[:, :3], 0 * way[:3])


def test_support_of_a_steady_walk_on_a_plane() -> None:
    """Straight ahead the feet are where the body is: the height is the plane's, level or sloping, all the time."""
    time = np.stack([np.linspace(0, 0.999, 50), np.mod(np.linspace(0, 0.999, 50) + 0.5, 1)])
    slope, way, one_ = 0.3, 1.2, np.ones((LEGS, 50))
    stance = np.stack([0.1 * np.array([[1.0], [-1.0]]) * one_, 0 * one_, -0.05 * one_])
    prints = []
    for z in (stance[2] - way * time, stance[2] + way * (1 - time)):
        normal = np.stack([0 * one_, one_, -slope * one_]) / np.sqrt(1 + slope**2)
        prints.append(Footprint(np.stack([stance[0], slope * z, z]), 0 * one_, normal, np.zeros((2, LEGS, 50))))
    keys = KeyTimes(*(v * one_ for v in (0.1, 0.2, 0.3, 0.6, 0.75, 0.85)))
    found = in_double(
        flight.support, stance, *prints, time, keys, np.array([[0.0], [1.0]]) * np.ones(50), np.full(50, way)
    )
    # the way along the slope is a little longer than its level part: 5 % of it at this slope
    np.testing.assert_allclose(found.height, slope * stance[2, 0], atol=0.02)
    upright, no_rise = np.repeat(UP[:, None, None], LEGS, 1) + np.zeros((3, LEGS, 50)), np.array([1.0, 0.0, 1.0])
    level_prints = [p._replace(position=p.position * no_rise[:, None, None], normal=upright) for p in prints]
    found = in_double(
        flight.support, stance, *level_prints, time, keys, np.array([[0.0], [1.0]]) * np.ones(50), np.full(50, way)
    )
    np.testing.assert_allclose(found.height, 0.0, atol=1e-12)
    np.testing.assert_allclose(found.footing, stance, atol=1e-12)


# --- the plate (4.10) ------------------------------------------------------------------------------------------------


def position_by_text(
    root: np.ndarray, stance: np.ndarray, before: Any, after: Any, time: float, liftoff: float,
    strike: float, n: np.ndarray, up: np.ndarray, base: float,
) -> np.ndarray:  # fmt: skip
    """Steps (1) to (5). The level that carries the body is a height: E is where the line along `up` meets it."""
    nx, ny, nz = n
    ft = share(liftoff, strike, time)
    start, end = before.position, after.position
    lp, lt = np.sin(np.pi * nz), np.sin(np.pi * ft)
    b = start * (1 - nz) + end * nz
    b = b + flat((root + stance - (start + (end - start) * np.clip(time, 0, 1))) * lp, up)
    mid = (start + end) / 2
    h = [p.normal @ (p.position - mid) / (p.normal @ up) for p in (before, after)]
    b = b + max(0.0, max(h) * 2 / np.pi * lp - ny) * up
    b = b + ny * up + nx * hat(np.cross(up, end - start))
    e = b + (up * (base - b[1]) / up[1]) * lt
    return e if (e - b) @ up > 0 else b


def attitude_by_docstring(
    yaw: float, before: Any, after: Any, time: float, liftoff: float, strike: float
) -> tuple[float, np.ndarray]:
    """(6), turned in flight alone; what the body's yaw may add is bounded in mid-flight and not at the ends."""
    ft = share(liftoff, strike, time)
    if ft < 0.5:
        turned = before.yaw + wrapped(yaw - before.yaw) * 2 * ft
    else:
        turned = yaw + wrapped(after.yaw - yaw) * (2 * ft - 1)
    bounded = yaw + np.clip(wrapped(turned - yaw), -MOST_TURN, MOST_TURN)
    turned = turned + (bounded - turned) * 4 * ft * (1 - ft)
    normal = before.normal * (1 - ft) + after.normal * ft
    return turned, normal / np.linalg.norm(normal)


def flights(rng: np.random.Generator, count: int, steepest: float = 0.6) -> dict[str, Any]:
    case = standing(rng, count, steepest)
    return dict(
        root=0.1 * rng.normal(size=(3, count)), yaw=rng.uniform(-4, 4, count), **case,
        curve=np.stack([rng.normal(size=(LEGS, count)) * 0.05, rng.uniform(0, 0.2, (LEGS, count)),
                        rng.uniform(size=(LEGS, count))]),
        up=random_normals(rng, count, 0.2), base_height=0.1 * rng.normal(size=count),
    )  # fmt: skip


def by_text(case: dict[str, Any]) -> Any:
    count, keys = case["yaw"].size, case["keys"]
    out = Footbase(*(np.zeros((*lead, LEGS, count)) for lead in ((3,), (), (3,), (3,))))
    for i in range(count):
        before, after = one(case["before"], i), one(case["after"], i)
        for k in range(LEGS):
            moment = case["time"][k, i], keys.liftoff[k, i], keys.strike[k, i]
            out.position[:, k, i] = position_by_text(
                case["root"][:, i], case["stance"][:, k, i], before[k], after[k], *moment, case["curve"][:, k, i],
                case["up"][:, i], case["base_height"][i],
            )  # fmt: skip
            turned, normal = attitude_by_docstring(case["yaw"][i], before[k], after[k], *moment)
            ft = share(moment[1], moment[2], moment[0])
            foot = before[k].foot * (1 - ft) + after[k].foot * ft
            out.yaw[k, i], out.normal[:, k, i] = turned, normal
            out.sole[:, k, i] = arc(UP, normal) @ yawed(turned) @ level(foot)
    return out


def plate(*case: Any) -> Any:
    return footbase(*case, jnp.array(MOST_TURN, case[0].dtype))


def test_footbase() -> None:
    rng = np.random.default_rng(2)
    for count in (6, 400):
        case = flights(rng, count)
        check = assert_matches_in_batches if count == 6 else assert_matches
        check(plate, by_text(case), *case.values(), double=1e-7, single=1e-5)
    small = flights(rng, 3)
    assert_gradients_agree(plate, *small.values())
    assert_gradient_finite(plate, *small.values())


def test_footbase_of_a_foot_that_stays() -> None:
    """Both prints at one place, a key time of no length, level ground: finite, and where the foot is."""
    case = flights(np.random.default_rng(3), 3, 0.0)
    case["after"] = case["before"]
    case["keys"] = KeyTimes(*(np.full((LEGS, 3), 0.5) for _ in range(6)))
    case["up"] = np.repeat(UP[:, None], 3, 1)
    assert_gradient_finite(plate, *case.values())
    case["curve"] = case["curve"] * 0.0
    found = in_single(plate, *case.values())
    np.testing.assert_array_equal(found.position, case["before"].position.astype(np.float32))
    np.testing.assert_array_equal(found.normal, case["before"].normal.astype(np.float32))


def test_planted_feet_lie_on_their_prints() -> None:
    """Property 10 at the kernel: at either end of the flight the plate is the print, position, yaw and normal."""
    rng = np.random.default_rng(4)
    case = flights(rng, 200)
    keys = case["keys"]
    first = rng.uniform(size=case["time"].shape) < 0.5
    case["time"] = np.where(first, keys.liftoff * rng.uniform(size=first.shape), keys.strike + 0.1 * rng.uniform())
    case["curve"] = np.stack([0.0 * first, 0.0 * first, np.where(first, 0.0, 1.0)])
    case["base_height"][:] = 5.0  # a level that would lift a flying foot
    found = in_double(plate, *case.values())
    stands = [np.where(first, a, b) for a, b in zip(case["before"], case["after"], strict=True)]
    assert_close(found.position, stands[0], 1e-12)
    np.testing.assert_allclose(np.exp(1j * found.yaw), np.exp(1j * stands[1]), atol=1e-9)
    assert_close(found.normal, stands[2], 1e-9)
    # in single precision to less than a micrometre, a metre from the body
    assert np.abs(in_single(plate, *case.values()).position - stands[0]).max() < 1e-6


def between(before: Any, after: Any, samples: int = 101, lift: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Heights above the chord and share of the way, of steps [n] on upright bodies."""
    at = np.linspace(0, 1, samples)
    count = before.position.shape[-1]
    found = []
    for t in at:
        keys = KeyTimes(*(np.full((LEGS, count), v) for v in (0.0, 0.0, 0.2, 0.8, 1.0, 1.0)))
        time = np.full((LEGS, count), t)
        # the stance place goes along with the chord: no stray
        stance = before.position * (1 - t) + after.position * t
        curve = np.stack([0 * time, lift + 0 * time, time])
        up = np.repeat(UP[:, None], count, 1)
        low = np.full(count, -9.0)
        args = np.zeros((3, count)), np.zeros(count), stance, before, after, time, keys, curve, up, low
        found.append(in_double(plate, *args).position[1] - stance[1])
    return np.array(found), at


@pytest.mark.parametrize("lift", [0.0, 0.05])
def test_the_arc_is_nothing_on_a_plane(lift: float) -> None:
    """Property 14, whatever the slope."""
    rng = np.random.default_rng(5)
    normal = np.repeat(random_normals(rng, 30, 1.2)[:, None], LEGS, 1)
    prints = []
    for _ in range(2):
        x, z = rng.normal(size=(2, LEGS, 30))
        y = -(normal[0] * x + normal[2] * z) / normal[1]
        prints.append(Footprint(np.stack([x, y, z]), 0 * x, normal, np.zeros((2, LEGS, 30))))
    above, _ = between(*prints, samples=11, lift=lift)
    np.testing.assert_allclose(above, lift, atol=1e-9)


def test_the_arc_over_a_step() -> None:
    """Property 14 and 9.6: level treads a step of height H apart: chord + H/pi, and level at the upper end."""
    for rise in (0.2, -0.2):
        position = np.zeros((3, LEGS, 1))
        level_ = np.repeat(UP[:, None, None], LEGS, 1)
        before = Footprint(position, np.zeros((LEGS, 1)), level_, np.zeros((2, LEGS, 1)))
        after = before._replace(position=position + np.array([0.0, rise, 0.6])[:, None, None])
        above, at = between(before, after)
        height = above[:, 0, 0] + rise * at
        upper = np.abs(rise)
        np.testing.assert_allclose(height[50], rise / 2 + upper / np.pi, atol=1e-12)
        np.testing.assert_allclose(height[50] - min(rise, 0), 0.8183 * upper, atol=2e-5)
        end = slice(-2, None) if rise > 0 else slice(0, 2)
        assert abs(np.diff(height[end])[0] / 0.01) < 0.02 * upper
        high = above[:, 0, 0].max()
        np.testing.assert_allclose(high, upper / np.pi, atol=1e-12)


def test_altitudes_in_flight() -> None:
    """Property 15: never lower over the chord than in the clip; in mid-flight not below the ground of the body."""
    case = flights(np.random.default_rng(6), 500)
    found = in_double(plate, *case.values()).position
    along, up = case["curve"][2], case["up"][:, None]
    chord = case["before"].position * (1 - along) + case["after"].position * along
    assert (((found - chord) * up).sum(0) >= case["curve"][1] - 1e-9).all()
    keys = case["keys"]
    case["time"] = 0.5 * (keys.liftoff + keys.strike)
    assert (in_double(plate, *case.values()).position[1] >= case["base_height"] - 1e-9).all()


def test_no_stray_at_the_ends_nor_straight_ahead() -> None:
    """Property 16."""
    case = flights(np.random.default_rng(7), 50, 0.0)
    case["curve"][:2] = 0.0
    case["base_height"][:] = -9.0
    case["up"] = np.repeat(UP[:, None], 50, 1)
    horizontal = [0, 2]
    for along, ends in ((0.0, "before"), (1.0, "after")):
        case["curve"][2] = along
        found = in_double(plate, *case.values()).position
        np.testing.assert_allclose(found[horizontal], case[ends].position[horizontal], atol=1e-12)
    case["curve"][2] = np.random.default_rng(8).uniform(size=(LEGS, 50))
    start, end = case["before"].position, case["after"].position
    case["stance"] = start + (end - start) * case["time"] - case["root"][:, None]
    found = in_double(plate, *case.values()).position
    chord = start + (end - start) * case["curve"][2]
    np.testing.assert_allclose(found[horizontal], chord[horizontal], atol=1e-12)


def test_turn_against_the_body_in_mid_flight() -> None:
    """Property 17 where the foot is free: at most 45 degrees; a standing foot is not turned by the body."""
    case = flights(np.random.default_rng(9), 300)
    keys = case["keys"]
    case["time"] = 0.5 * (keys.liftoff + keys.strike)
    found = in_double(plate, *case.values())
    against = np.abs(np.angle(np.exp(1j * (found.yaw - case["yaw"]))))
    assert against.max() <= MOST_TURN + 1e-9
    case["time"] = 0.9 * keys.liftoff
    stands = in_double(plate, *case.values())
    np.testing.assert_array_equal(stands.yaw, case["before"].yaw)
