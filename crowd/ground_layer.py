"""One level of the ground on the host: what the kernels use too, and its heights in NumPy."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

Kind = Literal["flat", "slope", "ramp", "steps", "stretches", "sines", "grid"]
FORWARD = np.array([0.0, 1.0])
F32 = np.float32


@dataclass(frozen=True, eq=False)
class Layer:
    """Height of one level over the plane, m.

    parameters: as `kernels.terrain` has them: flat (height); slope (tangent); ramp (start, end, drop); steps (start,
    tread, rise, count[, back]); stretches (start, length, tangent) each; sines [4, w].
    """

    kind: Kind
    parameters: np.ndarray
    axis: np.ndarray = field(default_factory=FORWARD.copy)  # [2] unit (x, z): direction along which a profile varies
    base: float = 0.0  # m, added to profiles and waves (not to flat ground, which is its height)
    grid: np.ndarray | None = None  # [rows, columns] m
    gap: float | None = (
        None  # m: cells whose posts differ by more, and all beyond the grid, are no ground; None: all are
    )
    origin: np.ndarray = field(default_factory=lambda: np.zeros(2))  # [2] m, world (x, z) of grid[0, 0]
    cell: np.ndarray = field(default_factory=lambda: np.ones(2))  # [2] m, signed step in x per column and in z per row
    missing: np.ndarray | None = None  # [rows, columns] True where the file has no height (filled with the nearest)
    area: tuple[np.ndarray, np.ndarray] | None = None  # low and high corner (x, z) of what it covers; None: everywhere
    source: str = ""  # name of its file

    @property
    def post(self) -> tuple[int, int]:
        """Row and column of the post nearest to the world's origin: places counted from it keep their digits."""
        if self.grid is None:
            return 0, 0
        rows, columns = self.grid.shape
        column, row = np.rint(-self.origin / self.cell)
        return int(np.clip(row, 0, rows - 1)), int(np.clip(column, 0, columns - 1))

    @property
    def everywhere(self) -> bool:
        """Whether there is ground of this layer at every place."""
        return self.area is None and self.gap is None


def heights(layer: Layer, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Height in m at world points of one shape, wherever the layer is."""
    if layer.grid is not None:
        return _bilinear(layer.grid, *cells(layer, x, z))
    values = layer.parameters
    if layer.kind == "sines":
        cycles = x[..., None] * values[1] + z[..., None] * values[2] + values[3]
        return layer.base + np.asarray((values[0] * np.sin(2 * np.pi * cycles)).sum(-1))
    if layer.kind == "steps":
        return layer.base + _steps(values.astype(F32), _along(layer, x.astype(F32), z.astype(F32)))
    s = _along(layer, x, z)
    if layer.kind == "flat":
        return np.full(s.shape, values[0])
    if layer.kind == "slope":
        return layer.base + s * values[0]
    if layer.kind == "ramp":
        start, end, drop = values
        return layer.base - drop * np.clip((s - start) / (end - start), 0.0, 1.0)
    start, length, tangent = values.reshape(-1, 3).T
    return layer.base + np.asarray((tangent * np.clip(s[..., None] - start, 0.0, length)).sum(-1))


def there(layer: Layer, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Where the layer exists at world points: in its rectangle and off its gaps."""
    found = np.ones(x.shape, bool)
    if layer.area is not None:
        (x0, z0), (x1, z1) = (corner.astype(F32) for corner in layer.area)
        x, z = x.astype(F32), z.astype(F32)
        found = (x >= x0) & (x <= x1) & (z >= z0) & (z <= z1)
    if layer.grid is not None and layer.gap is not None:
        u, v = cells(layer, x, z)
        found &= whole_cells(layer.grid, layer.gap)[_corner(layer.grid, u, v)]
        found &= (u == (x - layer.origin[0]) / layer.cell[0]) & (v == (z - layer.origin[1]) / layer.cell[1])
    return found


def whole_cells(grid: np.ndarray, gap: float) -> np.ndarray:
    """[rows - 1, columns - 1] which cells are ground, not the jump from one level to another."""
    corners = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, :-1], grid[1:, 1:]])
    return np.ptp(corners, axis=0) < gap


def cells(layer: Layer, x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Column and row of points, fractional, kept inside the grid."""
    assert layer.grid is not None
    rows, columns = layer.grid.shape
    u = np.clip((x - layer.origin[0]) / layer.cell[0], 0.0, columns - 1.0)
    v = np.clip((z - layer.origin[1]) / layer.cell[1], 0.0, rows - 1.0)
    return u, v


def _along(layer: Layer, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    axis = layer.axis.astype(x.dtype)
    return np.asarray(x * axis[0] + z * axis[1])


def _steps(values: np.ndarray, s: np.ndarray) -> np.ndarray:
    """In single precision, as the kernel: at an edge both are on the same step."""
    start, tread, rise, count = values[:4]
    step = np.clip(np.floor((s - start) / tread) + F32(1), 0, count)
    if len(values) > 4:
        step = step - np.clip(np.floor((s - values[4]) / tread) + F32(1), 0, count)
    return np.asarray(step * rise, float)


def _corner(grid: np.ndarray, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of the first post of the cells at column u and row v."""
    rows, columns = grid.shape
    return np.clip(np.floor(v).astype(int), 0, rows - 2), np.clip(np.floor(u).astype(int), 0, columns - 2)


def _bilinear(grid: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    j, i = _corner(grid, u, v)
    a, b = u - i, v - j
    near = grid[j, i] * (1 - a) + grid[j, i + 1] * a
    return np.asarray(near * (1 - b) + (grid[j + 1, i] * (1 - a) + grid[j + 1, i + 1] * a) * b)
