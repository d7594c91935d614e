"""Trajectories of characters from files: CSV with a header line, or columns of text with # comments."""

from __future__ import annotations

import functools
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crowd.errors import fail, nearest
from crowd.scenario_control import Columns

FASTEST = 15.0  # m/s between two samples; anything faster is a mistake in the file
MAX_BYTES = 500_000_000
# Names that a column may go by, lower case, without unit.
NAMES = {
    "id": ("id", "persid", "personid", "person", "pedid", "ped", "agent", "character", "track_id"),
    "time": ("t", "time", "time_s", "t_s", "seconds"),
    "frame": ("frame", "frames", "fr", "frame_id"),
    "x": ("x", "x_m", "pos_x"),
    "z": ("z", "z_m", "pos_z"),
    "y": ("y", "y_m", "pos_y"),
    "heading_deg": ("heading_deg", "heading"),
}
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "s": 1.0, "ms": 0.001, "deg": 1.0, "": 1.0}


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Where one character is when."""

    time: np.ndarray  # [k] s, rising
    place: np.ndarray  # [k, 2] m, the ground coordinates
    heading: np.ndarray | None  # [k] rad


@dataclass(frozen=True)
class _Table:
    """A file's lines with numbers in them, split into columns, and where each column's meaning is."""

    path: Path
    rows: list[list[str]]
    lines: list[int]  # number of each row in the file
    column: dict[str, tuple[int, float]]  # meaning -> column, factor to SI
    rate: float | None  # frames per second


def read_trajectories(path: Path, columns: Columns, rate: float | None) -> dict[str, Trajectory]:
    """Trajectories by id, in the file's order. Raises `InputError` naming the file, the line and what is wrong."""
    try:
        found = path.stat()
    except OSError:
        raise fail(str(path), "no such file") from None
    if found.st_size > MAX_BYTES:
        raise fail(str(path), f"{found.st_size:,} bytes; at most {MAX_BYTES:,} are read")
    return _read(path, found.st_mtime_ns, columns.model_dump_json(), rate)


@functools.lru_cache(maxsize=4)
def _read(path: Path, _changed: int, columns: str, rate: float | None) -> dict[str, Trajectory]:
    """A scenario's check and its scene read the same file: once is enough."""
    table = _table(path, Columns.model_validate_json(columns), rate)
    place = np.stack([_numbers(table, "x"), _numbers(table, "z")], 1)
    time = _numbers(table, "time" if "time" in table.column else "frame")
    time = time if "time" in table.column else time / (table.rate or 1.0)
    heading = np.radians(_numbers(table, "heading_deg")) if "heading_deg" in table.column else None
    rows: dict[str, list[int]] = {}
    for number, row in enumerate(table.rows):
        rows.setdefault(_id(row[table.column["id"][0]]), []).append(number)
    return {name: _one(table, name, np.array(mine), time, place, heading) for name, mine in rows.items()}


def _id(text: str) -> str:
    """The same for 7, 7.0 and "7"."""
    text = text.strip().strip('"')
    return text.removesuffix(".0") if re.fullmatch(r"-?\d+\.0", text) else text


def _one(
    table: _Table, name: str, rows: np.ndarray, time: np.ndarray, place: np.ndarray, heading: np.ndarray | None
) -> Trajectory:
    rows = rows[np.argsort(time[rows], kind="stable")]
    time, place = time[rows], place[rows]
    step = np.diff(time)
    if len(twice := np.flatnonzero(step <= 0)):
        line = table.lines[rows[twice[0] + 1]]
        raise fail(f"{table.path}:{line}", f"id {name} has time {time[twice[0]]:g} s twice; each once is needed")
    way = np.linalg.norm(np.diff(place, axis=0), axis=1)
    if len(far := np.flatnonzero(way > FASTEST * step)):
        at = far[0]
        raise fail(
            f"{table.path}:{table.lines[rows[at + 1]]}",
            f"id {name} jumps {way[at]:.2f} m in {step[at]:.3g} s ({way[at] / step[at]:.0f} m/s); at most "
            f"{FASTEST:g} m/s (are the places in m, and the rate right?)",
        )
    return Trajectory(time, place, None if heading is None else heading[rows])


def _numbers(table: _Table, meaning: str) -> np.ndarray:
    """A column in SI units; the first value that is none is named with its line."""
    column, factor = table.column[meaning]
    try:
        values = np.array([row[column] for row in table.rows], float)
    except ValueError:
        values = np.array([_value(row[column]) for row in table.rows])
    if len(bad := np.flatnonzero(~np.isfinite(values))):
        text = table.rows[bad[0]][column]
        raise fail(f"{table.path}:{table.lines[bad[0]]}", f"{text[:40]!r} ({meaning}) is not a finite number")
    return values * factor


