"""Trajectories from files: what is read, how it is told when it is wrong, and that walking characters reproduce it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crowd import scenario, scene, tracks
from crowd.errors import InputError
from crowd.scenario_control import Columns, Trajectories
from crowd.scenario_trajectories import read_trajectories
from tests.crowd.scenes import run
from tests.crowd.scenes import scenario as model

CSV = "id,t,x,z\n" + "".join(f"{who},{0.5 * k},{who},{0.6 * k}\n" for k in range(9) for who in (1, 2))


def read(tmp_path: Path, text: str, rate: float | None = None, **columns: str) -> dict[str, Any]:
    path = tmp_path / "ways.csv"
    path.write_text(text)
    return read_trajectories(path, Columns(**columns), rate)


def herd(file: str, **more: Any) -> dict[str, Any]:
    given = {"file": file, **more.pop("trajectories", {})}
    return {"name": "p", "archetype": "human", "trajectories": given, **more}


@pytest.mark.parametrize(
    ("text", "rate", "columns"),
    [
        (CSV, None, {}),
        (CSV.replace(",", ";"), None, {}),
        (CSV.replace(",", "\t"), None, {}),
        (CSV.replace("id,t,x,z", "PersID,time,X,Y"), None, {}),
        (CSV.replace("id,t,x,z", "who,t,east,north"), None, {"id": "who", "x": "east", "z": "north"}),
        ("# a comment\n\n" + CSV, None, {}),
        ("﻿" + CSV, None, {}),
    ],
    ids=["commas", "semicolons", "tabs", "other names", "named columns", "comments", "byte order mark"],
)
def test_read(tmp_path: Path, text: str, rate: float | None, columns: dict[str, str]) -> None:
    found = read(tmp_path, text, rate, **columns)
    assert list(found) == ["1", "2"]
    np.testing.assert_allclose(found["2"].time, 0.5 * np.arange(9))
    np.testing.assert_allclose(found["2"].place, np.stack([np.full(9, 2.0), 0.6 * np.arange(9)], 1))
    assert found["1"].heading is None


def test_read_frames_units_headings_and_any_order(tmp_path: Path) -> None:
    found = read(tmp_path, "frame,id,x [cm],y/cm,heading_deg\n20,a,100,300,90\n10,a,50,150,45\n10,b,0,0,0\n", 20.0)
    np.testing.assert_allclose(found["a"].time, [0.5, 1.0])
    np.testing.assert_allclose(found["a"].place, [[0.5, 1.5], [1.0, 3.0]])
    np.testing.assert_allclose(found["a"].heading, np.radians([45, 90]))


def test_read_trackers_text(tmp_path: Path) -> None:
    text = "# framerate: 25.00\n# id frame x/m y/m z/m\n1\t50 1.0 2.0 1.76\n1\t51 1.0 2.1 1.76\n2 50 0 0 1.8\n"
    for version in (text, text.replace("# id frame x/m y/m z/m\n", "")):
        found = read(tmp_path, version)
        np.testing.assert_allclose(found["1"].time, [2.0, 2.04])
        np.testing.assert_allclose(found["1"].place, [[1.0, 2.0], [1.0, 2.1]])  # its z is a height
    np.testing.assert_allclose(read(tmp_path, text.replace("x/m y/m", "x/cm y/cm"))["1"].place[0], [0.01, 0.02])


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("id,t,x,z", "id,t,x,height", ("has no column 'z'", "id, t, x, height", "'columns'")),
        ("id,t,x,z", "id,when,x,z", ("has no column 't'",)),
        ("id,t,x,z", "id,frame,x,z", ("rate_hz",)),
        ("id,t,x,z\n", "", ("has no header line", "id, t, x, z")),
        ("1,0.5,1,0.6", "1,0.5,one,0.6", (".csv:4", "'one' (x) is not a finite number")),
        ("1,0.5,1,0.6", "1,0.5,nan,0.6", (".csv:4", "not a finite number")),
        ("1,0.5,1,0.6", "1,0.5,1", (".csv:4", "3 values; 4 are needed")),
        ("1,0.5,1,0.6", "1,0.0,1,0.6", (".csv:4", "id 1 has time 0 s twice")),
        ("1,0.5,1,0.6", "1,0.5,1,99", (".csv:4", "id 1 jumps", "at most 15 m/s")),
        (CSV, "id,t,x,z\n", ("has no samples",)),
        (CSV, "id,t,x,y,z\n1,0,1,2,3\n", ("both y and z", "columns")),
    ],
)
def test_bad_file_is_told_with_its_line(tmp_path: Path, old: str, new: str, says: tuple[str, ...]) -> None:
    assert old in CSV
    (tmp_path / "ways.csv").write_text(CSV.replace(old, new, 1))
    (tmp_path / "scene.yaml").write_text(
        "frames: 10\nherds:\n- name: p\n  archetype: human\n  trajectories:\n    file: ways.csv\n"
    )
    with pytest.raises(InputError) as caught:
        scenario.load(tmp_path / "scene.yaml")
    message = str(caught.value)
    assert message.startswith("scene.yaml:6 herds[0].trajectories.file: ")
    assert len(caught.value.problems) == 1
    for part in says:
        assert part in message


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"count": 3}, "herds[0].count: 3: ways.csv has 2 trajectories"),
        ({"trajectories": {"ids": [1, 7]}}, "herds[0].trajectories.ids: no id 7"),
        ({"trajectories": {"columns": {"x": "xx"}}}, "has no column 'xx' (did you mean 'x'?)"),
        ({"trajectories": {"file": "gone.csv"}}, "herds[0].trajectories.file"),
        ({"place": {"kind": "grid", "spacing_m": 1.0}}, "herds[0].place: goes without trajectories"),
        ({"speed_m_s": 1.0}, "both speed_m_s and trajectories are given"),
    ],
)
def test_bad_use_of_a_file(tmp_path: Path, more: dict[str, Any], says: str) -> None:
    (tmp_path / "ways.csv").write_text(CSV)
    given = herd(str(tmp_path / "ways.csv"), **more)
    with pytest.raises(InputError) as caught:
        scenario.load(model([given]))
    assert says in str(caught.value).replace(f"{tmp_path}/", "")


def test_count_is_the_files_unless_smaller(tmp_path: Path) -> None:
    (tmp_path / "ways.csv").write_text(CSV)
    file = str(tmp_path / "ways.csv")
    assert scenario.load(model([herd(file)])).character_count == 2
    assert scenario.load(model([herd(file, count=1)])).character_count == 1
    assert scenario.load(model([herd(file)]), ["herds.p.count=1"]).character_count == 1
    chosen = scene.load(model([herd(file, trajectories={"ids": ["2"], "offset_m": [10.0, 1.0]})])).herds[0]
    np.testing.assert_allclose(chosen.points, [[12.0, 1.0]])
    assert chosen.count == 1


def test_late_start_is_the_middle_of_the_way(tmp_path: Path) -> None:
    (tmp_path / "ways.csv").write_text(CSV)
    given = Trajectories(file="ways.csv", start_s=2.25)
    track = tracks.load(given, 0, tmp_path / "ways.csv", "t")
    np.testing.assert_allclose(track.place[0, :, 1], 2.7)
    np.testing.assert_allclose(track.velocity[0], [[0.0, 1.2]] * 2, atol=1e-9)
    assert len(track.place) == np.ceil(1.75 * track.rate) + 2
    np.testing.assert_array_equal(track.velocity[-1], 0.0)
    with pytest.raises(InputError, match=r"t.start_s: 9 s is after the last sample \(4 s\)"):
        tracks.load(given.model_copy(update={"start_s": 9.0}), 0, tmp_path / "ways.csv", "t")


def test_table_of_sparse_samples_is_smooth_and_passes_them(tmp_path: Path) -> None:
    """A circle of 3 m sampled once a second: the table is on it, with its speed and its headings."""
    t = np.arange(13)
    rows = "".join(f"1,{s},{3 * np.sin(s / 2):.9f},{3 * np.cos(s / 2):.9f}\n" for s in t)
    (tmp_path / "ways.csv").write_text("id,t,x,z\n" + rows)
    track = tracks.load(Trajectories(file="ways.csv"), 0, tmp_path / "ways.csv", "t")
    at = np.arange(len(track.place)) / track.rate
    inner = (at > 1) & (at < 11)
    expected = 3 * np.stack([np.sin(at / 2), np.cos(at / 2)], 1)
    np.testing.assert_allclose(track.place[inner, 0], expected[inner], atol=0.02)
    np.testing.assert_allclose(np.hypot(*track.velocity[inner, 0].T), 1.5, rtol=0.03)
    turn = np.diff(track.heading[(at > 1.5) & (at < 10.5), 0]) * track.rate
    np.testing.assert_allclose(turn, 0.5, atol=0.03)


FILES = ("juelich_UNI_CORR_500_01.txt", "juelich_bottleneck_040_c_56_h-.txt")


@pytest.fixture(scope="module")
def followed(shared_data: Path) -> dict[str, tuple[np.ndarray, ...]]:
    """Of each real file, 40 s: walked places, the file's places [t, n, 2], and when each one is under way."""
    files = [shared_data / "crowd" / name for name in FILES]
    if not all(file.is_file() for file in files):
        pytest.skip("the recorded crowds are not there")
    herds = [herd(str(file)) | {"name": f"p{number}"} for number, file in enumerate(files)]
    arrays = run(model(herds), 40.0)
    out = {}
    for number, file in enumerate(files):
        found = arrays[f"p{number}"]
        known = list(read_trajectories(file, Columns(), None).values())
        at = min(one.time[0] for one in known) + (1 + np.arange(len(found["position"]))) / 60
        place = np.stack(
            [np.stack([np.interp(at, one.time, one.place[:, axis]) for axis in (0, 1)], 1) for one in known], 1
        )
        under_way = np.stack([(at > one.time[0]) & (at < one.time[-1]) for one in known], 1)
        assert not found["fault"].any()
        out[file.name] = found["position"][..., [0, 2]], place, under_way
    return out


