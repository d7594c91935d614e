"""Motion capture end to end: characters exported as captures that travel come back as what they were."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crowd import characters, posing
from crowd.analysis import gait
from crowd.characters.idle import synthesise_idle, with_idle
from crowd.errors import InputError
from crowd.types import Archetype
from tests.crowd.bvh_files import exported, walker

CASES = [("human", "walk"), ("human", "jog"), ("dog", "walk"), ("dog", "trot"), ("hexapod", "walk")]


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], tuple[Archetype, gait.Gait, Archetype]]:
    folder = tmp_path_factory.mktemp("captures")
    out = {}
    for name, role in CASES:
        original = characters.load(name)
        clip = next(clip for clip in original.clips if clip.name == role)
        (folder / f"{name}_{role}.bvh").write_text(exported(original, clip, seconds=2.5))
        out[name, role] = original, gait.analyse(original, clip), characters.load(f"{name}_{role}.bvh", folder)
    return out


@pytest.mark.parametrize("case", CASES, ids=str)
def test_round_trip(imported: dict, case: tuple[str, str]) -> None:
    original, expected, found = imported[case]
    assert len(found.legs) == len(original.legs)
    clip = next(clip for clip in found.clips if clip.role in ("walk", "run"))
    measured = gait.analyse(found, clip)
    assert measured.speed == pytest.approx(expected.speed, rel=0.03)
    assert measured.period == pytest.approx(expected.period, abs=0.02)
    assert measured.direction == pytest.approx([0, 1], abs=0.02)
    assert np.abs(np.mod(measured.lift - expected.lift + 0.5, 1) - 0.5).max() < 0.05
    assert np.abs(measured.duty - expected.duty).max() < 0.08


@pytest.mark.parametrize("case", CASES, ids=str)
def test_archetype_invariants(imported: dict, case: tuple[str, str]) -> None:
    _, _, found = imported[case]
    skeleton, mesh = found.skeleton, found.mesh
    assert skeleton.parents[0] == -1 and all(parent < joint for joint, parent in enumerate(skeleton.parents))
    assert mesh.weights.sum(1) == pytest.approx(1.0)
    assert any(clip.role == "idle" for clip in found.clips)
    for clip in found.clips:
        assert np.linalg.norm(clip.rotation, axis=-1) == pytest.approx(1.0)
        assert np.all(np.sum(clip.rotation[1:] * clip.rotation[:-1], -1) >= 0)
        contact, _ = gait.feet(found, clip.rotation, clip.translation)
        assert contact[..., 1].min() == pytest.approx(0.0, abs=0.01 * found.height)
    for left, right in zip(found.legs[::2], found.legs[1::2], strict=True):
        assert (left.side, right.side) == (1, -1)
    rotation, position = posing.world_transforms(skeleton, posing.rest_motion(skeleton))
    skin = posing.skin(mesh, rotation, position)
    assert skin[:, 1].min() == pytest.approx(0.0, abs=0.03 * found.height)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_standing_feet_stay_on_the_ground(imported: dict, case: tuple[str, str]) -> None:
    _, _, found = imported[case]
    idle = next(clip for clip in found.clips if clip.role == "idle")
    contact, _ = gait.feet(found, idle.rotation, idle.translation)
    assert np.abs(contact[..., 1]).max() < 2e-3 * found.height
    assert np.ptp(contact, axis=0).max() < 2e-3 * found.height
    assert idle.cyclic and len(idle.rotation) >= 8
    step = np.linalg.norm(np.diff(np.concatenate([idle.rotation, idle.rotation[:1]]), axis=0), axis=-1)
    assert 0 < step.max() < 0.02  # it breathes, without a jump at the end
    for left, right in zip(contact[0, ::2], contact[0, 1::2], strict=True):
        assert left[0] > 0 > right[0]
        assert left[2] == pytest.approx(right[2], abs=0.01 * found.height)


def test_arms_hang_in_idle_though_the_rest_pose_holds_them_out(tmp_path: Path) -> None:
    (tmp_path / "tpose.bvh").write_text(walker(tpose=True, unit=0.01))
    found = characters.load("tpose.bvh", tmp_path)
    idle = next(clip for clip in found.clips if clip.role == "idle")
    drops = []
    for motion in (posing.rest_motion(found.skeleton), posing.clip_motion(idle)):
        _, position = posing.world_transforms(found.skeleton, motion)
        arm = found.arms[0]
        bone = position[..., arm.hand, :] - position[..., arm.shoulder, :]
        drops.append(float(np.mean(-bone[..., 1] / np.linalg.norm(bone, axis=-1))))
    assert drops[0] < 0.3 and drops[1] > 0.85


def test_an_idle_of_the_file_is_kept() -> None:
    human = characters.load("human")
    assert with_idle(human) is human


def test_no_gait_no_idle() -> None:
    human = characters.load("human")
    bare = Archetype(**{**vars(human), "clips": ()})
    with pytest.raises(InputError, match="neither an idle clip nor a walk"):
        synthesise_idle(bare)
