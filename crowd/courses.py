"""Where a herd starts and where its way leads: a place, a path's curve, or trajectories."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crowd import curves, placement, tracks
from crowd.curves import Curve
from crowd.scenario_control import Route
from crowd.scenario_herd import Herd
from crowd.tracks import Track

JOIN, TANGENT = 1.0, 0.1  # m further on along the curve, where characters start out to: from beside it, or on it


@dataclass(frozen=True, eq=False)
class Start:
    """The first moment of n characters."""

    points: np.ndarray  # [n, 2] m, world (x, z)
    headings: np.ndarray  # [n] rad, of the way they walk
    curve: Curve | None = None
    along: np.ndarray | None = None  # [n] m
    track: Track | None = None


def start(herd: Herd, seed: int, folder: Path, where: str) -> Start:
    """Start points, headings and the way to go. `where` names the herd's trajectories for messages."""
    if herd.trajectories is not None:
        track = tracks.load(herd.trajectories, herd.count, folder / Path(herd.trajectories.file).expanduser(), where)
        return Start(track.place[0], track.heading[0], track=track)
    points, headings = placement.place(herd, seed)
    if herd.path is None:
        return Start(points, headings)
    begun = _on_curve(herd.path, herd.count, points)
    if "heading_deg" in herd.model_fields_set:
        return dataclasses.replace(begun, headings=headings)
    return begun


def formation(route: Route) -> bool:
    """Whether characters keep their offsets from the herd's middle."""
    return route.keep_formation and route.along == "place"


def _on_curve(route: Route, count: int, points: np.ndarray) -> Start:
    curve = curves.build(route)
    first = route.start_m
    if route.along == "spread":
        room = curve.length if curve.closed else curve.length - min(first or 0.0, curve.length)
        along = (first or 0.0) + room * np.arange(count) / count
        along = np.mod(along, curve.length) if curve.closed else along
        points = curve.at(along)
        offset = np.zeros((count, 2))
    else:
        offset = points - points.mean(0) if formation(route) else np.zeros((count, 2))
        along = np.full(count, min(first, curve.length)) if first is not None else curve.nearest(points - offset)
    join = TANGENT if route.along == "spread" else JOIN
    way = curve.at(along + join) + offset - points
    if not curve.closed:  # nearly at the end: as the curve ends
        ends = np.hypot(*way.T) < 0.1 * join
        way[ends] = curve.points[-1] - curve.points[-2]
    return Start(points, np.arctan2(way[:, 0], way[:, 1]), curve, along)
