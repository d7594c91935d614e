"""Gains too soft for the drag: the estimate against runs on both sides of it, and how it is told."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
from typer.testing import CliRunner

from crowd import check, scene, simulate
from crowd.build import build
from crowd.check_gains import MOST_LEAN, MOST_SWAY, loads, under, yaw_need
from crowd.cli import app
from crowd.scene import HerdScene, Scene
from tests.crowd.scenes import herd, scenario

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
SURFACE = 0.9
DAMPING = 25.0  # N m s: less than a half of critical at the gains below
# gain over the least one; NaN: the usual gain
YAW = (0.5, 2.0, np.nan, np.nan, 0.1)
PITCH = (np.nan, np.nan, 0.5, 2.0, np.nan)

Arrays = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def waders() -> Scene:
    soft = {"yaw_n_m_rad": 100.0, "yaw_damping_n_m_s": DAMPING}
    return scene.load(scenario([herd("p", "human", len(YAW), gains=soft)], SURFACE))


def least(walker: HerdScene, loaded: Scene) -> tuple[float, float, float]:
    """Yaw gain, negative yaw spring, pitch gain (N m/rad) that hold waist-deep in water."""
    water = loaded.scenario.fluid_table.fluid(loaded.scenario.world.fluids[0])
    every = [loads(walker, wet, water, 0.0) for wet in under(walker.archetype, SURFACE)]
    yaw, _ = yaw_need(walker, every[-1])
    return float(yaw[0]), float(every[-1].spring[0]), max(float(one.lean[0]) for one in every) / MOST_LEAN


@pytest.fixture(scope="module")
def around(waders: Scene) -> tuple[Scene, Arrays]:
    """Walkers with gains on either side of the least ones; the last has little of both in yaw."""
    yaw, spring, pitch = least(waders.herds[0], waders)
    layout, assets, params, states = build(waders)
    walkers = params.characters[0]

    def changed(name: str, factors: tuple[float, ...], unit: float, usual: float) -> jnp.ndarray:
        values = np.asarray(getattr(walkers, name)).copy()
        values[0, : len(factors)] = np.where(np.isnan(factors), usual, np.array(factors) * unit)
        return jnp.asarray(values)

    yaw_gain, pitch_gain = changed("yaw_gain", YAW, yaw, 500.0), changed("pitch_gain", PITCH, pitch, 1500.0)
    loose = yaw_gain.at[0, len(YAW) - 1].set(0.1 * spring)
    damping = changed("yaw_damping", (1.0, 1.0, np.nan, np.nan, 0.2), DAMPING, 100.0)
    walkers = dataclasses.replace(walkers, yaw_gain=loose, pitch_gain=pitch_gain, yaw_damping=damping)
    program = layout, assets, dataclasses.replace(params, characters=(walkers,)), states
    return waders, simulate.simulate(waders, frames=1200, devices=1, program=program).herds["p"]


def test_the_drag_is_that_of_the_run(around: tuple[Scene, Arrays]) -> None:
    loaded, arrays = around
    walker = loaded.herds[0]
    water = loaded.scenario.fluid_table.fluid(loaded.scenario.world.fluids[0])
    load = loads(walker, under(walker.archetype, SURFACE)[-1], water, 0.0)
    measured = np.linalg.norm(arrays["drag_force"][300:, 1], axis=-1).mean()
    assert measured <= load.force[1] <= 1.35 * measured
    ahead = (arrays["center_of_pressure"] - arrays["position"])[300:, 1, 2].mean()
    assert float(load.spring[1] / load.force[1]) == pytest.approx(ahead, abs=0.025)


def test_yaw_swings_below_the_least_gain_and_is_steady_above(around: tuple[Scene, Arrays]) -> None:
    swing = np.abs(around[1]["yaw"][300:]).max(0)
    assert swing[0] > 0.75 * MOST_SWAY
    assert swing[1] < 0.6 * MOST_SWAY
    assert swing[4] > 1.0  # it has turned away


def test_the_body_leans_below_the_least_gain_and_hardly_above(around: tuple[Scene, Arrays]) -> None:
    lean = around[1]["pitch"][300:].mean(0)
    assert lean[2] > 1.2 * MOST_LEAN
    assert 0.3 * MOST_LEAN < lean[3] < 0.7 * MOST_LEAN


def test_a_flow_against_the_walker_asks_for_more(waders: Scene) -> None:
    assert len(check.needs(waders).warnings) == 1
    model = scenario([herd("p", "human", 1, gains={"pitch_n_m_rad": 300.0})])
    told = []
    for flow in (0.0, -1.0):
        model["world"]["fluids"] = [{"fluid": "water", "surface_m": SURFACE, "flow_m_s": [0.0, 0.0, flow]}]
        told += check.needs(scene.load(model)).warnings
    still, against = (asked(warning) for warning in told)
    assert against > 1.3 * still


def asked(warning: str) -> float:
    """The least value that a warning names."""
    return float(warning.rsplit("; ", 1)[1].split()[0])


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_scenarios_are_steady(path: Path) -> None:
    if not path.name.startswith(("fluids", "tune_")):
        assert check.needs(scene.load(path)).warnings == ()


@pytest.mark.parametrize("archetype", ["human", "dog", "hexapod", "spider"])
def test_usual_gains_hold_in_goo_and_weak_ones_do_not(archetype: str) -> None:
    hips = {"human": 0.9, "dog": 0.45, "hexapod": 0.34, "spider": 0.34}[archetype]
    model = scenario([herd("p", archetype, 1, {"human": 1.3, "dog": 1.1}.get(archetype, 0.8))], hips, fluid="goo")
    assert check.needs(scene.load(model)).warnings == ()
    weak = scene.load({**model, "herds": [{**model["herds"][0], "gains": {"pitch_n_m_rad": 5.0}}]})
    (warning,) = check.needs(weak).warnings
    assert "gains.pitch_n_m_rad: 5 is too soft for 'p'" in warning


def test_the_command_tells_where(tmp_path: Path) -> None:
    path = tmp_path / "deep.yaml"
    path.write_text(
        """name: deep
duration_s: 5
world:
  fluids:
  - {fluid: water, surface_m: 0.9}
herds:
- name: people
  archetype: human
  count: 2
  place: {kind: grid, spacing_m: 1}
  speed_m_s: 1.3
  gains:
    yaw_damping_n_m_s: 25
    yaw_n_m_rad: 80
    pitch_n_m_rad: 250
"""
    )
    done = CliRunner().invoke(app, ["check", str(path)])
    assert done.exit_code == 0, done.output
    told = [line for line in done.output.splitlines() if line.startswith("warning: ")]
    assert len(told) == 2
    assert told[0].startswith(
        "warning: deep.yaml:14 herds[0].gains.yaw_n_m_rad: 80 is too soft for 'people' in a drag of "
    )
    assert told[1].startswith("warning: deep.yaml:15 herds[0].gains.pitch_n_m_rad: 250 is too soft for 'people'")
    assert "leans by" in told[1]
    held = [f"{int(asked(line))}.0" for line in told]
    better = [
        "--set",
        f"herds.people.gains.yaw_n_m_rad={held[0]}",
        "--set",
        f"herds.people.gains.pitch_n_m_rad={held[1]}",
    ]
    assert "warning" not in CliRunner().invoke(app, ["check", str(path), *better]).output
