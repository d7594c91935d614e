"""Which clips a herd brings to a scene, in which styles, and when it changes style or plays a clip (spec 6.4, 6.5)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from crowd.characters.naming import full_name
from crowd.errors import InputError, Problem
from crowd.scenario import Scenario
from crowd.scenario_herd import Event, Herd
from crowd.scenario_styles import MOVES, NORMAL, unknown
from crowd.types import Archetype, Clip, ClipRole

if TYPE_CHECKING:
    from crowd.scene import HerdScene

STYLE_FADE, CLIP_FADE = 0.3, 0.1  # s, cross-fades where the event says nothing


@dataclass(frozen=True, eq=False)
class StyleClips:
    """The clips of one style, with their roles in it."""

    name: str
    clips: tuple[tuple[Clip, bool], ...]  # idle first; True: the clip serves reversed, too, for going the other way


@dataclass(frozen=True)
class Play:
    """A style or clip event as one herd meets it."""

    event: int  # number in the scenario
    channel: int  # into the herd's styles, then its extras
    fade: float  # s, cross-fade from what plays
    hold: float  # s from the event until the fade back begins; inf for styles


@dataclass(frozen=True, eq=False)
class Repertoire:
    """All that a herd may play: its channels are `styles` (those in use only), then `extras`."""

    styles: tuple[StyleClips, ...]
    style: int  # into `styles`, at the start
    extras: tuple[Clip, ...]  # clips that events play, in their order
    plays: tuple[Play, ...]  # in the scenario's order
    notes: tuple[str, ...]


def known_styles(archetype: Archetype) -> list[str]:
    """Names of the styles a herd of this archetype can take."""
    return [NORMAL, *(style.name for style in archetype.styles)]


def style_clips(archetype: Archetype, name: str, idle: Clip) -> StyleClips:
    """A known style; `idle` stands in where it has none."""
    by_name = {clip.name: clip for clip in archetype.clips}
    roles: list[tuple[str, ClipRole]] = [(c.name, c.role) for c in archetype.clips if c.role in MOVES]
    if name != NORMAL:
        roles = list(next(style for style in archetype.styles if style.name == name).clips)
    clips = [replace(by_name[clip], role=role) for clip, role in roles]
    if not any(clip.role == "idle" for clip in clips):
        clips.insert(0, idle)
    return StyleClips(name, tuple((clip, clip.name in archetype.also_backwards) for clip in clips))


def meets(event: Event, herd: Herd) -> bool:
    """Whether an event is meant for characters of the herd."""
    return event.herds is None or herd.name in event.herds


def repertoire(scenario: Scenario, index: int, archetype: Archetype, idle: Clip) -> Repertoire:
    """What herd number `index` plays. `idle`: the one of style normal.

    An event that names no herds concerns those that have its style or clip. Raises InputError with every style and
    clip the archetype does not have.
    """
    model = scenario.herds[index]
    styles, clips = known_styles(archetype), {clip.name: clip for clip in archetype.clips}
    problems: list[Problem] = []
    if model.style not in styles:
        where = scenario.where("herds", index, "style")
        problems.append(Problem(where, f"'{archetype.name}' has " + unknown("style", model.style, styles)))
    wanted: list[tuple[int, str, str]] = []  # event, kind, full name
    for number, event in enumerate(scenario.events):
        if not event.plays or not meets(event, model):
            continue
        kind = "style" if event.style is not None else "clip"
        name, known = str(getattr(event, kind)), styles if kind == "style" else list(clips)
        full = full_name(name, known)
        if full is not None:
            wanted.append((number, kind, full))
        elif event.herds is not None:
            text = f"herd '{model.name}' has " + unknown(kind, name, known)
            problems.append(Problem(scenario.where("events", number, kind), text))
    if problems:
        raise InputError(problems)
    used = [name for name in styles if name == model.style or (name in {n for _, k, n in wanted if k == "style"})]
    extras = list(dict.fromkeys(name for _, kind, name in wanted if kind == "clip"))
    channels = [("style", name) for name in used] + [("clip", name) for name in extras]
    return Repertoire(
        styles=tuple(style_clips(archetype, name, idle) for name in used),
        style=used.index(model.style),
        extras=tuple(clips[name] for name in extras),
        plays=tuple(
            _play(scenario.events[number], number, channels.index((kind, name)), clips.get(name))
            for number, kind, name in wanted
        ),
        notes=tuple(dict.fromkeys(_notes(archetype, idle, used, wanted))),
    )


def _play(event: Event, number: int, channel: int, clip: Clip | None) -> Play:
    if event.style is not None or clip is None:
        return Play(number, channel, STYLE_FADE if event.fade_s is None else event.fade_s, math.inf)
    fade = CLIP_FADE if event.fade_s is None else event.fade_s
    return Play(number, channel, fade, clip.duration if event.hold_s is None else event.hold_s)


def _notes(archetype: Archetype, idle: Clip, used: list[str], wanted: list[tuple[int, str, str]]) -> list[str]:
    """What of a repertoire the user may not have meant."""
    notes = []
    moves = {clip.name: clip.role for clip in archetype.clips if clip.role in MOVES}
    for style in archetype.styles:
        moves |= {name: role for name, role in style.clips if role in MOVES}
        if style.name in used and not any(role == "idle" for _, role in style.clips):
            notes.append(f"style '{style.name}' has no idle clip; '{idle.name}' of style normal is used")
    for _, kind, name in wanted:
        if kind == "clip" and name in moves:
            notes.append(f"'{name}' is a {moves[name]}; played by name it stays on the spot and feet are not adjusted")
    return notes


def unmet(scenario: Scenario, herds: Sequence[HerdScene]) -> list[Problem]:
    """Style and clip events for all herds that no herd can play."""
    played = {play.event for herd in herds for play in herd.plays}
    out = []
    for number, event in enumerate(scenario.events):
        if event.plays and event.herds is None and number not in played:
            kind = "style" if event.style is not None else "clip"
            known = [known_styles(h.archetype) if kind == "style" else _clip_names(h.archetype) for h in herds]
            names = list(dict.fromkeys(name for each in known for name in each))
            text = "no herd has it: " + unknown(kind, str(getattr(event, kind)), names)
            out.append(Problem(scenario.where("events", number, kind), text))
    return out


def _clip_names(archetype: Archetype) -> list[str]:
    return [clip.name for clip in archetype.clips]
