"""Styles of moving, as scenarios and rig descriptions tell them: names of clips by what they are for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated

from pydantic import BeforeValidator, Field

from crowd.errors import nearest
from crowd.scenario_types import Model
from crowd.scenario_yaml import KeyPath

if TYPE_CHECKING:
    from crowd.scenario_herd import Event, Herd

NORMAL = "normal"  # the style of the roles that detection, or the description's roles, give
MOVES = ("walk", "run", "step")


def _listed(value: object) -> object:
    return [value] if isinstance(value, str) else value


ClipName = Annotated[str, Field(min_length=1, max_length=200)]
Names = Annotated[list[ClipName], BeforeValidator(_listed, json_schema_input_type=ClipName | list[ClipName])]


class StyleNames(Model):
    """Clips of a style: at least one that walks or runs; left out `idle`: that of style normal."""

    idle: ClipName | None = None
    walk: Names = Field(default_factory=list)
    run: Names = Field(default_factory=list)
    step: Names = Field(default_factory=list)
    """Clips that go backwards, sideways or at a slant."""

    @property
    def listed(self) -> list[tuple[str, str]]:
        """(name, role) of every clip, idle first."""
        idle = [] if self.idle is None else [(self.idle, "idle")]
        return idle + [(name, role) for role in MOVES for name in getattr(self, role)]


Styles = dict[Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.\-]{0,63}$")], StyleNames]


def style_faults(styles: Mapping[str, StyleNames]) -> Iterator[tuple[str, str]]:
    """(style, what is wrong with it) of styles that cannot be, whatever the clips are."""
    for name, style in styles.items():
        if name == NORMAL:
            yield name, "'normal' is the style of the clips' own roles (clips: walk: ...); give this one another name"
        elif not style.walk and not style.run:
            yield name, f"style '{name}' has no walk; name at least one clip under walk or run"
        roles: dict[str, str] = {}
        for clip, role in style.listed:
            if roles.setdefault(clip, role) != role:
                yield name, f"clip '{clip}' is named both {roles[clip]} and {role}"


def unknown(kind: str, name: str, known: list[str], most: int = 30) -> str:
    """What is told of a name that is not among the known ones."""
    more = ", ..." if len(known) > most else ""
    return f"no {kind} '{name}'{nearest(name, known)}; {kind}s: {', '.join(known[:most])}{more}"


def style_checks(herds: Mapping[int, Herd], events: Mapping[int, Event]) -> Iterator[tuple[KeyPath, str]]:
    """Problems of styles and of events that play, as far as they need no character; by key path."""
    for index, herd in herds.items():
        for name, text in style_faults(herd.styles):
            yield ("herds", index, "styles", name), text
    for index, event in events.items():
        if event.fade_s is not None and not event.plays:
            yield ("events", index, "fade_s"), f"{event.fade_s:g}: only a style or a clip fades"
        if event.hold_s is not None and event.clip is None:
            yield ("events", index, "hold_s"), f"{event.hold_s:g}: only a clip is held"
