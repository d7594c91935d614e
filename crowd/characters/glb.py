"""glTF 2.0 containers (.glb, .gltf): chunks, buffers and accessors, every offset checked before it is read.

Source: Khronos glTF 2.0 specification. Anything the file says wrong is an `InputError` that names the file and the
place ("Fox.glb accessor 3").
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from crowd.errors import InputError, Problem, fail

_MAGIC, _JSON_CHUNK, _BIN_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942
_DTYPES: dict[int, np.dtype] = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
_SHAPES: dict[str, tuple[int, int]] = {  # columns, rows
    "SCALAR": (1, 1),
    "VEC2": (1, 2),
    "VEC3": (1, 3),
    "VEC4": (1, 4),
    "MAT2": (2, 2),
    "MAT3": (3, 3),
    "MAT4": (4, 4),
}
_MAX_FILE_BYTES = 1 << 30
_MAX_ACCESSOR_ITEMS = 20_000_000
# Extensions that change nothing about geometry, skins and motion as read here.
_HARMLESS = ("KHR_materials_", "KHR_texture_", "KHR_lights_", "EXT_texture_", "KHR_mesh_quantization", "KHR_xmp")


@dataclass(frozen=True, eq=False)
class Document:
    """A parsed glTF file: its JSON tree and its binary buffers."""

    path: Path
    tree: dict[str, Any]
    buffers: tuple[bytes, ...]
    _checked: dict[str, list[dict[str, Any]]] = field(default_factory=dict, init=False, repr=False)

    def where(self, place: str) -> str:
        """File and place, for messages."""
        return f"{self.path.name} {place}"

    def items(self, kind: str) -> list[dict[str, Any]]:
        """The top-level array `kind` (empty when absent); InputError when it is not an array of objects."""
        if kind not in self._checked:
            self._checked[kind] = objects(self, self.tree, kind, "")
        return self._checked[kind]

    def item(self, kind: str, index: object, place: str) -> dict[str, Any]:
        """Entry `index` of the array `kind`; InputError naming `place` when there is none."""
        found = self.items(kind)
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(found):
            raise fail(self.where(place), f"refers to {kind} {index!r}; the file has {_range(len(found))}")
        return found[index]

    def accessor(self, index: object, place: str, shape: str | None = None) -> np.ndarray:
        """Values [count, components] ([count, 4, 4] for MAT4) of an accessor, normalised integers as floats.

        shape: required accessor type ("VEC3"); place: who asks, for messages. A missing bufferView gives zeros.
        """
        entry = self.item("accessors", index, place)
        where = self.where(f"accessor {index}")
        kind = entry.get("type")
        if not isinstance(kind, str) or kind not in _SHAPES:
            raise fail(where, f"type {kind!r}; allowed: {', '.join(_SHAPES)}")
        if shape is not None and kind != shape:
            raise fail(where, f"type {kind}, but {place} needs {shape}")
        dtype = _component(entry)
        if dtype is None:
            raise fail(where, f"componentType {entry.get('componentType')!r}; allowed: {', '.join(map(str, _DTYPES))}")
        count = integer(self, entry, "count", where, None, 1)
        if count > _MAX_ACCESSOR_ITEMS:
            raise fail(where, f"count {count}; at most {_MAX_ACCESSOR_ITEMS}")
        columns, rows = _SHAPES[kind]
        if "bufferView" in entry:
            values = self._strided(entry["bufferView"], entry, where, count, columns, rows, dtype)
        else:
            values = np.zeros((count, columns * rows), dtype)
        if "sparse" in entry:
            values = self._sparse(values, entry["sparse"], where, columns, rows, dtype)
        if entry.get("normalized") and dtype.kind in "iu":
            values = np.maximum(values.astype(np.float64) / np.iinfo(dtype).max, -1.0)
        if dtype.kind == "f" and not np.all(np.isfinite(values)):
            bad = int(np.flatnonzero(~np.isfinite(values).all(1))[0])
            raise fail(where, f"element {bad} is {values[bad].tolist()} (not finite); used by {place}")
        return values if columns == 1 else values.reshape(count, columns, rows).swapaxes(1, 2)

    def _strided(
        self,
        view_index: object,
        entry: dict[str, Any],
        where: str,
        count: int,
        columns: int,
        rows: int,
        dtype: np.dtype,
    ) -> np.ndarray:
        name = where.removeprefix(f"{self.path.name} ")
        view = self.item("bufferViews", view_index, name)
        view_where = self.where(f"bufferView {view_index}")
        self.item("buffers", view.get("buffer"), f"bufferView {view_index}")
        data = self.buffers[view["buffer"]]
        start = integer(self, view, "byteOffset", view_where, 0, 0)
        length = integer(self, view, "byteLength", view_where, None, 1)
        if start + length > len(data):
            raise fail(
                view_where, f"bytes {start}..{start + length} lie outside buffer {view['buffer']} of {len(data)} bytes"
            )
        # matrix columns of 1 and 2 byte components start at multiples of 4 bytes
        column_bytes = rows * dtype.itemsize if columns == 1 else -(-rows * dtype.itemsize // 4) * 4
        size = column_bytes * columns
        stride = integer(self, view, "byteStride", view_where, size, 1)
        offset = integer(self, entry, "byteOffset", where, 0, 0)
        if stride < size:
            raise fail(view_where, f"byteStride {stride} is less than the {size} bytes of one element of {name}")
        if offset + (count - 1) * stride + size > length:
            raise fail(
                where,
                f"needs bytes {offset}..{offset + (count - 1) * stride + size} of bufferView {view_index}, "
                f"which has {length}",
            )
        raw = np.frombuffer(data, np.uint8, length - offset, start + offset)
        picked = np.lib.stride_tricks.as_strided(
            raw, (count, columns, rows * dtype.itemsize), (stride, column_bytes, 1)
        )
        return np.ascontiguousarray(picked).view(dtype).reshape(count, columns * rows)

    def _sparse(
        self, values: np.ndarray, sparse: object, where: str, columns: int, rows: int, dtype: np.dtype
    ) -> np.ndarray:
        if not isinstance(sparse, dict) or not all(isinstance(sparse.get(k), dict) for k in ("indices", "values")):
            raise fail(where, "sparse must have objects 'indices' and 'values'")
        count = integer(self, sparse, "count", where, None, 1)
        index_type = _component(sparse["indices"])
        if index_type is None or index_type.kind != "u":
            raise fail(
                where, f"sparse indices componentType {sparse['indices'].get('componentType')!r} is not unsigned"
            )
        if count > len(values):
            raise fail(where, f"sparse count {count} exceeds the accessor's {len(values)}")
        picked = self._strided(sparse["indices"].get("bufferView"), sparse["indices"], where, count, 1, 1, index_type)
        picked = picked[:, 0].astype(np.int64)
        if picked.max() >= len(values):
            raise fail(where, f"sparse index {picked.max()} out of range; the accessor has {_range(len(values))}")
        filled = values.copy()
        filled[picked] = self._strided(
            sparse["values"].get("bufferView"), sparse["values"], where, count, columns, rows, dtype
        )
        return filled


def _component(entry: dict[str, Any]) -> np.dtype | None:
    kind = entry.get("componentType")
    return _DTYPES.get(kind) if isinstance(kind, int) else None


def _range(count: int) -> str:
    return f"0..{count - 1}" if count else "none"


def objects(document: Document, entry: dict[str, Any], key: str, place: str) -> list[dict[str, Any]]:
    """Array of objects `entry[key]`, empty when absent."""
    found = entry.get(key, [])
    if not isinstance(found, list) or not all(isinstance(item, dict) for item in found):
        raise fail(document.where(place or key).rstrip(), f"{key} must be an array of objects")
    return found


def integer(document: Document, entry: dict[str, Any], key: str, where: str, default: int | None, minimum: int) -> int:
    """Whole number `entry[key]` of at least `minimum`; `default` None: required."""
    value = entry.get(key, default)
    if not isinstance(value, int) or isinstance(value, bool) or value < minimum:
        raise fail(where, f"{key} is {value!r}; must be a whole number of at least {minimum}")
    return value


def numbers(document: Document, entry: dict[str, Any], key: str, count: int, place: str) -> np.ndarray | None:
    """`count` finite numbers `entry[key]`, or None when absent."""
    if key not in entry:
        return None
    try:
        values = np.asarray(entry[key], np.float64)
    except (TypeError, ValueError):
        values = np.zeros(0)
    if values.shape != (count,) or not np.all(np.isfinite(values)):
        raise fail(document.where(place), f"{key} is {str(entry[key])[:80]}; must be {count} finite numbers")
    return values


def read_document(path: Path) -> Document:
    """Read a .glb or .gltf file with its buffers. External buffers must lie in the folder of the file or below it."""
    data = _read_bytes(path, str(path))
    if not data:
        raise fail(path.name, "the file is empty")
    if len(data) >= 4 and struct.unpack_from("<I", data)[0] == _MAGIC:
        text, binary = _chunks(path, data)
    elif path.suffix.lower() == ".glb":
        raise fail(path.name, f"is not a GLB file: it starts with {data[:4]!r} instead of b'glTF'")
    else:
        text, binary = data, None
    try:
        tree = json.loads(text.decode("utf-8-sig"))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise fail(f"{path.name} JSON", f"cannot be parsed: {error}") from None
    if not isinstance(tree, dict) or not isinstance(tree.get("asset"), dict):
        raise fail(f"{path.name} JSON", "is not a glTF document (no 'asset' object)")
    _check_version(path, tree)
    document = Document(path, tree, ())
    return Document(path, tree, tuple(_buffer(document, i, e, binary) for i, e in enumerate(document.items("buffers"))))


def _read_bytes(path: Path, where: str) -> bytes:
    try:
        if not path.exists():
            raise fail(where, "file not found")
        if not path.is_file():
            raise fail(where, "is not a file")
        if path.stat().st_size > _MAX_FILE_BYTES:
            raise fail(where, f"is larger than {_MAX_FILE_BYTES >> 20} MiB")
        return path.read_bytes()
    except (OSError, ValueError) as error:
        raise fail(where, f"cannot be read: {error}") from None


def _chunks(path: Path, data: bytes) -> tuple[bytes, bytes | None]:
    if len(data) < 20:
        raise fail(path.name, f"truncated GLB: {len(data)} bytes, a header and a JSON chunk need at least 20")
    _, version, length = struct.unpack_from("<III", data)
    if version != 2:
        raise fail(path.name, f"GLB version {version}; only version 2 is supported")
    if length > len(data):
        raise fail(path.name, f"truncated GLB: the header says {length} bytes, the file has {len(data)}")
    chunks: list[tuple[int, bytes]] = []
    offset = 12
    while offset + 8 <= length:
        size, kind = struct.unpack_from("<II", data, offset)
        if offset + 8 + size > length:
            raise fail(path.name, f"truncated GLB: chunk {len(chunks)} of {size} bytes at byte {offset} passes the end")
        chunks.append((kind, data[offset + 8 : offset + 8 + size]))
        offset += 8 + size
    if not chunks or chunks[0][0] != _JSON_CHUNK:
        raise fail(path.name, "the first chunk of the GLB is not JSON")
    binary = next((content for kind, content in chunks[1:] if kind == _BIN_CHUNK), None)
    return chunks[0][1], binary


def _check_version(path: Path, tree: dict[str, Any]) -> None:
    version = str(tree["asset"].get("version"))
    if version.split(".")[0] != "2":
        raise fail(f"{path.name} asset.version", f"is {version!r}; only glTF 2.x is supported")
    required = tree.get("extensionsRequired", [])
    if not isinstance(required, list):
        raise fail(f"{path.name} extensionsRequired", "must be an array of names")
    unsupported = [str(name) for name in required if not str(name).startswith(_HARMLESS)]
    advice = "export the file again without compression and optional extensions"
    if unsupported:
        raise InputError(
            Problem(f"{path.name} extensionsRequired", f"extension {name!r} is not supported; {advice}")
            for name in unsupported
        )


def _buffer(document: Document, index: int, entry: dict[str, Any], binary: bytes | None) -> bytes:
    place = f"buffer {index}"
    where = document.where(place)
    length = integer(document, entry, "byteLength", where, None, 1)
    uri = entry.get("uri")
    if uri is None:
        if index != 0 or binary is None:
            raise fail(where, "has no uri, and the file has no binary chunk for it")
        data = binary
    elif not isinstance(uri, str):
        raise fail(where, f"uri is {uri!r}; must be text")
    elif uri.startswith("data:"):
        data = _data_uri(where, uri)
    else:
        data = _external(document, where, uri)
    if len(data) < length:
        raise fail(where, f"byteLength {length}, but only {len(data)} bytes are there")
    return data[:length]


def _data_uri(where: str, uri: str) -> bytes:
    header, comma, payload = uri.partition(",")
    if not comma or not header.endswith(";base64"):
        raise fail(where, f"data URI {uri[:40]!r} is not base64")
    try:
        return base64.b64decode(payload, validate=True)
    except binascii.Error as error:
        raise fail(where, f"data URI cannot be decoded: {error}") from None


def _external(document: Document, where: str, uri: str) -> bytes:
    if "://" in uri or uri.startswith("//"):
        raise fail(where, f"uri {uri[:80]!r} is not a file beside the asset; remote buffers are not fetched")
    folder = document.path.resolve().parent
    try:
        target = (folder / unquote(uri)).resolve()
    except (OSError, ValueError) as error:
        raise fail(where, f"uri {uri[:80]!r} is not a path: {error}") from None
    if not target.is_relative_to(folder):
        raise fail(where, f"uri {uri[:80]!r} leads outside the asset's folder")
    return _read_bytes(target, f"{where} uri {uri[:80]!r}")
