"""Recordings written behind the run: the same bits in order, and nothing lost when writing or running stops."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
import pytest
import zarr

from crowd import recording_array, scene, simulate
from crowd.recorded import open_recording
from crowd.recording import Recorder
from crowd.recording_layout import HERD, ROOT
from crowd.recording_thread import Writing
from tests.crowd.scenes import herd, scenario

PATH = "recording.zarr"


def written(made: Any, path: Path, length: int) -> None:
    with Recorder(path, made.scene) as recorder, Writing(recorder) as writing:
        for chunk in made.chunks(length):
            writing.append(chunk)


def assert_same(path: Path, herds: dict[str, dict[str, np.ndarray]], frames: int) -> None:
    recording = open_recording(path)
    columns = ROOT | HERD | {"joint_translation": HERD["moving_translation"]}
    assert len(recording.time) == frames
    for name, arrays in recording.herds.items():
        for array, stored in arrays.items():
            expected = herds[name][array][:frames].astype(columns[array].dtype)
            np.testing.assert_array_equal(stored[:], expected, err_msg=array)


@pytest.mark.parametrize("length", [1, 7, 16, 33, 80])
def test_every_bit_is_there_however_it_is_cut(
    made_result: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, length: int
) -> None:
    """Chunks that are and are not whole blocks, blocks of all characters and of some with one left over."""
    for size in (1 << 20, 6000):
        monkeypatch.setattr(recording_array, "BLOCK_BYTES", size)
        monkeypatch.setattr(recording_array, "TILE", 1)
        written(made_result, tmp_path / PATH, length)
        assert_same(tmp_path / PATH, made_result.herds, 80)
    rotations = zarr.open_array(str(tmp_path / PATH / "ones" / "joint_rotation"), mode="r")
    assert rotations.chunks[1] < 3  # characters
    one = open_recording(tmp_path / PATH).herds["ones"]["joint_rotation"][:, 2]
    np.testing.assert_array_equal(one, made_result.herds["ones"]["joint_rotation"][:, 2].astype(np.float32))


@pytest.mark.parametrize(("length", "size"), [(7, 4 << 20), (10, 4 << 20), (10, 1)])
def test_a_run_is_recorded_as_it_is_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, length: int, size: int
) -> None:
    """Chunks that are no whole blocks, blocks of all characters, and tiles compressed where they lie, one not full."""
    monkeypatch.setattr(recording_array, "BLOCK_BYTES", size)
    record = {"rate_hz": 30, "pose": True}
    model = scenario([herd("people", "human", 130), herd("ants", "hexapod", 3, 0.5)], 0.4, record=record)
    loaded = scene.load(model)
    expected = simulate.simulate(loaded, frames=60, devices=1)
    with Recorder(tmp_path / PATH, loaded) as recorder, Writing(recorder) as writing:
        for chunk in simulate.stream(loaded, 60, chunk=length, devices=1):
            writing.append(chunk)
    assert np.ptp(expected.herds["people"]["joint_rotation"], axis=0).max() > 0.1
    assert expected.herds["people"]["joint_rotation"].flags.c_contiguous
    assert_same(tmp_path / PATH, expected.herds, 30)
    blocks = list((tmp_path / PATH / "people" / "joint_rotation").glob("c.0.*"))
    assert len(blocks) == (2 if size == 1 else 1)
    np.testing.assert_array_equal(open_recording(tmp_path / PATH).time, expected.time)


def test_the_next_chunk_is_stepped_while_the_caller_has_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the caller asking for it; states and chunks are of the same frame nevertheless."""
    started, inner, ended = [], simulate._advanced, []

    def advanced(run: Callable[..., Any], share: Any, left: int) -> Any:
        started.append(left)
        if len(started) == 2:
            second.set()
        return inner(run, share, left)

    second = Event()
    monkeypatch.setattr(simulate, "_advanced", advanced)
    loaded = scene.load(scenario([herd("people", "human", 2)]))
    chunks = simulate.stream(loaded, 20, 1, 8, on_state=lambda states: ended.append(int(states[0].frame[0, 0])))
    assert next(chunks).frames == 8
    assert second.wait(60.0)
    assert [chunk.first_frame for chunk in chunks] == [8, 16]
    assert started == [20, 12, 4]
    assert ended == [8, 16, 20]


