"""Analysed clips kept between runs, by the content of everything they depend on.

A file is named by a hash of the clip, the rig, the feet, the options and the code of the analysis, so that it never
needs to be thrown away by hand. What cannot be read or written is computed again in silence. `CROWD_ANALYSIS_CACHE=0`
turns it off; any other value is the folder to use instead of crowd/motions in the user's cache folder.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import os
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from crowd import posing, resampling
from crowd.analysis.foot import Foot
from crowd.analysis.gait import FINE
from crowd.analysis.motion import Motion, analyse_clip
from crowd.analysis.samples import LegAnalysis, MotionAnalysis
from crowd.analysis.stride import stride_poses
from crowd.cache_folder import user_cache
from crowd.types import Archetype, Clip

SWITCH = "CROWD_ANALYSIS_CACHE"
CLIP_TABLES = ("rotation", "translation")  # taken from the clip again instead of kept


def analysed(
    archetype: Archetype, clip: Clip, feet: Sequence[Foot], *, grounded: bool = False, compat: bool = False
) -> Motion:
    """`analyse_clip`, from the cache where it is there. Raises what that raises."""
    folder = cache_folder()
    if folder is None:
        return analyse_clip(archetype, clip, feet, grounded=grounded, compat=compat)
    path = folder / f"{_key(archetype, clip, feet, grounded, compat)}.npz"
    motion = _read(path, clip)
    if motion is None:
        motion = analyse_clip(archetype, clip, feet, grounded=grounded, compat=compat)
        _write(path, motion)
    return motion


def cache_folder() -> Path | None:
    """Where analysed clips are kept; None when that is turned off."""
    given = os.environ.get(SWITCH)
    return None if given == "0" else Path(given) if given else user_cache("motions")


@functools.cache
def _code() -> bytes:
    """Hash of the analysis' code."""
    files = [*sorted(Path(__file__).parent.glob("*.py")), Path(posing.__file__), Path(resampling.__file__)]
    return hashlib.blake2b(b"".join(file.read_bytes() for file in files)).digest()


def _key(archetype: Archetype, clip: Clip, feet: Sequence[Foot], grounded: bool, compat: bool) -> str:
    skeleton = archetype.skeleton
    told = (
        archetype.source, skeleton.names, skeleton.parents, archetype.legs, clip.name, clip.role, clip.duration,
        clip.cyclic, clip.speed, [(foot.name, foot.length, foot.height) for foot in feet], grounded, compat,
    )  # fmt: skip
    found = hashlib.blake2b(_code() + repr(told).encode(), digest_size=20)
    arrays = [skeleton.rest_rotation, skeleton.rest_translation, clip.rotation, clip.translation]
    for array in (*arrays, *(foot.heel for foot in feet), *(foot.toe_tip for foot in feet)):
        found.update(repr(array.shape).encode() + np.ascontiguousarray(array, float).tobytes())
    return found.hexdigest()


def _packed(value: Any, arrays: list[np.ndarray]) -> Any:
    """The value as JSON: arrays become their shape and are put into `arrays` one after the other."""
    if isinstance(value, np.ndarray):
        arrays.append(np.asarray(value, float).ravel())
        return {"shape": value.shape}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [each.name for each in dataclasses.fields(value) if each.name not in CLIP_TABLES]
        return {"fields": {name: _packed(getattr(value, name), arrays) for name in names}}
    return [_packed(each, arrays) for each in value] if isinstance(value, tuple) else value


def _unpacked(packed: Any, data: np.ndarray, at: list[int]) -> Any:
    """The inverse; dataclasses become the mapping of their fields, tuples stay tuples."""
    if isinstance(packed, dict) and "shape" in packed:
        start, size = at[0], int(np.prod(packed["shape"], dtype=int))
        at[0] += size
        return data[start : start + size].reshape(packed["shape"])
    if isinstance(packed, dict):
        return {name: _unpacked(value, data, at) for name, value in packed["fields"].items()}
    return tuple(_unpacked(each, data, at) for each in packed) if isinstance(packed, list) else packed


def _read(path: Path, clip: Clip) -> Motion | None:
    try:
        with np.load(path, allow_pickle=False) as file:
            fields = _unpacked(json.loads(file["fields"].tobytes()), file["data"], [0])
        told = fields["analysis"]
        told["legs"] = tuple(LegAnalysis(**leg) for leg in told["legs"])
        strides = round(clip.duration / told["duration"])
        poses = stride_poses(clip, strides, FINE) if strides > 1 else (clip.rotation, clip.translation)
        tables = dict(zip(CLIP_TABLES, poses, strict=True))
        return Motion(**{**fields, **tables, "analysis": MotionAnalysis(**told)})
    except (OSError, ValueError, KeyError, TypeError, AttributeError, EOFError, zipfile.BadZipFile):
        return None


def _write(path: Path, motion: Motion) -> None:
    arrays: list[np.ndarray] = []
    fields = np.frombuffer(json.dumps(_packed(motion, arrays)).encode(), np.uint8)
    partial = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as file:
            partial = file.name
            np.savez(file, fields=fields, data=np.concatenate(arrays))
        os.replace(partial, path)  # whole or not at all, whoever else writes
    except OSError:
        if partial is not None and os.path.exists(partial):
            os.unlink(partial)
