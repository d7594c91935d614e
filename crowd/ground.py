"""Ground of a scenario on the host: one description that the kernels use too, and heights in NumPy.

Shapes are those of `kernels.terrain`: a profile along one axis, or a grid that goes on level beyond its border.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from crowd.errors import fail
from crowd.ground_files import read_heights
from crowd.scenario_check import find_file
from crowd.scenario_world import Flat, HeightMap, Ramp, Slope, Steps
from crowd.scenario_world import Ground as GroundModel

Kind = Literal["flat", "slope", "ramp", "steps", "grid"]


@dataclass(frozen=True, eq=False)
class Ground:
    """Height of the ground over the plane, m.

    parameters: flat (height); slope (tangent); ramp (start, end, drop); steps (start, tread, rise, count); padded to 4.
    """

    kind: Kind
    parameters: np.ndarray  # [4]
    axis: np.ndarray  # [2] unit (x, z): direction along which a profile varies
    grid: np.ndarray | None = None  # [rows, columns] m
    origin: np.ndarray = field(default_factory=lambda: np.zeros(2))  # [2] m, world (x, z) of grid[0, 0]
    cell: np.ndarray = field(default_factory=lambda: np.ones(2))  # [2] m, signed step in x per column and in z per row
    missing: np.ndarray | None = None  # [rows, columns] True where the file has no height (filled with the nearest)
    notes: tuple[str, ...] = ()  # what the user should know


def build_ground(model: GroundModel, folder: Path) -> Ground:
    """The ground a scenario asks for; files are looked for in `folder`. Raises `InputError` for bad files."""
    forward = np.array([0.0, 1.0])
    match model:
        case Flat():
            return Ground("flat", _padded(model.height_m), forward)
        case Slope():
            toward = math.radians(model.toward_deg)
            axis = np.array([math.sin(toward), math.cos(toward)])
            return Ground("slope", _padded(math.tan(math.radians(model.angle_deg))), axis)
        case Ramp():
            return Ground("ramp", _padded(model.start_m, model.end_m, model.drop_m), forward)
        case Steps():
            return Ground("steps", _padded(model.start_m, model.tread_m, model.rise_m, model.count), forward)
        case HeightMap():
            return _height_map(model, folder)


def height(ground: Ground, x: np.ndarray | float, z: np.ndarray | float) -> np.ndarray:
    """Height in m at world points; x and z broadcast."""
    x, z = np.broadcast_arrays(np.asarray(x, dtype=np.float64), np.asarray(z, dtype=np.float64))
    if ground.grid is not None:
        return _bilinear(ground.grid, *_cells(ground, ground.grid, x, z))
    s = x * ground.axis[0] + z * ground.axis[1]
    a, b, c, d = ground.parameters
    match ground.kind:
        case "flat":
            return np.full(s.shape, a)
        case "slope":
            return np.asarray(s * a)
        case "ramp":
            return np.asarray(-c * np.clip((s - a) / (b - a), 0.0, 1.0))
        case _:
            return np.asarray(c * np.clip(np.floor((s - a) / b) + 1.0, 0.0, d))


def refuse_missing(ground: Ground, points: np.ndarray, where: str) -> None:
    """`InputError` when one of the points [n, 2] (x, z) lies where the height map has no height."""
    if ground.missing is None or ground.grid is None:
        return
    u, v = _cells(ground, ground.grid, points[:, 0], points[:, 1])
    on = ground.missing[np.rint(v).astype(int), np.rint(u).astype(int)]
    if on.any():
        x, z = points[np.argmax(on)]
        raise fail(where, f"{on.sum()} characters start where the height map has no height (one at [{x:.1f}, {z:.1f}])")


def _padded(*values: float) -> np.ndarray:
    return np.array([*values, 0.0, 0.0, 0.0])[:4]


def _height_map(model: HeightMap, folder: Path) -> Ground:
    path = find_file(model.file, folder) or folder / model.file
    read = read_heights(path, model.key)
    spacing = model.cell_m if model.cell_m is not None else read.cell
    if spacing is None:
        raise fail(str(path), "does not say how far its samples are apart; world.ground.cell_m is needed")
    notes: list[str] = []
    heights = read.heights
    missing = np.isnan(heights)
    if missing.any():
        from scipy.ndimage import distance_transform_edt

        nearest_cell = distance_transform_edt(missing, return_distances=False, return_indices=True)
        heights = heights[tuple(np.asarray(nearest_cell))]
        notes.append(f"{path.name}: {missing.sum():,} of {missing.size:,} cells have no height; the nearest is used")
    heights = heights * (1.0 if model.height_scale_m is None else model.height_scale_m)
    rows, columns = heights.shape
    datum = model.datum_m
    if datum == "center":
        datum = float(_bilinear(heights, np.array((columns - 1) / 2), np.array((rows - 1) / 2)))
    heights = heights - datum
    if np.abs(heights).max() > 2000.0:
        notes.append(f"{path.name}: heights up to {np.abs(heights).max():.0f} m; datum_m: center keeps more digits")
    center_x, center_z = model.center_m
    origin = np.array([center_x + (columns - 1) / 2 * spacing, center_z + (rows - 1) / 2 * spacing])
    return Ground(
        kind="grid",
        parameters=np.zeros(4),
        axis=np.array([0.0, 1.0]),
        grid=heights,
        origin=origin,
        cell=np.array([-spacing, -spacing]),
        missing=missing if missing.any() else None,
        notes=tuple(notes),
    )


def _cells(ground: Ground, grid: np.ndarray, x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Column and row of points, fractional, kept inside the grid."""
    rows, columns = grid.shape
    u = np.clip((x - ground.origin[0]) / ground.cell[0], 0.0, columns - 1.0)
    v = np.clip((z - ground.origin[1]) / ground.cell[1], 0.0, rows - 1.0)
    return u, v


def _bilinear(grid: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    rows, columns = grid.shape
    i = np.clip(np.floor(u).astype(int), 0, columns - 2)
    j = np.clip(np.floor(v).astype(int), 0, rows - 2)
    a, b = u - i, v - j
    near = grid[j, i] * (1 - a) + grid[j, i + 1] * a
    return np.asarray(near * (1 - b) + (grid[j + 1, i] * (1 - a) + grid[j + 1, i + 1] * a) * b)
