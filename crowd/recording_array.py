"""Arrays of a recording that grow with time, written straight into the files that the Zarr v3 format prescribes.

Zarr makes each array; its blocks are compressed and written here, because its own way costs milliseconds for every
array and a second copy. A block lies on disk as frames leave the device, components before characters: nothing has
to be turned around for writing, and it compresses better. Readers see time x character x component.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numcodecs import Blosc
from zarr.codecs import BloscCodec, TransposeCodec

from crowd.recording_layout import Column

BLOCK_BYTES = 2 << 20  # of one array, uncompressed: a good size for reading a few characters or a few moments
TILE = 128  # characters: a block has some tiles, so that one that came from a CPU can be compressed as it is
METADATA = "zarr.json"
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
        self.people = min(max(BLOCK_BYTES // max(span * each, 1) // TILE, 1) * TILE, max(first, 1))
        block = (span, *(max(size, 1) for size in (self.people, *shape[1:])[: len(shape)]))
        array = group.create_array(
            name,
            shape=(0, *shape),
            chunks=block,
            dtype=column.dtype,
            fill_value=self.fill,
            filters=[TransposeCodec(order=_turned(range(len(block))))] if len(shape) > 1 else [],
            compressors=BloscCodec(cname="lz4", clevel=LEVEL, shuffle="shuffle"),
            chunk_key_encoding={"name": "default", "separator": "."},  # "/" would make folders of one file
            dimension_names=("time", *column.dims),
            attributes={"units": column.unit, "description": column.description},
        )
        self._folder = root / array.path
        self._about = json.loads((self._folder / METADATA).read_text(encoding="utf-8"))
        self._room = len(json.dumps(self._about)) + len(str(2**63))
        stored(self._folder / METADATA, self._metadata(0))
        self._partial: np.ndarray | None = None  # the last block that came in pieces

    def write(self, start: int, parts: Sequence[np.ndarray]) -> None:
        """Values [t, *shape] from frame `start` on, where the last ones ended. They are not seen before `extend`.

        parts: of the characters, one after the other. A part that is a block as it is gets compressed where it lies.
        """
        if 0 in self.shape:
            return
        parts = [part.transpose(_turned(range(part.ndim))) for part in parts]
        done, frames = 0, len(parts[0])
        while done < frames:
            block, at = divmod(start + done, self.span)
            count = min(self.span - at, frames - done)
            pieces = [part[done : done + count] for part in parts]
            if count < self.span:
                pieces = [self._completed(at, _joined(pieces))]
            self._write_block(block, pieces)
            done += count

    def extend(self, frames: int) -> None:
        """Show that many frames to readers."""
        # One write over as many bytes: replacing the file would make some file systems wait for the disk every time.
        with (self._folder / METADATA).open("r+b", buffering=0) as file:
            file.write(self._metadata(frames))

    def cut(self, frames: int) -> None:
        """The same, and remove blocks beyond, left by a write that broke off."""
        self.extend(frames)
        beyond = -(-frames // self.span)
        for path in self._folder.glob("c.*"):
            if int(path.name.split(".")[1]) >= beyond:
                path.unlink()

    def _metadata(self, frames: int) -> bytes:
        """Of the array with that many frames; always of the same length."""
        self._about["shape"][0] = frames
        return json.dumps(self._about).ljust(self._room).encode()

    def _completed(self, at: int, piece: np.ndarray) -> np.ndarray:
        """The block that the piece belongs to, from frame `at` of it on; fill values where nothing is yet."""
        if self._partial is None or at == 0:
            self._partial = np.full((self.span, *piece.shape[1:]), self.fill, self.dtype)
        block = self._partial
        block[at : at + len(piece)] = piece
        return block

    def _write_block(self, number: int, parts: Sequence[np.ndarray]) -> None:
        """Block `number` along time, parts [span, ..., characters]: a file for every few characters."""
        name = f"c.{number}"
        if not self.shape:
            stored(self._folder / name, encoded(_joined(parts), self.dtype))
            return
        rest = ".0" * (len(self.shape) - 1)
        for first in range(0, self.shape[0], self.people):
            piece = _cut(parts, first, first + self.people)
            if piece.shape[-1] < self.people:
                whole = np.full((*piece.shape[:-1], self.people), self.fill, self.dtype)
                whole[..., : piece.shape[-1]] = piece
                piece = whole
            stored(self._folder / f"{name}.{first // self.people}{rest}", encoded(piece, self.dtype))


def _cut(parts: Sequence[np.ndarray], first: int, end: int) -> np.ndarray:
    """Characters `first` to `end` of parts [..., characters]; of one part no copy."""
    ends = np.cumsum([part.shape[-1] for part in parts])
    chosen = []
    for part, after in zip(parts, ends.tolist(), strict=True):
        before = after - part.shape[-1]
        if first < after and before < end:
            chosen.append(part[..., max(first - before, 0) : end - before])
    return _joined(chosen)


def _joined(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Parts [..., characters] as one array; of one part no copy."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts, -1)


def encoded(values: np.ndarray, dtype: np.dtype) -> bytes:
    """A block as it lies on disk."""
    return Blosc("lz4", LEVEL, Blosc.SHUFFLE).encode(np.ascontiguousarray(values, dtype))


def stored(path: Path, content: bytes) -> None:
    """A file replaced whole or not at all, whatever happens meanwhile."""
    part = path.with_name(f"{path.name}.partial")
    try:
        part.write_bytes(content)
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def _turned(block: Any) -> tuple[int, ...]:
    """(time, character, joint, component) to the order on disk: (time, component, joint, character)."""
    time, *rest = block
    return (time, *reversed(rest))
