"""The figures the project promises, worked out from lines of results."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Literal

from benchmarks.cases import CASES, Case

Line = dict[str, Any]


@dataclass(frozen=True)
class Figure:
    """A figure and, where one is promised, its limit."""

    name: str
    unit: str
    value: float | None  # None: not measured
    sense: Literal["<=", ">="] | None = None
    limit: float | None = None

    @property
    def reached(self) -> bool | None:
        """None where there is nothing to compare."""
        if self.value is None or self.limit is None:
            return None
        return (operator.le if self.sense == "<=" else operator.ge)(self.value, self.limit)

    @property
    def verdict(self) -> str:
        """In words."""
        if self.value is None:
            return "not measured"
        return {None: "", True: "reached", False: "falls short"}[self.reached]


def figures(lines: Iterable[Line]) -> list[Figure]:
    """All figures; those whose cases are not among the lines have no value."""
    lines = [line for line in lines if "error" not in line]
    case = {line["case"]: line for line in lines if line["kind"] == "case"}
    start = next((line for line in lines if line["kind"] == "start"), {})

    def us(name: str) -> float | None:
        return case.get(name, {}).get("us")

    found = [
        Figure("human, rigid, in water, N = 2048, one core", "µs", us("human-rigid-2048"), "<=", 5.0),
        Figure("human, skinned, in water, N = 2048, one core", "µs", us("human-skinned-2048"), "<=", 12.0),
    ]
    for mesh in ("rigid", "skinned"):
        gain = _ratio(us(f"human-{mesh}-2048"), us(f"human-{mesh}-2048-2dev"))
        found.append(Figure(f"2 devices against 1, {mesh}", "x", gain, ">=", 1.6))
    found.append(
        Figure("compile of two archetypes, no cache, one core", "s", _compile(case, "human-dog-rigid-2048"), "<=", 12.0)
    )
    found.append(Figure("warm start of `crowd run` to its first frames", "s", start.get("warm_s"), "<=", 5.0))
    for name in ("human-dog-rigid-2048", "human-dog-hexapod-rigid-2048"):
        found.append(Figure(f"{name} against its herds alone", "x", _mixed(us, name), "<=", 1.2))
    for name, legs, limit in (("human", "two", 1.2), ("dog", "four", 2.0)):
        added = _less(us(f"{name}-strides-2048"), us(f"{name}-clip-2048"))
        found.append(Figure(f"semi-procedural gait on {legs} legs, over the plain clip", "µs", added, "<=", limit))
    for few, many in (("human-rigid-64", "human-rigid-2048"), ("human-rigid-16384", "human-rigid-2048")):
        found.append(Figure(f"per character, {few} against {many}", "x", _ratio(us(few), us(many))))
    for name in ("human-rigid-64", "human-rigid-256", "human-skinned-64"):
        times = case.get(f"{name}-gradient", {}).get("over_forward")
        found.append(Figure(f"gradient of 120 frames over the run, {name}", "x", times, "<=", 12.0))
    return found


def _ratio(above: float | None, below: float | None) -> float | None:
    return None if above is None or not below else above / below


def _less(whole: float | None, part: float | None) -> float | None:
    return None if whole is None or part is None else whole - part


def _compile(case: dict[str, Line], name: str) -> float | None:
    """Seconds from traced program to executable without a cache; tracing has a column of its own."""
    line = case.get(name)
    return None if line is None else line["compile_cold_s"]


def _mixed(us: Callable[[str], float | None], name: str) -> float | None:
    """Cost of a mixed crowd against the mean of its herds alone, weighted with their characters."""
    together = us(name)
    mixed = next(case for case in CASES if case.name == name)
    alone = [us(alone_name(mixed, archetype)) for archetype, _ in mixed.herds]
    if together is None or any(value is None for value in alone):
        return None
    mean = sum((value or 0.0) * count for value, (_, count) in zip(alone, mixed.herds, strict=True)) / mixed.count
    return together / mean


def alone_name(mixed: Case, archetype: str) -> str:
    """Name of the case with one archetype of a mixed case only, and as many characters in all."""
    return f"{archetype}-{mixed.mesh}-{mixed.count}"
