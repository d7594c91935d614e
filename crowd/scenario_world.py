"""Scenario models of the world: ground, fluid regions and the table of named fluids."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

from pydantic import Field

from crowd.scenario_fluid import Density, Layer, River, Spectrum, Turbulence, Wave
from crowd.scenario_ground import Area, Flat, Ground, Height
from crowd.scenario_types import Flag, Model, Name, NotNegative, Number, Positive
from crowd.scenario_water import Water


class FluidRegion(Model):
    """Fluid over a rectangle (everywhere when `area_m` is left out), level and steady unless more is said."""

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
    layers: Annotated[tuple[Layer, ...], Field(max_length=8)] = ()
    """Other fluids below, from the top down."""
    waves: Annotated[tuple[Wave, ...], Field(max_length=64)] = ()
    """Trains of waves on the surface."""
    spectrum: Spectrum | None = None
    """A sea state, in addition."""
    wave_depth_m: Positive | None = None
    """Depth of the water for the waves; left out: the mean depth over the region where it is wet."""
    river: River | None = None
    turbulence: Turbulence | None = None
    surface_tension_n_m: NotNegative = 0.0
    """Holds up characters smaller than 0.1 m along their waterline, with `buoyancy`; 0.073 for clean water."""


class World(Model):
    """Ground and fluids."""

    ground: Ground = Flat(kind="flat")
    max_slope_deg: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, lt=90)] = 60.0
    """Feet are laid onto ground up to this steep."""
    max_step_height_m: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=100)] = 1.0
    """Ground further above or below a character is out of its feet's reach; it also tells levels apart."""
    fluids: tuple[FluidRegion, ...] = ()
    buoyancy: Flag = False
    """Record the share of its weight that each character's feet carry."""
    water: Water | None = None
    """Waves that characters make on the surface of a region; left out: surfaces stay level."""


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
    """N per 0.2 m2 of surface facing the flow; with `drag.b_mode: paper` N per triangle."""


class FluidTable(Model):
    """Named fluids and how drag depends on density: C_D0 and the offset force B (N per 0.2 m2)."""

    base_drag: Sigmoid
    offset_force_n: Sigmoid
    fluids: Annotated[dict[Name, Fluid], Field(min_length=1)]

    def fluid(self, region: FluidRegion | Layer) -> Fluid:
        """The fluid of a region or layer with every constant filled in."""
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
