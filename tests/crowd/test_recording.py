"""Recordings: what goes in comes out, from disk too, and a broken-off one stays readable."""

from __future__ import annotations

import numpy as np
import pytest
import xarray
import zarr

from crowd.errors import InputError
from crowd.recorded import open_recording
from crowd.recording import Recorder
from crowd.recording_layout import HERD, ROOT
from tests.crowd.made_strides import KEYS, striding


@pytest.fixture(scope="module")
def recorded(made_result, tmp_path_factory):
    path = tmp_path_factory.mktemp("recorded") / "recording.zarr"
    with Recorder(path, made_result.scene) as recorder:
        for chunk in made_result.chunks(30):
            recorder.append(chunk)
    return path


def test_round_trip(made_result, recorded):
    recording = open_recording(recorded)
    assert np.allclose(recording.time, made_result.time)
    for name, herd in made_result.herds.items():
        usual = {array for array, column in HERD.items() if not (column.strides or column.asked)}
        assert set(recording.herds[name]) == set(ROOT) | usual | {"joint_translation"}
        for array, value in herd.items():
            stored = recording.herds[name][array]
            assert stored.shape == value.shape
            assert np.allclose(stored[:], value, atol=1e-5, equal_nan=True), (name, array)
    assert recording.herds["ones"]["contact"].dtype == np.bool_
    assert recording.attributes["seed"] == 11
    assert recording.attributes["complete"] is True
    assert "name: made" in recording.attributes["config"]
    assert "/" not in recording.attributes["config"].replace("kg/", "")


def test_semi_procedural_round_trip(made_result, tmp_path):
    made = striding(made_result)
    with Recorder(tmp_path / "r.zarr", made.scene) as recorder:
        for chunk in made.chunks(30):
            recorder.append(chunk)
    recording = open_recording(tmp_path / "r.zarr")
    usual = {name for name, column in HERD.items() if not column.asked}
    assert set(recording.herds["ones"]) == set(ROOT) | usual | {"joint_translation"}
    assert "weights" not in recording.herds["twos"]
    for array in (name for name, column in HERD.items() if column.strides):
        assert np.allclose(recording.herds["ones"][array][:], made.herds["ones"][array], atol=1e-5), array
    motions = recording.scene.herds[0].motions
    assert [motion.name for motion in motions] == ["stand", "walk"]
    assert np.allclose(motions[1].velocity, [0, 0, 1.2])
    assert np.allclose(motions[1].keytimes, np.tile(KEYS, (2, 1)))
    assert recording.scene.herds[1].motions == ()


def test_indexing_follows_numpy(made_result, recorded):
    recording = open_recording(recorded)
    value, stored = made_result.herds["twos"]["position"], recording.herds["twos"]["position"]
    every = slice(None)
    keys = (3, -1, slice(5, 9), slice(None, None, 7), slice(9, 3, -2), (slice(2, 4), 1), (4, slice(0, 1)), slice(4, 4))
    keys += ((every, every, 1), (3, 1, 2), (3, every, slice(0, 2)), (every,), (slice(0, 9, 2), slice(1, None, -1), 0))
    for key in keys:
        assert stored[key].shape == value[key].shape, key
        assert np.allclose(stored[key], value[key], atol=1e-5), key
    assert np.asarray(stored).shape == value.shape
    value, stored = (herds["twos"]["joint_translation"] for herds in (made_result.herds, recording.herds))
    for key in (*keys, (every, every, 1, 0), (3, 1, slice(2, 4), slice(0, 2)), (every, 0, [0, 3], 1)):
        assert np.array_equal(stored[key], value[key].astype(np.float32)), key
    with pytest.raises(IndexError):
        stored[80]


def test_recording_holds_the_characters(made_result, recorded, box_man):
    scene = open_recording(recorded).scene
    read = scene.herds[1].archetype
    assert read.skeleton.names == box_man.skeleton.names
    assert read.skeleton.parents == box_man.skeleton.parents
    assert read.legs == box_man.legs
    for part in ("vertices", "triangles", "joints", "weights", "inverse_bind"):
        assert np.allclose(getattr(read.mesh, part), getattr(box_man.mesh, part))
    assert np.allclose(scene.herds[1].mass, made_result.scene.herds[1].mass)
    x, z = np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.5, 4.0])
    assert np.allclose(scene.ground(x, z), made_result.scene.ground(x, z), atol=0.02)
    assert scene.levels[0]["surface_m"] == -0.05
    assert scene.levels[0]["fluid"] == "water"


