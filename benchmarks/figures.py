"""The figures the project promises, worked out from lines of results."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Literal

from benchmarks.alone import CASE as ALONE
from benchmarks.cases import CASES, RATE, Case

Line = dict[str, Any]
Cases = dict[str, Line]  # by name
Us = Callable[[str], float | None]  # of a case, by its name; for ratios: as times the reference, where there is one

RECORDED = "human-rigid-2048-recorded"
FOUR = "human-dog-hexapod-spider-rigid-2048"
# Stages (benchmarks.stages) that move bodies by the pictures' mathematics: clips and forward kinematics are in `pose`,
# inverse kinematics in `feet` and `arms`. The rest senses, steers, adds forces, moves the abstract body, plans steps,
# records, and loops over tiles and frames.
MATHS = ("pose", "feet", "arms", "skin", "drag")


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


def comparable(line: Line) -> float | None:
    """Cost of a case, for ratios of cases: in turns with the reference where there was one."""
    return line.get("over_reference", line.get("us"))


def figures(lines: Iterable[Line]) -> list[Figure]:
    """All figures; those whose cases are not among the lines have no value."""
    lines = [line for line in lines if "error" not in line]
    case = {line["case"]: line for line in lines if line["kind"] == "case"}
    start = next((line for line in lines if line["kind"] == "start"), {})
    alone = next((line for line in lines if line["kind"] == "alone"), {})

    def us(name: str) -> float | None:
        return case.get(name, {}).get("us")

    def turns(name: str) -> float | None:
        return comparable(case.get(name, {}))

    return [
        *_costs(us),
        *_species(turns),
        *_devices(us, turns),
        *_herd_sizes(turns),
        *_mixtures(turns),
        *_programs(case),
        Figure(f"frame over its stages alone, {ALONE}", "x", alone.get("frame_over_alone"), "<=", 1.3),
        *_derivatives(case),
        Figure("recording full poses of every frame, 2048 people", "x", _of(case, RECORDED, "over_off"), "<=", 1.15),
        Figure("warm start of `crowd run` to its first frames", "s", start.get("warm_s"), "<=", 5.0),
        *_peers(next((line for line in lines if line["kind"] == "peers"), {})),
    ]


def _costs(us: Us) -> Iterable[Figure]:
    """What a character-frame takes on one core."""
    yield Figure("human, rigid, in water, N = 2048, one core", "µs", us("human-rigid-2048"), "<=", 3.2)
    yield Figure("human, skinned, in water, N = 2048, one core", "µs", us("human-skinned-2048"), "<=", 8.0)
    for name, legs, limit in (("human", "two", 1.2), ("dog", "four", 2.0)):
        added = _less(us(f"{name}-rubble-strides-2048"), us(f"{name}-rubble-clip-2048"))
        yield Figure(f"semi-procedural gait on {legs} legs, over the plain clip", "µs", added, "<=", limit)


def _species(us: Us) -> Iterable[Figure]:
    """Others than people."""
    for name in ("dog", "hexapod", "spider"):
        human = us("human-rigid-2048")
        alike = _ratio(us(f"{name}-rigid-knees-2048"), human)
        yield Figure(f"{name} against human, rigid, each to the knees", "x", alike, "<=", 1.6)
        yield Figure(f"{name} against human, rigid, both in 0.5 m", "x", _ratio(us(f"{name}-rigid-2048"), human))


def _devices(us: Us, turns: Us) -> Iterable[Figure]:
    """Two cores: how much faster, and how many characters that makes."""
    for mesh, limit in (("rigid", 8500), ("skinned", 3500)):
        one, both = f"human-{mesh}-2048", f"human-{mesh}-2048-2dev"
        yield Figure(f"2 devices against 1, {mesh}", "x", _ratio(turns(one), turns(both)), ">=", 1.7)
        alive = _ratio(1e6 / RATE, us(both))
        yield Figure(f"{mesh} at 60 Hz in real time, two cores", "characters", alive, ">=", limit)


def _herd_sizes(us: Us) -> Iterable[Figure]:
    """Cost of a character in small and large herds."""
    for count, limit in ((64, 1.4), (16384, 1.25), (100000, 1.4)):
        ratio = _ratio(us(f"human-rigid-{count}"), us("human-rigid-2048"))
        yield Figure(f"per character, human-rigid-{count} against 2048", "x", ratio, "<=", limit)


def _mixtures(us: Us) -> Iterable[Figure]:
    for name in ("human-dog-rigid-2048", FOUR):
        yield Figure(f"{name} against its herds alone", "x", _mixed(us, name), "<=", 1.15)


def _programs(case: Cases) -> Iterable[Figure]:
    """Compiling, memory, and where the time goes. Tracing has a column of its own in the table."""
    one = "human-rigid-2048"
    yield Figure("compile of one archetype, no cache, one core", "s", _of(case, one, "compile_cold_s"), "<=", 5.0)
    yield Figure("compile of four archetypes, no cache, one core", "s", _of(case, FOUR, "compile_cold_s"), "<=", 15.0)
    yield Figure("compile of one archetype from the cache", "s", _of(case, one, "compile_warm_s"), "<=", 2.0)
    temporaries = _of(case, one, "temp_bytes_per_character", 1e-3)
    yield Figure(f"temporaries of a character, {one}", "kB", temporaries, "<=", 3.0)
    peak = _of(case, "human-rigid-16384", "peak_rss_bytes", 1e-9)
    yield Figure("peak memory, human-rigid-16384", "GB", peak, "<=", 1.2)
    share = case.get(one, {}).get("stage_share")
    rest = 100 * (1 - sum(share.get(name, 0.0) for name in MATHS)) if share else None
    yield Figure(f"all but clip, FK, IK, skin and drag, {one}", "%", rest, "<=", 40.0)


def _derivatives(case: Cases) -> Iterable[Figure]:
    """Gradients of a run by every parameter."""
    for name, limit in (("human-rigid-64", 6.0), ("human-rigid-256", 8.0), ("human-skinned-64", None)):
        line = case.get(f"{name}-gradient", {})
        times, held = line.get("over_forward"), line.get("temp_bytes_per_character")
        yield Figure(f"gradient of 120 frames over the run, {name}", "x", times, "<=" if limit else None, limit)
        if limit:
            kilobytes = None if held is None else 1e-3 * held / line["gradient_frames"]
            yield Figure(f"temporaries of a character-frame, {name}-gradient", "kB", kilobytes, "<=", 2.0)


def _peers(line: Line) -> Iterable[Figure]:
    """What others take for a character and simulated second, over what this simulator takes."""
    limits = (("mujoco", "MuJoCo C", 30.0), ("mjx", "MJX", 40.0), ("vmap", "one character vmapped", 10.0))
    for key, name, limit in limits:
        yield Figure(f"{name} over this simulator, one core", "x", line.get(f"{key}_over_own"), ">=", limit)


def _of(case: Cases, name: str, key: str, unit: float = 1.0) -> float | None:
    value = case.get(name, {}).get(key)
    return None if value is None else unit * value


def _ratio(above: float | None, below: float | None) -> float | None:
    return None if above is None or not below else above / below


def _less(whole: float | None, part: float | None) -> float | None:
    return None if whole is None or part is None else whole - part


def _mixed(us: Us, name: str) -> float | None:
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
