"""The semi-procedural gait on bodies of many kinds: real files and built-in ones, walking and turning on the spot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import crowd
from crowd import metrics_gait, scene
from crowd.stances import find_stances, to_measure, travel
from tests.crowd.scenes import scenario

RATE = 60
SLIDE, INSIDE = 3e-3, 10e-3  # m
# two and four legs, of two to five bones; one walk made, one recorded
FILES = ("characters/CesiumMan.glb", "characters/Quaternius_Stag.glb", "mocap/cmu_12_01.bvh")


def herd(archetype: str, **changes: Any) -> dict[str, Any]:
    place = {"kind": "grid", "spacing_m": 3.0, "columns": 2}
    return {"name": "h", "archetype": archetype, "count": 2, "place": place, "velocity_m_s": [0.0, 0.0]} | changes


def walked(loaded: scene.Scene, seconds: float, velocity: list[float], turn: float = 0.0) -> dict[str, np.ndarray]:
    """Arrays [frame, character, ...] from the second second on; turn: rad/s of the heading asked for."""
    stepper, frames = crowd.stepper(loaded), []
    for frame in range(int(seconds * RATE)):
        facing = np.full(2, turn * frame / RATE) if turn else None
        shown = stepper.step(velocity={"h": np.tile(velocity, (2, 1))}, facing={"h": facing} if turn else None)["h"]
        frames.append({name: shown[name] for name in shown if name != "joint_translation"})
    return {name: np.stack([frame[name] for frame in frames])[RATE:] for name in frames[0]}


def slides(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """m that each stance's footbase moved, in space."""
    alive = np.ones(arrays["contact"].shape[:2], bool)
    return travel(to_measure(find_stances(arrays["contact"], alive)), arrays["ball"], horizontal=False)


@pytest.mark.parametrize("file", FILES)
def test_soles_of_real_rigs_stay_where_they_stand(shared_data: Path, file: str) -> None:
    """On level ground at the speed of the slowest walk, 1.7 m tall."""
    rig = {"height_m": 1.7}
    loaded = scene.load(scenario([herd(str(shared_data / file), rig=rig)], gait="semi_procedural"))
    speed = min(m.velocity[2] for m in loaded.herds[0].motions if m.kind == "walk" and m.velocity[2] > 0.05)
    arrays = walked(loaded, 5.0, [0.0, float(speed)])
    assert len(slides(arrays)) >= 6
    assert slides(arrays).max() <= SLIDE
    alive = np.ones(arrays["contact"].shape[:2], bool)
    depth = metrics_gait.penetration(arrays, alive, lambda x, z, altitude: np.zeros_like(x))
    assert depth[arrays["contact"]].max() <= INSIDE
    assert arrays["over_reach"].max() <= SLIDE


@pytest.mark.parametrize("archetype", ["dog", "hexapod", "spider"])
def test_wide_bodies_turn_above_their_feet(archetype: str) -> None:
    """90 degrees a second on the spot: they step, no standing foot slides, none is out of reach."""
    loaded = scene.load(scenario([herd(archetype)], gait="semi_procedural"))
    arrays = walked(loaded, 5.0, [0.0, 0.0], turn=np.pi / 2)
    assert (np.diff(arrays["steps"][[0, -1]], axis=0) >= 2).all()
    assert slides(arrays).max() <= SLIDE
    assert arrays["over_reach"].max() <= SLIDE


@pytest.mark.parametrize(("archetype", "speed"), [("dog", 1.2), ("hexapod", 0.3)])
def test_front_legs_reach_down_a_slope(archetype: str, speed: float) -> None:
    """25 degrees down: stance places come nearer as the body pitches, and the hips follow the legs."""
    slope = {"kind": "slope", "angle_deg": -25.0, "toward_deg": 0.0}
    loaded = scene.load(scenario([herd(archetype)], gait="semi_procedural", ground=slope))
    arrays = walked(loaded, 5.0, [0.0, speed])
    assert slides(arrays).max() <= SLIDE
    assert arrays["over_reach"].max() <= SLIDE
