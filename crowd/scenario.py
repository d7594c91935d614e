"""A scenario: what YAML says, validated, before any array exists.

`load` reads a file or a mapping, applies `--set` overrides and either returns a `Scenario` or raises `InputError` with
every problem at once, each with file, line, key path, the value found and what is allowed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, PrivateAttr

from crowd.errors import InputError, Problem, fail, nearest
from crowd.scenario_check import cross_checks
from crowd.scenario_control_check import fill_counts
from crowd.scenario_files import find_file
from crowd.scenario_herd import BUILT_IN, MAX_CHARACTERS, Event, Herd
from crowd.scenario_set import apply_overrides
from crowd.scenario_types import Flag, Model, Name, NotNegative
from crowd.scenario_validate import validate
from crowd.scenario_world import FluidTable, World
from crowd.scenario_yaml import Document, KeyPath, read_file

__all__ = ["BUILT_IN", "MAX_CHARACTERS", "Drag", "Pictures", "Record", "Scenario", "configs_folder", "load", "schema"]


class Drag(Model):
    """How the fluid's force is computed."""

    mesh: Literal["skinned", "rigid"] = "skinned"
    """skinned: linear blending, exact. rigid: every triangle on one bone, several times faster."""
    submersion: Literal["clipped", "centroid"] = "clipped"
    """clipped: triangles are cut at the surface. centroid: wet when the centroid is (the paper)."""
    b_mode: Literal["area", "paper"] = "area"
    """How the offset force is shared: by area (independent of the mesh), or the same for every triangle (the paper);
    the constants of fluids.yaml are meant for area, those of fluids_belt.yaml for paper and people with a belt."""


class Record(Model):
    """What is written to the recording."""

    rate_hz: Annotated[int, Field(strict=True, ge=1, le=240)] = 30
    """Divides the scenario's rate."""
    pose: Flag = True
    """Joint rotations and translations too."""


class Pictures(Model):
    """A strip of pictures of the skinned crowd."""

    at_s: tuple[NotNegative, ...] = ()
    """Moments; left out: four, evenly spread."""
    width_px: Annotated[int, Field(strict=True, ge=64, le=8192)] = 1600
    height_px: Annotated[int, Field(strict=True, ge=64, le=8192)] = 700
    follow: Name | None = None
    """Herd the camera follows; left out: all."""
    debug: Flag = False
    """Also draw a character of each semi-procedural herd with its footprints and the ghost of its unadjusted pose."""


class Scenario(Model):
    """A crowd, its world and how long to run. SI units; keys carry their unit."""

    exactly_one: ClassVar[tuple[str, ...]] = ("duration_s", "frames")

    name: Name
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**31)] = 0
    duration_s: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=86_400)] | None = None
    frames: Annotated[int, Field(strict=True, ge=1, le=20_000_000)] | None = None
    rate_hz: Annotated[int, Field(strict=True, ge=15, le=240)] = 60
    gait: Literal["semi_procedural", "footsteps", "clip"] = "semi_procedural"
    """semi_procedural: analysed clips, blended, feet on predicted prints. footsteps: the step controller of the
    character-fluid paper. clip: the clip plays, and skates."""
    bands: Literal["polar", "cartesian"] = "polar"
    """How clips are weighted over the velocity plane (semi_procedural)."""
    compat: Flag = False
    """semi_procedural with the known defects of the original system, to compare numbers."""
    schedule: Literal["paper", "scaled", "mixed", "actual"] = "mixed"
    """How step length and time follow the actual speed."""
    drag: Drag = Drag()
    fluids: str | None = None
    """File of named fluids and drag constants; left out: the one that comes with the program."""
    world: World = World()
    herds: Annotated[tuple[Herd, ...], Field(min_length=1, max_length=64)]
    events: tuple[Event, ...] = ()
    record: Record = Record()
    pictures: Pictures | None = Pictures()

    _path: Path | None = PrivateAttr(default=None)
    _lines: dict[KeyPath, int] = PrivateAttr(default_factory=dict)
    _fluid_table: FluidTable | None = PrivateAttr(default=None)
    _document: Document | None = PrivateAttr(default=None)

    @property
    def path(self) -> Path | None:
        """The file it came from; None for a mapping."""
        return self._path

    @property
    def folder(self) -> Path:
        """Where relative files are looked for."""
        return self._path.parent if self._path is not None else Path.cwd()

    @property
    def lines(self) -> dict[KeyPath, int]:
        """1-based line of every key path in the file, for messages."""
        return self._lines

    @property
    def fluid_table(self) -> FluidTable:
        """Named fluids and drag constants."""
        if self._fluid_table is None:
            return load_fluids(configs_folder() / "fluids.yaml")
        return self._fluid_table

    @property
    def frame_count(self) -> int:
        """Frames to step: `frames`, or the duration at the rate (at least 1)."""
        if self.frames is not None:
            return self.frames
        return max(1, round((self.duration_s or 0.0) * self.rate_hz))

    @property
    def character_count(self) -> int:
        """Characters of all herds."""
        return sum(herd.count for herd in self.herds)

    def where(self, *path: str | int) -> str:
        """Place of a key path for messages, e.g. "wade.yaml:12 herds[0].archetype"."""
        return (self._document or Document("scenario", None)).where(path)