def test_writing_is_behind_the_caller_but_not_far(
    made_result: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gate, inner, handed = Event(), Recorder.append, []

    def append(recorder: Recorder, chunk: Any) -> None:
        assert gate.wait(60.0)
        inner(recorder, chunk)

    monkeypatch.setattr(Recorder, "append", append)
    recorder = Recorder(tmp_path / PATH, made_result.scene)

    def all_of_them() -> None:
        with recorder, Writing(recorder) as writing:
            for chunk in made_result.chunks(16):
                writing.append(chunk)
                handed.append(chunk.first_frame)

    caller = Thread(target=all_of_them, daemon=True)
    caller.start()
    caller.join(0.5)
    assert recorder.frames == 0
    assert handed in ([0], [0, 32])  # one is being written, one waits, the third has no room
    gate.set()
    caller.join(60.0)
    assert handed == [0, 32, 64, 96, 128]
    assert_same(tmp_path / PATH, made_result.herds, 80)


def test_a_full_disk_is_told_and_keeps_what_is_there(
    made_result: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing can be written from the middle of the third chunk on, the end of the recording neither."""
    inner, room = recording_array.stored, []

    def stored(path: Path, content: bytes) -> None:
        if path.parent.name == "ball" and path.name.startswith("c.2"):
            room.append(path)
        if room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        inner(path, content)

    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(recording_array, "stored", stored)
    monkeypatch.setattr(Recorder, "_write_ground", full)
    with pytest.raises(OSError, match=r"No space left.*first 32 recorded frames stay.*recording\.zarr") as told:
        written(made_result, tmp_path / PATH, 16)
    assert told.value.errno == errno.ENOSPC  # the command line knows it
    assert len(room) == 1  # no further chunk was tried
    assert open_recording(tmp_path / PATH).attributes["complete"] is False
    assert_same(tmp_path / PATH, made_result.herds, 32)


def test_a_failed_rewrite_of_a_block_keeps_the_block(
    made_result: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Chunks shorter than a block: the last one on disk is replaced whole or not at all."""
    inner = os.replace
    chunks = made_result.chunks(4)
    recorder = Recorder(tmp_path / PATH, made_result.scene)
    for chunk in chunks[:2]:
        recorder.append(chunk)

    def replace(source: Path, target: Path) -> None:
        if "yaw" in str(target):
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        inner(source, target)

    monkeypatch.setattr(os, "replace", replace)
    with pytest.raises(OSError, match="first 8 recorded"), recorder, Writing(recorder) as writing:
        writing.append(chunks[2])
    assert_same(tmp_path / PATH, made_result.herds, 8)
    assert not list((tmp_path / PATH).rglob("*.partial"))


def test_other_faults_are_raised_as_they_are(made_result: Any, tmp_path: Path) -> None:
    chunks = made_result.chunks(10)
    chunks[1].herds["ones"]["yaw"] = chunks[1].herds["ones"]["yaw"][:, :2]
    with (
        pytest.raises(ValueError, match=r"ones\.yaw"),
        Recorder(tmp_path / PATH, made_result.scene) as recorder,
        Writing(recorder) as writing,
    ):
        for chunk in chunks:
            writing.append(chunk)
    assert_same(tmp_path / PATH, made_result.herds, 10)


def test_an_interrupt_writes_what_was_handed_over(made_result: Any, tmp_path: Path) -> None:
    with (
        pytest.raises(KeyboardInterrupt),
        Recorder(tmp_path / PATH, made_result.scene) as recorder,
        Writing(recorder) as writing,
    ):
        for chunk in made_result.chunks(16)[:3]:
            writing.append(chunk)
        raise KeyboardInterrupt
    assert_same(tmp_path / PATH, made_result.herds, 48)
    assert open_recording(tmp_path / PATH).attributes["complete"] is False


def test_blocks_of_a_broken_write_are_removed(made_result: Any, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / PATH, made_result.scene)
    recorder.append(made_result.chunks(16)[0])
    for array in recorder._arrays.values():
        if array.span == 16:
            array.write(16, [np.zeros((16, *array.shape), array.dtype)])
    left = list((tmp_path / PATH).rglob("c.1*"))
    recorder.close(complete=False)
    assert left
    assert not list((tmp_path / PATH).rglob("c.1*"))
    with pytest.raises(ValueError, match="closed"):
        recorder.append(made_result.chunks(16)[1])
    assert_same(tmp_path / PATH, made_result.herds, 16)
