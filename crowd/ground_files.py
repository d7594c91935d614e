"""Height maps from files: PNG, NPY, ESRI ASCII grid and NPZ. Rows run from far (+z) to near, columns from +x to -x."""

from __future__ import annotations

import math
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from crowd.errors import fail, nearest

MAX_CELLS = 64_000_000
ESRI_NODATA = -9999.0  # the format's own default, where the header does not say
METRES_PER_DEGREE = 111_195.0  # of latitude, on a sphere of 6371 km
_CELL_KEYS = ("dx", "dy", "xmin", "xmax", "ymin", "ymax")
_ESRI_KEYS = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize", "nodata_value")


@dataclass(frozen=True, eq=False)
class HeightFile:
    """Heights as the file has them; NaN where it has none."""

    heights: np.ndarray  # [rows, columns] float64; PNG: 0 (black) to 1 (white)
    cell: float | tuple[float, float] | None = None  # m (along columns, along rows), where the file says it
    note: str = ""  # how the cell was understood
    unsure: str = ""  # why what the file says of its cell is not enough


def read_heights(path: Path, key: str = "elevation") -> HeightFile:
    """Heights of a file by its ending. Raises `InputError` naming the file and what is wrong with it."""
    readers = {".png": _png, ".npy": _npy, ".asc": _ascii_grid}
    suffix = path.suffix.lower()
    if not path.is_file():
        raise fail(str(path), "no such file")
    if suffix == ".npz":
        read = _npz(path, key)
    elif suffix in readers:
        read = readers[suffix](path)
    else:
        raise fail(str(path), f"'{suffix}': must be {', '.join([*readers, '.npz'])}")
    heights = read.heights
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise fail(str(path), f"shape {heights.shape}: must be rows x columns, at least 2 x 2")
    if not np.isfinite(heights).any():
        raise fail(str(path), "no cell has a height")
    return replace(read, heights=np.where(np.isfinite(heights), heights, np.nan))


def _check_size(path: Path, cells: int) -> None:
    if cells > MAX_CELLS:
        raise fail(str(path), f"{cells:,} cells; at most {MAX_CELLS:,} are read")


def _png(path: Path) -> HeightFile:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as image:
            _check_size(path, image.size[0] * image.size[1])
            deep = image.mode.startswith("I")  # 16 bit grey
            grey = np.asarray(image if deep else image.convert("L"), dtype=np.float64)
    except UnidentifiedImageError:
        raise fail(str(path), "is not an image") from None
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise fail(str(path), f"is not a readable PNG ({error})") from None
    return HeightFile(grey / (65535.0 if deep else 255.0))


def _npy(path: Path) -> HeightFile:
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise fail(str(path), f"is not a readable NPY array ({str(error).splitlines()[0]})") from None
    return HeightFile(_numbers(path, array))


def _npz(path: Path, key: str) -> HeightFile:
    try:
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist():
                _check_size(path, member.file_size // 8)
        with np.load(path, allow_pickle=False) as file:
            if key not in file.files:
                raise fail(str(path), f"has no array '{key}'{nearest(key, file.files)}; it has {', '.join(file.files)}")
            heights = _numbers(path, file[key])
            said = {name: float(file[name]) for name in _CELL_KEYS if name in file.files and _is_number(file[name])}
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise fail(str(path), f"is not a readable NPZ archive ({str(error).splitlines()[0]})") from None
    return _with_cell(heights, said)


def _is_number(array: np.ndarray) -> bool:
    return array.size == 1 and array.dtype.kind in "iuf" and bool(np.isfinite(array).all())


def _with_cell(heights: np.ndarray, said: dict[str, float]) -> HeightFile:
    """Heights with the cell that an archive's dx and dy mean: metres, or degrees where its borders show a latitude.

    Degrees: borders within 360 and 90 that are as far apart as the cells are in all, and cells below 0.05. Metres:
    cells of at least half a metre and borders, where there are any, that no degrees can be. Nothing else is guessed.
    """
    if "dx" not in said or "dy" not in said:
        return HeightFile(heights)
    dx, dy = abs(said["dx"]), abs(said["dy"])
    given = f"dx {said['dx']:g} and dy {said['dy']:g}"
    if heights.ndim != 2 or not (dx > 0 and dy > 0):
        return HeightFile(heights, unsure=f"{given}: no size of a cell")
    borders = [name for name in ("xmin", "xmax", "ymin", "ymax") if name in said]
    spans = [abs(said["xmax"] - said["xmin"]) / dx, abs(said["ymax"] - said["ymin"]) / dy] if len(borders) == 4 else []
    rows, columns = heights.shape
    # Borders lie at the outermost samples, or half a cell beyond them.
    if any(abs(span - size + 0.5) > 0.6 for span, size in zip(spans, (columns, rows), strict=False)):
        return HeightFile(heights, unsure=f"{given} do not fit its borders and {columns} x {rows} cells")
    on_globe = all(abs(said[name]) <= (360.0 if name[0] == "x" else 90.0) for name in borders)
    if spans and on_globe and max(dx, dy) < 0.05:
        latitude = math.radians(0.5 * (said["ymin"] + said["ymax"]))
        cell = dx * METRES_PER_DEGREE * math.cos(latitude), dy * METRES_PER_DEGREE
        north = math.degrees(latitude)
        note = f"cells of {dx:.3g} x {dy:.3g} deg at latitude {north:.1f} are {cell[0]:.1f} x {cell[1]:.1f} m"
        return HeightFile(heights, cell, note)
    if min(dx, dy) >= 0.5 and not (spans and on_globe):
        return HeightFile(heights, (dx, dy), f"cells of {dx:g} x {dy:g} m")
    return HeightFile(heights, unsure=f"{given} could be metres or degrees")


def _numbers(path: Path, array: np.ndarray) -> np.ndarray:
    _check_size(path, array.size)
    if not (np.issubdtype(array.dtype, np.floating) or np.issubdtype(array.dtype, np.integer)):
        raise fail(str(path), f"holds {array.dtype}; heights must be real numbers")
    return np.array(array, dtype=np.float64)


def _ascii_grid(path: Path) -> HeightFile:
    """ESRI ASCII grid: a header of `key value` lines, then rows from north to south."""
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except UnicodeDecodeError:
        raise fail(str(path), "is not a text file") from None
    header: dict[str, float] = {}
    for number, line in enumerate(lines, 1):
        words = line.split()
        if not words or words[0][0] in "+-.0123456789":
            break
        name = words[0].lower()
        if name not in _ESRI_KEYS or len(words) != 2:
            raise fail(f"{path}:{number}", f"{line[:60]!r}: must be one of {', '.join(_ESRI_KEYS)} and its value")
        try:
            header[name] = float(words[1])
        except ValueError:
            raise fail(f"{path}:{number}", f"{words[1][:40]!r} is not a number") from None
    for name in ("ncols", "nrows", "cellsize"):
        if not header.get(name, 0.0) > 0.0:
            raise fail(str(path), f"header has no positive '{name}'")
    rows, columns = int(header["nrows"]), int(header["ncols"])
    _check_size(path, rows * columns)
    try:
        values = np.array(" ".join(lines[len(header) :]).split(), dtype=np.float64)
    except ValueError as error:
        raise fail(str(path), f"a height is not a number ({error})") from None
    if values.size != rows * columns:
        raise fail(str(path), f"{values.size} heights; {rows} rows of {columns} need {rows * columns}")
    values[values == header.get("nodata_value", ESRI_NODATA)] = np.nan
    return HeightFile(values.reshape(rows, columns), header["cellsize"])
