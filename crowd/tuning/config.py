"""Models of a tune file: a scenario, what is free in it, what it should come to, and how it is searched."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from crowd import scenario as scenarios
from crowd.errors import InputError, Problem, fail
from crowd.scenario import Scenario
from crowd.scenario_set import apply_overrides
from crowd.scenario_types import Flag, Model, Name, NotNegative, Number, Positive, Whole
from crowd.scenario_validate import validate
from crowd.scenario_yaml import Document, read_file
from crowd.tuning.quantities import Quantity

Share = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1)]
Count = Annotated[int, Field(strict=True, ge=1, le=10_000)]


class Parameter(Model):
    """A free number, between two bounds."""

    low: Number
    high: Number
    start: Number | None = None
    """Left out: as the scenario has it."""
    relative: Flag = False
    """Bounds and start are multiples of what the scenario has."""
    scale: Literal["linear", "log"] = "linear"
    """log: the same factor is the same step; both bounds positive."""


class Target(Model):
    """What a character of a herd should come to."""

    herd: Name
    character: Annotated[int, Field(strict=True, ge=0)] = 0
    quantity: Quantity
    value: Number
    tolerance: Positive
    """In the unit of the value: residuals are counted in it, and a fit within it is good."""


class Horizon(Model):
    """Stretches of a run, one after the other."""

    settle_s: NotNegative = 2.5
    """Stepped without gradient."""
    lead_s: NotNegative = 1.0
    """With gradient, not measured: sensitivities settle."""
    window_s: Positive = 4.0
    """Measured, in a Hann window: at least eight steps, or the moments of steps blur the gradient."""


class Starts(Model):
    """Where the search begins: once at the given start, then at random places between the bounds."""

    count: Count = 1
    seed: Whole = 0
    spread: Share = 1.0
    """Of the bounds, about the given start, that the random places cover."""


class Solver(Model):
    """How it is searched."""

    kind: Literal["levenberg_marquardt", "adam"] = "levenberg_marquardt"
    iterations: Count = 20
    learning_rate: Positive = 0.05
    """adam: share of the bounds in a step."""


class Tune(Model):
    """A tune file."""

    name: Name
    scenario: dict[str, Any] | str
    """A scenario, or the name of its file."""
    depth_hips: Positive | None = None
    """Puts every surface at this multiple of the first herd's hip height above the ground's origin."""
    free: Annotated[dict[str, Parameter], Field(min_length=1)]
    """Dotted names of numbers in `Params`: fluids.base_drag.a, characters.gain_forward, control.filter_time, ..."""
    targets: Annotated[tuple[Target, ...], Field(min_length=1)]
    prior: NotNegative = 0.05
    """Pull towards the given start, in tolerances for the whole width of the bounds."""
    horizon: Horizon = Horizon()
    starts: Starts = Starts()
    solver: Solver = Solver()
    rounds: Annotated[int, Field(strict=True, ge=1, le=10)] = 2
    """Statistics of triangles (median_drag_coefficient) are measured anew before each."""


class Problemset(Model):
    """A tune file with its scenario, both valid."""

    model_config = Model.model_config | {"arbitrary_types_allowed": True}

    tune: Tune
    scenario: Scenario
    document: Any

    def where(self, *path: str | int) -> str:
        """Place of a key path for messages."""
        return self.document.where(path)


def load(source: str | Path | Mapping[str, Any], overrides: Sequence[str] = ()) -> Problemset:
    """The tune file (or mapping) and its scenario; raises `InputError` with every problem found."""
    path = None if isinstance(source, Mapping) else Path(source)
    document = Document("tune", dict(source)) if isinstance(source, Mapping) else read_file(Path(source))
    if not isinstance(document.data, dict):
        raise fail(document.label, "a tune file is a mapping with name, scenario, free and targets")
    document, problems = apply_overrides(document, overrides, Tune)
    if path is not None:
        document.data.setdefault("name", path.stem)
    tune, _, found = validate(document, Tune)
    problems += found
    scenario, found = _scenario(document, path.parent if path is not None else Path.cwd())
    problems += found
    if tune is not None and scenario is not None:
        problems += _bounds(tune, document) + _targets(tune, scenario, document) + _paced(scenario)
    if problems or tune is None or scenario is None:
        raise InputError(dict.fromkeys(problems))
    return Problemset(tune=tune, scenario=scenario, document=document)


def _scenario(document: Document, folder: Path) -> tuple[Scenario | None, list[Problem]]:
    inner = document.data.get("scenario")
    try:
        if isinstance(inner, str):
            return scenarios.load(folder / inner), []
        if isinstance(inner, dict):
            inner.setdefault("name", document.data.get("name", "tune"))
            return scenarios.load_part(document.part("scenario"), folder), []
    except InputError as error:
        return None, list(error.problems)
    return None, []  # reported by validation


def _paced(scenario: Scenario) -> list[Problem]:
    """Herds that are not stepped every frame: nothing here is differentiated through that."""
    return [
        Problem(scenario.where("herds", index, "detail", "every"), f"{herd.detail.every}: tuning steps every frame")
        for index, herd in enumerate(scenario.herds)
        if herd.detail is not None and herd.detail.every > 1
    ]


def _bounds(tune: Tune, document: Document) -> list[Problem]:
    problems = []
    for name, one in tune.free.items():
        where = document.where(("free", name))
        if one.low >= one.high:
            problems.append(Problem(where, f"low {one.low:g} is not below high {one.high:g}"))
        elif one.scale == "log" and one.low <= 0:
            problems.append(Problem(where, f"low {one.low:g}: on a log scale both bounds are positive"))
        elif one.relative and one.low <= 0:
            problems.append(Problem(where, f"low {one.low:g}: multiples are positive"))
        elif one.start is not None and not one.low <= one.start <= one.high:
            problems.append(Problem(where, f"the bounds {one.low:g} to {one.high:g} exclude the start {one.start:g}"))
    return problems


def _targets(tune: Tune, scenario: Scenario, document: Document) -> list[Problem]:
    counts = {herd.name: herd.count for herd in scenario.herds}
    problems = []
    for number, target in enumerate(tune.targets):
        where = document.where(("targets", number))
        if target.herd not in counts:
            problems.append(Problem(where, f"no herd '{target.herd}'; there are {', '.join(counts)}"))
        elif target.character >= counts[target.herd]:
            message = f"character {target.character}: herd '{target.herd}' has {counts[target.herd]}, counted from 0"
            problems.append(Problem(where, message))
    return problems
