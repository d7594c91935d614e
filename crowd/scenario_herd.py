"""Scenario models of who walks: herds, how they are placed, how they vary, and what happens to them."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from crowd.scenario_belt import Belt
from crowd.scenario_control import Distance, Facing, Limits, Route, Trajectories, Waypoints
from crowd.scenario_detail import Detail
from crowd.scenario_responses import Load, Responses
from crowd.scenario_styles import NORMAL, ClipName, Styles
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

    preset: Literal["paper", "measured"] = "paper"
    """paper: waist-deep in water 72 % of the speed is left; measured: as of people, 0.57, 0.43 and 0.39 at 0.35 m, at
    0.90 m and chest-deep."""
    velocity_n_s_m: Positive | None = None
    lateral_n_s_m: Positive | None = None
    damping_kg: NotNegative | None = None
    yaw_inertia_kg_m2: Positive | None = None
    yaw_n_m_rad: Positive | None = None
    yaw_damping_n_m_s: NotNegative | None = None
    pitch_inertia_kg_m2: Positive | None = None
    pitch_n_m_rad: Positive | None = None
    pitch_damping_n_m_s: NotNegative | None = None


Angle = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, lt=180)]
Share = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1)]


class Locomotion(Model):
    """Constants of the semi-procedural gait; lengths left out follow from the length of the legs."""

    min_step_m: NotNegative | None = None
    """Steps shorter than this are not taken: the foot rests (0.2 m for a person)."""
    max_step_s: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.1, le=10)] = 1.5
    """Longest leg cycle."""
    max_step_turn_deg: Angle = 160.0
    """Most that the body turns in a leg cycle; a resting foot steps when its print has turned by half of this."""
    max_step_acceleration_m_s2: Positive | None = None
    """Harder accelerations hurry the steps, up to twice (5 for a person)."""
    max_foot_turn_deg: Angle = 45.0
    """Of a foot against the body."""
    max_adjustment_m: Positive | None = None
    """Of a foot against the clip (0.5 m for a person, more for wide bodies, which turn above their standing feet)."""
    blend_s: NotNegative = 0.2
    """Time over which the weights of clips follow the velocity."""
    hug_across: Share | None = None
    """0: the body stays upright on a cross slope, 1: lies along it (by number of legs: 0, 0, 1 for 2, 4, more)."""
    hug_along: Share | None = None
    """The same up and down slopes (0, 1, 1)."""
    climb_tilt: NotNegative | None = None
    """Lean into climbs."""
    climb_sensitivity_s_m: NotNegative | None = None
    accelerate_tilt: NotNegative | None = None
    """Lean into accelerations."""
    accelerate_sensitivity_s_m: NotNegative | None = None


class Herd(Model):
    """Characters of one archetype."""

    exactly_one: ClassVar[tuple[str, ...]] = ("speed_m_s", "velocity_m_s", "waypoints", "path", "trajectories")
    at_least_one: ClassVar[tuple[tuple[str, ...], ...]] = (("count", "trajectories"), ("place", "path", "trajectories"))

    name: Name
    archetype: Annotated[str, Field(min_length=1, max_length=1000)]
    """human, dog, hexapod, spider, or a .glb, .gltf, .bvh or rig description .yaml (relative to this file)."""
    rig: str | dict[str, Any] | None = None
    """Rig description that overrides detection: a .yaml file or the mapping itself."""
    count: Count = 0
    """Left out with trajectories: as many as the file has."""
    place: Place | None = None
    """Not needed with trajectories, nor along a path with `along: spread`."""
    heading_deg: Number = 0.0
    """0 looks along +z, positive turns left (toward +x); left out: along velocity_m_s, the path or to the
    first way-point."""
    speed_m_s: Speed | None = None
    """Desired speed along the heading."""
    velocity_m_s: tuple[Speed, Speed] | None = None
    """Desired velocity in the world [x, z]."""
    waypoints: Waypoints | None = None
    path: Route | None = None
    """A curve to walk along."""
    trajectories: Trajectories | None = None
    """Ways from a file."""
    facing: Literal["along"] | Facing = "along"
    """along: the way one walks. Otherwise characters look there and step sideways or backwards as they must."""
    limits: Limits = Limits()
    variation: Variation = Variation()
    gains: Gains = Gains()
    locomotion: Locomotion = Locomotion()
    style: Name = NORMAL
    """Way of moving at the start: a style of the character, or of `styles`."""
    styles: Styles = Field(default_factory=dict)
    """Ways of moving beside the character's own: style: {idle: ..., walk: [...], run: [...], step: [...]}."""
    body_density_kg_m3: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=100, le=5000)] = 985.0
    """Mass over volume, for buoyancy; the mesh counts as that large. A person with air in the lungs: 980 to 1000."""
    belt: Flag | Belt = False
    """true: with a belt, a small patch of 2000 triangles at the front, under which medians over triangles lie."""
    arms_up: Flag = True
    """Arms are kept above the surface in deep fluid."""
    load: Load | None = None
    """Something to carry."""
    responses: Responses = Responses()
    detail: Detail | None = None
    """Less work for these characters: fewer triangles, slower steps."""


class Rain(Model):
    """Random impulses on every chosen character, in any direction along the ground: a test of balance."""

    rate_hz: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=100)]
    """Mean number per second and character."""
    impulse_n_s: Positive
    """Mean strength; each has half to one and a half of it."""
    for_s: Positive | None = None
    """Left out: to the end of the run."""


class Event(Model):
    """Something that happens at a time to chosen characters."""

    exactly_one: ClassVar[tuple[str, ...]] = (
        "impulse_n_s", "velocity_m_s", "stop", "style", "clip", "rain", "load",
    )  # fmt: skip

    at_s: NotNegative
    herds: Annotated[tuple[Name, ...], Field(min_length=1)] | None = None
    """Names of herds; left out: all."""
    characters: Literal["all"] | tuple[Annotated[int, Field(strict=True, ge=0)], ...] = "all"
    """Numbers of characters within each herd (from 0)."""
    impulse_n_s: tuple[Number, Number, Number] | None = None
    velocity_m_s: tuple[Speed, Speed] | None = None
    """New desired velocity [x, z] from then on."""
    style: Name | None = None
    """Way of moving from then on; with `herds` left out: of the herds that have it."""
    clip: ClipName | None = None
    """Clip to play over the walking or standing, then back; with `herds` left out: by the herds that have it."""
    rain: Rain | None = None
    """Random impulses from then on."""
    load: Literal["pick_up", "put_down"] | None = None
    """Herds with a load carry it from then on, or no more."""
    fade_s: NotNegative | None = None
    """Cross-fade to the style (left out: 0.3) or to the clip and back (0.1)."""
    hold_s: Positive | None = None
    """How long the clip plays until it fades back; left out: once through."""
    stop: Flag | None = None
    """true: stand from then on, the same as velocity_m_s: [0, 0]."""
    facing_deg: Number | None = None
    """With velocity_m_s or stop: heading to keep from then on; left out: as the herd's `facing` says."""
    frame: Literal["world", "character"] = "world"
    """Axes of the impulse or velocity, and what facing_deg is counted from."""

    @property
    def plays(self) -> bool:
        """Whether it is about what characters play; otherwise it moves them."""
        return self.style is not None or self.clip is not None

    @property
    def moves(self) -> bool:
        """Whether it is one impulse, or a velocity to go at from then on."""
        return not self.plays and self.rain is None and self.load is None

    @property
    def turn(self) -> tuple[float, float] | None:
        """m/s, the velocity asked for; None for an impulse."""
        return (0.0, 0.0) if self.stop else self.velocity_m_s
