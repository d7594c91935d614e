"""Scenario models of how a herd's bodies respond: to a load, to resistance, with their arms, and how soon."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from crowd.scenario_types import Flag, Model, NotNegative, Positive
from crowd.scenario_yaml import KeyPath

if TYPE_CHECKING:
    from crowd.scenario_herd import Event, Herd

Ratio = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=1.5)]
Delay = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.02, le=5)]
Band = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.05, le=2)]
Seconds = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.1, le=1e6)]


class Load(Model):
    """Something that every character of the herd carries: a rucksack, a basket on the head, a child on the arm."""

    mass_kg: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=1e4)]
    height_m: Positive | None = None
    """Of its middle above the ground, of a character of the archetype's own size that stands upright."""
    height_share: Ratio | None = None
    """The same as a share of the stature; both left out: 0.72, between the shoulder blades."""
    behind_m: NotNegative | None = None
    """Of its middle behind the hips, at the archetype's own size."""
    forward_m: NotNegative | None = None
    """The same ahead of the hips; both left out: right above them."""
    carried: Flag = True
    """From the start; otherwise from the first event `load: pick_up` on."""


class Transitions(Model):
    """Who is held back too much gives up jogging, then walking; speeds are of a person's size (1.7 m)."""

    walk_below_m_s: Positive = 1.11
    """A jog that the fluid would slow to less than this falls to a walk (people in water change at 1.11)."""
    stop_below_m_s: Positive = 0.3
    """A walk that it would slow to less than this, or to less than half of what is asked for, ends: one rests."""
    hysteresis: Band = 0.25
    """Share above these speeds at which jogging and walking are taken up again."""
    react_s: Delay = 1.0
    """Time constant with which the resistance is felt."""
    rest_s: Seconds = 6.0
    """How long one rests before trying again where nothing has changed; large: who stopped stays."""


class ArmResponse(Model):
    """How arms are kept above the surface: late, slowly, and only as far as joints go."""

    hysteresis_m: NotNegative = 0.12
    """Raised arms come down only when the surface is this much lower than where they went up (for a person's size)."""
    time_s: Delay = 0.3
    """Time constant of going up and coming down."""
    least_elbow_deg: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=10, le=90)] = 35.0
    """Angle of the elbow when bent most; 180 is straight."""
    most_elbow_deg: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=120, le=178)] = 168.0
    """The same when stretched most."""
    back_deg: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=80)] = 20.0
    """How far behind the plane of the shoulders a raised hand may be."""


class HighStep(Model):
    """Feet are lifted out of shallow water; lengths are of a person's size (1.7 m)."""

    clearance_m: NotNegative = 0.05
    """Of the sole above the surface in the middle of the swing."""
    to_depth_m: Positive = 0.32
    """In deeper water they stay under (fading out over half of it again)."""


class LegClearance(Model):
    """Legs keep out of each other's way: no step crosses the other foot, no swing goes through it."""

    gap_share: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=1)] = 0.6
    """Of the distance at which the two feet stand at rest (and at most of 0.7 foot lengths): how near they come."""


class Responses(Model):
    """Responses of the body beyond those that every character has; what is left out is not in the program."""

    transitions: Transitions | None = None
    """Fall from jogging to walking and from walking to resting where the fluid resists too much."""
    reaction_s: Delay | None = None
    """Time constant with which steps follow the body's speed; left out: 0.35 (footsteps) or 0.1 (semi_procedural)."""
    high_step: HighStep | None = None
    """Feet are lifted out of shallow water."""
    leg_clearance: LegClearance | None = None
    """Legs keep out of each other's way."""
    arms: ArmResponse | None = None
    """Limits, hysteresis and slowness of the arms that are kept above the surface."""


Found = Iterator[tuple[KeyPath, str]]


def response_problems(herds: Mapping[int, Herd], events: Mapping[int, Event]) -> Found:
    """Problems of loads, responses and of events that need them, by key path."""
    for index, herd in herds.items():
        load, path = herd.load, ("herds", index)
        for one, other in (("height_m", "height_share"), ("behind_m", "forward_m")) if load is not None else ():
            value = getattr(load, other)
            if getattr(load, one) is not None and value is not None:
                yield (*path, "load", other), f"{value:g}: '{one}' says where already; give one of them"
        change = herd.responses.transitions
        if change is not None and change.stop_below_m_s >= change.walk_below_m_s:
            text = f"{change.stop_below_m_s:g}: must be below walk_below_m_s {change.walk_below_m_s:g}"
            yield (*path, "responses", "transitions", "stop_below_m_s"), text
        if herd.responses.arms is not None and not herd.arms_up:
            yield (*path, "responses", "arms"), "arms of this herd stay down (arms_up: false); leave one of the two out"
    for index, event in events.items():
        meant = [herd for herd in herds.values() if event.herds is None or herd.name in event.herds]
        if event.load is not None and meant and all(herd.load is None for herd in meant):
            names = ", ".join(herd.name for herd in meant)
            yield ("events", index, "load"), f"'{event.load}': nobody there has a load (herds: {names}); give one"
