"""Scenario model of a water surface that the crowd moves (`world.water`), and what has to hold for it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from pydantic import Field

from crowd.scenario_ground import Area
from crowd.scenario_types import Flag, Model
from crowd.scenario_yaml import KeyPath

WATER_HZ = 10  # no more frames of the surface than this are kept
MOST_CELLS, FEWEST_CELLS = 262_144, 16  # on the whole grid, and along a side
PATH: KeyPath = ("world", "water")


class Water(Model):
    """Waves on the surface of a fluid region: characters make wakes and ripples, and may feel them."""

    region: Annotated[int, Field(strict=True, ge=0)] = 0
    """Number of the region in `world.fluids` whose surface it is."""
    area_m: Area | None = None
    """Rectangle of the grid, within the region; left out: the region's."""
    cell_m: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.02, le=5)] = 0.1
    """Side of a cell; both sides of the area are whole numbers of cells."""
    depth_m: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=1e4)] | None = None
    """Depth that sets how fast waves travel; left out: the mean over the area's wet ground."""
    border_m: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=1e3)] = 2.0
    """Width of the margin in which waves die away."""
    strength: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=10)] = 1.0
    """Factor on the waves that bodies make; 1: as much water as they displace."""
    feedback: Flag = False
    """Characters stand in, and are dragged by, the water as the waves move it."""


def water_problems(water: Water, regions: Mapping[int, Any], count: int) -> Iterator[tuple[KeyPath, str]]:
    """What does not fit. regions: the valid ones of `count` by number."""
    if water.region >= count:
        there = f"regions 0 to {count - 1}" if count else "no fluid; name one under world.fluids"
        yield (*PATH, "region"), f"{water.region}: no fluid there (world.fluids has {there})"
        return
    region = regions.get(water.region)
    if region is None:
        return
    area, path = (water.area_m, "area_m") if water.area_m else (region.area_m, "cell_m")
    if area is None:
        yield PATH, f"area_m is needed: world.fluids[{water.region}] is everywhere, a grid is not"
        return
    yield from _grid(water, area, path)
    for axis in "xz":
        (low, high), outer = getattr(area, axis), getattr(region.area_m, axis, (-1e9, 1e9))
        if low < outer[0] or high > outer[1]:
            yield (
                (*PATH, "area_m", axis),
                f"[{low:g}, {high:g}]: no fluid there (world.fluids[{water.region}]: [{outer[0]:g}, {outer[1]:g}])",
            )
    for index, other in regions.items():
        if index != water.region and other.priority >= region.priority and _meet(area, other.area_m):
            yield (
                (*PATH, "region"),
                f"{water.region}: world.fluids[{index}] lies over a part of its area; choose another area_m",
            )


def _grid(water: Water, area: Area, path: str) -> Iterator[tuple[KeyPath, str]]:
    """Sides that are no whole number of cells, too few or too many of them."""
    counts = []
    for axis in "xz":
        low, high = getattr(area, axis)
        cells = (high - low) / water.cell_m
        if low >= high:
            yield (*PATH, path, axis), f"[{low:g}, {high:g}]: the first must be below the second"
            return
        if abs(cells - round(cells)) > 1e-3:
            fits = (high - low) / max(1, round(cells))
            yield (
                (*PATH, "cell_m"),
                f"{water.cell_m:g}: does not fit into {axis} of {high - low:g} m a whole number of times "
                f"({fits:.4g} would)",
            )
        if cells < FEWEST_CELLS:
            yield (*PATH, "cell_m"), f"{water.cell_m:g}: {cells:.0f} cells along {axis}, at least {FEWEST_CELLS}"
        if 2 * water.border_m >= high - low:
            yield (*PATH, "border_m"), f"{water.border_m:g}: two borders fill {axis} of {high - low:g} m"
        counts.append(cells)
    total = counts[0] * counts[1]
    if total > MOST_CELLS:
        wide = (total / MOST_CELLS) ** 0.5 * water.cell_m
        yield (
            (*PATH, "cell_m"),
            f"{water.cell_m:g}: {total:,.0f} cells, at most {MOST_CELLS:,} (cells of {wide:.3g} m or a smaller area_m)",
        )


def _meet(area: Area, other: Area | None) -> bool:
    """Whether two rectangles have more than an edge in common."""
    if other is None:
        return True
    pairs = ((area.x, other.x), (area.z, other.z))
    return all(max(p[0], q[0]) < min(p[1], q[1]) for p, q in pairs)
