"""Scenario models of how a herd is steered: limits, paths, facing, trajectories from files."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from crowd.scenario_types import Flag, Model, NotNegative, Number, Point, Positive

Distance = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=1e4)]
WalkingSpeed = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=15)]
ColumnName = Annotated[str, Field(min_length=1, max_length=200)]


TURN_RATE = 2.1  # rad/s, where the limits say nothing


class Limits(Model):
    """How fast the commanded velocity and heading may change. Per second, whatever the rate of the run."""

    acceleration_m_s2: Positive | None = None
    """Of a speed that grows; left out: at once."""
    deceleration_m_s2: Positive | None = None
    """Of a speed that falls; left out: as acceleration_m_s2."""
    turn_rate_deg_s: Positive | None = None
    """Of the heading; left out: 120."""


def turn_rate(limits: Limits) -> float:
    """rad/s, of headings."""
    return TURN_RATE if limits.turn_rate_deg_s is None else math.radians(limits.turn_rate_deg_s)


class Waypoints(Model):
    """Points to walk to, one after the other, at one speed; then stand, or start again (`loop`)."""

    points_m: Annotated[tuple[Point, ...], Field(min_length=1)]
    speed_m_s: WalkingSpeed
    loop: Flag = False
    keep_formation: Flag = True
    """Every character keeps its offset from the herd's middle; otherwise all walk to the same point."""


class Route(Model):
    """A curve to walk along at one speed: round and round when closed, else to its end, and stand."""

    curve: Literal["spline", "polyline", "circle", "figure_eight"] = "spline"
    """spline: smooth, through every point. polyline: straight between them."""
    points_m: Annotated[tuple[Point, ...], Field(min_length=2, max_length=10_000)] | None = None
    """Of a spline or polyline."""
    center_m: Point = (0.0, 0.0)
    """Of a circle or figure_eight."""
    radius_m: Distance | None = None
    """Of a circle; of a figure_eight half its length, which lies along x."""
    closed: Flag = False
    """The last point leads to the first; circles and figures of eight always do."""
    speed_m_s: WalkingSpeed
    start_m: NotNegative | None = None
    """Way along the curve at which characters join it; left out: nearest to where they start."""
    along: Literal["place", "spread"] = "place"
    """place: they start at their `place`. spread: evenly along the curve, and `place` is not needed."""
    keep_formation: Flag = True
    """Every character keeps its offset from the herd's middle; otherwise all walk on the same line, as when spread."""


class Columns(Model):
    """Names of a file's columns, where they are not the usual ones."""

    id: ColumnName | None = None
    time: ColumnName | None = None
    frame: ColumnName | None = None
    x: ColumnName | None = None
    z: ColumnName | None = None
    heading_deg: ColumnName | None = None


class Trajectories(Model):
    """Recorded or planned ways: where each character is when. They are followed by walking, not played back."""

    file: Annotated[str, Field(min_length=1, max_length=1000)]
    """CSV with a header line (id, t or frame, x, z or y, maybe heading_deg), or text `id frame x y` with # comments."""
    rate_hz: Positive | None = None
    """Frames per second of a `frame` column; left out: the file's comment `framerate: 25`."""
    columns: Columns = Columns()
    ids: Annotated[tuple[int | str, ...], Field(min_length=1)] | None = None
    """Which of the file, in this order; left out: the first `count`."""
    offset_m: Point = (0.0, 0.0)
    """Added to every place."""
    start_s: Number | None = None
    """The file's time at which the run starts; left out: the first there is."""


class Facing(Model):
    """Where characters look while they move elsewhere."""

    exactly_one: ClassVar[tuple[str, ...]] = ("heading_deg", "point_m")

    heading_deg: Number | None = None
    """A fixed heading: 0 looks along +z, positive turns left."""
    point_m: Point | None = None
    """Always toward this point [x, z]."""