def configs_folder() -> Path:
    """Folder of the scenarios and fluids that come with the program (checkout or installed)."""
    package = Path(__file__).resolve().parent
    installed = package / "configs"
    return installed if installed.is_dir() else package.parent / "configs"


def load(source: str | Path | Mapping[str, Any], overrides: Sequence[str] = ()) -> Scenario:
    """Scenario of a YAML file or of a mapping of the same shape.

    overrides: "key.path=value" each, lists by number or name ("herds[0].count=10", "herds.people.count=10").
    Raises `InputError` with every problem found.
    """
    path = None if isinstance(source, Mapping) else Path(source)
    if isinstance(source, Mapping):
        document = Document("scenario", _plain(source))
    else:
        document = read_file(_existing(Path(source)))
    if document.data is None:
        raise fail(document.label, "is empty; a scenario is a mapping with at least name, duration_s and herds")
    if not isinstance(document.data, dict):
        found = "list" if isinstance(document.data, list) else type(document.data).__name__
        raise fail(document.where(()), f"a {found} at the top; a scenario is a mapping (name: ..., herds: ...)")
    document, problems = apply_overrides(document, overrides, Scenario)
    if path is not None and "name" not in document.data:
        document.data["name"] = path.stem
    return _checked(document, path, path.parent if path is not None else Path.cwd(), problems)


def load_part(document: Document, folder: Path) -> Scenario:
    """The scenario that stands in a part of another file; raises `InputError` with every problem found."""
    return _checked(document, folder / document.label, folder, [])


def _checked(document: Document, path: Path | None, folder: Path, problems: list[Problem]) -> Scenario:
    """The scenario of a mapping, whose relative files are looked for in `folder`."""
    fill_counts(document.data, folder)
    scenario, parts, found_problems = validate(document, Scenario)
    problems += found_problems
    table, table_problems = _fluids(document, folder)
    problems += table_problems + cross_checks(document, parts, table, folder)
    if problems or scenario is None:
        raise InputError(_in_order(problems))
    scenario._path, scenario._lines, scenario._document = path, document.lines, document
    scenario._fluid_table = table
    return scenario


def _in_order(problems: list[Problem]) -> list[Problem]:
    """Each problem once, by line."""

    def line(problem: Problem) -> int:
        found = re.match(r"[^:]*:(\d+)", problem.where)
        return int(found[1]) if found else 0

    return sorted(dict.fromkeys(problems), key=line)


def _plain(value: Any) -> Any:
    """Mappings, sequences and NumPy values of a Python caller as what YAML would have given."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def load_fluids(path: Path) -> FluidTable:
    """The table of named fluids in a YAML file; raises `InputError`."""
    document = read_file(path)
    if not isinstance(document.data, dict):
        raise fail(path.name, "a table of fluids is a mapping with base_drag, offset_force_n and fluids")
    table, _, problems = validate(document, FluidTable)
    if problems or table is None:
        raise InputError(problems)
    return table


def _fluids(document: Document, folder: Path) -> tuple[FluidTable | None, list[Problem]]:
    """The table the document asks for, or the reasons why there is none."""
    name = document.data.get("fluids")
    if name is None:
        return load_fluids(configs_folder() / "fluids.yaml"), []
    if not isinstance(name, str):
        return None, []  # reported by validation
    path = find_file(name, folder)
    if path is None:
        return None, [Problem(document.where(("fluids",)), f"{name!r}: no such file ({folder / name})")]
    try:
        return load_fluids(path), []
    except InputError as error:
        return None, list(error.problems)


def _existing(path: Path) -> Path:
    if not path.exists():
        known = sorted(file.stem for file in configs_folder().glob("*.yaml"))
        raise fail(str(path), f"no such file{nearest(path.stem, known)}")
    return path


def schema() -> dict[str, Any]:
    """JSON Schema of a scenario file, for editors."""
    body = Scenario.model_json_schema()
    body["required"] = [key for key in body["required"] if key != "name"]  # the file's name when left out
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "crowd scenario"} | body
