"""Normalised foot flight of the default mode, and the lookup of such tables (sections 2.11, 2.12)."""

from __future__ import annotations

import numpy as np

from crowd.analysis.samples import SAMPLES

TIMES = np.arange(SAMPLES) / SAMPLES


def flight_table(
    footbase: np.ndarray, stance: int, liftoff: float, strike: float, direction: np.ndarray, distance: float,
) -> np.ndarray:  # fmt: skip
    """[50, 3] normalised footbase over leg-cycle time: exactly (0, 0, 0) until liftoff, (0, 0, 1) from strike on.

    footbase: [50 or more, 3] in clip time, stance: its sample at leg-cycle time 0; liftoff and strike: multiples of
    1/50; direction: [3] unit, horizontal; distance: m per cycle. In flight x (sideways, m) and y (up, m, >= 0) are the
    clip's less the line between their values at liftoff and strike; z runs from 0 to 1 of a stride likewise. A motion
    that does not travel (distance 0) has z = (1 - cos(pi u)) / 2 over its flight, as grounded motions have.
    """
    path = footbase[(stance + np.arange(SAMPLES)) % SAMPLES]
    first, last = round(liftoff * SAMPLES), round(strike * SAMPLES)
    share = np.clip((TIMES - liftoff) / (strike - liftoff), 0.0, 1.0)
    off = path - path[first] + distance * direction * (TIMES - liftoff)[:, None]
    left = np.array([direction[2], 0.0, -direction[0]])
    x, y = off @ left, off[:, 1]
    z = off @ direction / distance if distance > 0 else 0.5 - 0.5 * np.cos(np.pi * share)
    table = np.stack([x - x[last] * share, np.maximum(y - y[last] * share, 0.0), z + (1.0 - z[last]) * share], -1)
    table[: first + 1] = 0.0
    table[last:] = [0.0, 0.0, 1.0]
    return table


def lookup(table: np.ndarray, time: np.ndarray | float, compat: bool = False) -> np.ndarray:
    """Table [50, 3] at leg-cycle times [...] in 0..1, linear between samples: [..., 3].

    After the last sample it leads to sample 0 one stride on; compat: it holds the last sample, as the original does.
    """
    time = np.clip(np.asarray(time, float), 0.0, 1.0)
    after = table[-1] if compat else table[0] + np.array([0.0, 0.0, 1.0])
    wrapped = np.concatenate([table, after[None]])
    low = np.minimum(np.floor(time * SAMPLES).astype(int), SAMPLES - 1)
    t = (time * SAMPLES - low)[..., None]
    return wrapped[low] * (1 - t) + wrapped[low + 1] * t


def phase_time(phase: int, progress: np.ndarray | float, liftoff: float, strike: float) -> np.ndarray:
    """Leg-cycle time of a progress 0..1 within phase 0 (until liftoff), 1 (flight) or 2 (from strike)."""
    start, end = ((0.0, liftoff), (liftoff, strike), (strike, 1.0))[phase]
    return start + np.asarray(progress) * (end - start)
