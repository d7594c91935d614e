"""What has to hold between parts of a scenario: names, times, rates, overlaps, files, sizes.

Runs on whichever parts are valid by themselves, so that one bad key does not hide the other problems.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from crowd.errors import Problem, nearest
from crowd.scenario_control_check import control
from crowd.scenario_detail import detail_problems
from crowd.scenario_files import find_file
from crowd.scenario_fluid_check import fluid_problems
from crowd.scenario_ground_check import ground_problems
from crowd.scenario_herd import (
    ASSET_SUFFIXES,
    BUILT_IN,
    MAX_CHARACTERS,
    TAKEN_NAMES,
    Event,
    Herd,
    Normal,
    Places,
    PoissonDisc,
    Uniform,
)
from crowd.scenario_responses import response_problems
from crowd.scenario_styles import style_checks
from crowd.scenario_types import Model
from crowd.scenario_water import Water, water_problems
from crowd.scenario_world import FluidRegion, FluidTable, World
from crowd.scenario_yaml import Document, KeyPath

M = TypeVar("M", bound=Model)


@dataclass(frozen=True)
class _Parts:
    """The valid parts of a document, by their key paths."""

    herds: dict[int, Herd]
    names: dict[int, str]  # of all herds, valid or not
    events: dict[int, Event]
    world: World | None
    regions: dict[int, FluidRegion]
    rate: int | None
    duration: float | None  # s
    cut_short: bool  # duration_s or frames came from an override: later events and pictures simply do not happen


def recording_bytes(count: int, joints: int, legs: int, frames: int, pose: bool = True, moving: int = 1) -> int:
    """Uncompressed size of a recording of `frames` recorded frames; moving: joints whose translation is animated."""
    scalars = 3 * 5 + 9 + legs * 11  # vectors, scalars, feet
    return 4 * count * frames * (scalars + (7 + 4 * joints + 3 * moving if pose else 0))


def cross_checks(document: Document, data: dict[str, Any], table: FluidTable | None, folder: Path) -> list[Problem]:
    """Problems between the parts of a scenario. data: in declared keys (see `validate`)."""
    parts = _parts(document, data)
    checks = (_sizes, _names, _places, _variations, _water, _events, _times, _details)
    problems = [Problem(document.where(path), text) for check in checks for path, text in check(parts, data)]
    problems += [Problem(document.where(path), text) for path, text in _files(parts, data, folder)]
    problems += [Problem(document.where(path), text) for path, text in style_checks(parts.herds, parts.events)]
    problems += [Problem(document.where(path), text) for path, text in response_problems(parts.herds, parts.events)]
    problems += [Problem(document.where(path), text) for path, text in control(parts.herds, parts.events, folder)]
    problems += [
        Problem(document.where(path), text) for path, text in fluid_problems(parts.regions, table, _buoyant(data))
    ]
    return problems


Found = Iterator[tuple[KeyPath, str]]


def _valid(model: type[M], data: Any) -> M | None:
    try:
        return model.model_validate(data)
    except ValidationError:
        return None


def _each(model: type[M], items: Any) -> dict[int, M]:
    listed = items if isinstance(items, list) else []
    return {i: valid for i, item in enumerate(listed) if (valid := _valid(model, item)) is not None}


def _number(value: Any) -> float | None:
    return value if isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < 1e12 else None


def _parts(document: Document, data: dict[str, Any]) -> _Parts:
    herds = data.get("herds")
    listed = herds if isinstance(herds, list) else []
    names = {i: herd["name"] for i, herd in enumerate(listed) if isinstance(herd, dict) and "name" in herd}
    world = data.get("world", {})
    rate = _number(data.get("rate_hz", 60))
    duration, frames = _number(data.get("duration_s")), _number(data.get("frames"))
    if duration is None and frames is not None and rate is not None:
        duration = frames / rate
    return _Parts(
        herds=_each(Herd, herds),
        names={i: name for i, name in names.items() if isinstance(name, str)},
        events=_each(Event, data.get("events")),
        world=_valid(World, world),
        regions=_each(FluidRegion, world.get("fluids") if isinstance(world, dict) else None),
        rate=int(rate) if rate is not None else None,
        duration=duration,
        cut_short=bool({("duration_s",), ("frames",)} & document.overridden.keys()),
    )


def _buoyant(data: dict[str, Any]) -> bool:
    world = data.get("world")
    return isinstance(world, dict) and world.get("buoyancy") is True


def _sizes(parts: _Parts, data: dict[str, Any]) -> Found:
    """The number of characters is refused before anything is allocated."""
    total = 0
    herds = data.get("herds")
    for herd in herds if isinstance(herds, list) else []:
        count = _number(herd.get("count")) if isinstance(herd, dict) else None
        total += int(count or 0)
    if total > MAX_CHARACTERS:
        frames = int((parts.duration or 1.0) * 30)
        size = recording_bytes(total, 25, 2, frames) / 1e9
        yield (
            ("herds",),
            f"{total:,} characters in all; at most {MAX_CHARACTERS:,} (this many would need about "
            f"{recording_bytes(total, 25, 2, 1) / 1e9:,.1f} GB of memory and record about {size:,.0f} GB)",
        )


def _names(parts: _Parts, data: dict[str, Any]) -> Found:
    first: dict[str, int] = {}
    for index, name in parts.names.items():
        if name in first:
            yield ("herds", index, "name"), f"'{name}' is the name of herds[{first[name]}] too; names are unique"
        if name in TAKEN_NAMES:
            yield ("herds", index, "name"), f"'{name}' is the name of an array of the recording; choose another"
        first.setdefault(name, index)
    pictures = data.get("pictures")
    follow = pictures.get("follow") if isinstance(pictures, dict) else None
    names = list(dict.fromkeys(parts.names.values()))
    if isinstance(follow, str) and follow not in names:
        yield ("pictures", "follow"), f"'{follow}': no such herd{nearest(follow, names)}; herds: {', '.join(names)}"


def _places(parts: _Parts, data: dict[str, Any]) -> Found:
    for index, herd in parts.herds.items():
        place, path = herd.place, ("herds", index, "place")
        if isinstance(place, Places) and len(place.points_m) != herd.count:
            yield (*path, "points_m"), f"{len(place.points_m)} points for a count of {herd.count}; as many are needed"
        if isinstance(place, PoissonDisc):
            # Circles of this distance cannot be packed denser than a hexagonal lattice.
            room = 0.9069 * ((place.radius_m + place.min_distance_m / 2) / (place.min_distance_m / 2)) ** 2
            if herd.count > max(room, 1):
                yield (
                    (*path, "min_distance_m"),
                    f"{herd.count} characters {place.min_distance_m} m apart do not fit in a disc of "
                    f"{place.radius_m} m (at most {int(room)})",
                )


def _variations(parts: _Parts, data: dict[str, Any]) -> Found:
    for index, herd in parts.herds.items():
        for key in ("height", "mass", "speed"):
            drawn, path = getattr(herd.variation, key), ("herds", index, "variation", key)
            if isinstance(drawn, Normal) and not (drawn.low <= drawn.mean <= drawn.high):
                yield path, f"mean {drawn.mean} is not between min {drawn.low:g} and max {drawn.high:g}"
            if isinstance(drawn, Uniform) and drawn.min > drawn.max:
                yield path, f"min {drawn.min} is above max {drawn.max}"


def _water(parts: _Parts, data: dict[str, Any]) -> Found:
    world = data.get("world")
    given = world.get("water") if isinstance(world, dict) else None
    water = _valid(Water, given) if given is not None else None
    if water is not None:
        fluids = world.get("fluids") if isinstance(world, dict) else None
        yield from water_problems(water, parts.regions, len(fluids) if isinstance(fluids, list) else 0)


def _details(parts: _Parts, data: dict[str, Any]) -> Found:
    world = data.get("world")
    yield from detail_problems(parts.herds, parts.rate, isinstance(world, dict) and world.get("water") is not None)


def _events(parts: _Parts, data: dict[str, Any]) -> Found:
    names = list(dict.fromkeys(parts.names.values()))
    for index, event in parts.events.items():
        path: KeyPath = ("events", index)
        if parts.duration is not None and event.at_s > parts.duration and not parts.cut_short:
            yield (*path, "at_s"), f"{event.at_s} s is after the end of the run ({parts.duration:g} s)"
        for number, name in enumerate(event.herds or ()):
            if name not in names:
                yield (
                    (*path, "herds", number),
                    f"'{name}': no such herd{nearest(name, names)}; herds: {', '.join(names)}",
                )
        meant = [herd for herd in parts.herds.values() if event.herds is None or herd.name in event.herds]
        for herd in meant if event.characters != "all" else ():
            beyond = [number for number in event.characters if isinstance(number, int) and number >= herd.count]
            if beyond:
                yield (
                    (*path, "characters"),
                    f"{beyond[0]}: herd '{herd.name}' has {herd.count} characters (0 to {herd.count - 1})",
                )


def _times(parts: _Parts, data: dict[str, Any]) -> Found:
    record, pictures = data.get("record"), data.get("pictures")
    rate = _number(record.get("rate_hz", 30)) if isinstance(record, dict) else 30
    if rate is not None and parts.rate is not None and parts.rate % rate:
        allowed = ", ".join(str(d) for d in range(parts.rate, 0, -1) if parts.rate % d == 0)
        yield ("record", "rate_hz"), f"{rate}: must divide rate_hz {parts.rate} (one of {allowed})"
    times = pictures.get("at_s") if isinstance(pictures, dict) else None
    for index, time in enumerate(times if isinstance(times, list) else []):
        late = isinstance(time, int | float) and parts.duration is not None and time > parts.duration
        if late and not parts.cut_short:
            yield ("pictures", "at_s", index), f"{time} s is after the end of the run ({parts.duration:g} s)"


def _files(parts: _Parts, data: dict[str, Any], folder: Path) -> Found:
    herds = data.get("herds")
    for index, herd in enumerate(herds if isinstance(herds, list) else []):
        archetype, rig = (herd.get(key) if isinstance(herd, dict) else None for key in ("archetype", "rig"))
        path: KeyPath = ("herds", index)
        if isinstance(archetype, str) and archetype and archetype not in BUILT_IN:
            if Path(archetype).suffix.lower() not in ASSET_SUFFIXES:
                yield (
                    (*path, "archetype"),
                    f"'{archetype}': must be {', '.join(BUILT_IN)} or a {', '.join(ASSET_SUFFIXES)} file"
                    f"{nearest(archetype, BUILT_IN)}",
                )
            elif find_file(archetype, folder) is None:
                yield (*path, "archetype"), f"'{archetype}': no such file ({folder / archetype})"
        if isinstance(rig, str) and find_file(rig, folder) is None:
            yield (*path, "rig"), f"'{rig}': no such file ({folder / rig})"
    if parts.world is not None:
        yield from ground_problems(parts.world.ground, folder)
