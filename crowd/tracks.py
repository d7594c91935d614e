"""Trajectories as one table: where each character should be, how fast and facing where, at equal steps of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crowd.errors import fail
from crowd.scenario_control import Trajectories
from crowd.scenario_trajectories import Trajectory, chosen, read_trajectories

LEAST_RATE, MOST_RATE = 10.0, 30.0  # Hz of the table: linear between its samples is then fine enough
VELOCITY_SPAN = 0.12  # s on both sides, over which a velocity is measured: trackers' noise is a centimetre
HEADING_SPAN = 0.5  # s on both sides, over which a direction is measured: heads sway with every step
HEADING_WAY = 0.1  # m within it; a character that moves less keeps the direction it had, or will have
MOST_NUMBERS = 250_000_000  # of a table: 1 GB


@dataclass(frozen=True, eq=False)
class Track:
    """n characters over m samples; the first sample is the start of the run."""

    rate: float  # samples per second
    place: np.ndarray  # [m, n, 2] m, world (x, z); the first before a trajectory begins, the last when it is over
    velocity: np.ndarray  # [m, n, 2] m/s; 0 before and after
    heading: np.ndarray  # [m, n] rad, without jumps of whole turns


def load(model: Trajectories, count: int, path: Path, where: str) -> Track:
    """The table of the first `count` chosen trajectories of a file; 0: of all.

    Raises `InputError` for an unknown id, more characters than the file has, or a table larger than memory.
    """
    found = chosen(read_trajectories(path, model.columns, model.rate_hz), model.ids, f"{where}.ids")
    if count > len(found):
        raise fail(where, f"{path.name} has {len(found)} trajectories to follow; {count} characters are asked for")
    found = found[: count or len(found)]
    start = min(one.time[0] for one in found) if model.start_s is None else model.start_s
    end = max(one.time[-1] for one in found)
    if start > end:
        raise fail(f"{where}.start_s", f"{start:g} s is after the last sample ({end:g} s)")
    rate = float(np.clip(_sampling(found), LEAST_RATE, MOST_RATE))
    samples = int(np.ceil((end - start) * rate)) + 2  # the last one stands
    if 5 * samples * len(found) > MOST_NUMBERS:
        raise fail(where, f"{samples:,} samples of {len(found):,} characters are too many; choose fewer ids")
    at = start + np.arange(samples) / rate
    place, velocity, heading = zip(*(_followed(one, at) for one in found), strict=True)
    return Track(rate, np.stack(place, 1) + np.array(model.offset_m), np.stack(velocity, 1), np.stack(heading, 1))


def _sampling(found: Sequence[Trajectory]) -> float:
    """Hz, the most usual one."""
    steps = np.concatenate([np.diff(one.time) for one in found])
    return 1.0 / float(np.median(steps)) if len(steps) else LEAST_RATE


def _followed(one: Trajectory, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place [m, 2], velocity [m, 2] and heading [m] at the times `at`."""
    first, last = one.time[0], one.time[-1]
    inside = (at >= first) & (at < last)
    low, high = (np.clip(at + side * VELOCITY_SPAN, first, last) for side in (-1, 1))
    span = np.maximum(high - low, 1e-9)[:, None]
    velocity = np.where(inside[:, None], (_place(one, high) - _place(one, low)) / span, 0.0)
    return _place(one, at), velocity, _heading(one, at)


def _place(one: Trajectory, at: np.ndarray) -> np.ndarray:
    """Places [m, 2] on the cubic through the samples whose slopes are the neighbours' (held beyond the ends)."""
    time, place = one.time, one.place
    if len(time) == 1:
        return np.repeat(place, len(at), 0)
    at = np.clip(at, time[0], time[-1])
    step = np.diff(time)[:, None]
    slope = np.diff(place, axis=0) / step
    inner = (slope[:-1] * step[1:] + slope[1:] * step[:-1]) / (step[:-1] + step[1:])
    tangent = np.concatenate([slope[:1], inner, slope[-1:]])
    low = np.clip(np.searchsorted(time, at, "right") - 1, 0, len(time) - 2)
    h = step[low]
    u = ((at - time[low])[:, None]) / h
    a, b, ta, tb = place[low], place[low + 1], tangent[low] * h, tangent[low + 1] * h
    return (1 + 2 * u) * (1 - u) ** 2 * a + u * (1 - u) ** 2 * ta + u**2 * (3 - 2 * u) * b + u**2 * (u - 1) * tb


def _heading(one: Trajectory, at: np.ndarray) -> np.ndarray:
    """Headings [m] rad: the file's, or the way gone around each moment; held where there is none."""
    if one.heading is not None:
        return np.interp(at, one.time, np.unwrap(one.heading))
    way = _place(one, at + HEADING_SPAN) - _place(one, at - HEADING_SPAN)
    moving = np.hypot(*way.T) > HEADING_WAY
    if not moving.any():
        x, z = one.place[-1] - one.place[0]
        return np.full(len(at), np.arctan2(x, z) if x or z else 0.0)
    angle = np.unwrap(np.arctan2(way[moving, 0], way[moving, 1]))
    return np.interp(at, at[moving], angle)
