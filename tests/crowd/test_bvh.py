"""BVH reading against kinematics worked out by hand, and all the ways of writing the same motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crowd.characters import bvh, bvh_text
from crowd.characters.raw_rig import RawRig
from tests.crowd.bvh_files import MINIMAL


def read(folder: Path, text: str, newline: str = "\n") -> RawRig:
    path = folder / "case.bvh"
    path.write_bytes(text.replace("\n", newline).encode())
    return bvh.read(path)


def test_kinematics_by_hand(tmp_path: Path) -> None:
    rig = read(tmp_path, MINIMAL)
    assert rig.names == ("Hips", "Leg", "Leg end") and rig.parents == (-1, 0, 1)
    clip = rig.clips[0]
    assert clip.duration == pytest.approx(0.1) and clip.name == "case"
    assert clip.position[0] == pytest.approx(np.array([[0, 10, 0], [1, 8, 0], [1, 5, 0]]))
    # a quarter turn about z takes the shin's -y to +x
    assert clip.position[1] == pytest.approx(np.array([[1, 10, 0], [2, 8, 0], [5, 8, 0]]))
    assert rig.rest_position == pytest.approx(np.array([[0, 0, 0], [1, -2, 0], [1, -5, 0]]))


def test_channels_apply_in_the_order_listed(tmp_path: Path) -> None:
    text = MINIMAL.replace("CHANNELS 3 Zrotation Xrotation Yrotation", "CHANNELS 3 Xrotation Zrotation Yrotation")
    text = text.replace("1 10 0 0 0 0 90 0 0", "1 10 0 0 0 0 90 90 0")
    listed_x_z = read(tmp_path, text).clips[0].position[1, 2]
    # Rx(90) Rz(90) (0, -3, 0): z first takes -y to +x (3, 0, 0); x leaves it
    assert listed_x_z == pytest.approx([5, 8, 0])
    text = text.replace("Xrotation Zrotation Yrotation\n    End", "Zrotation Xrotation Yrotation\n    End")
    # Rz(90) Rx(90) (0, -3, 0): x first takes -y to -z (0, 0, -3); z leaves it
    assert read(tmp_path, text).clips[0].position[1, 2] == pytest.approx([2, 8, -3])


@pytest.mark.parametrize(
    "change",
    [
        ("Frames: 2", "Frames:\t2"),
        ("Frames: 2", "frames 2"),
        ("Frame Time: 0.1", "Frame Time:.1"),
        ("Frame Time: 0.1", "FrameTime : 1e-1"),
        ("  ", "\t"),
        ("End Site", "End site"),
        ("End Site", "End Site toe"),
        ("ROOT Hips\n{", "ROOT Hips {"),
        ("HIERARCHY\n", "\n\nHierarchy\n"),
        ("Xposition Yposition", "xposition yPosition"),
        ("1 10 0 0 0 0 90 0 0", "1 10 0 0 0\n0 90 0 0"),
        ("0 10 0 0 0 0 0 0 0", "0\t10  0 0 0 0 0 0 0   "),
        ("MOTION", "MOTION "),
        ("HIERARCHY", "\ufeffHIERARCHY"),
    ],
    ids=lambda change: change[1].strip().encode("unicode_escape").decode(),
)
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"], ids=["lf", "crlf", "cr"])
def test_spellings_mean_the_same(tmp_path: Path, change: tuple[str, str], newline: str) -> None:
    plain, other = read(tmp_path, MINIMAL), read(tmp_path, MINIMAL.replace(*change), newline)
    assert other.names == plain.names
    assert other.clips[0].position == pytest.approx(plain.clips[0].position)


@pytest.mark.parametrize(("written", "expected"), [("1 -2 0.5", [1, -2, 0.5]), ("0 0 0.5", [1, -2, 0.5])])
def test_position_channels_replace_or_add_to_the_offset(tmp_path: Path, written: str, expected: list[float]) -> None:
    """Absolute translations lie near the offset, added ones near zero; on any joint."""
    turns = "Zrotation Xrotation Yrotation\n    End"
    text = MINIMAL.replace(f"CHANNELS 3 {turns}", f"CHANNELS 6 Xposition Yposition Zposition {turns}")
    text = text.replace("0 10 0 0 0 0 0 0 0", f"0 10 0 0 0 0 {written} 0 0 0")
    text = text.replace("1 10 0 0 0 0 90 0 0", f"0 10 0 0 0 0 {written} 0 0 0")
    clip = read(tmp_path, text).clips[0]
    assert clip.position[1, 1] - clip.position[1, 0] == pytest.approx(expected)


def test_more_frames_than_said_are_left_out_and_noted(tmp_path: Path) -> None:
    rig = read(tmp_path, MINIMAL + "2 10 0 0 0 0 0 0 0\n")
    assert len(rig.clips[0].position) == 2
    assert "Frames: says 2" in rig.notes[0]


def test_names_with_spaces_several_roots_and_no_channels(tmp_path: Path) -> None:
    text = MINIMAL.replace("JOINT Leg", "JOINT Left leg: upper")
    text = text.replace("MOTION", "ROOT Prop\n{\n OFFSET 5 0 0\n CHANNELS 0\n}\nMOTION")
    rig = read(tmp_path, text)
    assert rig.names == ("Hips", "Left leg: upper", "Prop", "Left leg: upper end")
    assert rig.parents == (-1, 0, -1, 1)
    assert rig.clips[0].position[1, 2] == pytest.approx([5, 0, 0])


def test_lines_of_joints_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "case.bvh"
    path.write_text(MINIMAL)
    assert [joint.line for joint in bvh_text.parse(path).joints] == [2, 6]


def test_a_deep_tree_is_no_recursion(tmp_path: Path) -> None:
    depth = 150
    text = "HIERARCHY\n" + "".join(
        f"{'JOINT' if k else 'ROOT'} j{k}\n{{\nOFFSET 0 1 0\nCHANNELS 1 Xrotation\n" for k in range(depth)
    )
    text += "End Site\n{\nOFFSET 0 1 0\n}\n" + "}\n" * depth + "MOTION\nFrames: 1\nFrame Time: 0.1\n" + "0 " * depth
    assert read(tmp_path, text).clips[0].position[0, -1] == pytest.approx([0, depth + 1, 0])
