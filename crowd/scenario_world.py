"""Scenario models of the world: ground shapes, fluid regions and the table of named fluids."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from crowd.scenario_types import Coordinate, Model, Name, NotNegative, Number, Point, Positive, Whole

Height = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e4, le=1e4)]
Density = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.1, le=25_000)]


class Flat(Model):
    """Level ground."""

    kind: Literal["flat"]
    height_m: Height = 0.0


class Slope(Model):
    """A plane through the origin that rises in one direction."""

    kind: Literal["slope"]
    angle_deg: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-45, le=45)]
    """Positive rises along `toward_deg`."""
    toward_deg: Number = 0.0
    """Direction in which the ground rises: 0 = +z, 90 = +x."""


class Ramp(Model):
    """A beach along +z: level at height 0, down (positive drop) between start and end, level again."""

    kind: Literal["ramp"]
    start_m: Coordinate
    end_m: Coordinate
    drop_m: Height


class Steps(Model):
    """Stairs along +z: level at height 0 up to `start_m`, then `count` steps (negative rise goes down)."""

    kind: Literal["steps"]
    rise_m: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-2, le=2)]
    tread_m: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.05, le=1e4)]
    count: Annotated[int, Field(strict=True, ge=1, le=10_000)]
    start_m: Coordinate = 0.0


class HeightMap(Model):
    """Heights from a file, bilinear between samples, level beyond its edges.

    The map is not mirrored: seen from above with +z up the page, the file's first row is at the top (far, +z) and its
    columns run to the right (-x).
    """

    kind: Literal["heightmap"]
    file: str
    """PNG (grey value), NPY (heights in m), ESRI ASCII grid (.asc) or NPZ (`key` names the array)."""
    cell_m: Positive | None = None
    """Distance of neighbouring samples; needed unless the file says it (.asc)."""
    height_scale_m: Height | None = None
    """PNG: height of white above black. Other files: factor on their heights (1)."""
    datum_m: Height | Literal["center"] = 0.0
    """Height in the file that becomes 0; `center`: the one in the middle of the map."""
    center_m: Point = (0.0, 0.0)
    """Where in the world [x, z] the middle of the map lies."""
    key: str = "elevation"


Ground = Annotated[Flat | Slope | Ramp | Steps | HeightMap, Field(discriminator="kind")]


class Area(Model):
    """A rectangle seen from above."""

    x: Point
    z: Point


class FluidRegion(Model):
    """Fluid with a level surface over a rectangle (everywhere when `area_m` is left out)."""

    exactly_one: ClassVar[tuple[str, ...]] = ("fluid", "density_kg_m3")

    fluid: Name | None = None
    """A name in the fluids file."""
    density_kg_m3: Density | None = None
    surface_m: Height
    """Height of the surface in the world."""
    area_m: Area | None = None
    flow_m_s: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    """Velocity of the fluid in the world [x, y, z]."""
    priority: Annotated[int, Field(strict=True, ge=-1000, le=1000)] = 0
    """Where regions overlap the highest priority holds."""


class World(Model):
    """Ground and fluids."""

    ground: Ground = Flat(kind="flat")
    fluids: tuple[FluidRegion, ...] = ()


class Sigmoid(Model):
    """a / (1 + exp(-b (density - c)))."""

    a: NotNegative
    b: Number
    c: Number

    def at(self, density: float) -> float:
        """Value at a density in kg/m3."""
        return self.a / (1.0 + math.exp(min(700.0, -self.b * (density - self.c))))


class Fluid(Model):
    """A named fluid; drag coefficient and offset force follow from the density unless given."""

    density_kg_m3: Density
    drag_coefficient: NotNegative | None = None
    offset_force_n: NotNegative | None = None
    """N per 0.2 m2 of surface facing the flow."""


class FluidTable(Model):
    """Named fluids and how drag depends on density: C_D0 and the offset force B (N per 0.2 m2)."""

    base_drag: Sigmoid
    offset_force_n: Sigmoid
    fluids: Annotated[dict[Name, Fluid], Field(min_length=1)]

    def fluid(self, region: FluidRegion) -> Fluid:
        """The fluid of a region with every constant filled in."""
        known = self.fluids[region.fluid] if region.fluid is not None else None
        density = known.density_kg_m3 if known is not None else region.density_kg_m3
        assert density is not None, "load() checks that a region names a fluid or a density"
        drag = known.drag_coefficient if known is not None else None
        offset = known.offset_force_n if known is not None else None
        return Fluid(
            density_kg_m3=density,
            drag_coefficient=self.base_drag.at(density) if drag is None else drag,
            offset_force_n=self.offset_force_n.at(density) if offset is None else offset,
        )


__all__ = [
    "Area", "Flat", "Fluid", "FluidRegion", "FluidTable", "Ground", "HeightMap",
    "Ramp", "Sigmoid", "Slope", "Steps", "Whole", "World",
]  # fmt: skip
