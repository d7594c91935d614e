"""Foot events of a run: when feet lift, leave the ground, strike it and have landed (4.15)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np

from crowd.errors import fail, nearest

# The event that ends each phase of a foot: 0 stance, 1 lifting, 2 in flight, 3 landing.
EVENTS = ("lift", "liftoff", "strike", "land")
ROW = np.dtype([("time", np.float64), ("character", np.int32), ("leg", np.int32), ("event", "U7")])
BLOCK_VALUES = 16_000_000  # phases read at a time


@runtime_checkable
class RunLike(Protocol):
    """`crowd.simulate.Result` or `crowd.recorded.Recording`."""

    @property
    def time(self) -> np.ndarray: ...
    @property
    def herds(self) -> Mapping[str, Any]: ...


def foot_events(run: RunLike, herd: str) -> np.ndarray:
    """Foot events of a semi-procedural herd, in order of time, then character, leg and course of the step.

    A structured array with time (s, of the first recorded frame after the event), character and leg (numbers, in the
    archetype's order of legs) and event: `lift` (heel or toe rises), `liftoff` (the foot leaves the ground), `strike`
    (it touches it), `land` (it lies on it). `events[events["event"] == "strike"]` picks some;
    `pandas.DataFrame(events)` makes a table.

    Events that fall between two recorded frames are all there, at the same time; only a foot that is a whole step
    further between two frames seems to have rested. Raises InputError for an unknown herd or one of another gait.
    """
    known = list(run.herds)
    if herd not in known:
        raise fail("herd", f"{herd!r}: no such herd{nearest(herd, known)}; there are {', '.join(known)}")
    if "foot_phase" not in run.herds[herd]:
        raise fail("herd", f"{herd!r}: foot events are those of `gait: semi_procedural`; this herd walks by another")
    parts = [transitions(phase, first) for first, phase in _blocks(run.herds[herd]["foot_phase"], len(run.time))]
    rows = np.concatenate([np.zeros((0, 4), np.int64), *parts])
    out = np.zeros(len(rows), ROW)
    frame, out["character"], out["leg"], event = rows.T
    out["time"], out["event"] = np.asarray(run.time)[frame], np.array(EVENTS)[event]
    return out


def transitions(phase: np.ndarray, first: int = 0) -> np.ndarray:
    """Rows [E, 4] of frame, character, leg, event (number in EVENTS) where phases [t, n, L] change; skipped ones too.

    first: number of the first frame. Ordered by frame, character, leg and course.
    """
    steps = np.diff(phase.astype(np.int8), axis=0) % 4
    frame, character, leg = np.nonzero(steps)
    count = steps[frame, character, leg].astype(np.int64)
    row = np.repeat(np.arange(len(count)), count)
    course = np.arange(len(row)) - (np.cumsum(count) - count)[row]
    event = (phase[frame, character, leg].astype(np.int64)[row] + course) % 4
    return np.stack([frame[row] + first + 1, character[row], leg[row], event], 1)


def _blocks(phase: Any, frames: int) -> Iterator[tuple[int, np.ndarray]]:
    """Pieces of phases [t, n, L] along time that overlap in one frame, and where each starts."""
    width = max(1, BLOCK_VALUES // max(int(np.prod(phase.shape[1:])), 1))
    for first in range(0, max(frames - 1, 0), width):
        yield first, np.asarray(phase[first : first + width + 1])
