"""Arrays of a recording that grow with time, written straight into the files that the Zarr v3 format prescribes.

Zarr makes each array; its blocks are compressed and written here, because its own way costs milliseconds for every
array and a second copy. A block lies on disk as frames leave the device, components before characters: nothing has
to be turned around for writing, and it compresses better. Readers see time x character x component.
"""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numcodecs import Blosc
from zarr.codecs import BloscCodec, TransposeCodec

from crowd.recording_layout import Column

BLOCK_BYTES = 2 << 20  # of one array, uncompressed: a good size for reading a few characters or a few moments
LEVEL = 1  # measured on poses: 2.5 GB/s on a core; zstd is five times slower for a tenth less


class GrowingArray:
    """An empty array [time, *shape] in a group; `span` frames make a block, long ones are cut along the characters too.

    Not thread-safe. What was extended to stays as it is on disk whatever later calls do: files are replaced whole.
    """

    def __init__(self, root: Path, group: zarr.Group, name: str, column: Column, shape: tuple[int, ...], span: int):
        self.shape, self.span = shape, span
        self.dtype = np.dtype(column.dtype).newbyteorder("<")
        self.fill: Any = np.nan if np.issubdtype(column.dtype, np.floating) else 0
        each = int(np.prod(shape[1:], dtype=np.int64)) * self.dtype.itemsize
        first = shape[0] if shape else 0
        self.people = int(np.clip(BLOCK_BYTES // max(span * each, 1), 1, max(first, 1)))
        block = (span, *(max(size, 1) for size in (self.people, *shape[1:])[: len(shape)]))
        array = group.create_array(
            name,
            shape=(0, *shape),
            chunks=block,
            dtype=column.dtype,
            fill_value=self.fill,
            filters=[TransposeCodec(order=_turned(range(len(block))))] if len(shape) > 1 else [],
            compressors=BloscCodec(cname="lz4", clevel=LEVEL, shuffle="shuffle"),
            dimension_names=("time", *column.dims),
            attributes={"units": column.unit, "description": column.description},
        )
        self._folder = root / array.path
        self._about = json.loads((self._folder / "zarr.json").read_text(encoding="utf-8"))
        self._partial: np.ndarray | None = None  # the last block, while it is not full

    def write(self, start: int, values: np.ndarray) -> None:
        """Values [t, *shape] from frame `start` on, where the last ones ended. They are not seen before `extend`."""
        if 0 in self.shape:
            return
        values = values.transpose(_turned(range(values.ndim)))
        done = 0
        while done < len(values):
            block, at = divmod(start + done, self.span)
            count = min(self.span - at, len(values) - done)
            piece = values[done : done + count]
            if count < self.span:
                piece = self._completed(at, piece)
            self._write_block(block, piece)
            done += count

    def extend(self, frames: int) -> None:
        """Show that many frames to readers."""
        self._about["shape"][0] = frames
        stored(self._folder / "zarr.json", json.dumps(self._about).encode())

    def cut(self, frames: int) -> None:
        """The same, and remove blocks beyond, left by a write that broke off."""
        self.extend(frames)
        beyond = -(-frames // self.span)
        for folder in (self._folder / "c").glob("[0-9]*"):
            if int(folder.name) >= beyond:
                shutil.rmtree(folder) if folder.is_dir() else folder.unlink()

    def _completed(self, at: int, piece: np.ndarray) -> np.ndarray:
        """The block that the piece belongs to, from frame `at` of it on; fill values where nothing is yet."""
        if self._partial is None or at == 0:
            self._partial = np.full((self.span, *piece.shape[1:]), self.fill, self.dtype)
        block = self._partial
        block[at : at + len(piece)] = piece
        if at + len(piece) == self.span:
            self._partial = None
        return block

    def _write_block(self, number: int, values: np.ndarray) -> None:
        """Block `number` along time, values [span, ..., character]: a file for every few characters."""
        folder = self._folder / "c" / str(number)
        if not self.shape:
            stored(folder, encoded(values, self.dtype))
            return
        rest = ("0",) * (len(self.shape) - 1)
        for first in range(0, self.shape[0], self.people):
            piece = values[..., first : first + self.people]
            if piece.shape[-1] < self.people:
                whole = np.full((*piece.shape[:-1], self.people), self.fill, self.dtype)
                whole[..., : piece.shape[-1]] = piece
                piece = whole
            stored(folder.joinpath(str(first // self.people), *rest), encoded(piece, self.dtype))


def encoded(values: np.ndarray, dtype: np.dtype) -> bytes:
    """A block as it lies on disk."""
    return Blosc("lz4", LEVEL, Blosc.SHUFFLE).encode(np.ascontiguousarray(values, dtype))


def stored(path: Path, content: bytes) -> None:
    """A file replaced whole or not at all, whatever happens meanwhile."""
    part = path.with_suffix(".partial")
    try:
        try:
            part.write_bytes(content)
        except FileNotFoundError:
            path.parent.mkdir(parents=True, exist_ok=True)
            part.write_bytes(content)
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def _turned(block: Any) -> tuple[int, ...]:
    """(time, character, joint, component) to the order on disk: (time, component, joint, character)."""
    time, *rest = block
    return (time, *reversed(rest))
