"""Recordings read back: the same names and shapes as the result of a simulation, read from disk when asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from crowd.errors import fail
from crowd.recorded_scene import RecordedHerd, RecordedMotion, RecordedScene, grid_heights
from crowd.recording_layout import FORMAT, GROUND, HERD, ROOT
from crowd.recording_water import recorded_water
from crowd.types import Archetype, Leg, Mesh, Skeleton, WaterFrames


@dataclass(frozen=True)
class Stored:
    """An array [time, character, ...] on disk; index time and characters by integers or slices."""

    array: zarr.Array
    frames: int
    first: int  # column of the herd's first character
    count: int

    @property
    def shape(self) -> tuple[int, ...]:
        return (self.frames, self.count, *self.array.shape[2:])

    @property
    def dtype(self) -> np.dtype:
        return np.dtype(self.array.dtype)

    def __len__(self) -> int:
        return self.frames

    def __getitem__(self, key: Any) -> np.ndarray:
        keys = key if isinstance(key, tuple) else (key,)
        time, people, *rest = keys if len(keys) > 1 else (*keys, slice(None))
        rows = range(self.frames)[time]
        columns = range(self.first, self.first + self.count)[people]
        read = np.asarray(self.array[_selection(rows), _selection(columns)])
        return read[(*_steps(rows, columns), *rest)]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.asarray(self[:], dtype)


@dataclass(frozen=True)
class StoredTranslations(Stored):
    """Places [time, character, joint, component] of all joints, of which only the moving ones are on disk."""

    moving: tuple[int, ...]
    rest: np.ndarray  # [J, 3] m

    @property
    def shape(self) -> tuple[int, ...]:
        return (self.frames, self.count, *self.rest.shape)

    def __getitem__(self, key: Any) -> np.ndarray:
        keys = key if isinstance(key, tuple) else (key,)
        read = super().__getitem__(keys[:2])
        out = np.empty((*read.shape[:-2], *self.rest.shape), read.dtype)
        out[:] = self.rest
        out[..., list(self.moving), :] = read
        return out[(*(slice(None),) * (out.ndim - 2), *keys[2:])]


def _selection(chosen: range | int) -> slice | int:
    """What to read for a range: the same places in increasing order."""
    if isinstance(chosen, int):
        return chosen
    return slice(min(chosen), max(chosen) + 1, abs(chosen.step)) if chosen else slice(0, 0)


def _steps(*chosen: range | int) -> tuple[slice, ...]:
    """Turn what was read for a range around where the range runs backward."""
    return tuple(slice(None, None, -1 if part.step < 0 else 1) for part in chosen if isinstance(part, range))


class StoredHerd(Mapping[str, Stored]):
    """Arrays of one herd by name, those of the root included."""

    def __init__(self, arrays: dict[str, Stored]):
        self._arrays = arrays

    def __getitem__(self, name: str) -> Stored:
        return self._arrays[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._arrays)

    def __len__(self) -> int:
        return len(self._arrays)


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording on disk. `time` [t] s; herds[name][array] as in `crowd.recording_layout`; `scene` without clips."""

    path: Path
    time: np.ndarray
    herds: dict[str, StoredHerd]
    scene: RecordedScene
    attributes: dict[str, Any]
    water: WaterFrames | None = None  # of a surface that the crowd moves


def open_recording(path: str | Path) -> Recording:
    """Open a recording, whole or cut short; frames that were not completely written are left out.

    Raises `InputError` when there is none at `path`.
    """
    path = Path(path)
    try:
        # Consolidated metadata is only there after an orderly end; what lies on disk always is.
        root = zarr.open_group(str(path), mode="r", use_consolidated=False)
    except (OSError, ValueError, KeyError) as error:
        raise fail(str(path), "no recording there (a folder written by `crowd run`, recording.zarr)") from error
    attributes: dict[str, Any] = dict(root.attrs)
    if attributes.get("format") != FORMAT:
        found = f"format {attributes.get('format')!r}, expected {FORMAT!r}"
        raise fail(str(path), f"{found}; a recording of another version can be made again by `crowd run`")
    frames = int(attributes["frames"])
    herds, described, first = {}, [], 0
    for name in attributes["herds"]:
        group = root[name]
        assert isinstance(group, zarr.Group)
        count = int(_array(group, "character").shape[0])
        arrays = {n: Stored(_array(root, n), frames, first, count) for n in ROOT if n in root}
        arrays |= {n: Stored(_array(group, n), frames, 0, count) for n in HERD if n in group}
        herd = _herd(name, group, count)
        if "moving_translation" in arrays:
            on_disk, rest = _array(group, "moving_translation"), herd.archetype.skeleton.rest_translation
            arrays["joint_translation"] = StoredTranslations(on_disk, frames, 0, count, herd.moving, rest)
        herds[name] = StoredHerd(arrays)
        described.append(herd)
        first += count
    time = np.asarray(_array(root, "time")[:frames]) if "time" in root else np.zeros(0)
    scene = RecordedScene(tuple(described), _heights(root), list(attributes.get("levels") or []))
    return Recording(path, time, herds, scene, attributes, recorded_water(root))


def _array(group: zarr.Group, name: str) -> zarr.Array:
    found = group[name]
    assert isinstance(found, zarr.Array)
    return found


def _heights(root: zarr.Group) -> Any:
    if f"{GROUND}/height" not in root:
        return lambda x, z: np.zeros(np.broadcast_shapes(np.shape(x), np.shape(z)))
    return grid_heights(*(np.asarray(_array(root, f"{GROUND}/{name}")[...]) for name in ("x", "z", "height")))


def _herd(name: str, group: zarr.Group, count: int) -> RecordedHerd:
    def read(array: str) -> np.ndarray:
        return np.asarray(_array(group, array)[...])

    skeleton = Skeleton(
        tuple(str(joint) for joint in read("joint")),
        tuple(int(parent) for parent in read("parent")),
        read("rest_rotation"),
        read("rest_translation"),
    )
    legs = tuple(
        Leg(str(leg), hip, knee, ankle, ball, (x, y, z), side)
        for leg, (hip, knee, ankle, ball, side), (x, y, z) in zip(
            read("leg"), read("leg_joint").tolist(), read("ball_offset").tolist(), strict=True
        )
    )
    mesh = Mesh(
        read("mesh_vertex"), read("mesh_triangle"), read("mesh_joint"), read("mesh_weight"), read("inverse_bind")
    )
    about: dict[str, Any] = dict(group.attrs)
    archetype = Archetype(
        about["archetype"],
        skeleton,
        mesh,
        legs,
        (),
        (),
        about["pelvis"],
        about["height"],
        about["mass"],
        about["source"],
    )
    motions: tuple[RecordedMotion, ...] = ()
    if "motion" in group:
        tables = (read("motion"), read("motion_velocity"), read("motion_keys"))
        motions = tuple(RecordedMotion(str(motion), *values) for motion, *values in zip(*tables, strict=True))
    moving = tuple(read("moving").tolist())
    return RecordedHerd(name, archetype, count, read("scale"), read("mass"), read("reference_speed"), moving, motions)
