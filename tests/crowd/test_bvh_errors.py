"""Bad BVH files: each is refused with one message that names file, line and what is allowed."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from crowd import characters
from crowd.characters import bvh
from crowd.errors import InputError
from tests.crowd.bvh_files import MINIMAL, walker

FRAMES = "0 10 0 0 0 0 0 0 0\n1 10 0 0 0 0 90 0 0\n"

# name: (text, where, words of the message)
TEXTS: dict[str, tuple[str, str, str]] = {
    "empty": ("", "bad.bvh", "empty"),
    "blank": (" \n\t\n", "bad.bvh", "empty"),
    "another format": ("<xml>\n</xml>\n", "bad.bvh:1", "expected HIERARCHY"),
    "no hierarchy": (MINIMAL[MINIMAL.index("MOTION") :], "bad.bvh:1", "MOTION without a HIERARCHY"),
    "no root": ("HIERARCHY\nMOTION\nFrames: 1\nFrame Time: 0.1\n0\n", "bad.bvh:1", "no ROOT"),
    "misspelt root": (MINIMAL.replace("ROOT", "ROTO"), "bad.bvh:2", "found 'ROTO'; expected ROOT"),
    "no motion": (MINIMAL[: MINIMAL.index("MOTION")], "bad.bvh", "no MOTION section"),
    "brace left open": (MINIMAL.replace("}\nMOTION", "MOTION"), "bad.bvh:14", "a brace is not closed"),
    "brace too many": (MINIMAL.replace("}\nMOTION", "}\n}\nMOTION"), "bad.bvh:16", "closing brace too many"),
    "brace missing": (MINIMAL.replace("ROOT Hips\n{", "ROOT Hips"), "bad.bvh:3", "expected {"),
    "unknown word": (MINIMAL.replace("JOINT", "JOINTS"), "bad.bvh:6", "did you mean 'JOINT'"),
    "offset of two": (MINIMAL.replace("1 -2 0", "1 -2"), "bad.bvh:9", "three numbers"),
    "offset no number": (MINIMAL.replace("1 -2 0", "1 two 0"), "bad.bvh:8", "found 'two'"),
    "offset nan": (MINIMAL.replace("1 -2 0", "1 nan 0"), "bad.bvh:8", "not a finite number"),
    "no offset": (MINIMAL.replace("    OFFSET 1 -2 0\n", ""), "bad.bvh:8", "expected OFFSET"),
    "unknown channel": (MINIMAL.replace("6 Xposition", "6 Xpostion"), "bad.bvh:5", "did you mean 'Xposition'"),
    "too few channels": (MINIMAL.replace("CHANNELS 3 Zrotation", "CHANNELS 3"), "bad.bvh:10", "only 2 names follow"),
    "too many channels": (MINIMAL.replace("CHANNELS 3", "CHANNELS 2"), "bad.bvh:9", "more names follow"),
    "channel count no number": (MINIMAL.replace("CHANNELS 3", "CHANNELS x"), "bad.bvh:9", "from 0 to 6"),
    "channel twice": (MINIMAL.replace("3 Zrotation Xrotation", "3 Xrotation Xrotation"), "bad.bvh:9", "listed twice"),
    "joint name twice": (MINIMAL.replace("JOINT Leg", "JOINT Hips"), "bad.bvh:6", "used on line 2"),
    "joint without name": (MINIMAL.replace("JOINT Leg", "JOINT"), "bad.bvh:6", "without a name"),
    "no bone has length": (MINIMAL.replace("1 -2 0", "0 0 0").replace("0 -3 0", "0 0 0"), "bad.bvh:2", "length zero"),
    "no channels at all": (
        re.sub(r"CHANNELS \d.*", "CHANNELS 0", MINIMAL).replace(FRAMES, ""),
        "bad.bvh:16",
        "no joint has channels",
    ),
    "motion ends": (MINIMAL[: MINIMAL.index("Frames:")], "bad.bvh:16", "ends before 'Frames:'"),
    "no frame time": (MINIMAL.replace("Frame Time: 0.1\n", ""), "bad.bvh:18", "expected 'Frame Time: <number>'"),
    "frames no number": (MINIMAL.replace("Frames: 2", "Frames: two"), "bad.bvh:17", "'two' is not a number"),
    "frames zero": (MINIMAL.replace("Frames: 2", "Frames: 0"), "bad.bvh:17", "allowed: 1 to"),
    "frames negative": (MINIMAL.replace("Frames: 2", "Frames: -2"), "bad.bvh:17", "allowed: 1 to"),
    "frames huge": (MINIMAL.replace("Frames: 2", "Frames: 99999999999"), "bad.bvh:17", "allowed: 1 to"),
    "frames nan": (MINIMAL.replace("Frames: 2", "Frames: nan"), "bad.bvh:17", "allowed: 1 to"),
    "frame time zero": (MINIMAL.replace("Time: 0.1", "Time: 0"), "bad.bvh:18", "allowed: 0.0001 to 1 second"),
    "frame time negative": (MINIMAL.replace("Time: 0.1", "Time: -0.1"), "bad.bvh:18", "allowed: 0.0001 to 1 second"),
    "frame time in fps": (MINIMAL.replace("Time: 0.1", "Time: 60"), "bad.bvh:18", "1/60"),
    "frames missing": (MINIMAL.replace("Frames: 2", "Frames: 3"), "bad.bvh:20", "ends after 2 frames"),
    "no frames": (MINIMAL.replace(FRAMES, ""), "bad.bvh:17", "ends after 0 frames"),
    "numbers missing": (
        MINIMAL.replace("1 10 0 0 0 0 90 0 0", "1 10 0"),
        "bad.bvh:20",
        "3 numbers; the HIERARCHY has 9",
    ),
    "numbers too many": (MINIMAL.replace("0 10 0 0", "0 10 0 0 0"), "bad.bvh:19", "10 numbers"),
    "value nan": (MINIMAL.replace("90 0 0", "nan 0 0"), "bad.bvh:20", "Leg Zrotation is 'nan'"),
    "value infinite": (MINIMAL.replace("90 0 0", "1e999 0 0"), "bad.bvh:20", "expected a finite number"),
    "value no number": (MINIMAL.replace("90 0 0", "90° 0 0"), "bad.bvh:20", "Leg Zrotation is '90°'"),
    "decimal comma": (MINIMAL.replace("90 0 0", "90,5 0 0"), "bad.bvh:20", "'90,5'"),
}


@pytest.mark.parametrize("name", TEXTS, ids=str)
def test_bad_text(tmp_path: Path, name: str) -> None:
    text, where, words = TEXTS[name]
    path = tmp_path / "bad.bvh"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        bvh.read(path)
    problem = caught.value.problems[0]
    assert problem.where == where, str(problem)
    assert words in problem.message, str(problem)


def test_missing_file_folder_and_binary(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.bvh: file not found"):
        bvh.read(tmp_path / "none.bvh")
    with pytest.raises(InputError, match="is not a file"):
        bvh.read(tmp_path)
    (tmp_path / "x.bvh").write_bytes(bytes(range(256)) * 40)
    with pytest.raises(InputError, match=r"x\.bvh:1: is binary"):
        bvh.read(tmp_path / "x.bvh")


def test_every_bad_number_is_told_up_to_a_limit(tmp_path: Path) -> None:
    path = tmp_path / "bad.bvh"
    path.write_text(MINIMAL.replace("Frames: 2", "Frames: 40").replace(FRAMES, "nan 10 0 0 0 0 0 0 0\n" * 40))
    with pytest.raises(InputError) as caught:
        bvh.read(path)
    assert 5 < len(caught.value.problems) <= 12
    assert [problem.where for problem in caught.value.problems[:2]] == ["bad.bvh:19", "bad.bvh:20"]


def test_truncated_anywhere_never_crashes(tmp_path: Path) -> None:
    """Any prefix is either read or refused; nothing else may be raised."""
    path = tmp_path / "cut.bvh"
    for end in range(0, len(MINIMAL), 3):
        path.write_text(MINIMAL[:end])
        try:
            bvh.read(path)
        except InputError as error:
            assert "cut.bvh" in str(error)


def _frozen(text: str) -> str:
    head, rows = text.split("Frame Time")
    first = rows.split("\n")
    return head + "Frame Time" + "\n".join([first[0], *[first[1]] * (len(first) - 2), ""])


MOTIONS: dict[str, tuple[str, str]] = {
    "one frame": (
        re.sub(r"(Frame Time.*\n.*\n)[\s\S]*", r"\1", walker()).replace("Frames:  241", "Frames: 1"),
        "needs at least 8",
    ),
    "stands still": (_frozen(walker()), "the feet move by 0%"),
    "half a stride": (walker(seconds=0.6), "nothing repeats"),
    "quarter of a stride": (walker(seconds=0.2), "needs at least"),
}


@pytest.mark.parametrize("name", MOTIONS, ids=str)
def test_motion_without_a_cycle(tmp_path: Path, name: str) -> None:
    text, words = MOTIONS[name]
    path = tmp_path / "bad.bvh"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        bvh.read_rig(path)
    assert caught.value.problems[0].where.startswith("bad.bvh")
    assert words in caught.value.problems[0].message, str(caught.value)


def test_one_leg_is_not_enough(tmp_path: Path) -> None:
    joints = [("hips", "0 0 0"), ("spine", "0 0.3 0"), ("head", "0 0.3 0"), ("thigh", "0 0 0.01"), ("shin", "0 -0.4 0")]
    parents = {"spine": "hips", "head": "spine", "thigh": "hips", "shin": "thigh"}

    def block(name: str, offset: str) -> str:
        inner = "".join(block(child, at) for child, at in joints if parents.get(child) == name)
        end = "" if inner else f"End Site {{ OFFSET 0 {'-0.4' if name == 'shin' else '0.2'} 0 }}\n"
        channels = "CHANNELS 4 Xposition Yposition Zposition Xrotation" if name == "hips" else "CHANNELS 1 Xrotation"
        return f"{'ROOT' if name == 'hips' else 'JOINT'} {name}\n{{\nOFFSET {offset}\n{channels}\n{inner}{end}}}\n"

    hop = [2 * math.pi * k / 40 for k in range(161)]
    rows = [
        f"0 {0.8 + 0.1 * math.sin(a):.5f} {0.02 * k:.5f} 0 0 0 {30 * math.cos(a):.5f} 20" for k, a in enumerate(hop)
    ]
    text = f"HIERARCHY\n{block(*joints[0])}MOTION\nFrames: 161\nFrame Time: 0.0166667\n" + "\n".join(rows) + "\n"
    (tmp_path / "hopper.bvh").write_text(text)
    with pytest.raises(InputError, match=r"hopper\.bvh: no legs? found"):
        characters.load("hopper.bvh", tmp_path)
