"""Motions of real character files: contacts and speeds that others read in them, and sound tables for all of them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from crowd import characters
from crowd.analysis import analyse_clip
from crowd.analysis.motion_set import MotionSet, motion_set
from crowd.types import Archetype
from tests.crowd.analysis.test_motions import check_tables, signed

# Touchdown phases in fractions of the clip, read off ankle heights (below 15 % of their range), so that feet which come
# down before they stop, or land by the heel, touch down a little later here.
TOUCHDOWN: list[tuple[str, str, dict[str, float], float]] = [
    ("CesiumMan.glb", "clip 0", {"left": 0.41, "right": 0.91}, 0.05),
    ("KayKit_Barbarian.glb", "Walking_A", {"left": 0.97, "right": 0.48}, 0.05),
    ("KayKit_Barbarian.glb", "Running_A", {"left": 0.14, "right": 0.64}, 0.03),
    ("RobotExpressive.glb", "Walking", {"left": 0.97, "right": 0.47}, 0.05),
    ("Quaternius_Velociraptor.glb", "Armature|Velociraptor_Walk", {"left": 0.47, "right": 0.22}, 0.05),
    ("Quaternius_Velociraptor.glb", "Armature|Velociraptor_Run", {"left": 0.93, "right": 0.49}, 0.12),  # slides forward
    (
        "Quaternius_Horse.glb",
        "AnimalArmature|Walk",
        {"hind left": 0.23, "front left": 0.41, "hind right": 0.74, "front right": 0.96},
        0.07,
    ),
    (
        "Quaternius_Horse.glb",
        "AnimalArmature|Gallop",
        {"hind left": 0.53, "front left": 0.98, "hind right": 0.35, "front right": 0.78},
        0.07,
    ),
    (
        "Quaternius_Stag.glb",
        "AnimalArmature|Walk",
        {"hind left": 0.24, "front left": 0.41, "hind right": 0.76, "front right": 0.96},
        0.07,
    ),
    (
        "Quaternius_Stag.glb",
        "AnimalArmature|Gallop",
        {"hind left": 0.56, "front left": 0.0, "hind right": 0.38, "front right": 0.85},
        0.07,
    ),
]
# m/s along the way of the whole recording where it is told, and how near the clip's own feet come to the measured one.
MOCAP: list[tuple[str, float | None, float]] = [
    ("cmu_002_01_cc.bvh", 1.35, 0.06),
    ("cmu_002_03_cc.bvh", 2.98, 0.2),  # a run whose feet never roll off level
    ("cmu_003_01_cc.bvh", None, 0.06),  # on uneven ground
    ("cmu_007_04_cc.bvh", 1.08, 0.06),
    ("cmu_007_12_cc.bvh", 2.22, 0.06),
    ("cmu_07_01_fbx.glb", None, 0.03),
    ("cmu_12_01.bvh", None, 0.05),
]


@cache
def loaded(path: Path) -> tuple[Archetype, MotionSet]:
    archetype = characters.load(str(path))
    return archetype, motion_set(archetype)


@pytest.mark.parametrize(("file", "clip", "phases", "tolerance"), TOUCHDOWN, ids=lambda v: str(v)[:24])
def test_touchdown(shared_data: Path, file: str, clip: str, phases: dict[str, float], tolerance: float) -> None:
    archetype, found = loaded(shared_data / "characters" / file)
    motion = next(motion for motion in found.motions if motion.name == clip)
    names = [leg.name for leg in archetype.legs]
    touchdown = motion.stance_time - motion.cycle_offset + motion.keytimes[:, 4]
    wanted = np.array([phases[name] for name in names])
    assert np.abs(signed(touchdown - wanted)).max() < tolerance, dict(zip(names, np.mod(touchdown, 1), strict=True))


@pytest.mark.parametrize(("file", "speed", "tolerance"), MOCAP, ids=lambda v: str(v)[:16])
def test_mocap_speed(shared_data: Path, file: str, speed: float | None, tolerance: float) -> None:
    archetype, found = loaded(shared_data / "mocap" / file)
    motion = next(motion for motion in found.motions if motion.kind == "walk")
    clip = next(clip for clip in archetype.clips if clip.name == motion.name)
    assert clip.speed is not None and motion.speed == pytest.approx(clip.speed)
    if speed is not None:
        assert motion.speed == pytest.approx(speed, rel=0.05)
    measured = analyse_clip(archetype, type(clip)(**{**clip.__dict__, "speed": None}), found.feet)
    assert measured.speed == pytest.approx(clip.speed, rel=tolerance)


@pytest.mark.parametrize(
    "file",
    [f"characters/{name}" for name in dict.fromkeys(row[0] for row in TOUCHDOWN)]
    + ["characters/Fox.glb", "mocap/makehuman_zombieWalk1.bvh"],
)
def test_sets_of_real_rigs_are_sound(shared_data: Path, file: str) -> None:
    archetype, found = loaded(shared_data / file)
    walks = [motion for motion in found.motions if motion.kind == "walk"]
    assert len(walks) >= 2 and any(motion.velocity[2] < 0 for motion in walks)
    assert sum(motion.kind == "grounded" for motion in found.motions) == 1
    assert sum(motion.cycle_offset for motion in walks) == pytest.approx(0, abs=1e-9)
    for motion in walks:
        check_tables(motion)
        assert np.abs(motion.flight[:, :, 2]).max() < 1.25
    for foot in found.feet:
        assert 0.03 < foot.length / archetype.height < 0.4
