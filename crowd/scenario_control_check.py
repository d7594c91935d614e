"""What has to hold of a herd's path, trajectories and facing; and counts that a file of trajectories says."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from crowd.errors import InputError
from crowd.scenario_control import Route, Trajectories
from crowd.scenario_herd import Event, Herd
from crowd.scenario_trajectories import chosen, read_trajectories
from crowd.scenario_yaml import KeyPath

Found = Iterator[tuple[KeyPath, str]]
TABLED = ("circle", "figure_eight")  # curves that need a radius and no points


def fill_counts(data: dict[str, Any], folder: Path) -> None:
    """Puts the number of a file's trajectories where a herd leaves its count out.

    A file that cannot be read counts as one: `control` tells what is wrong with it.
    """
    herds = data.get("herds")
    for herd in herds if isinstance(herds, list) else []:
        given = herd.get("trajectories") if isinstance(herd, dict) else None
        if isinstance(given, dict) and isinstance(given.get("file"), str) and herd.get("count") is None:
            try:
                parts = {key: given[key] for key in ("file", "rate_hz", "columns", "ids") if key in given}
                herd["count"] = len(chosen(_read(Trajectories.model_validate(parts), folder), parts.get("ids"), ""))
            except (InputError, ValidationError):
                herd["count"] = 1


def _read(model: Trajectories, folder: Path) -> dict[str, Any]:
    return read_trajectories(folder / Path(model.file).expanduser(), model.columns, model.rate_hz)


def control(herds: dict[int, Herd], events: dict[int, Event], folder: Path) -> Found:
    """Problems of the herds' ways and of events, by key path; herds and events that are valid by themselves."""
    for index, herd in herds.items():
        path: KeyPath = ("herds", index)
        if herd.path is not None:
            yield from _route(herd.path, (*path, "path"))
            if herd.place is None and herd.path.along == "place":
                yield (*path, "place"), "missing; 'place' is needed (or path.along: spread)"
        if herd.trajectories is not None:
            yield from _trajectories(herd, herd.trajectories, (*path, "trajectories"), folder)
    for index, event in events.items():
        if event.stop is False:
            yield ("events", index, "stop"), "false: must be true, or left out"
        if event.facing_deg is not None and event.turn is None:
            yield ("events", index, "facing_deg"), "goes with velocity_m_s or stop, not with an impulse"


def _route(route: Route, path: KeyPath) -> Found:
    if route.curve in TABLED:
        if route.radius_m is None:
            yield path, f"missing; 'radius_m' is needed for curve: {route.curve}"
        if route.points_m is not None:
            yield (*path, "points_m"), f"is for splines and polylines; a {route.curve} has center_m and radius_m"
        return
    if route.radius_m is not None:
        yield (*path, "radius_m"), f"is for {' and '.join(TABLED)}; a {route.curve} has points_m"
    if route.points_m is None:
        yield path, f"missing; 'points_m' is needed for curve: {route.curve}"
        return
    points = route.points_m + (route.points_m[:1] if route.closed else ())
    for number, (a, b) in enumerate(pairwise(points)):
        if abs(a[0] - b[0]) + abs(a[1] - b[1]) < 1e-3:
            yield (*path, "points_m", number), f"{list(a)}: the same place as the next point; each must be another"


def _trajectories(herd: Herd, model: Trajectories, path: KeyPath, folder: Path) -> Found:
    if herd.place is not None:
        yield (*path[:2], "place"), "goes without trajectories; with them characters start where theirs begin"
    try:
        found = chosen(_read(model, folder), model.ids, "ids")
    except InputError as error:
        for problem in error.problems:
            yield (*path, "ids" if problem.where == "ids" else "file"), str(problem).removeprefix("ids: ")
        return
    if herd.count > len(found):
        yield (*path[:2], "count"), f"{herd.count}: {model.file} has {len(found)} trajectories to follow"
