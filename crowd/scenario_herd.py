"""Scenario models of who walks: herds, how they are placed, how they vary, and what happens to them."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from crowd.scenario_types import Flag, Model, Name, NotNegative, Number, Point, Positive

BUILT_IN = ("human", "dog", "hexapod", "spider")
ASSET_SUFFIXES = (".glb", ".gltf", ".bvh", ".yaml", ".yml")
MAX_CHARACTERS = 1_000_000
# Names of arrays at the root of a recording, where each herd has a group of its own name.
_TAKEN = (
    "position velocity yaw pitch desired_velocity phase drag_force drag_torque center_of_pressure drag_power depth "
    "fault scale mass reference_speed time character component herd herd_name"
)
TAKEN_NAMES = frozenset(_TAKEN.split())

Count = Annotated[int, Field(strict=True, ge=1, le=MAX_CHARACTERS)]
Distance = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=1e4)]
Speed = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-15, le=15)]
Factor = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.1, le=10)]


class Grid(Model):
    """Rows along -z from the front, columns along x, centred; the last row may be short."""

    kind: Literal["grid"]
    spacing_m: Distance
    center_m: Point = (0.0, 0.0)
    columns: Annotated[int, Field(strict=True, ge=1)] | None = None
    """Characters side by side; left out: about as many as rows."""


class Disc(Model):
    """Even (sunflower) spread over a disc."""

    kind: Literal["disc"]
    radius_m: Distance
    center_m: Point = (0.0, 0.0)


class PoissonDisc(Model):
    """Random places in a disc, no two nearer than `min_distance_m`."""

    kind: Literal["poisson_disc"]
    radius_m: Distance
    min_distance_m: Distance
    center_m: Point = (0.0, 0.0)


class Places(Model):
    """Every place by hand: as many [x, z] as the herd counts."""

    kind: Literal["list"]
    points_m: Annotated[tuple[Point, ...], Field(min_length=1)]


Place = Annotated[Grid | Disc | PoissonDisc | Places, Field(discriminator="kind")]


class Waypoints(Model):
    """Points to walk to, one after the other, at one speed; then stand, or start again (`loop`)."""

    points_m: Annotated[tuple[Point, ...], Field(min_length=1)]
    speed_m_s: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=15)]
    loop: Flag = False
    keep_formation: Flag = True
    """Every character keeps its offset from the herd's middle; otherwise all walk to the same point."""


class Normal(Model):
    """Normal distribution cut off at min and max (3 sd from the mean when left out)."""

    kind: Literal["normal"]
    mean: Factor = 1.0
    sd: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=3)]
    min: Factor | None = None
    max: Factor | None = None

    @property
    def low(self) -> float:
        """Smallest value drawn."""
        return max(self.mean - 3 * self.sd, 0.1) if self.min is None else self.min

    @property
    def high(self) -> float:
        """Largest value drawn."""
        return self.mean + 3 * self.sd if self.max is None else self.max


class Uniform(Model):
    """Every value between min and max equally likely."""

    kind: Literal["uniform"]
    min: Factor
    max: Factor


class Constant(Model):
    """The same value for all."""

    kind: Literal["constant"]
    value: Factor = 1.0


Distribution = Annotated[Normal | Uniform | Constant, Field(discriminator="kind")]
_SAME = Constant(kind="constant")


class Variation(Model):
    """Factors on the archetype's own height and mass and on the herd's speed, drawn for each character."""

    height: Distribution = _SAME
    mass: Distribution = _SAME
    """On top of the mass that follows from the height (its cube)."""
    speed: Distribution = _SAME


class Gains(Model):
    """Controller gains; those left out follow from the archetype's mass and size."""

    velocity_n_s_m: Positive | None = None
    lateral_n_s_m: Positive | None = None
    damping_kg: NotNegative | None = None
    yaw_inertia_kg_m2: Positive | None = None
    yaw_n_m_rad: Positive | None = None
    yaw_damping_n_m_s: NotNegative | None = None
    pitch_inertia_kg_m2: Positive | None = None
    pitch_n_m_rad: Positive | None = None
    pitch_damping_n_m_s: NotNegative | None = None


class Herd(Model):
    """Characters of one archetype."""

    exactly_one: ClassVar[tuple[str, ...]] = ("speed_m_s", "velocity_m_s", "waypoints")

    name: Name
    archetype: Annotated[str, Field(min_length=1, max_length=1000)]
    """human, dog, hexapod, spider, or a .glb, .gltf, .bvh or rig description .yaml (relative to this file)."""
    rig: str | dict[str, Any] | None = None
    """Rig description that overrides detection: a .yaml file or the mapping itself."""
    count: Count
    place: Place
    heading_deg: Number = 0.0
    """0 looks along +z, positive turns left (toward +x); left out: along velocity_m_s or to the first way-point."""
    speed_m_s: Speed | None = None
    """Desired speed along the heading."""
    velocity_m_s: tuple[Speed, Speed] | None = None
    """Desired velocity in the world [x, z]."""
    waypoints: Waypoints | None = None
    variation: Variation = Variation()
    gains: Gains = Gains()
    arms_up: Flag = True
    """Arms are kept above the surface in deep fluid."""


class Event(Model):
    """Something that happens at a time to chosen characters."""

    exactly_one: ClassVar[tuple[str, ...]] = ("impulse_n_s", "velocity_m_s")

    at_s: NotNegative
    herds: Annotated[tuple[Name, ...], Field(min_length=1)] | None = None
    """Names of herds; left out: all."""
    characters: Literal["all"] | tuple[Annotated[int, Field(strict=True, ge=0)], ...] = "all"
    """Numbers of characters within each herd (from 0)."""
    impulse_n_s: tuple[Number, Number, Number] | None = None
    velocity_m_s: tuple[Speed, Speed] | None = None
    """New desired velocity [x, z] from then on."""
    frame: Literal["world", "character"] = "world"
    """Axes of the impulse or velocity."""
