"""Responses of bodies: giving up jogs and walks, reaction; loads and arms are in test_loads and test_arm_responses."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crowd import scene, simulate
from crowd.build import build
from crowd.params import Responses
from crowd.state import Responded
from kernels.effort import FREE, RESTS, WALKS
from tests.crowd.scenes import herd, run, scenario

MEASURED = {"preset": "measured"}
TRANSITIONS: dict[str, Any] = {"transitions": {}}


# --- giving up -------------------------------------------------------------------------------------------------------

GAITS = ("footsteps", "semi_procedural")


def each_its_own(model: dict[str, Any], **numbers: dict[int, float]) -> simulate.Result:
    """A run of one herd whose characters have numbers of their own: "a__b" is that of the character's a.b."""
    loaded = scene.load(model)
    layout, assets, params, states = build(loaded)

    def changed(tree: Any, path: list[str], values: dict[int, float]) -> Any:
        if path:
            return dataclasses.replace(tree, **{path[0]: changed(getattr(tree, path[0]), path[1:], values)})
        for which, value in values.items():
            tree = tree.at[0, which].set(value)
        return tree

    one = params.characters[0]
    for name, values in numbers.items():
        one = changed(one, name.split("__"), values)
    program = (layout, assets, dataclasses.replace(params, characters=(one,)), states)
    return simulate.simulate(loaded, program=program, devices=1)


def changes(gears: np.ndarray) -> tuple[list[int], np.ndarray]:
    """Gears one after the other, and the frames before each change."""
    at = np.flatnonzero(np.diff(gears.astype(int)))
    return gears[np.append(at, -1)].tolist(), at


JOGGER, STUBBORN, WALKER = range(3)


@pytest.fixture(scope="module", params=GAITS)
def valley(request: pytest.FixtureRequest) -> dict[str, np.ndarray]:
    """A jogger, one that does not give up and a walker, through a valley of water: 0 to 0.9 m and back, to a place."""
    down, up = ({"length_m": 26.0, "angle_deg": angle} for angle in (-2.0, 2.0))
    joggers = herd(
        "p", "human", 3, None, gains=MEASURED, responses=TRANSITIONS,
        waypoints={"points_m": [[1.5, 72.1]], "speed_m_s": 2.6},
    )  # fmt: skip
    ground = {"kind": "slopes", "start_m": 4.0, "stretches": [down, up]}
    model = scenario([joggers], 0.0, ground=ground, gait=request.param, rate_hz=30, duration_s=95.0)
    never = {STUBBORN: 0.0}
    return each_its_own(
        model, way_speed={WALKER: 1.3},
        responses__transitions__walk_below=never, responses__transitions__stop_below=never,
    ).herds["p"]  # fmt: skip


def test_jogger_falls_to_a_walk_once_and_takes_it_up_again_once(valley: dict[str, np.ndarray]) -> None:
    """Down in deep water, up again in clearly shallower water; nothing in between, whatever steps do."""
    gears, at = changes(valley["gear"][:, JOGGER])
    assert gears == [FREE, WALKS, FREE]
    deep, shallow = valley["depth"][at, JOGGER]
    assert 0.25 < deep < 0.8 and 0.05 < shallow < deep - 0.1
    speed = valley["velocity"][..., 2]
    walks = slice(at[0] + 60, at[1])
    assert speed[walks, JOGGER].mean() < 0.8 * speed[walks, STUBBORN].mean()
    assert speed[at[1] :, JOGGER].max() > 2.5
    assert not valley["fault"].any()


def test_who_only_walks_goes_on_walking(valley: dict[str, np.ndarray]) -> None:
    assert (valley["gear"][:, [STUBBORN, WALKER]] == FREE).all()


def test_way_points_are_reached_all_the_same(valley: dict[str, np.ndarray]) -> None:
    """All end where they were sent, side by side as they began, and stand."""
    way = valley["position"][-1][:, [0, 2]] - valley["position"][0][:, [0, 2]]
    np.testing.assert_allclose(way, [[0.0, 72.0]] * 3, atol=0.45)
    assert np.abs(valley["velocity"][-1]).max() < 0.05


def test_trajectories_are_caught_up_with(tmp_path: Path) -> None:
    """A jog through water that is given up stays behind its trajectory, and gets to its end all the same."""
    times = np.arange(0.0, 24.1, 0.5)
    rows = [f"1,{t},0,{2.4 * t}" for t in times]
    (tmp_path / "way.csv").write_text("id,t,x,z\n" + "\n".join(rows) + "\n")
    jogger = {
        "name": "p", "archetype": "human", "trajectories": {"file": str(tmp_path / "way.csv")},
        "gains": MEASURED, "responses": TRANSITIONS,
    }  # fmt: skip
    model = scenario([jogger], rate_hz=30)
    model["world"]["fluids"] = [{"fluid": "water", "surface_m": 1.2, "area_m": {"x": [-5, 5], "z": [8, 20]}}]
    arrays = run(model, 75.0)["p"]
    gears, _ = changes(arrays["gear"][:, 0])
    assert gears == [FREE, WALKS, FREE]
    behind = 2.4 * np.minimum(np.arange(1, 2251) / 30.0, 24.0) - arrays["position"][:, 0, 2]
    assert behind.max() > 4.0
    assert abs(behind[-1]) < 0.3 and np.abs(arrays["velocity"][-1]).max() < 0.05


TRIES, STAYS, PLODS, STRONG = range(4)


