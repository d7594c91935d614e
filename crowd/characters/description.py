"""The rig description: a small YAML that names what detection found, or overrides it. Every key is optional."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from crowd.errors import InputError, Problem, fail
from crowd.scenario_styles import Names, Styles, style_faults
from crowd.scenario_types import Model
from crowd.scenario_validate import validate
from crowd.scenario_yaml import Document, read_file

Axis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]


class LegDescription(Model):
    """hip, knee and ankle are bent by inverse kinematics; `ball` carries the contact point (left out: the ankle)."""

    name: str | None = None
    hip: str
    knee: str
    ankle: str
    ball: str | None = None


class ArmDescription(Model):
    """Joints of an arm from the trunk outwards."""

    name: str | None = None
    shoulder: str
    elbow: str
    hand: str


class ClipRoles(Model):
    """Clip names by role in style "normal"; a role left out is detected, an empty list means none.

    `other` clips, and walks, runs and steps that only another style names, are none of style "normal".
    """

    idle: str | None = None
    walk: Names | None = None
    run: Names | None = None
    step: Names | None = None
    """Walks and runs that go backwards, sideways or at a slant."""
    other: Names | None = None
    also_backwards: Names | None = None
    """Walks, runs and steps that are played reversed, too, for going the other way."""
    styles: Styles = Field(default_factory=dict)
    """Other ways of moving: style: {idle: ..., walk: [...], run: [...], step: [...]}."""

    def named(self) -> list[tuple[str, str]]:
        """(key path below clips, clip name) of every clip named."""
        out = [] if self.idle is None else [("idle", self.idle)]
        for role in ("walk", "run", "step", "other", "also_backwards"):
            out += [(role, name) for name in getattr(self, role) or []]
        return out + [(f"styles.{key}.{role}", name) for key, s in self.styles.items() for name, role in s.listed]


class RigDescription(Model):
    """What a character file means. Anything left out is detected."""

    asset: str | None = None
    """The character file, relative to this description."""
    name: str | None = None
    """Name of the species."""
    metres_per_unit: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    height_m: float | None = Field(default=None, gt=0, le=100)
    """Standing height of the neutral pose; overrides metres_per_unit."""
    up: Axis | None = None
    forward: Axis | None = None
    pelvis: str | None = None
    legs: list[LegDescription] | None = None
    arms: list[ArmDescription] | None = None
    attach: dict[str, str] | None = None
    """Joints that move with another joint than the file says: child: new parent."""
    clips: ClipRoles = ClipRoles()
    mass_kg: float | None = Field(default=None, gt=0, le=1e6)


def parse(data: Mapping[str, Any] | RigDescription, where: str) -> RigDescription:
    """A description from a mapping. Raises InputError with every bad key, naming the nearest known one."""
    if isinstance(data, RigDescription):
        return data
    return _validated(Document(where, dict(data)))


def read(path: Path) -> RigDescription:
    """A description from a YAML file. Raises InputError with file, line and key path."""
    document = read_file(path)
    if not isinstance(document.data, dict):
        raise fail(path.name, "must be a mapping of keys (asset, legs, clips, ...)")
    return _validated(document)


def _validated(document: Document) -> RigDescription:
    description, _, problems = validate(document, RigDescription)
    if description is None:
        raise InputError(problems)
    faults = style_faults(description.clips.styles)
    if problems := [Problem(document.where(("clips", "styles", name)), text) for name, text in faults]:
        raise InputError(problems)
    if description.up is not None and description.forward is not None and description.up[1] == description.forward[1]:
        raise fail(document.where(("forward",)), f"{description.forward!r} lies along up {description.up!r}")
    return description


def dump(description: RigDescription, comments: Sequence[str] = ()) -> str:
    """YAML text of a description with `comments` as its head."""
    from ruamel.yaml import YAML

    writer = YAML()
    writer.width = 110
    out = io.StringIO()
    out.writelines(f"# {line}\n" for line in comments)
    writer.dump(description.model_dump(exclude_none=True, exclude_defaults=True), out)
    return out.getvalue()
