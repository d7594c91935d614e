"""Recording of a run as a Zarr v3 store that grows while the run goes on.

At the root lie the arrays every character has (time x character x component, all herds one after the other), in one
group per herd its feet and poses, with skeleton, skin and names, so that the recording can be drawn and measured by
itself. `xarray.open_zarr(path)` and `xarray.open_zarr(path, group=herd)` open it.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from io import StringIO
from pathlib import Path
from threading import Lock
from types import TracebackType
from typing import Any, Protocol, runtime_checkable

import numpy as np
import zarr

from crowd.errors import fail
from crowd.recorded_scene import HerdLike, SceneLike, levels_of, motions_of
from crowd.recording_array import GrowingArray
from crowd.recording_layout import FORMAT, GROUND, HERD, KIND, ROOT, SIZES, Column
from crowd.recording_static import fixed, write_static
from crowd.recording_water import WaterRecorder
from crowd.scenario_herd import TAKEN_NAMES

GROUND_SAMPLES = 256
EXPECTED_FRAMES = 32  # per chunk, unless the first piece suggests otherwise


@runtime_checkable
class ChunkLike(Protocol):
    """Recorded frames of all herds, as `crowd.simulate.stream` yields them."""

    @property
    def first_frame(self) -> int: ...
    @property
    def time(self) -> np.ndarray: ...
    @property
    def herds(self) -> Mapping[str, Mapping[str, np.ndarray]]: ...


@runtime_checkable
class InParts(Protocol):
    """Arrays of a herd in a chunk that can also be had in pieces along the characters."""

    def parts(self, name: str) -> list[np.ndarray]: ...


class Recorder:
    """Writes chunks as they come. Use as a context manager.

    What `append` has written stays readable, also when the program is killed or the disk is full: arrays grow when
    all their frames are there, the root attribute `frames` says how many frames are whole, and `open_recording` keeps
    to it. Leaving the context, with or without an exception, cuts every array to the whole frames.

    path: a new or empty folder, or an earlier recording, which is replaced; anything else raises `InputError`.
    pose: record joint rotations and translations too; without them no pictures can be drawn from the recording.
    """

    def __init__(self, path: str | Path, scene: SceneLike, pose: bool | None = None):
        self.path = Path(path)
        self.scene = scene
        self.pose = _wants_pose(scene) if pose is None else pose
        self.frames = 0
        self._lock, self._closed = Lock(), False  # chunks may come from another thread than the end does
        self._water: WaterRecorder | None = None
        self._arrays: dict[tuple[str | None, str], GrowingArray] = {}  # by herd (None: the root) and name
        _refuse_names(scene)
        self._low, self._high = np.full(2, np.inf), np.full(2, -np.inf)
        _refuse_foreign(self.path)
        self._root = zarr.open_group(str(self.path), mode="w", zarr_format=3, attributes=_attributes(scene))
        self._characters = sum(herd.count for herd in scene.herds)
        write_static(self._root, scene.herds)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close(complete=kind is None)
        except OSError:
            if kind is None:  # otherwise what stopped the run is told, not that its recording cannot be closed either
                raise

    def append(self, chunk: ChunkLike) -> None:
        """Add recorded frames; none, and ValueError, when an array is missing or has another shape."""
        with self._lock:
            self._append(chunk)

    def _append(self, chunk: ChunkLike) -> None:
        if self._closed:
            raise ValueError(f"{self.path}: the recording is closed")
        count = len(chunk.time)
        if count == 0:
            return
        if not self._arrays:
            self._create(count)
        end = self.frames + count
        # One array after the other: a chunk may make them when they are asked for.
        for (herd, name), array in self._arrays.items():
            array.write(self.frames, self._values(chunk, herd, name))
        # All lengths change together at the end: a reader never meets arrays of different lengths for longer than that.
        for array in self._arrays.values():
            array.extend(end)
        self._root.attrs["frames"] = end
        self.frames = end
        water = getattr(chunk, "water", None)
        if water is not None:
            self._water = self._water or WaterRecorder(self._root, water)
            self._water.append(water)
        for part in self._values(chunk, None, "position"):
            self._note_places(part[..., [0, 2]].reshape(-1, 2))

    def _note_places(self, position: np.ndarray) -> None:
        """Where characters [., 2] have been, for the ground under them."""
        position = position[np.isfinite(position).all(1)]
        if len(position):
            self._low, self._high = np.minimum(self._low, position.min(0)), np.maximum(self._high, position.max(0))

    def close(self, complete: bool = True) -> None:
        """Cut arrays to whole frames, add the ground under the characters, gather the metadata. Twice does nothing."""
        with self._lock:
            if not self._closed:
                self._closed = True
                self._close(complete)

    def _close(self, complete: bool) -> None:
        if not self._arrays:
            self._create(EXPECTED_FRAMES)
        for array in self._arrays.values():
            array.cut(self.frames)
        self._write_ground()
        self._root.attrs.update({"complete": complete, "closed": True})
        with warnings.catch_warnings():
            # Consolidated metadata makes opening fast; the format calls it an extension, and zarr says so each time.
            warnings.simplefilter("ignore")
            for group in (*(herd.name for herd in self.scene.herds), ""):
                zarr.consolidate_metadata(str(self.path), path=group or None, zarr_format=3)

    def _values(self, chunk: ChunkLike, herd: str | None, name: str) -> list[np.ndarray]:
        """One array [t, ...] to write, of a herd or (None) of all, in parts, with its shape checked."""
        if name == "time":
            return [np.asarray(chunk.time, np.float64)]
        found = []
        for one in self.scene.herds:
            if herd in (None, one.name):
                parts = _parts(chunk.herds.get(one.name, {}), name)
                shape = (len(chunk.time), *(_sizes(one)[dim] for dim in (ROOT | HERD)[name].dims))
                people = sum(part.shape[1] for part in parts if part.ndim > 1)
                for part in parts:
                    if (*part.shape[:1], people, *part.shape[2:]) != shape:
                        raise ValueError(f"{one.name}.{name}: shape {part.shape}, expected {shape}")
                found += parts
        return found

    def _herd_columns(self, herd: HerdLike) -> dict[str, Column]:
        strides = bool(motions_of(herd))
        kept = {name: column for name, column in HERD.items() if self.pose or not column.optional}
        asked = _asked(self.scene, herd)
        kept = {name: column for name, column in kept.items() if not column.asked or column.asked in asked}
        return {name: column for name, column in kept.items() if strides or not column.strides}

    def _create(self, frames: int) -> None:
        """Empty arrays, cut along time as the chunks come."""
        span = frames if 8 <= frames <= 128 else EXPECTED_FRAMES
        self._grow(self._root, None, ROOT, SIZES | {"character": self._characters}, span)
        for herd in self.scene.herds:
            group = self._root[herd.name]
            assert isinstance(group, zarr.Group)
            self._grow(group, herd.name, self._herd_columns(herd), _sizes(herd), span)

    def _grow(
        self, group: zarr.Group, herd: str | None, columns: dict[str, Column], sizes: dict[str, int], span: int
    ) -> None:
        """Empty arrays of one group, time among them."""
        self._arrays[herd, "time"] = GrowingArray(self.path, group, "time", TIME, (), TIME_SPAN)
        for name, column in columns.items():
            shape = tuple(sizes[dim] for dim in column.dims)
            self._arrays[herd, name] = GrowingArray(self.path, group, name, column, shape, span)

    def _write_ground(self) -> None:
        """Ground heights on a grid around where the characters have been, in the group `_ground`."""
        known = bool(np.isfinite(self._low).all())
        low, high = (self._low, self._high) if known else (np.zeros(2), np.zeros(2))
        x, z = np.linspace(low - 15.0, high + 15.0, GROUND_SAMPLES, axis=1)
        group = self._root.create_group(GROUND, overwrite=True)
        height = np.broadcast_to(self.scene.ground(x[None, :], z[:, None]), (len(z), len(x)))
        fixed(group, "x", x, ("x",), "m", "world x")
        fixed(group, "z", z, ("z",), "m", "world z")
        fixed(group, "height", height.astype(np.float32), ("z", "x"), "m", "height of the ground")


TIME = Column((), "s", "simulated time since the start", np.float64)
TIME_SPAN = 4096


def config_text(scene: SceneLike) -> str:
    """The scenario as YAML with overrides and defaults filled in; empty without one."""
    scenario = getattr(scene, "scenario", None)
    if scenario is None:
        return ""
    from ruamel.yaml import YAML

    stream = StringIO()
    YAML(typ="safe", pure=True).dump(scenario.model_dump(mode="json"), stream)
    return stream.getvalue()


def _attributes(scene: SceneLike) -> dict[str, Any]:
    scenario = getattr(scene, "scenario", None)
    return {
        "format": FORMAT,
        "title": str(getattr(scenario, "name", "crowd")),
        "herds": [herd.name for herd in scene.herds],
        "conventions": "SI units, radians; right-handed, y up, +z forward, +x the character's left; quaternions wxyz",
        "crowd_version": _version("jax-crowd"),
        "jax_version": _version("jax"),
        "numpy_version": np.__version__,
        "seed": int(getattr(scenario, "seed", 0)),
        "config": config_text(scene),
        "levels": levels_of(scene),
        "frames": 0,
        "complete": False,
    }


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "unknown"


def _wants_pose(scene: SceneLike) -> bool:
    record = getattr(getattr(scene, "scenario", None), "record", None)
    return bool(getattr(record, "pose", True))


def _refuse_foreign(path: Path) -> None:
    """`InputError` unless the path is free, empty or a recording: opening it for writing empties the folder."""
    if path.is_dir() and not any(path.iterdir()):
        return
    if path.exists():
        try:
            ours = str(zarr.open_group(str(path), mode="r").attrs.get("format")).startswith(KIND)
        except (OSError, ValueError, KeyError):
            ours = False
        if not ours:
            raise fail(str(path), "exists and is not a recording; choose another place or remove it")


def _refuse_names(scene: SceneLike) -> None:
    """`InputError` for herds whose group would carry the name of an array."""
    for herd in scene.herds:
        if herd.name in TAKEN_NAMES:
            raise fail(f"herd {herd.name!r}", "has the name of an array of the recording; choose another")


def _parts(arrays: Mapping[str, np.ndarray], name: str) -> list[np.ndarray]:
    """An array of a herd along the characters; of a missing one, something without a shape."""
    return arrays.parts(name) if isinstance(arrays, InParts) and name in arrays else [np.asarray(arrays.get(name))]


def _sizes(herd: HerdLike) -> dict[str, int]:
    legs, joints = len(herd.archetype.legs), herd.archetype.skeleton.count
    moving = {"motion": len(motions_of(herd)), "moving": len(herd.moving)}
    return SIZES | {"character": herd.count, "leg": legs, "joint": joints} | moving


def _asked(scene: SceneLike, herd: HerdLike) -> set[str]:
    """What of the arrays that a scenario has to ask for it asks for."""
    scenario, model = getattr(scene, "scenario", None), getattr(herd, "model", None)
    floats = scenario is not None and scenario.world.buoyancy and bool(scenario.world.fluids)
    changes = model is not None and model.responses.transitions is not None
    return {name for name, there in (("buoyancy", floats), ("transitions", changes)) if there}
