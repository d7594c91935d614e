"""Styles a scenario gives to a character beside those it has."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from crowd.characters.description import RigDescription
from crowd.characters.naming import full_name
from crowd.errors import InputError, Problem
from crowd.scenario_styles import MOVES, StyleNames, unknown
from crowd.types import Archetype, Style

Where = Callable[..., str]  # place of a key path below the scenario's `styles`, for messages


def check_clips(styles: Mapping[str, StyleNames], names: Sequence[str], where: Where) -> None:
    """Raises InputError with every clip of the styles that is none of `names`."""
    problems = [
        Problem(where(key, role), unknown("clip", clip, list(names)))
        for key, style in styles.items()
        for clip, role in style.listed
        if full_name(clip, names) is None
    ]
    if problems:
        raise InputError(problems)


def described(description: RigDescription | None, styles: Mapping[str, StyleNames]) -> RigDescription:
    """The description with the styles added, or put in place of its own of the same name."""
    given = description or RigDescription()
    roles = given.clips.model_copy(update={"styles": {**given.clips.styles, **styles}})
    return given.model_copy(update={"clips": roles})


def with_styles(archetype: Archetype, styles: Mapping[str, StyleNames], where: Where) -> Archetype:
    """A finished archetype with styles made of its clips added. Raises InputError naming clip and place."""
    clips = {clip.name: clip for clip in archetype.clips}
    check_clips(styles, list(clips), where)
    problems = [
        Problem(where(key, role), f"clip '{clip}' does not loop, so it is no {role}")
        for key, style in styles.items()
        for clip, role in style.listed
        if role in ("idle", *MOVES) and not clips[full_name(clip, list(clips)) or clip].cyclic
    ]
    if problems:
        raise InputError(problems)
    kept = [style for style in archetype.styles if style.name not in styles]
    new = [
        Style(key, tuple((full_name(c, list(clips)) or c, role) for c, role in style.listed))  # pyright: ignore[reportArgumentType]
        for key, style in styles.items()
    ]
    return replace(archetype, styles=(*kept, *new))
