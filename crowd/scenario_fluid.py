"""Scenario models of fluid that is not level and steady: waves, layers, rivers, turbulence."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from crowd.scenario_ground import Height
from crowd.scenario_types import Model, Name, Number, Point, Positive

Density = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.1, le=25_000)]
Length = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.01, le=1e4)]
Seed = Annotated[int, Field(strict=True, ge=0, lt=2**31)]


class Wave(Model):
    """A train of sine waves on the surface."""

    exactly_one: ClassVar[tuple[str, ...]] = ("wavelength_m", "period_s")

    amplitude_m: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=50)]
    """Half the height from trough to crest."""
    wavelength_m: Length | None = None
    period_s: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.1, le=60)] | None = None
    """In water that does not flow."""
    toward_deg: Number = 0.0
    """Where the waves go: 0 is +z, 90 is +x."""
    phase_deg: Number = 0.0
    """At the origin at time 0; 0 is a crest."""


class Spectrum(Model):
    """Many wave trains of a sea state, drawn when the scenario is loaded."""

    height_m: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=30)]
    """Significant height: four times the standard deviation of the surface."""
    period_s: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.3, le=30)]
    """Period of the peak."""
    toward_deg: Number = 0.0
    """Mean direction: 0 is +z, 90 is +x."""
    spread_deg: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=90)] = 20.0
    """Standard deviation of the directions."""
    components: Annotated[int, Field(strict=True, ge=1, le=256)] = 16
    """Each costs as much as the last."""
    peakedness: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1, le=10)] = 1.0
    """1: Pierson and Moskowitz, a sea that has grown up. 3.3: the mean JONSWAP sea."""
    seed: Seed | None = None
    """Left out: the scenario's."""


class Layer(Model):
    """Fluid under the surface of a region, down to the next layer or the ground."""

    exactly_one: ClassVar[tuple[str, ...]] = ("fluid", "density_kg_m3")

    fluid: Name | None = None
    """A name in the fluids file."""
    density_kg_m3: Density | None = None
    top_m: Height
    """Height of its top in the world."""
    flow_m_s: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    """Velocity of the fluid in the world [x, y, z]."""


class River(Model):
    """Flow that is fastest in the middle and 0 at the banks; it adds to `flow_m_s`."""

    speed_m_s: Number
    """In the middle, at the surface."""
    width_m: Positive
    toward_deg: Number = 0.0
    """Where the river goes: 0 is +z, 90 is +x."""
    through_m: Point = (0.0, 0.0)
    """A point [x, z] of its middle line."""
    profile: Literal["parabolic", "log"] = "parabolic"
    """Across the river: parabolic, or log of the distance to the nearer bank over the roughness."""
    over_depth: Literal["even", "log"] = "even"
    """Down from the surface: even, or log of the height above the ground over the roughness."""
    roughness_m: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1e-5, le=1)] = 0.01
    """Length at which the logarithms begin."""


class Turbulence(Model):
    """Eddies in the ground plane: a sum of random waves of velocity, free of divergence, carried by the flow."""

    exactly_one: ClassVar[tuple[str, ...]] = ("intensity_m_s", "intensity_share")

    intensity_m_s: Positive | None = None
    """Root mean square of each horizontal component."""
    intensity_share: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=2)] | None = None
    """The same over the speed of the flow (flow_m_s and the river's middle together)."""
    length_m: Length = 1.0
    """Typical wavelength; they reach from half to twice this."""
    modes: Annotated[int, Field(strict=True, ge=1, le=256)] = 16
    seed: Seed | None = None
    """Left out: the scenario's."""