@pytest.mark.parametrize("name", FILES)
def test_real_crowds_are_reproduced(followed: dict[str, tuple[np.ndarray, ...]], name: str) -> None:
    """Mean speed within 3 % (asked for), a few centimetres beside the recorded way (heads sway more than bodies)."""
    walked, recorded, under_way = followed[name]
    off = np.linalg.norm(walked - recorded, axis=-1)
    assert off[under_way].mean() < 0.05
    assert np.percentile(off[under_way], 99) < 0.15
    speed = []
    for n in np.flatnonzero(under_way.sum(0) > 120):
        frames = np.flatnonzero(under_way[:, n])
        ways = (way[frames[-1], n] - way[frames[0], n] for way in (walked, recorded))
        speed.append([np.linalg.norm(way) / len(frames) for way in ways])
    mine, theirs = np.mean(speed, 0)
    assert mine == pytest.approx(theirs, rel=0.03)


def test_characters_stand_before_and_after(tmp_path: Path) -> None:
    """One walks from 1 s to 5 s, the other the whole 6 s; a heading in the file is where the first looks."""
    rows = [f"a,{t},{0.0},{1.2 * (t - 1):.3f},90" for t in np.arange(1, 5.01, 0.25)]
    rows += [f"b,{t},3,{1.2 * t:.3f},0" for t in np.arange(0, 6.01, 0.25)]
    (tmp_path / "ways.csv").write_text("id,t,x,z,heading_deg\n" + "\n".join(rows))
    arrays = run(model([herd(str(tmp_path / "ways.csv"))]), 8.0)["p"]
    z = arrays["position"][:, :, 2]
    assert np.ptp(z[:50, 0]) < 0.01
    np.testing.assert_allclose(z[179, 0], 2.4, atol=0.15)  # it side-steps, which takes longer to set out
    np.testing.assert_allclose(z[179, 1], 3.6, atol=0.03)
    np.testing.assert_allclose(z[-1], [4.8, 7.2], atol=0.02)
    assert np.abs(arrays["velocity"][-1, 0]).max() < 0.1  # and to settle: bodies give way sideways
    assert np.abs(arrays["velocity"][-1, 1]).max() < 0.01
    np.testing.assert_allclose(np.degrees(arrays["yaw"][100:, 0]), 90.0, atol=0.5)
    np.testing.assert_allclose(np.degrees(arrays["yaw"][100:, 1]), 0.0, atol=0.5)
