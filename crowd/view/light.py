"""Sun, sky and shadows of a picture. All colours are linear light; the sun is a parallel lamp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowd.view.zbuffer import rasterize

TO_SUN = np.array([0.52, 0.74, 0.43]) / np.linalg.norm([0.52, 0.74, 0.43])
SUN = np.array([1.02, 0.95, 0.84])
SKY_FILL, GROUND_FILL = np.array([0.40, 0.47, 0.58]), np.array([0.25, 0.23, 0.20])
HORIZON, ZENITH = np.array([0.80, 0.87, 0.93]), np.array([0.30, 0.50, 0.76])
MAP_SIZE = 2048  # texels along the longer side of the shadow map
BIAS = 0.02  # m, keeps a surface from shading itself


def sky(direction: np.ndarray) -> np.ndarray:
    """Sky colour [..., 3] in unit directions [..., 3] (below the horizon: the horizon's colour)."""
    height = np.clip(direction[..., 1:2], 0.0, 1.0) ** 0.6
    return (HORIZON + (ZENITH - HORIZON) * height).astype(np.float32)


def diffuse(normal: np.ndarray, lit: np.ndarray, open_sky: np.ndarray | float = 1.0) -> np.ndarray:
    """Light on a matt surface [..., 3]: sun times Lambert times `lit` (0 in shadow), and light from sky and ground.

    open_sky: share [...] of the sky that reaches the point (below 1 next to a foot on the ground).
    """
    up = 0.5 + 0.5 * normal[..., 1:2]
    lambert = np.clip(normal @ TO_SUN.astype(np.float32), 0.0, 1.0) * lit
    fill = (GROUND_FILL + (SKY_FILL - GROUND_FILL) * up) * np.asarray(open_sky)[..., None]
    return (fill + lambert[..., None] * SUN).astype(np.float32)


@dataclass(frozen=True)
class ShadowMap:
    """Height towards the sun of what the sun sees, on a grid of texels across the light."""

    axes: np.ndarray  # [3, 3] rows: across, along, towards the sun
    corner: np.ndarray  # [2] m, light coordinates of texel (0, 0)
    texel: float  # m
    height: np.ndarray  # [h, w] m above `floor`, 0 where the light passes
    floor: float

    def lit(self, points: np.ndarray) -> np.ndarray:
        """Share of sunlight [...] at world points [..., 3], soft over about two texels; 1 off the map."""
        across, along, towards = self.axes.astype(np.float32)
        column = (points @ across - np.float32(self.corner[0])) / np.float32(self.texel) - np.float32(0.5)
        row = (points @ along - np.float32(self.corner[1])) / np.float32(self.texel) - np.float32(0.5)
        # The empty map holds 0, so anything that lies below its floor still gets the sun through a free texel.
        level = np.maximum(points @ towards + np.float32(BIAS + self.texel - self.floor), 0.0)
        rows, columns = self.height.shape
        column, row = np.clip(column, 1.0, columns - 3.0), np.clip(row, 1.0, rows - 3.0)
        left, top = column.astype(np.int32), row.astype(np.int32)
        u, v = column - left, row - top
        corner = (top - 1) * columns + left - 1
        stored = self.height.reshape(-1)
        total = np.zeros(level.shape, np.float32)
        # The mean over 3 x 3 texels, moved continuously between them.
        for j, share in enumerate((1 - v, None, None, v)):
            line = np.zeros(level.shape, np.float32)
            for i, part in enumerate((1 - u, None, None, u)):
                free = stored[corner + (j * columns + i)] <= level
                line += free if part is None else part * free
            total += line if share is None else share * line
        return total * np.float32(1 / 9)


def shadow_map(corners: np.ndarray) -> ShadowMap:
    """Shadow map of triangles [T, 3, 3] (world corners); at least one triangle."""
    across = np.cross([0.0, 1.0, 0.0], TO_SUN)
    across = across / np.linalg.norm(across)
    axes = np.stack([across, np.cross(TO_SUN, across), TO_SUN])
    coordinates = corners @ axes.T
    low, high = coordinates.min((0, 1)), coordinates.max((0, 1))
    texel = max(float((high - low)[:2].max()) / (MAP_SIZE - 8), 0.008)
    corner = low[:2] - 4 * texel
    size = tuple(int(n) for n in np.ceil((high[:2] - corner) / texel + 4))
    floor = float(low[2]) - 1.0
    seen = rasterize((coordinates[..., :2] - corner) / texel, coordinates[..., 2] - floor, (size[0], size[1]))
    return ShadowMap(axes, corner, texel, seen.nearness, floor)


@dataclass(frozen=True)
class Occlusion:
    """How much of the sky is hidden from the ground by bodies just above it, on a grid."""

    corner: np.ndarray  # [2] m (x, z)
    cell: float  # m
    openness: np.ndarray  # [rows z, columns x]

    def at(self, points: np.ndarray) -> np.ndarray:
        """Share of sky [...] left at world points [..., 3]; 1 off the grid."""
        place = (points[..., [0, 2]] - self.corner.astype(np.float32)) / np.float32(self.cell) - np.float32(0.5)
        base = np.floor(place).astype(np.int32)
        part = place - base
        rows, columns = self.openness.shape
        outside = (base < 0).any(-1) | (base[..., 0] >= columns - 1) | (base[..., 1] >= rows - 1)
        column, row = np.clip(base[..., 0], 0, columns - 2), np.clip(base[..., 1], 0, rows - 2)
        u, v = part[..., 0], part[..., 1]
        grid = self.openness
        value = (grid[row, column] * (1 - u) + grid[row, column + 1] * u) * (1 - v)
        value = value + (grid[row + 1, column] * (1 - u) + grid[row + 1, column + 1] * u) * v
        return np.where(outside, np.float32(1.0), value.astype(np.float32))


def contact_occlusion(points: np.ndarray, above: np.ndarray, area: np.ndarray) -> Occlusion:
    """Soft dark patches under bodies: samples [S, 3] at heights `above` [S] over the ground stand for `area` [S] m2."""
    ground = points[:, [0, 2]]
    low, high = ground.min(0) - 0.6, ground.max(0) + 0.6
    cell = max(float((high - low).max()) / 1200, 0.05)
    columns, rows = (int(n) for n in np.ceil((high - low) / cell) + 1)
    index = ((ground - low) / cell).astype(np.int64)
    weight = area * np.exp(-np.maximum(above, 0.0) / 0.22) / cell**2
    cover = np.bincount(index[:, 1] * columns + index[:, 0], weight, rows * columns).reshape(rows, columns)
    radius = max(round(0.10 / cell), 1)
    for _ in range(3):
        for axis in (0, 1):
            cover = _box(cover, radius, axis)
    return Occlusion(low, cell, (1.0 - 0.75 * (1.0 - np.exp(-1.1 * cover))).astype(np.float32))


def _box(values: np.ndarray, radius: int, axis: int) -> np.ndarray:
    """Running mean over 2 radius + 1 cells, zero outside."""
    pad = [(0, 0), (0, 0)]
    pad[axis] = (radius + 1, radius)
    total = np.cumsum(np.pad(values, pad), axis)
    size = values.shape[axis]
    width = 2 * radius + 1
    return (np.take(total, np.arange(width, width + size), axis) - np.take(total, np.arange(size), axis)) / width
