"""One stride out of motions that travel: exact speed, closed loops, turning and climbing taken out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crowd.characters import bvh, bvh_text
from crowd.characters.cycle import CyclePiece, extract_cycle, to_global, to_local
from crowd.characters.raw_rig import RawRig
from crowd.errors import InputError
from crowd.posing import multiply
from tests.crowd.bvh_files import walker


def poses(folder: Path, text: str) -> tuple[np.ndarray, np.ndarray, tuple[int, ...], list[int], float]:
    path = folder / "walker.bvh"
    path.write_text(text)
    file = bvh_text.parse(path)
    feet = [k for k, joint in enumerate(file.joints) if joint.name.endswith(("foot", "toe"))]
    return *bvh.local_poses(file), file.parents, feet, 1 / file.frame_time


def cut(folder: Path, **options: float) -> tuple[CyclePiece, tuple[int, ...]]:
    rotation, translation, parents, feet, rate = poses(folder, walker(**options))  # type: ignore[arg-type]
    return extract_cycle(rotation, translation, parents, feet, rate), parents


@pytest.mark.parametrize("speed", [0.4, 1.2, 3.0])
@pytest.mark.parametrize("heading", [0.0, 130.0])
def test_speed_period_and_direction(tmp_path: Path, speed: float, heading: float) -> None:
    piece, _ = cut(tmp_path, speed=speed, heading_deg=heading)
    assert piece.speed == pytest.approx(speed, rel=2e-3)
    assert piece.duration == pytest.approx(1.1, abs=1 / 60)
    angle = np.degrees(np.arctan2(piece.direction[0], piece.direction[1]))
    assert np.mod(angle - heading + 180, 360) - 180 == pytest.approx(0, abs=0.5)
    assert abs(piece.turned) < 1e-3 and abs(piece.climbed) < 1e-3


@pytest.mark.parametrize("rate", [24.0, 30.0, 120.0])
def test_any_rate(tmp_path: Path, rate: float) -> None:
    piece, _ = cut(tmp_path, rate=rate, seconds=3.0)
    assert piece.speed == pytest.approx(1.2, rel=0.01)
    assert len(piece.rotation) == pytest.approx(1.1 * rate, abs=1)


@pytest.mark.parametrize("turn", [-40.0, 25.0])
def test_a_curved_climbing_walk_becomes_straight_and_level(tmp_path: Path, turn: float) -> None:
    piece, parents = cut(tmp_path, turn_deg_s=turn, climb=0.2)
    assert np.degrees(piece.turned) == pytest.approx(turn * piece.duration, abs=0.5)
    assert piece.climbed == pytest.approx(0.2 * piece.duration, abs=0.005)
    assert piece.speed == pytest.approx(1.2, rel=0.01)
    _, position = to_global(parents, piece.rotation, piece.translation)
    hips = position[:, 0]
    assert np.ptp(hips[:, [0, 2]], axis=0).max() < 0.02
    assert np.ptp(hips[:, 1]) < 1e-3


def test_the_loop_closes(tmp_path: Path) -> None:
    piece, parents = cut(tmp_path, turn_deg_s=15.0, period=1.107)  # no whole number of frames
    _, position = to_global(parents, piece.rotation, piece.translation)
    steps = np.linalg.norm(np.diff(np.concatenate([position, position[:1]]), axis=0), axis=-1)
    assert steps[-1].max() < 1.3 * steps[:-1].max()
    assert np.all(np.sum(piece.rotation[1:] * piece.rotation[:-1], -1) >= 0)
    assert np.linalg.norm(piece.rotation, axis=-1) == pytest.approx(1.0)


def test_in_place_already(tmp_path: Path) -> None:
    rotation, translation, parents, feet, rate = poses(tmp_path, walker())
    translation[:, 0, [0, 2]] = 0.0
    piece = extract_cycle(rotation, translation, parents, feet, rate)
    assert piece.speed is None and piece.direction == pytest.approx([0, 1])


def test_a_step_is_not_taken_for_a_stride(tmp_path: Path) -> None:
    """Left and right mirror each other after half a period; one stride is the whole of it."""
    piece, _ = cut(tmp_path, period=0.9)
    assert piece.duration == pytest.approx(0.9, abs=1 / 60)


def test_standing_before_and_after_is_left_out(tmp_path: Path) -> None:
    rotation, translation, parents, feet, rate = poses(tmp_path, walker(seconds=4))
    rotation = np.concatenate([np.repeat(rotation[:1], 200, 0), rotation, np.repeat(rotation[-1:], 100, 0)])
    translation = np.concatenate([np.repeat(translation[:1], 200, 0), translation, np.repeat(translation[-1:], 100, 0)])
    piece = extract_cycle(rotation, translation, parents, feet, rate)
    assert piece.first >= 195 and piece.last <= 200 + 4 * rate + 5
    assert piece.speed == pytest.approx(1.2, rel=0.01)


def test_a_minute_at_120_hz(tmp_path: Path) -> None:
    piece, _ = cut(tmp_path, seconds=60, rate=120.0)
    assert piece.speed == pytest.approx(1.2, rel=2e-3)
    assert piece.duration == pytest.approx(1.1, abs=1 / 120)


def test_noise_alone_is_refused(tmp_path: Path) -> None:
    rotation, translation, parents, feet, rate = poses(tmp_path, walker())
    walk = np.cumsum(np.random.default_rng(1).standard_normal((len(rotation), len(parents), 3)), 0) * 0.03
    turn = np.concatenate([np.ones((*walk.shape[:2], 1)), walk], -1)
    rotation = multiply(rotation[:1], turn / np.linalg.norm(turn, axis=-1, keepdims=True))
    with pytest.raises(InputError, match="nothing repeats"):
        extract_cycle(rotation, translation, parents, feet, rate, "noise.bvh")


def test_local_and_global_poses_are_inverse(tmp_path: Path) -> None:
    rotation, translation, parents, _, _ = poses(tmp_path, walker(turn_deg_s=20))
    back_q, back_p = to_local(parents, *to_global(parents, rotation, translation))
    assert back_p == pytest.approx(translation)
    assert np.abs(np.sum(back_q * rotation, -1)) == pytest.approx(1.0)


VARIANTS = {
    "metres": {},
    "centimetres, z up": {"unit": 0.01, "up": "z"},
    "0.45 inches, tabs, CRLF": {"unit": 0.0254 / 0.45, "tabs": True},
    "calibration pose": {"tpose": True},
    "calibration pose, z up, inches": {"tpose": True, "up": "z", "unit": 0.0254},
    "heading": {"heading_deg": 75.0},
    "decimetres, turning": {"unit": 0.1, "turn_deg_s": 20.0},
}


@pytest.mark.parametrize("name", VARIANTS, ids=str)
def test_capture_becomes_a_rig(tmp_path: Path, name: str) -> None:
    path = tmp_path / "walker.bvh"
    path.write_text(walker(**VARIANTS[name]))
    rig = bvh.read_rig(path)
    assert rig.metres_per_unit is not None and rig.mesh is not None and rig.up == "+y"
    clip = rig.clips[0]
    assert clip.speed is not None
    assert clip.speed * rig.metres_per_unit == pytest.approx(1.2, rel=0.02)
    assert np.ptp(rig.rest_position[:, 1]) * rig.metres_per_unit == pytest.approx(1.7, abs=0.12)
    assert rig.rest_position[:, 1].min() == pytest.approx(0, abs=1e-9)
    assert clip.position[0] == pytest.approx(clip.position[-1], abs=1e-9)
    toes = clip.position[:, [rig.names.index("l_toe"), rig.names.index("r_toe")]]
    ahead = toes.mean((0, 1)) - clip.position[:, [rig.names.index("l_foot"), rig.names.index("r_foot")]].mean((0, 1))
    facing = np.array(_facing(rig))
    assert ahead[[0, 2]] @ facing / np.linalg.norm(ahead[[0, 2]]) > 0.98  # the clip faces as the rest pose
    if "tpose" in VARIANTS[name]:
        assert any("calibration" in note for note in rig.notes)
        arm = rig.rest_position[rig.names.index("l_hand")] - rig.rest_position[rig.names.index("l_arm")]
        assert abs(arm[1]) < 0.3 * np.linalg.norm(arm)


def _facing(rig: RawRig) -> tuple[float, float]:
    place = dict(zip(rig.names, rig.rest_position, strict=True))
    ahead = place["l_toe"] + place["r_toe"] - place["l_foot"] - place["r_foot"]
    ahead = ahead / np.hypot(ahead[0], ahead[2])
    return ahead[0], ahead[2]


FILES = {
    "cmu_002_01_cc": (1.35, 1.6, 1.9),
    "cmu_002_03_cc": (2.98, 1.5, 1.9),
    "cmu_003_01_cc": (None, 1.6, 1.9),
    "cmu_007_04_cc": (1.08, 1.6, 1.9),
    "cmu_007_12_cc": (2.22, 1.6, 1.9),
    "cmu_12_01": (None, 1.3, 1.6),
    "makehuman_zombieWalk1": (None, 1.4, 1.8),
}


@pytest.mark.parametrize("name", FILES, ids=str)
def test_real_captures(shared_data: Path, name: str) -> None:
    speed, low, high = FILES[name]
    rig = bvh.read_rig(shared_data / "mocap" / f"{name}.bvh")
    assert rig.metres_per_unit is not None and rig.mesh is not None
    assert 20 <= rig.count <= 35
    assert low < np.ptp(rig.rest_position[:, 1]) * rig.metres_per_unit < high
    if speed is not None:
        assert rig.clips[0].speed is not None
        assert rig.clips[0].speed * rig.metres_per_unit == pytest.approx(speed, rel=0.05)