@pytest.fixture(scope="module")
def goo() -> dict[str, np.ndarray]:
    """Into goo on a beach: who rests for 3 s at a time, who stays, who does not give up, who has a strong body."""
    walkers = herd("p", "human", 4, 1.3, gains=MEASURED, responses={"transitions": {"rest_s": 3.0}})
    ground = {"kind": "ramp", "start_m": 3.0, "end_m": 13.0, "drop_m": 1.0}
    model = scenario([walkers], 0.0, ground=ground, fluid="goo", rate_hz=30, duration_s=30.0)
    return each_its_own(
        model, gain_forward={STRONG: 900.0},
        responses__transitions__rest_time={STAYS: 1e5}, responses__transitions__stop_below={PLODS: 0.0},
    ).herds["p"]  # fmt: skip


def test_walker_rests_where_goo_is_too_thick_and_tries_again(goo: dict[str, np.ndarray]) -> None:
    gears, at = changes(goo["gear"][:, TRIES])
    assert gears[:5] == [FREE, RESTS, FREE, RESTS, FREE] and set(gears) == {FREE, RESTS}
    np.testing.assert_allclose(np.diff(at)[::2] / 30.0, 3.0, atol=0.1)
    assert (np.diff(at)[1::2] > 15).all()  # a try is no flicker: at least half a second
    rest = slice(at[0] + 45, at[1])
    assert np.abs(goo["velocity"][rest, TRIES, 2]).mean() < 0.08


def test_who_stops_for_good_stands_at_the_edge(goo: dict[str, np.ndarray]) -> None:
    gears, _ = changes(goo["gear"][:, STAYS])
    assert gears == [FREE, RESTS]
    ends = goo["position"][-1, :, 2]
    assert 3.5 < ends[STAYS] < ends[TRIES] < ends[PLODS] < ends[STRONG]
    assert np.abs(goo["velocity"][-300:, STAYS, 2]).mean() < 0.06  # the slope under it pulls
    # 38 % of its walk are left to a strong body: more than what it gives up at
    assert (goo["gear"][:, [PLODS, STRONG]] == FREE).all()


# --- reaction --------------------------------------------------------------------------------------------------------


def followed(velocity: np.ndarray, start: float, time: float) -> float:
    """The last value of a low-pass of this time constant, at 60 Hz."""
    value = start
    for v in velocity:
        value += (v - value) * (1.0 - np.exp(-1.0 / 60.0 / time))
    return value


REACTIONS = (0.05, 1.0)


@pytest.fixture(scope="module", params=GAITS)
def reacting(request: pytest.FixtureRequest) -> tuple[dict[str, np.ndarray], np.ndarray, str]:
    """Two who speed up from 0.8 to 1.6 m/s at 1 s and react after REACTIONS, and the speed that their steps follow."""
    people = herd("p", "human", 2, 0.8, responses={"reaction_s": 0.05})
    faster = [{"at_s": 1.0, "velocity_m_s": [0.0, 1.6]}]
    model = scenario([people], events=faster, gait=request.param, duration_s=2.0)
    result = each_its_own(model, responses__reaction=dict(enumerate(REACTIONS)))
    gait = result.state[0].gait
    smoothed = gait.smoothed[0, 1] if request.param == "footsteps" else gait.velocity[0, 2]
    return result.herds["p"], smoothed, request.param


def test_reaction_is_the_time_constant_of_what_steps_follow(reacting: tuple) -> None:
    """Against a low-pass in NumPy of the recorded velocity, in mid-course of speeding up."""
    arrays, smoothed, _ = reacting
    for n, time in enumerate(REACTIONS):
        assert smoothed[n] == pytest.approx(followed(arrays["velocity"][:, n, 2], 0.8, time), abs=1e-3)
    assert smoothed[0] > smoothed[1] + 0.2


def test_steps_come_later_with_a_longer_reaction(reacting: tuple) -> None:
    """In the second after speeding up feet stay further behind the body, and the semi-procedural clock goes slower."""
    arrays, _, gait = reacting
    ahead = (arrays["handle"][..., 2] - arrays["position"][:, :, None, 2]).mean(2)
    assert np.abs(ahead[:59].mean(0)).max() < 0.02
    after = ahead[60:].mean(0)
    assert after[1] < after[0] - 0.03
    if gait == "semi_procedural":
        done = np.ptp(np.unwrap(arrays["phase"][59:], period=1.0, axis=0), axis=0)
        assert done[1] < done[0] - 0.08


# --- the program -----------------------------------------------------------------------------------------------------


def test_what_is_off_is_not_in_the_program() -> None:
    layout, _, params, states = build(scene.load(scenario([herd("p", "human", 2)], 0.9)), tile=2)
    assert layout.herds[0].responses == () and "load" not in layout.forces
    assert params.characters[0].responses == Responses() and params.events.loads is None
    assert states[0].responded == Responded()


def test_bits_do_not_depend_on_who_else_is_there() -> None:
    """With everything on: the first two of five are the only two, to the last bit."""
    responses = {"transitions": {}, "reaction_s": 0.3, "arms": {}}

    def some(count: int) -> dict[str, np.ndarray]:
        people = herd(
            "p",
            "human",
            count,
            2.6,
            gains=MEASURED,
            load={"mass_kg": 20.0, "behind_m": 0.25, "carried": False},
            responses=responses,
        )
        events = [{"at_s": 0.5, "load": "pick_up", "characters": [1]}]
        return run(scenario([people], 1.1, events=events), 3.0)["p"]

    few, many = some(2), some(5)
    assert (few["gear"][-1] == WALKS).all() and few["pitch"][-1, 1] > few["pitch"][-1, 0] + 0.05
    for name, array in few.items():
        np.testing.assert_array_equal(many[name][:, :2], array, name)
