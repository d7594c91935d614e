"""The moving water surface in a recording: the group `_water`, at its own modest rate."""

from __future__ import annotations

from typing import Any

import numpy as np
import zarr
from zarr.codecs import BloscCodec

from crowd.types import WaterFrames

GROUP = "_water"  # no herd can have this name
ABOUT = {
    "x": (("x",), "m", "world x of the middles of the cells"),
    "z": (("z",), "m", "world z of the middles of the cells"),
}


class WaterRecorder:
    """Writes the heights of a surface as they come; half precision keeps 0.1 mm of a wave of 0.2 m."""

    def __init__(self, root: zarr.Group, first: WaterFrames):
        self.frames = 0
        self._group = root.create_group(GROUP, overwrite=True)
        self._group.attrs.update({"surface": float(first.surface), "frames": 0})
        for name, (dims, unit, text) in ABOUT.items():
            about: dict[str, Any] = {"units": unit, "description": text}
            self._group.create_array(name, data=getattr(first, name), dimension_names=dims, attributes=about)
        self._time = self._group.create_array(
            "time", shape=(0,), chunks=(4096,), dtype=np.float64, fill_value=np.nan, dimension_names=("time",),
            attributes={"units": "s", "description": "simulated time since the start"},
        )  # fmt: skip
        shape = (len(first.z), len(first.x))
        self._height = self._group.create_array(
            "height", shape=(0, *shape), chunks=(1, *shape), dtype=np.float16, fill_value=np.nan,
            compressors=BloscCodec(cname="zstd", clevel=2, shuffle="bitshuffle"), dimension_names=("time", "z", "x"),
            attributes={"units": "m", "description": "height of the water above its still surface"},
        )  # fmt: skip

    def append(self, water: WaterFrames) -> None:
        """Add the frames of a chunk."""
        end = self.frames + len(water.time)
        self._time.resize((end,))
        self._height.resize((end, *self._height.shape[1:]))
        if end > self.frames:
            self._time[self.frames : end] = water.time
            self._height[self.frames : end] = water.height.astype(np.float16)
        self.frames = end
        self._group.attrs["frames"] = end


def recorded_water(root: zarr.Group) -> WaterFrames | None:
    """The surface of a recording; None for one without. Heights stay on disk until a frame is asked for."""
    if GROUP not in root:
        return None
    group = root[GROUP]
    assert isinstance(group, zarr.Group)
    attributes: dict[str, Any] = dict(group.attrs)
    x, z, time = (np.asarray(group[name][...]) for name in ("x", "z", "time"))  # type: ignore[index]
    return WaterFrames(time[: attributes["frames"]], group["height"], x, z, attributes["surface"])
