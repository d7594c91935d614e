"""The grid of a moving water surface on the host: where it lies, how deep the water is, where waves die ashore."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from crowd.errors import fail
from crowd.ground import Ground, height

GRAVITY = 9.81
SHALLOW = 0.2  # m: waves die where the water is shallower
LOSS = 9.0  # of amplitude across a border, times the fastest wave's time to cross it


@dataclass(frozen=True, eq=False)
class WaterGrid:
    """Fields are [rows along z, columns along x]."""

    x: np.ndarray  # [columns] m, middles of the cells
    z: np.ndarray  # [rows] m
    cell: float  # m
    surface: float  # m, world, when still
    depth: float  # m
    current: tuple[float, float]  # m/s (x, z)
    border: float  # m
    strength: float
    feedback: bool
    shore: np.ndarray  # [rows, columns] 0 in open water, 1 on dry ground

    @property
    def rate(self) -> float:
        """1/s, greatest loss: even the fastest wave dies in the border."""
        return LOSS * math.sqrt(GRAVITY * self.depth) / self.border


def water_grid(world: Any, terrain: Ground, where: str) -> WaterGrid | None:
    """The grid a scenario's world asks for; None without `world.water`. `InputError` where the ground is dry."""
    water = world.water
    if water is None:
        return None
    region = world.fluids[water.region]
    area = water.area_m or region.area_m
    x, z = (_middles(low, high, water.cell_m) for low, high in (area.x, area.z))
    deep = region.surface_m - height(terrain, x[None, :], z[:, None])
    wet = deep > 0.0
    if not wet.any():
        raise fail(where, f"no fluid there: the ground lies above surface_m {region.surface_m:g} in the whole area")
    return WaterGrid(
        x=x,
        z=z,
        cell=water.cell_m,
        surface=region.surface_m,
        depth=float(deep[wet].mean()) if water.depth_m is None else water.depth_m,
        current=(region.flow_m_s[0], region.flow_m_s[2]),
        border=water.border_m,
        strength=water.strength,
        feedback=water.feedback,
        shore=np.broadcast_to(np.clip(1.0 - deep / SHALLOW, 0.0, 1.0) ** 2, (len(z), len(x))),
    )


def _middles(low: float, high: float, cell: float) -> np.ndarray:
    return low + cell * (0.5 + np.arange(round((high - low) / cell)))