@pytest.mark.filterwarnings("error")
def test_opens_with_xarray(made_result, recorded):
    root = xarray.open_zarr(recorded)
    assert root.position.dims == ("time", "character", "component")
    assert root.position.attrs["units"] == "m"
    assert list(root.component.values) == ["x", "y", "z"]
    assert list(root.herd_name.values) == ["ones"] * 3 + ["twos"] * 2
    assert root.attrs["herds"] == ["ones", "twos"]
    assert {"crowd_version", "jax_version", "config", "seed"} <= set(root.attrs)
    twos = xarray.open_zarr(recorded, group="twos")
    assert twos.joint_rotation.dims == ("time", "character", "joint", "quaternion")
    assert list(twos.character.values) == [3, 4]
    assert twos.moving_translation.dims == ("time", "character", "moving", "component")
    assert list(twos.joint.values[twos.moving.values]) == [twos.joint.values[0], twos.joint.values[3]]
    knee = twos.joint_rotation.sel(joint="knee_l", quaternion="x").isel(character=0)
    assert np.allclose(knee, made_result.herds["twos"]["joint_rotation"][:, 0, 4, 1], atol=1e-6)
    assert np.allclose(twos.ball.sel(time=1.0, leg="left"), made_result.herds["twos"]["ball"][20, :, 0], atol=1e-5)


@pytest.mark.filterwarnings("ignore:Failed to open Zarr store with consolidated")
def test_what_was_written_stays_readable(made_result, tmp_path):
    """The program is killed while it writes the third chunk: no context is left, no array is closed."""
    path = tmp_path / "cut.zarr"
    recorder = Recorder(path, made_result.scene)
    chunks = made_result.chunks(16)
    recorder.append(chunks[0])
    assert len(open_recording(path).time) == 16
    recorder.append(chunks[1])
    root = zarr.open_group(str(path), mode="r+")
    for name in ("position", "velocity"):
        array = root[name]
        assert isinstance(array, zarr.Array)
        array.resize((48, *array.shape[1:]))
    recording = open_recording(path)
    assert len(recording.time) == 32
    assert recording.attributes["complete"] is False
    position = recording.herds["ones"]["position"]
    assert position.shape == (32, 3, 3)
    assert np.allclose(position[:], made_result.herds["ones"]["position"][:32], atol=1e-5)
    assert xarray.open_zarr(path, group="ones").sizes["time"] == 32


def test_exception_leaves_whole_frames(made_result, tmp_path):
    path = tmp_path / "stopped.zarr"
    with pytest.raises(KeyboardInterrupt), Recorder(path, made_result.scene) as recorder:
        recorder.append(made_result.chunks(16)[0])
        raise KeyboardInterrupt
    recording = open_recording(path)
    assert recording.attributes["complete"] is False
    assert xarray.open_zarr(path).sizes["time"] == 16
    with Recorder(tmp_path / "none.zarr", made_result.scene):
        pass
    assert len(open_recording(tmp_path / "none.zarr").time) == 0


def test_wrong_chunks_write_nothing(made_result, tmp_path):
    chunk = made_result.chunks(10)[0]
    with Recorder(tmp_path / "r.zarr", made_result.scene) as recorder:
        recorder.append(chunk)
        chunk.herds["ones"]["yaw"] = chunk.herds["ones"]["yaw"][:, :2]
        with pytest.raises(ValueError, match=r"ones\.yaw"):
            recorder.append(chunk)
    assert len(open_recording(tmp_path / "r.zarr").time) == 10


def test_without_poses(made_result, tmp_path):
    with Recorder(tmp_path / "r.zarr", made_result.scene, pose=False) as recorder:
        recorder.append(made_result.chunks(10)[0])
    herd = open_recording(tmp_path / "r.zarr").herds["ones"]
    assert "joint_rotation" not in herd
    assert herd["ball"].shape == (10, 3, 2, 3)


def test_replaces_only_recordings(made_result, recorded, tmp_path):
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match="not a recording"):
        Recorder(tmp_path, made_result.scene)
    assert (tmp_path / "letter.txt").read_text() == "dear"
    with pytest.raises(InputError, match="no recording"):
        open_recording(tmp_path)
    with pytest.raises(InputError, match="no recording"):
        open_recording(tmp_path / "nowhere")
    again = tmp_path / "again.zarr"
    for length in (10, 20):
        with Recorder(again, made_result.scene) as recorder:
            recorder.append(made_result.chunks(length)[0])
    assert len(open_recording(again).time) == 20
    zarr.open_group(str(again), mode="r+").attrs["format"] = "crowd-recording-1"
    with pytest.raises(InputError, match="of another version can be made again"):
        open_recording(again)
    with Recorder(again, made_result.scene) as recorder:
        recorder.append(made_result.chunks(10)[0])
    assert len(open_recording(again).time) == 10


def test_herds_cannot_have_the_names_of_arrays() -> None:
    """The scenario refuses every name that a recording uses at its root."""
    from crowd.recording_layout import ROOT, STATIC_UNITS
    from crowd.scenario_herd import TAKEN_NAMES

    assert {*ROOT, *STATIC_UNITS, "time", "character", "component", "herd", "herd_name"} == TAKEN_NAMES
