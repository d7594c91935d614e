"""What must hold of any walk: planted feet, one answer at every frame rate and place; the paper's statements."""

from __future__ import annotations

import numpy as np
import pytest

from crowd import scene
from tests.crowd.scenes import herd, run, scenario

BUILT_IN = [("human", 1.3), ("human", 2.6), ("dog", 1.1), ("dog", 2.2), ("hexapod", 0.9), ("spider", 0.8)]


@pytest.fixture(scope="module")
def dry() -> dict[str, dict[str, np.ndarray]]:
    """Every built-in gait on flat dry ground, 6 s."""
    herds = [herd(f"{name}{i}", name, 3, speed) for i, (name, speed) in enumerate(BUILT_IN)]
    return run(scenario(herds), 6.0)


def stances(contact: np.ndarray) -> list[slice]:
    """Time ranges in which a foot stays planted."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], contact.astype(int), [0]])))
    return [slice(a, b) for a, b in edges.reshape(-1, 2)]


@pytest.mark.parametrize("which", range(len(BUILT_IN)), ids=[f"{n}-{v}" for n, v in BUILT_IN])
class TestDryWalk:
    def test_planted_feet_do_not_move(self, dry: dict[str, dict[str, np.ndarray]], which: int) -> None:
        arrays = dry[f"{BUILT_IN[which][0]}{which}"]
        steps = 0
        for n in range(arrays["contact"].shape[1]):
            for leg in range(arrays["contact"].shape[2]):
                for stance in stances(arrays["contact"][:, n, leg]):
                    steps += 1
                    handle, ball = arrays["handle"][stance, n, leg], arrays["ball"][stance, n, leg]
                    assert np.ptp(handle, axis=0).max() < 1e-5
                    assert np.linalg.norm(ball - handle, axis=-1).max() < 1e-4
        assert steps > 6

    def test_speed_is_the_one_asked_for(self, dry: dict[str, dict[str, np.ndarray]], which: int) -> None:
        name, speed = BUILT_IN[which]
        velocity = dry[f"{name}{which}"]["velocity"]
        np.testing.assert_allclose(velocity[-1, :, 2], speed, rtol=1e-4)
        np.testing.assert_allclose(velocity[-1, :, 0], 0.0, atol=1e-4)

    def test_feet_stay_under_the_body(self, dry: dict[str, dict[str, np.ndarray]], which: int) -> None:
        arrays = dry[f"{BUILT_IN[which][0]}{which}"]
        ahead = arrays["handle"][120:, ..., 2] - arrays["position"][120:, :, None, 2]
        # a stance is at most 0.75 of the stride, and no foot is wanted further from its rest place than half of that
        name, speed = BUILT_IN[which]
        gaits = scene.load(scenario([herd("one", name, 1, speed)])).herds[0].gaits
        stride = min(gaits, key=lambda gait: abs(gait.speed - speed)).stride
        assert np.ptp(ahead, axis=(0, 1)).max() < 0.78 * stride
        assert np.ptp(ahead, axis=(0, 1)).min() > 0.2 * stride

    def test_no_faults(self, dry: dict[str, dict[str, np.ndarray]], which: int) -> None:
        arrays = dry[f"{BUILT_IN[which][0]}{which}"]
        assert not arrays["fault"].any()
        assert not np.abs(arrays["over_reach"][arrays["contact"]]).max() > 0.01


GAITS = ("footsteps", "semi_procedural")


@pytest.mark.parametrize("gait", GAITS)
def test_yaw_and_translation_equivariance(gait: str) -> None:
    """The same walk turned by 70 degrees and moved by 40 m is the same walk, turned and moved."""
    model = scenario([herd("p", "human", 1)], 0.9, gait=gait)
    arrays = run(model, 4.0)["p"]
    turned_herd = {**model["herds"][0], "heading_deg": 70.0, "place": {"kind": "list", "points_m": [[40.0, -25.0]]}}
    turned = run({**model, "herds": [turned_herd]}, 4.0)["p"]
    angle = np.radians(70.0)
    x, z = arrays["position"][:, 0, 0], arrays["position"][:, 0, 2]
    expected = np.stack([x * np.cos(angle) + z * np.sin(angle) + 40, z * np.cos(angle) - x * np.sin(angle) - 25], -1)
    np.testing.assert_allclose(turned["position"][:, 0, [0, 2]], expected, atol=2e-3)
    np.testing.assert_allclose(turned["pitch"], arrays["pitch"], atol=2e-4)
    size = np.linalg.norm(arrays["drag_force"], axis=-1)
    np.testing.assert_allclose(np.linalg.norm(turned["drag_force"], axis=-1)[30:], size[30:], rtol=0.03, atol=2.0)


DEPTHS = (0.05, 0.485, 0.9, 1.22)  # ankle, knee, waist, chest


@pytest.fixture(scope="module")
def depths() -> dict[str, dict[str, np.ndarray]]:
    """Knee, waist and chest deep, next to each other."""
    steps = {"kind": "list", "points_m": [[0.0, 0.0]]}
    regions = [
        {"fluid": "water", "surface_m": depth, "area_m": {"x": [20.0 * i - 10, 20.0 * i + 10], "z": [-50, 50]}}
        for i, depth in enumerate(DEPTHS)
    ]
    herds = [
        {**herd(f"h{i}", "human", 1), "place": {**steps, "points_m": [[20.0 * i, 0.0]]}} for i in range(len(regions))
    ]
    model = scenario(herds)
    model["world"]["fluids"] = regions
    return run(model, 8.0)


def test_deeper_is_slower(depths: dict[str, dict[str, np.ndarray]]) -> None:
    speed = [depths[f"h{i}"]["velocity"][240:, 0, 2].mean() for i in range(4)]
    assert speed[0] > speed[1] > speed[2] > speed[3]
    assert speed[0] > 1.2
    assert 0.74 < speed[1] / 1.3 < 0.86
    assert 0.66 < speed[2] / 1.3 < 0.77


def test_drag_opposes_motion_and_leans_the_body_forward(depths: dict[str, dict[str, np.ndarray]]) -> None:
    for i in range(1, 4):
        arrays = depths[f"h{i}"]
        assert arrays["drag_force"][240:, 0, 2].mean() < -100
        assert arrays["drag_power"][240:, 0].mean() > 100
        assert 1.0 < np.degrees(arrays["pitch"][240:, 0].mean()) < 12.0


def test_centre_of_pressure_rises_with_depth_and_stays_under_water(depths: dict[str, dict[str, np.ndarray]]) -> None:
    heights = [np.nanmean(depths[f"h{i}"]["center_of_pressure"][240:, 0, 1]) for i in range(1, 4)]
    assert heights == sorted(heights)
    for i, surface in enumerate(DEPTHS):
        center = depths[f"h{i}"]["center_of_pressure"][2:, 0, 1]
        assert np.nanmax(center) < surface + 0.02


def test_pressure_swings_to_the_stepping_leg(depths: dict[str, dict[str, np.ndarray]]) -> None:
    arrays = depths["h1"]
    side = arrays["center_of_pressure"][240:, 0, 0] - arrays["position"][240:, 0, 0]
    left, right = ~arrays["contact"][240:, 0, 0], ~arrays["contact"][240:, 0, 1]
    assert side[left & ~right].mean() > 0.01
    assert side[right & ~left].mean() < -0.01


def test_arms_up_reduce_drag_at_the_chest() -> None:
    """Fig. 8: raised arms make chest-deep wading faster."""
    up = run(scenario([herd("p", "human", 1)], 1.15), 8.0)["p"]
    down = run(scenario([herd("p", "human", 1, arms_up=False)], 1.15), 8.0)["p"]
    assert up["velocity"][240:, 0, 2].mean() > down["velocity"][240:, 0, 2].mean() + 0.005


def test_denser_is_slower() -> None:
    speed = []
    for fluid in ("water", "mud", "goo"):
        arrays = run(scenario([herd("p", "human", 1)], 0.9, fluid=fluid), 8.0)["p"]
        speed.append(arrays["velocity"][240:, 0, 2].mean() / 1.3)
    assert speed[0] > speed[1] > speed[2] > 0.25


def test_measured_people() -> None:
    """Preset `measured`: speed factors of wading people (188 of them at 0.35 m and 0.90 m), falling, convex."""
    speed = {}
    for depth in (0.35, 0.90, 1.22):
        arrays = run(scenario([herd("p", "human", 2, gains={"preset": "measured"})], depth), 12.0)["p"]
        speed[depth] = float(arrays["velocity"][420:, :, 2].mean() / 1.3)
    assert speed[0.35] == pytest.approx(0.58, abs=0.03)
    assert speed[0.90] == pytest.approx(0.40, abs=0.05)
    assert 0.30 <= speed[1.22] <= 0.45
    falls = [(1.0 - speed[0.35]) / 0.35, (speed[0.35] - speed[0.90]) / 0.55, (speed[0.90] - speed[1.22]) / 0.32]
    assert falls[0] > falls[1] > falls[2] > 0


@pytest.mark.parametrize("gait", GAITS)
def test_side_push_takes_side_steps_and_recovers(gait: str) -> None:
    """150 N s sideways: displaced by J / k, side steps, back at speed within 3 s, facing ahead.

    Feet never cross in the footstep controller, which keeps them apart; the semi-procedural system has no such rule,
    and a foot may step over the other for a moment.
    """
    push = [{"at_s": 3.0, "impulse_n_s": [150.0, 0.0, 0.0]}]
    arrays = run(scenario([herd("p", "human", 4)], events=push, gait=gait), 8.0)["p"]
    start = arrays["position"][170, :, 0]
    np.testing.assert_allclose(arrays["position"][-1, :, 0] - start, 150.0 / 250.0, rtol=0.02)
    left, right = arrays["handle"][..., 0, 0], arrays["handle"][..., 1, 0]
    assert (left - right).min() > (0.05 if gait == "footsteps" else -0.25)
    moved = arrays["handle"][-1, :, :, 0] - arrays["handle"][170, :, :, 0]
    assert moved.min() > 0.4
    after = arrays["velocity"][360:, :]
    np.testing.assert_allclose(after[..., 2], 1.3, rtol=0.01)
    np.testing.assert_allclose(after[..., 0], 0.0, atol=0.013)


def test_stops_with_both_feet_at_rest() -> None:
    stop = [{"at_s": 2.0, "velocity_m_s": [0.0, 0.0]}]
    arrays = run(scenario([herd("p", "human", 4), herd("d", "dog", 3, 1.1)], events=stop), 7.0)
    for name, size in (("p", 1.0), ("d", 0.5)):
        end = arrays[name]
        assert end["contact"][-30:].all()
        assert np.ptp(end["handle"][-30:], axis=0).max() == 0.0
        assert np.abs(end["velocity"][-1]).max() < 1e-3
        off = end["handle"][-1] - end["position"][-1, :, None]
        spread = np.ptp(off[:, :2, 2], axis=1)
        assert spread.max() < 0.25 * size


@pytest.mark.parametrize("gait", GAITS)
def test_one_character_that_breaks_leaves_the_others_alone(gait: str) -> None:
    """NaN mass for one: its fault bit is set, it stands still for ever, all others keep their bits."""
    import dataclasses

    from crowd import build, simulate
    from crowd.state import FAULT_BODY

    loaded = scene.load(scenario([herd("p", "human", 6)], 0.9, gait=gait))
    whole = simulate.simulate(loaded, frames=60, devices=1).herds["p"]
    layout, assets, params, states = build.build(loaded)
    mass = params.characters[0].mass.at[0, 2].set(np.nan)
    broken = dataclasses.replace(params, characters=(dataclasses.replace(params.characters[0], mass=mass),))
    found = simulate.simulate(loaded, frames=60, devices=1, program=(layout, assets, broken, states)).herds["p"]
    others = [0, 1, 3, 4, 5]
    for name, values in whole.items():
        np.testing.assert_array_equal(found[name][:, others], values[:, others], err_msg=name)
    assert (found["fault"][:, 2] & FAULT_BODY).all()
    assert np.isfinite(found["ball"]).all()
    assert np.ptp(found["position"][:, 2], axis=0).max() == 0.0
