"""Real character files by many hands come through, with the legs, sizes and gaits that a person sees in them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from crowd import posing
from crowd.analysis.gait import analyse
from crowd.characters.inspect import Inspection, inspect
from crowd.types import Archetype


@dataclass(frozen=True)
class Seen:
    """What a person reads in a file; phases are touchdowns in fractions of the clip."""

    file: str
    height: tuple[float, float]  # m, range
    legs: dict[str, tuple[str, ...]]  # hip, ankle
    roles: dict[str, str]
    touchdown: dict[str, dict[str, float]]
    arms: int = 0


REAL = [
    Seen(
        "characters/CesiumMan.glb",
        (1.45, 1.55),
        {"left": ("leg_joint_L_1", "leg_joint_L_3"), "right": ("leg_joint_R_1", "leg_joint_R_3")},
        {"clip 0": "walk"},
        {"clip 0": {"left": 0.41, "right": 0.91}},
        2,
    ),
    Seen(
        "characters/Fox.glb",
        (0.78, 0.8),
        {
            "front left": ("b_LeftUpperArm_09", "b_LeftHand_011"),
            "front right": ("b_RightUpperArm_06", "b_RightHand_08"),
            "hind left": ("b_LeftLeg01_015", "b_LeftFoot02_018"),
            "hind right": ("b_RightLeg01_019", "b_RightFoot02_022"),
        },
        {"Survey": "idle", "Walk": "walk", "Run": "run"},
        {},
    ),
    Seen(
        "characters/KayKit_Barbarian.glb",
        (2.3, 2.5),
        {"left": ("upperleg.l", "foot.l"), "right": ("upperleg.r", "foot.r")},
        {
            "Idle": "idle",
            "Walking_A": "walk",
            "Walking_B": "walk",
            "Walking_C": "walk",
            "Running_A": "run",
            "Running_B": "run",
            "Running_Strafe_Left": "step",
            "Running_Strafe_Right": "step",
            "Walking_Backwards": "step",
        },
        {},
        2,
    ),
    Seen(
        "characters/Quaternius_Horse.glb",
        (4.7, 5.0),
        {
            "front left": ("FrontUpperLeg.L", "FF.L"),
            "front right": ("FrontUpperLeg.R", "FF.R"),
            "hind left": ("BackShoulder.L", "FFB.L"),
            "hind right": ("BackShoulder.R", "FFB.R"),
        },
        {"AnimalArmature|Idle": "idle", "AnimalArmature|Walk": "walk", "AnimalArmature|Gallop": "run"},
        {
            "AnimalArmature|Walk": {
                "hind left": 0.23,
                "front left": 0.41,
                "hind right": 0.74,
                "front right": 0.96,
            },
            "AnimalArmature|Gallop": {
                "hind right": 0.35,
                "hind left": 0.53,
                "front right": 0.78,
                "front left": 0.98,
            },
        },
    ),
    Seen(
        "characters/Quaternius_Stag.glb",
        (5.2, 5.5),
        {
            "front left": ("FrontUpperLeg.L", "FF.L"),
            "front right": ("FrontUpperLeg.R", "FF.R"),
            "hind left": ("BackLeg.L", "FFB.L"),
            "hind right": ("BackLeg.R", "FFB.R"),
        },
        {"AnimalArmature|Idle": "idle", "AnimalArmature|Walk": "walk", "AnimalArmature|Gallop": "run"},
        {
            "AnimalArmature|Walk": {
                "hind left": 0.24,
                "front left": 0.41,
                "hind right": 0.76,
                "front right": 0.96,
            },
            "AnimalArmature|Gallop": {
                "hind right": 0.38,
                "hind left": 0.56,
                "front right": 0.85,
                "front left": 0.0,
            },
        },
    ),
    Seen(
        "characters/Quaternius_Velociraptor.glb",
        (1.5, 2.2),
        {"left": ("BackUpLeg.L", "BackFoot.L"), "right": ("BackUpLeg.R", "BackFoot.R")},
        {
            "Armature|Velociraptor_Idle": "idle",
            "Armature|Velociraptor_Walk": "walk",
            "Armature|Velociraptor_Run": "run",
        },
        {
            "Armature|Velociraptor_Walk": {"right": 0.22, "left": 0.47},
            "Armature|Velociraptor_Run": {"left": 0.93, "right": 0.49},
        },
        2,
    ),
    Seen(
        "characters/RobotExpressive.glb",
        (4.3, 4.6),
        {"left": ("UpperLeg.L", "Foot.L"), "right": ("UpperLeg.R", "Foot.R")},
        {"Idle": "idle", "Walking": "walk", "Running": "run"},
        {"Walking": {"left": 0.03, "right": 0.51}},
        2,
    ),
    Seen(
        "mocap/cmu_07_01_fbx.glb",
        (1.4, 1.8),
        {"left": ("LeftUpLeg", "LeftFoot"), "right": ("RightUpLeg", "RightFoot")},
        {"07_01|07_01": "walk"},
        {},
        2,
    ),
]


@pytest.fixture(scope="module", params=REAL, ids=lambda seen: Path(seen.file).stem)
def case(request: pytest.FixtureRequest, shared_data: Path) -> tuple[Seen, Inspection]:
    seen: Seen = request.param
    path = shared_data / seen.file
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    return seen, inspect(path)


def test_legs_and_arms(case: tuple[Seen, Inspection]) -> None:
    seen, found = case
    names = found.archetype.skeleton.names
    assert {leg.name: (names[leg.hip], names[leg.ankle]) for leg in found.archetype.legs} == seen.legs
    assert len(found.archetype.arms) == seen.arms
    assert [leg.side for leg in found.archetype.legs] == [1, -1] * (len(seen.legs) // 2)


def test_size(case: tuple[Seen, Inspection]) -> None:
    seen, found = case
    assert seen.height[0] < found.archetype.height < seen.height[1]
    assert found.archetype.mass > 0


def test_gaits(case: tuple[Seen, Inspection]) -> None:
    seen, found = case
    assert {clip.name: clip.role for clip in found.archetype.clips if clip.role != "other"} == seen.roles


def test_every_clip_of_the_file_can_be_played(case: tuple[Seen, Inspection]) -> None:
    archetype = case[1].archetype
    assert len({clip.name for clip in archetype.clips}) == len(archetype.clips)
    for clip in archetype.clips:
        assert clip.cyclic or clip.role == "other"
        np.testing.assert_allclose(np.linalg.norm(clip.rotation, axis=-1), 1, atol=1e-9)
        _, position = posing.world_transforms(archetype.skeleton, posing.clip_motion(clip))
        hips = position[:, [leg.hip for leg in archetype.legs]].mean(1)
        assert np.abs(hips[0, [0, 2]]).max() < 0.3 * archetype.height  # starts over the origin
        assert position[..., 1].min() > -0.15 * archetype.height, clip.name  # what artists let sink into the ground
        if not clip.cyclic:  # feet end where they began, on average
            feet = position[:, [leg.ball for leg in archetype.legs]].mean(1)
            assert np.abs(feet[-1] - feet[0])[[0, 2]].max() < 1e-9


def test_touchdowns(case: tuple[Seen, Inspection]) -> None:
    seen, found = case
    for clip, phases in seen.touchdown.items():
        line = next(line for line in found.lines if line.startswith(f"clip '{clip}'"))
        for leg, phase in phases.items():
            told = float(line.split(f"{leg} ")[1].split(",")[0])
            assert min(abs(told - phase), 1 - abs(told - phase)) < 0.09, (clip, leg, told, phase)


def foot_points(archetype: Archetype, rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    return np.stack(
        [
            position[..., leg.ball, :] + posing.rotate(rotation[..., leg.ball, :], np.array(leg.ball_offset))
            for leg in archetype.legs
        ],
        -2,
    )


def test_feet_on_the_ground_and_skin_above_it(case: tuple[Seen, Inspection]) -> None:
    archetype = case[1].archetype
    rotation, position = posing.world_transforms(archetype.skeleton, posing.rest_motion(archetype.skeleton))
    vertices = posing.skin(archetype.mesh, rotation, position)
    assert abs(vertices[:, 1].min()) < 0.02 * archetype.height
    assert np.abs(foot_points(archetype, rotation, position)[:, 1]).max() < 0.02 * archetype.height
    for clip in (clip for clip in archetype.clips if clip.role != "other"):
        rotation, position = posing.world_transforms(archetype.skeleton, posing.clip_motion(clip))
        feet = foot_points(archetype, rotation, position)
        assert abs(feet[..., 1].min()) < 0.01 * archetype.height
        skin = posing.skin(archetype.mesh, rotation[::6], position[::6])
        assert -0.05 * archetype.height < skin[..., 1].min() < 0.06 * archetype.height
        if clip.role != "idle":
            assert np.abs(feet.mean((0, 1))[0]) < 0.05 * archetype.height  # symmetric about the middle


def test_planted_feet_go_backwards(case: tuple[Seen, Inspection]) -> None:
    archetype = case[1].archetype
    for clip in archetype.clips:
        if clip.role not in ("walk", "run"):
            continue
        rotation, position = posing.world_transforms(archetype.skeleton, posing.clip_motion(clip))
        feet = foot_points(archetype, rotation, position)
        low = feet[..., 1] < np.percentile(feet[..., 1], 20, axis=0)
        assert np.median(np.roll(feet, -1, 0)[low][:, 2] - feet[low][:, 2]) < 0


def test_steps_go_the_way_that_is_told(shared_data: Path) -> None:
    """Planted feet of steps move against the direction of the report, at its speed."""
    found = inspect(shared_data / "characters/KayKit_Barbarian.glb")
    told = {"Running_Strafe_Left": "forward left", "Running_Strafe_Right": "forward right"}
    told["Walking_Backwards"] = "backwards"
    for name, way in told.items():
        line = next(line for line in found.lines if line.startswith(f"clip '{name}'"))
        assert f"step {way}" in line
        gait = analyse(found.archetype, next(clip for clip in found.archetype.clips if clip.name == name))
        assert float(line.split(" m/s")[0].split()[-1]) == pytest.approx(gait.speed, rel=0.15)
        assert np.sign(np.round(gait.direction, 1)).tolist() == {"forward left": [1, 1], "forward right": [-1, 1]}.get(
            way, [0, -1]
        )
    others = [line for line in found.lines if line.startswith("other clips")]
    assert len(others) == 1 and "'Jump_Full_Short'" in others[0] and "'Sit_Chair_Down'" in others[0]


def test_mesh_is_fit_for_drag(case: tuple[Seen, Inspection]) -> None:
    mesh = case[1].archetype.mesh
    assert np.isfinite(mesh.vertices).all()
    assert mesh.triangles.min() >= 0 and mesh.triangles.max() < len(mesh.vertices)
    np.testing.assert_allclose(mesh.weights.sum(1), 1, atol=1e-5)
    assert mesh.joints.max() < case[1].archetype.skeleton.count
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 0


def test_report_and_description_name_everything(case: tuple[Seen, Inspection]) -> None:
    seen, found = case
    text = found.yaml
    assert f"asset: {Path(seen.file).name}" in text
    for hip, ankle in seen.legs.values():
        assert f"hip: {hip}" in text and f"ankle: {ankle}" in text
