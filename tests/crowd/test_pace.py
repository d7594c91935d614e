"""Steps of several frames: who is stepped when, what is shown between, and that nobody notices the others."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
import pytest

import crowd
import crowd.scenario
from crowd import scene, simulate
from crowd.build import Program, build
from crowd.errors import InputError
from crowd.scenario_detail import Detail
from crowd.scene import Scene
from tests.crowd.scenes import herd, scenario

BEACH = {"kind": "ramp", "start_m": 0.2, "end_m": 2.0, "drop_m": 0.7}
PUSH = {"at_s": 31 / 60, "impulse_n_s": [60.0, 0.0, 0.0], "characters": [3, 140]}
COUNT, FRAMES = 400, 40  # four tiles


def model(count: int = COUNT, every: int = 2, rate: int = 60, **more: Any) -> dict[str, Any]:
    detail = {"every": every, **more.pop("keys", {})}
    people = herd("people", "human", count)
    if every > 1:
        people["detail"] = detail
    record = {"rate_hz": rate, "pose": True}
    return scenario([people], more.pop("surface", 0.1), record=record, rate_hz=rate, **{"ground": BEACH, **more})


class Run(NamedTuple):
    """Every frame of a run, and the states after it."""

    scene: Scene
    arrays: dict[str, np.ndarray]
    states: list[Any]

    @property
    def stepped(self) -> np.ndarray:
        """[t, tiles] the frame that each tile's state is of."""
        return np.array([np.asarray(state.frame)[:, 0] for state in self.states])


def stepped(loaded: Scene, frames: int = FRAMES, devices: int = 1, program: Program | None = None) -> Run:
    states: list[Any] = []

    def keep(found: tuple[Any, ...]) -> None:
        states.append(jax.tree.map(lambda leaf: np.array(leaf), found[0]))

    chunks = list(simulate.stream(loaded, frames, devices, 1, program=program, on_state=keep))
    names = chunks[0].herds["people"].keys()
    arrays = {name: np.concatenate([chunk.herds["people"][name] for chunk in chunks]) for name in names}
    return Run(loaded, arrays, states)


def driven(stepper: crowd.Stepper, frames: int = FRAMES) -> Run:
    """The same by a stepper, from where it stands."""
    shown, states = [], []
    for _ in range(frames):
        shown.append(stepper.step()["people"].arrays)
        states.append(stepper.state[0])
    return Run(stepper.scene, {name: np.stack([one[name] for one in shown]) for name in shown[0]}, states)


@pytest.fixture(scope="module")
def stepper() -> crowd.Stepper:
    return crowd.stepper(scene.load(model(events=[PUSH])))


@pytest.fixture(scope="module")
def paced(stepper: crowd.Stepper) -> Run:
    """Four tiles of people who wade in, every second frame; two of them are pushed."""
    return driven(stepper)


def test_turns_are_shared_out_evenly(paced: Run) -> None:
    """After the first two frames half of the tiles are stepped in each, by two frames."""
    ahead = paced.stepped
    moved = np.diff(ahead, axis=0)
    assert set(np.unique(moved[2:])) == {0, 2}
    assert ((moved[2:] > 0).sum(1) == 2).all()
    now = 1 + np.arange(FRAMES)
    assert ((ahead >= now[:, None]) & (ahead <= now[:, None] + 1)).all()
    assert all((state.paced.frame == frame + 1).all() for frame, state in enumerate(paced.states))


def test_what_is_shown_lies_between(paced: Run) -> None:
    arrays = {name: np.asarray(values, float) for name, values in paced.arrays.items()}
    tiles = np.repeat(np.arange(4), 128)[:COUNT]
    for frame in range(4, FRAMES - 1):
        between = paced.stepped[frame][tiles] > frame + 1
        assert 100 < between.sum() < 300
        for name in ("position", "velocity", "ball", "drag_force", "handle"):
            middle = 0.5 * (arrays[name][frame - 1] + arrays[name][frame + 1])
            np.testing.assert_allclose(arrays[name][frame][between], middle[between], atol=2e-4, rtol=2e-5)
        both = arrays["contact"][frame - 1] * arrays["contact"][frame + 1]
        np.testing.assert_array_equal(arrays["contact"][frame][between], both[between])
    turns = arrays["joint_rotation"]
    np.testing.assert_allclose(np.linalg.norm(turns, axis=-1), 1.0, atol=1e-5)
    assert np.abs(np.diff(turns, axis=0)).max() < 0.3


