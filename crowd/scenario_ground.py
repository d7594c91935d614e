"""Scenario models of the ground: its kinds, and several levels of them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from crowd.scenario_types import Coordinate, Model, NotNegative, Number, Point, Positive

Height = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e4, le=1e4)]
Angle = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-60, le=60)]
Rise = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-2, le=2)]
Tread = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.05, le=1e4)]
Count = Annotated[int, Field(strict=True, ge=1, le=10_000)]
Cell = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.01, le=1e4)]
MAX_STRETCHES, MAX_WAVES, MAX_LAYERS = 64, 16, 8


class Area(Model):
    """A rectangle seen from above."""

    x: Point
    z: Point


class Surface(Model):
    """What every kind of ground can have."""

    area_m: Area | None = None
    """Only in a layer of `kind: layers`: the rectangle it covers; left out: everywhere."""


class Flat(Surface):
    """Level ground."""

    kind: Literal["flat"]
    height_m: Height = 0.0


class Slope(Surface):
    """A plane through the origin that rises in one direction."""

    kind: Literal["slope"]
    angle_deg: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-45, le=45)]
    """Positive rises along `toward_deg`."""
    toward_deg: Number = 0.0
    """Direction in which the ground rises: 0 = +z, 90 = +x."""
    height_m: Height = 0.0
    """At the world's origin."""


class Ramp(Surface):
    """A beach along +z: level at height 0, down (positive drop) between start and end, level again."""

    kind: Literal["ramp"]
    start_m: Coordinate
    end_m: Coordinate
    drop_m: Height


class Steps(Surface):
    """Stairs along +z: level at height 0 up to `start_m`, then `count` steps (negative rise goes down)."""

    kind: Literal["steps"]
    rise_m: Rise
    tread_m: Tread
    count: Count
    start_m: Coordinate = 0.0


class Stairs(Surface):
    """Stairs in any direction: level up to `start_m`, `count` steps and, after a landing, as many down again."""

    kind: Literal["stairs"]
    count: Count
    rise_m: Rise = 0.17
    """Height of a step; negative goes down first."""
    tread_m: Tread = 0.29
    start_m: Coordinate = 0.0
    """Place of the first riser, from the world's origin along `toward_deg`."""
    toward_deg: Number = 0.0
    """Direction of the walk over it: 0 = +z, 90 = +x."""
    landing_m: NotNegative | None = None
    """Length of the level on top, from the last riser to the first one back; left out: it stays on that level."""
    height_m: Height = 0.0
    """In front of the stairs."""


class Stretch(Model):
    """A straight piece of a profile."""

    length_m: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=1e5)]
    angle_deg: Angle
    """Positive goes up."""


class Slopes(Surface):
    """Stretches of different slope one after the other in one direction; level before and behind them."""

    kind: Literal["slopes"]
    stretches: Annotated[tuple[Stretch, ...], Field(min_length=1, max_length=MAX_STRETCHES)]
    start_m: Coordinate = 0.0
    """Where the first stretch begins, from the world's origin along `toward_deg`."""
    toward_deg: Number = 0.0
    """0 = +z, 90 = +x."""
    height_m: Height = 0.0
    """In front of the first stretch."""


class Wave(Model):
    """One sine wave of the ground."""

    amplitude_m: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1000)]
    wavelength_m: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.1, le=1e5)]
    toward_deg: Number = 0.0
    """Direction across its crests: 0 = +z, 90 = +x."""
    phase_deg: Number = 0.0
    """At the world's origin; 0: a zero, rising."""


class Sines(Surface):
    """Rolling ground: the sum of a few sine waves."""

    kind: Literal["sines"]
    waves: Annotated[tuple[Wave, ...], Field(min_length=1, max_length=MAX_WAVES)]
    height_m: Height = 0.0


class Rubble(Surface):
    """Random heights on a grid, bilinear between; they depend on the scenario's seed alone. Level around it."""

    kind: Literal["rubble"]
    amplitude_m: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=100)] = 0.1
    """Heights lie evenly between minus and plus this."""
    cell_m: Cell = 0.4
    extent_m: tuple[Positive, Positive] = (40.0, 40.0)
    """Size along x and z."""
    center_m: Point = (0.0, 0.0)
    height_m: Height = 0.0


class HeightMap(Surface):
    """Heights from a file, bilinear between samples, level beyond its edges.

    The map is not mirrored: seen from above with +z up the page, the file's first row is at the top (far, +z) and its
    columns run to the right (-x).
    """

    kind: Literal["heightmap"]
    file: str
    """PNG (grey value), NPY (heights in m), ESRI ASCII grid (.asc) or NPZ (`key` names the array).

    `package:NAME/FILE`: a file in an installed Python package.
    """
    cell_m: Positive | tuple[Positive, Positive] | None = None
    """Distance of neighbouring samples, or [along x, along z]; needed unless the file says it (.asc, some .npz)."""
    height_scale_m: Height | None = None
    """PNG: height of white above black. Other files: factor on their heights (1)."""
    datum_m: Height | Literal["center"] = 0.0
    """Height in the file that becomes 0; `center`: the one in the middle of the map."""
    center_m: Point = (0.0, 0.0)
    """Where in the world [x, z] the middle of the map lies."""
    key: str = "elevation"


class Mesh(Surface):
    """Ground from a triangle mesh, sampled from above; several levels where one could walk under it."""

    kind: Literal["mesh"]
    file: str
    """OBJ, PLY, STL, GLB, glTF or OFF; `package:NAME/FILE`: a file in an installed Python package."""
    cell_m: Cell = 0.1
    """Distance of the samples; edges of the mesh become slopes one cell wide."""
    up: Literal["y", "z"] = "y"
    """Axis of the file that points up."""
    scale: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=1e6)] = 1.0
    offset_m: tuple[Coordinate, Height, Coordinate] = (0.0, 0.0, 0.0)
    """Where in the world [x, y, z] the file's origin lies."""
    headroom_m: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.1, le=100)] = 1.5
    """Surfaces with less space above them are no ground (the underside of a deck, what is inside a block)."""


Level = Annotated[
    Flat | Slope | Ramp | Steps | Stairs | Slopes | Sines | Rubble | HeightMap | Mesh, Field(discriminator="kind")
]


class Layers(Surface):
    """Several grounds, one over the other: characters walk on the highest one not far above them."""

    kind: Literal["layers"]
    layers: Annotated[tuple[Level, ...], Field(min_length=1, max_length=MAX_LAYERS)]
    """At least one of them without `area_m`, so that there is ground everywhere."""


Ground = Annotated[
    Flat | Slope | Ramp | Steps | Stairs | Slopes | Sines | Rubble | HeightMap | Mesh | Layers,
    Field(discriminator="kind"),
]
