"""Measures of the semi-procedural gait: penetration of the ground, drift of the footbase, time that legs rest."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol, runtime_checkable

import numpy as np

from crowd.stances import Stances, chosen, find_stances, to_measure, travel

# (x, z, altitude) to the height of the ground, m; altitude is the world height of the character that asks.
Ground = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@runtime_checkable
class Arrays(Protocol):
    """Recorded arrays [t, n, ...] of some characters by name."""

    def __getitem__(self, name: str, /) -> np.ndarray: ...
    def __contains__(self, name: object, /) -> bool: ...


def per_stance(arrays: Arrays, alive: np.ndarray, ground: Ground | None) -> Iterator[tuple[str, np.ndarray, Stances]]:
    """Quantities in m with the stances or flights [S] that they are of.

    foot_slide_footbase: largest distance, in space, of the middle of the posed foot's footbase from where it was when
    the stance began. penetration_stance, penetration_flight: deepest that heel or toe tip came under the ground (0 when
    neither did); only where a ground is given. Flights cut off by the recording or a fault do not count.
    """
    contact = arrays["contact"]
    stances = to_measure(find_stances(contact, alive))
    yield "foot_slide_footbase", travel(stances, arrays["ball"], horizontal=False), stances
    if ground is None:
        return
    depth = penetration(arrays, alive, ground)
    flights = find_stances(~contact, alive)
    flights = chosen(flights, flights.whole)
    yield "penetration_stance", _deepest(stances, depth), stances
    yield "penetration_flight", _deepest(flights, depth), flights


def penetration(arrays: Arrays, alive: np.ndarray, ground: Ground) -> np.ndarray:
    """[t, n, L] m by which the deeper one of heel and toe tip lies under the ground, 0 above; 0 when not alive."""
    altitude = arrays["position"][..., 1, None].astype(float)
    depth = np.zeros(arrays["contact"].shape)
    for name in ("heel", "toe"):
        point = np.where(alive[..., None, None], arrays[name], 0.0).astype(float)
        level = ground(point[..., 0], point[..., 2], np.where(alive[..., None], altitude, 0.0))
        depth = np.maximum(depth, level - point[..., 1])
    return np.where(alive[..., None], depth, 0.0)


def parked_share(arrays: Arrays, alive: np.ndarray) -> np.ndarray:
    """[n] share of legs and frames in which a leg rests; NaN for characters that were never alive."""
    count = alive.sum(0) * arrays["parked"].shape[2]
    rests = (arrays["parked"] & alive[..., None]).sum((0, 2))
    return np.where(count > 0, rests / np.maximum(count, 1), np.nan)


def _deepest(stances: Stances, depth: np.ndarray) -> np.ndarray:
    """Largest depth [S] in each stance of depth [t, n, L]."""
    if len(stances) == 0:
        return np.zeros(0)
    stance, frame, start = stances.frames()
    return np.maximum.reduceat(depth[frame, stances.character[stance], stances.leg[stance]], start)
