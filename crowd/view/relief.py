"""A water surface that is not level: heights and slopes between the samples of a grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowd.types import WaterFrames

F32 = np.float32


@dataclass(frozen=True, eq=False)
class Relief:
    """Height [m] over the still surface and its slopes along x and z, on cells [rows, columns]; 0 off the grid."""

    low: tuple[float, float]  # m (x, z), middle of the first cell
    cell: float  # m
    fields: np.ndarray  # [3, rows, columns]

    @property
    def highest(self) -> float:
        """m over the still surface."""
        return float(np.abs(self.fields[0]).max(initial=0.0))

    @staticmethod
    def of(x: np.ndarray, z: np.ndarray, height: np.ndarray) -> Relief:
        """The relief of heights [rows, columns] at x [columns] and z [rows]."""
        cell = float(x[1] - x[0])
        level = np.asarray(height, F32)
        by_z, by_x = np.gradient(level, cell)
        return Relief((float(x[0]), float(z[0])), cell, np.stack([level, by_x, by_z]).astype(F32))

    def at(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        """[3, P] height and slopes at points x, z [P], bilinear."""
        _, rows, columns = self.fields.shape
        u, v = (x - F32(self.low[0])) / F32(self.cell), (z - F32(self.low[1])) / F32(self.cell)
        inside = (u >= 0) & (u <= columns - 1) & (v >= 0) & (v <= rows - 1)
        u, v = np.clip(np.nan_to_num(u), 0, columns - 1), np.clip(np.nan_to_num(v), 0, rows - 1)
        i, j = np.minimum(u.astype(int), columns - 2), np.minimum(v.astype(int), rows - 2)
        s, t = (u - i).astype(F32), (v - j).astype(F32)
        near = self.fields[:, j, i] * (1 - s) + self.fields[:, j, i + 1] * s
        far = self.fields[:, j + 1, i] * (1 - s) + self.fields[:, j + 1, i + 1] * s
        return np.where(inside, near * (1 - t) + far * t, F32(0.0))


def relief_at(water: WaterFrames, time: float) -> Relief:
    """The surface at a moment in s: between two kept frames their mixture."""
    after = int(np.clip(np.searchsorted(water.time, time), 0, len(water.time) - 1))
    before = max(after - 1, 0)
    span = water.time[after] - water.time[before]
    share = float(np.clip((time - water.time[before]) / span, 0.0, 1.0)) if span > 0 else 1.0
    first, last = (np.asarray(water.height[frame], F32) for frame in (before, after))
    return Relief.of(water.x, water.z, first * F32(1 - share) + last * F32(share))