def _value(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def _table(path: Path, columns: Columns, rate: float | None) -> _Table:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError):
        raise fail(str(path), "is not a text file") from None
    comments, rows, lines, header = [], [], [], None
    split = None
    for number, line in enumerate(text.splitlines(), 1):
        bare = line.strip()
        if not bare:
            continue
        if bare[0] == "#":
            comments.append(bare.lstrip("#").strip())
            continue
        if split is None:
            split = next((mark for mark in (",", ";") if mark in bare), None)
        words = [word.strip() for word in bare.split(split)] if split else bare.split()
        if header is None and not rows and all(np.isnan(_value(word)) for word in words):
            header = [word.strip('"') for word in words]
            continue
        width = len(header or (rows[0] if rows else words))
        if len(words) != width:
            raise fail(f"{path}:{number}", f"{len(words)} values; {width} are needed as in the lines before")
        rows.append(words)
        lines.append(number)
    if not rows:
        raise fail(str(path), "has no samples; each line is an id, a time and a place")
    if header is None:
        column = _commented(path, comments, len(rows[0]), split, columns)
    else:
        column = _columns(path, header, columns, plain=False)
    rate = rate if rate is not None else _rate(comments)
    if "time" not in column and rate is None:
        raise fail(str(path), "counts frames; 'rate_hz' is needed (no comment '# framerate: 25' says it)")
    return _Table(path, rows, lines, column, rate)


def _rate(comments: Sequence[str]) -> float | None:
    for comment in comments:
        match = re.search(r"frame ?rate\s*[:=]?\s*(\d+(?:\.\d+)?)", comment, re.IGNORECASE)
        if match and float(match[1]) > 0:
            return float(match[1])
    return None


def _commented(
    path: Path, comments: Sequence[str], width: int, split: str | None, columns: Columns
) -> dict[str, tuple[int, float]]:
    """Columns of a file without a header line: from the last comment that names as many, else id, frame, x, y."""
    for comment in reversed(comments):
        names = [word.strip() for word in comment.split(split)] if split else comment.split()
        if len(names) == width and any(_meaning(name)[0] in NAMES["x"] for name in names):
            return _columns(path, names, columns, plain=True)
    if split or width < 4 or columns != Columns():
        raise fail(str(path), "has no header line; its first line must name the columns: id, t, x, z")
    return {"id": (0, 1.0), "frame": (1, 1.0), "x": (2, 1.0), "z": (3, 1.0)}


def _meaning(name: str) -> tuple[str, float]:
    """Lower-case name without its unit, and the unit's factor ("x/cm" -> "x", 0.01)."""
    match = re.fullmatch(r"(.*?)\s*(?:/|\[|\()\s*(m|cm|mm|s|ms|deg)\s*[\])]?", name.lower())
    return (match[1], UNITS[match[2]]) if match else (name.lower(), 1.0)


def _columns(path: Path, names: Sequence[str], columns: Columns, plain: bool) -> dict[str, tuple[int, float]]:
    """Where each meaning's column is. plain: the file's z, beside x and y, is a height (pedestrian trackers' text)."""
    found: dict[str, tuple[int, float]] = {}
    for meaning, known in NAMES.items():
        given = getattr(columns, meaning, None)
        if given is not None and given not in names:
            raise fail(
                str(path), f"has no column '{given}'{nearest(given, list(names))}; its columns: {', '.join(names)}"
            )
        for index, name in enumerate(names):
            bare, factor = _meaning(name)
            if meaning not in found and (name == given if given is not None else bare in known):
                found[meaning] = (index, factor)
    if "y" in found and columns.z is None:
        if "z" in found and not plain:
            message = "has both y and z; 'columns: {z: z}' or 'columns: {z: y}' says which lies on the ground beside x"
            raise fail(str(path), message)
        found["z"] = found["y"]
    found.pop("y", None)
    missing = [meaning for meaning in ("id", "x", "z") if meaning not in found]
    missing += [] if {"time", "frame"} & found.keys() else ["t"]
    if missing:
        raise fail(
            str(path),
            f"has no column {' and none '.join(repr(name) for name in missing)}; its columns: {', '.join(names)} "
            "(id, t or frame, x, z or y are needed; 'columns' says which is which)",
        )
    return found


def chosen(found: dict[str, Trajectory], ids: Sequence[int | str] | None, where: str) -> list[Trajectory]:
    """The trajectories of `ids`, all without; raises `InputError` for an id that is not there."""
    if ids is None:
        return list(found.values())
    names = [_id(str(name)) for name in ids]
    unknown = [name for name in names if name not in found]
    if unknown:
        known = list(found)
        shown = ", ".join(known[:10]) + (", ..." if len(known) > 10 else "")
        raise fail(where, f"no id {unknown[0]}{nearest(unknown[0], known)}; ids: {shown}")
    return [found[name] for name in names]