def test_each_turn_is_a_step_of_that_length(paced: Run) -> None:
    """From any state on, the run at half the rate gives what is shown at every turn."""
    start = 3
    loaded = scene.load(model(every=1, rate=30))
    layout, assets, params, _ = build(loaded)
    begun = jax.device_put(dataclasses.replace(paced.states[start], paced=None))
    slow = stepped(loaded, 12, program=(layout, assets, params, (begun,)))
    first = paced.stepped[start][np.repeat(np.arange(4), 128)[:COUNT]]
    for number in range(12):
        at = first + 2 * (number + 1) - 1, np.arange(COUNT)
        for name, atol in (("position", 2e-4), ("velocity", 2e-3), ("yaw", 1e-3), ("ball", 1e-3), ("drag_force", 3.0)):
            np.testing.assert_allclose(paced.arrays[name][at], slow.arrays[name][number], atol=atol, err_msg=name)


def test_pushes_meet_everybody(paced: Run) -> None:
    """Two characters of tiles that take turns are pushed in a frame at which only one of the tiles is stepped."""
    aside = paced.arrays["velocity"][:, :, 0]
    for one, other in ((3, 2), (140, 139)):
        change = aside[:, one] - aside[:, other]
        assert np.abs(change[:29]).max() < 0.05
        assert change[33] == pytest.approx(60.0 / 140.0, abs=0.25)  # mass and damping are 70 each


def test_bits_do_not_depend_on_devices_and_count(paced: Run) -> None:
    two = stepped(paced.scene, devices=2)
    few = stepped(scene.load(model(200, events=[PUSH])))
    for name, values in paced.arrays.items():
        np.testing.assert_array_equal(two.arrays[name], values, err_msg=name)
        np.testing.assert_array_equal(few.arrays[name], values[:, :200], err_msg=name)


def test_a_broken_character_touches_nobody(stepper: crowd.Stepper, paced: Run) -> None:
    _, _, _, (state,) = build(paced.scene)
    velocity = np.array(state.velocity)
    velocity[1, :, 7] = np.nan
    stepper.reset((dataclasses.replace(state, velocity=velocity),))
    found = driven(stepper)
    others = np.arange(COUNT) != 128 + 7
    assert found.arrays["fault"][-1, 128 + 7] and not found.arrays["fault"][:, others].any()
    for name, values in paced.arrays.items():
        np.testing.assert_array_equal(found.arrays[name][:, others], values[:, others], err_msg=name)


def test_only_far_and_calm_tiles_are_slow() -> None:
    """Tile 0 is near, tile 1 far; one of the far is pushed, and as long as it sways its tile is stepped every frame."""
    keys = {"far_m": 150.0, "from_m": [0.0, 0.0], "calm_m_s2": 0.5}
    push = {"at_s": 0.7, "impulse_n_s": [200.0, 0.0, 0.0], "characters": [150]}
    loaded = scene.load(model(200, keys=keys, events=[push], ground={"kind": "flat"}, surface=None))
    assert loaded.herds[0].points[128:, 0].min() > 190.0
    found = stepped(loaded, 120)
    now = 1 + np.arange(120)
    np.testing.assert_array_equal(found.stepped[:, 0], now)
    ahead = found.stepped[:, 1] - now
    assert ahead[30:40].sum() == 5, "every second frame"
    assert ahead[43:50].sum() == 0, "after the push"
    assert ahead[110:].sum() == 5, "calm again"


def test_a_stepper_shows_where_they_are_now(stepper: crowd.Stepper, paced: Run) -> None:
    stepper.reset()
    stepper.step(frames=17)
    assert stepper.frame == 17
    shown = stepper.step()["people"]
    np.testing.assert_allclose(stepper.position["people"], shown["position"], atol=1e-6)
    np.testing.assert_array_equal(shown["position"], paced.arrays["position"][17])


@pytest.mark.parametrize("name", ["responses", "waves", "figure_eight", "push"])
def test_all_kinds_of_herds_can_be_stepped_so(name: str) -> None:
    """Traced, not compiled."""
    scenario = crowd.scenario.load(Path("configs") / f"{name}.yaml")
    slow = [herd.model_copy(update={"detail": Detail(every=2, calm_m_s2=1.0)}) for herd in scenario.herds[-1:]]
    program = build(scene.load(scenario.model_copy(update={"herds": tuple(slow)})))
    shares = simulate.dealt(program, 1)[0]
    simulate.compiled(program[0], 1).trace(*shares, np.int32(2))


def test_no_derivatives_through_turns(paced: Run) -> None:
    with pytest.raises(InputError, match=r"herds\[0\].detail.every: a herd that is not stepped every frame"):
        crowd.rollout(paced.scene, 0.1)
