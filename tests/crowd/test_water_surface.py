"""A water surface that the crowd moves: who makes waves, who feels them, and that nothing else changes."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from crowd import advance, live, scene, simulate
from crowd.build import build
from crowd.check import needs
from crowd.errors import InputError
from crowd.recorded import open_recording
from crowd.recording import Recorder
from crowd.water_assets import section
from tests.crowd.scenes import herd, scenario

AREA = {"x": [-3, 5], "z": [-3, 5]}
SECONDS = 1.0


def model(depth: float = 0.8, water: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
    """Two people; `water`: the surface's keys, None for a level one."""
    made = scenario([herd("people", "human", 2)], surface=depth, **more)
    made["world"]["fluids"][0]["area_m"] = AREA
    if water is not None:
        made["world"]["water"] = {"cell_m": 0.125, "border_m": 1.0, **water}
    return made


@pytest.fixture(scope="module")
def runs() -> dict[str, simulate.Result]:
    """The same crowd in level water, on a surface it moves, and on one that it feels."""
    waters = {"level": None, "moved": {}, "felt": {"feedback": True}}
    return {name: simulate.simulate(scene.load(model(water=water)), seconds=SECONDS) for name, water in waters.items()}


def same(a: simulate.Result, b: simulate.Result) -> bool:
    return all(
        np.array_equal(a.herds[name][key], b.herds[name][key], equal_nan=True)
        for name in a.herds
        for key in a.herds[name]
    )


def test_waves_that_nobody_feels_change_no_bit(runs: dict[str, simulate.Result]) -> None:
    assert runs["level"].water is None
    assert same(runs["level"], runs["moved"])
    assert not same(runs["level"], runs["felt"])


def test_walkers_make_waves_near_them(runs: dict[str, simulate.Result]) -> None:
    surface = runs["moved"].water
    assert surface is not None and surface.height.shape == (10, 64, 64)
    np.testing.assert_allclose(np.diff(surface.time), 0.1, rtol=1e-6)
    height = surface.height[-1]
    assert 0.005 < np.abs(height).max() < 0.3
    z, x = np.unravel_index(np.argmax(np.abs(height)), height.shape)
    position = np.concatenate([runs["moved"].herds[name]["position"][-1] for name in ("people",)])
    assert np.hypot(position[:, 0] - surface.x[x], position[:, 2] - surface.z[z]).min() < 1.0


def test_felt_waves_change_the_depth(runs: dict[str, simulate.Result]) -> None:
    level, felt = (runs[name].herds["people"]["depth"] for name in ("level", "felt"))
    change = np.abs(felt - level)
    assert not change[0].any(), "before the first step the water is still"
    assert 1e-3 < change.max() < 0.3


def test_the_surface_is_part_of_the_state(runs: dict[str, simulate.Result]) -> None:
    """Chunks of any length, and a walk cut in two, give the same bits; padding makes no waves."""
    loaded = scene.load(model(water={"feedback": True}))
    chunks = list(simulate.stream(loaded, round(SECONDS * 60), chunk=7))
    whole = np.concatenate([chunk.water.height for chunk in chunks if chunk.water is not None])
    felt = runs["felt"].water
    assert felt is not None
    np.testing.assert_array_equal(whole, felt.height)
    stepper = live.stepper(loaded)
    stepper.step(frames=25)
    other = live.stepper(loaded, stepper.state)
    other.step(frames=35)
    np.testing.assert_array_equal(other.water, runs["felt"].state[-1].height)
    with pytest.raises(InputError, match=r"people, world\.water"):
        stepper.reset(stepper.state[:-1])


def test_a_standing_crowd_leaves_water_still() -> None:
    """A frozen character displaces nothing and blows nothing up, whatever its numbers are."""
    loaded = scene.load(model(water={}))
    program = build(loaded)
    layout, assets, params, states = program
    broken = dataclasses.replace(states[0], position=states[0].position.at[:, 0, 0].set(np.nan))
    result = simulate.simulate(loaded, frames=20, program=(layout, assets, params, (broken, *states[1:])))
    assert result.herds["people"]["fault"][-1].astype(bool).tolist() == [True, False]
    assert result.water is not None and np.isfinite(result.water.height).all()


def test_gradients_through_the_waves_are_finite() -> None:
    layout, assets, params, states = build(scene.load(model(water={"feedback": True})), walls=False, tile=4)
    assert params.water is not None
    still = params.water

    def height(strength: Any, depth: Any) -> Any:
        water = dataclasses.replace(still, strength=strength, depth=depth)
        swept = dataclasses.replace(params, water=water)
        after, _ = advance.rollout(layout, 6, assets, swept, states, jnp.int32(6))
        return (after[-1].height ** 2).sum()

    derivative = jax.jit(jax.jacfwd(height, argnums=(0, 1)))(1.0, 0.8)
    assert all(np.isfinite(value) and value != 0 for value in derivative)


def test_recording_keeps_the_surface(runs: dict[str, simulate.Result], tmp_path: Path) -> None:
    loaded = scene.load(model(water={}))
    with Recorder(tmp_path / "recording", loaded) as recorder:
        for chunk in simulate.stream(loaded, round(SECONDS * 60), chunk=7):
            recorder.append(chunk)
    back, made = open_recording(tmp_path / "recording").water, runs["moved"].water
    assert back is not None and made is not None
    np.testing.assert_array_equal(back.time, made.time)
    np.testing.assert_array_equal(back.x, made.x)
    assert back.surface == 0.8
    np.testing.assert_allclose(np.asarray(back.height[:]), made.height, atol=1e-4)


def test_check_counts_the_grid() -> None:
    moved, level = scene.load(model(water={})), scene.load(model())
    assert moved.water is not None
    cells, seconds = len(moved.water.x) * len(moved.water.z), moved.scenario.frame_count / moved.scenario.rate_hz
    assert needs(moved).recording - needs(level).recording == 4 * cells * round(10 * seconds)
    assert 40 * cells < needs(moved).memory - needs(level).memory < 1000 * cells


def test_several_devices_are_refused() -> None:
    loaded = scene.load(model(water={}))
    with pytest.raises(InputError, match=r"world\.water"):
        simulate.dealt(build(loaded, 2), 2)


def test_dry_ground_is_refused() -> None:
    with pytest.raises(InputError, match="no fluid there: the ground lies above"):
        scene.load(model(depth=-0.5, water={}))


def test_section_of_a_box() -> None:
    """1.2 m by 0.4 m, cut in many triangles."""
    line = np.linspace(0, 1, 9)
    u, v = (each.ravel() for each in np.meshgrid(line[:-1], line[:-1]))
    step = line[1]
    quads = np.stack([np.stack([u + a, v + b], 1) for a, b in ((0, 0), (step, 0), (step, step), (0, step))], 1)
    faces = []
    for axis in range(3):
        for side in (0.0, 1.0):
            others = [(axis + 1) % 3, (axis + 2) % 3]
            corner = np.full((len(quads), 4, 3), side)
            corner[..., others] = quads
            faces.append(corner if side else corner[:, ::-1])
    corners = np.concatenate(faces)[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3) * [1.2, 0.7, 0.4]
    triangles = np.arange(3 * len(corners)).reshape(-1, 3)
    found = section(corners.reshape(-1, 3), triangles, np.array([0.2, 0.5, 0.9]))
    np.testing.assert_allclose(found, [0.48, 0.48, 0.0], atol=1e-9)
