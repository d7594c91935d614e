"""Measures of a run: foot slide, speed against dry, drag, reach, steps, lean. From memory or from a recording.

One definition for tests, report and benchmarks. Characters are read in blocks, so memory stays bounded.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from crowd import metrics_gait, posing
from crowd.metrics_gait import Ground
from crowd.recorded_scene import HerdLike, SceneLike
from crowd.stances import find_stances, flat_travel, strides, to_measure, travel

BLOCK_VALUES = 4_000_000  # numbers of one array held at a time
MOST_CHARACTERS = 4096  # measured per herd; of larger herds an even selection
OVER_REACH = 0.001  # m, smaller ones do not count as violations
STANDS = 0.05  # m/s of desired velocity below which a relative speed means nothing
BANDS = ("dry", "to mid-leg", "to hip", "above hip")  # fluid depth over hip height: 0, up to 0.5, up to 1, beyond


@dataclass(frozen=True)
class Row:
    """One line of the table: a quantity of one herd, over all depths or within one band of depth."""

    herd: str
    depth: str  # "all" or one of BANDS
    quantity: str
    unit: str
    mean: float
    median: float
    p95: float
    max: float
    n: int  # samples: stances, strides or characters


@runtime_checkable
class RunLike(Protocol):
    """`crowd.simulate.Result` or `crowd.recorded.Recording`."""

    @property
    def scene(self) -> Any: ...
    @property
    def time(self) -> np.ndarray: ...
    @property
    def herds(self) -> Mapping[str, Any]: ...


def measure(run: RunLike, most: int = MOST_CHARACTERS, ground: Ground | None = None) -> list[Row]:
    """All measures of a run; quantities without a sample (drag of a dry herd) are left out.

    foot_slide_handle, _sole, _ankle (mm per stance): the planted foot handle's largest distance from where it was
    planted; horizontally that of the contact point of the posed foot; that of the ankle while the foot lies flat.
    speed (m/s), relative_speed (over the desired speed, along it): per character over whole gait cycles.
    drag_force (N), drag_power (W), lean (deg): per character, mean over time. step_length (m): half a stride, per
    stride; step_frequency (1/s): per character. over_reach (mm): largest per character; over_reach_share: frames and
    legs out of reach by more than 1 mm. faults: characters that were frozen.

    Of semi-procedural herds also foot_slide_footbase, penetration_stance, penetration_flight (mm, each at its deepest
    in a stance or flight, see `crowd.metrics_gait`) and parked_share (of legs and frames, per character).

    ground (x, z, altitude): exact heights for the penetration; default the run's own scene if that is a live one. A
    recording by itself holds only a coarse grid of heights and says nothing about it.
    """
    rows: list[Row] = []
    scene: SceneLike = run.scene
    exact = ground or (getattr(scene, "ground", None) if hasattr(scene, "terrain") else None)
    for herd in scene.herds:
        samples: dict[tuple[str, str, str], list[np.ndarray]] = {}
        for part in _blocks(herd.count, len(run.time), len(herd.archetype.legs), most):
            arrays = _Reader(run.herds[herd.name], part)
            for quantity, unit, band, values in _block(herd, part, arrays, np.asarray(run.time), exact):
                samples.setdefault((band, quantity, unit), []).append(values)
        for (band, quantity, unit), values in samples.items():
            row = _row(herd.name, band, quantity, unit, np.concatenate(values))
            rows += [row] if row is not None else []
    order = {band: number for number, band in enumerate(("all", *BANDS))}
    names = [herd.name for herd in scene.herds]
    return sorted(rows, key=lambda row: (names.index(row.herd), order[row.depth]))


def hip_height(herd: HerdLike) -> np.ndarray:
    """Height [n] in m of the hips over the ground in the rest pose, at each character's size."""
    archetype = herd.archetype
    _, joints = posing.world_transforms(archetype.skeleton, posing.rest_motion(archetype.skeleton))
    hips = [leg.hip for leg in archetype.legs]
    level = float(np.mean(joints[hips, 1])) if hips else archetype.height
    return np.asarray(herd.scale, float) * max(level, 1e-3)


def write_metrics(rows: Iterable[Row], path: str | Path) -> Path:
    """Write the table as CSV (UTF-8, one header line); returns the path."""
    path = Path(path)
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([field.name for field in fields(Row)])
        writer.writerows([_text(value) for value in astuple(row)] for row in rows)
    return path


def print_metrics(rows: Iterable[Row], console: Any = None, depth: str = "all") -> None:
    """Print the rows of one depth (None of them: all) as a table; `console` is a rich Console."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in ("herd", "quantity", "unit"):
        table.add_column(name, no_wrap=True)
    for name in ("mean", "median", "p95", "max", "n"):
        table.add_column(name, justify="right", no_wrap=True)
    for row in rows:
        if row.depth == depth:
            numbers = (_short(value) for value in (row.mean, row.median, row.p95, row.max))
            table.add_row(row.herd, row.quantity, row.unit, *numbers, str(row.n))
    (console or Console()).print(table)


def _short(value: float) -> str:
    return "0" if abs(value) < 5e-5 else f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def _text(value: Any) -> Any:
    return f"{value:.6g}" if isinstance(value, float) else value


def _row(herd: str, band: str, quantity: str, unit: str, values: np.ndarray) -> Row | None:
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return None
    middle, high = np.quantile(values, [0.5, 0.95])
    mean, most = float(values.mean()), float(values.max())
    return Row(herd, band, quantity, unit, mean, float(middle), float(high), most, len(values))


class _Reader:
    """Arrays of the characters `part` of a herd, read once each."""

    def __init__(self, herd: Mapping[str, Any], part: slice):
        self._herd, self._part = herd, part

    def __getitem__(self, name: str) -> np.ndarray:
        return np.asarray(self._herd[name][:, self._part])

    def __contains__(self, name: object) -> bool:
        return name in self._herd


def _blocks(count: int, frames: int, legs: int, most: int) -> Iterator[slice]:
    """Characters to read together; of more than `most` an even selection."""
    stride = -(-count // most)
    width = stride * int(np.clip(BLOCK_VALUES // max(frames * max(legs, 1) * 3, 1), 1, 4096))
    for first in range(0, count, width):
        yield slice(first, min(first + width, count), stride)


Sample = tuple[str, str, str, np.ndarray]  # quantity, unit, band, values


def _block(herd: HerdLike, part: slice, arrays: _Reader, time: np.ndarray, ground: Ground | None) -> Iterator[Sample]:
    """Samples of all quantities of some characters."""
    fault = arrays["fault"]
    alive = fault == 0
    yield "faults", "1", "all", (~alive).any(0).astype(float)
    if len(time) == 0:
        return
    depth = arrays["depth"]
    hips = hip_height(herd)[part]
    band = np.where(depth <= 0, 0, np.where(depth <= 0.5 * hips, 1, np.where(depth <= hips, 2, 3)))
    band = np.where(alive, band, -1)
    yield from _feet(arrays, alive, band, np.asarray(herd.scale, float)[part], time)
    if "foot_phase" in arrays:
        yield from _gait(arrays, alive, band, ground)
    yield from _body(arrays, alive, band)


def _feet(arrays: _Reader, alive: np.ndarray, band: np.ndarray, size: np.ndarray, time: np.ndarray) -> Iterator[Sample]:
    stances = find_stances(arrays["contact"], alive)
    handle = arrays["handle"]
    kept = to_measure(stances)
    middle = band[(kept.first + kept.last) // 2, kept.character]
    slides = {
        "foot_slide_handle": travel(kept, handle, horizontal=False),
        "foot_slide_sole": travel(kept, arrays["ball"]),
        "foot_slide_ankle": flat_travel(kept, arrays["ankle"], time, size),
    }
    for quantity, values in slides.items():
        yield from _by_band(quantity, "mm", 1000 * values, middle)
    person, frame, length, duration = strides(stances, handle, time)
    yield from _by_band("step_length", "m", length / 2, band[frame, person])
    count, total = np.bincount(person, minlength=len(size)), np.bincount(person, duration, len(size))
    with np.errstate(divide="ignore", invalid="ignore"):
        yield "step_frequency", "1/s", "all", np.where(total > 0, 2 * count / total, np.nan)
    reach = np.where(alive[..., None], arrays["over_reach"], 0.0)
    if reach.shape[2]:
        yield "over_reach", "mm", "all", 1000 * reach.max((0, 2))
        yield "over_reach_share", "1", "all", (reach > OVER_REACH).mean((0, 2))


def _gait(arrays: _Reader, alive: np.ndarray, band: np.ndarray, ground: Ground | None) -> Iterator[Sample]:
    """What only the semi-procedural gait shows."""
    for quantity, values, stances in metrics_gait.per_stance(arrays, alive, ground):
        middle = band[(stances.first + stances.last) // 2, stances.character]
        yield from _by_band(quantity, "mm", 1000 * values, middle)
    yield "parked_share", "1", "all", metrics_gait.parked_share(arrays, alive)


def _by_band(quantity: str, unit: str, values: np.ndarray, band: np.ndarray) -> Iterator[Sample]:
    yield quantity, unit, "all", values
    for number, name in enumerate(BANDS):
        yield quantity, unit, name, values[band == number]


def _body(arrays: _Reader, alive: np.ndarray, band: np.ndarray) -> Iterator[Sample]:
    """Speed over whole gait cycles and the means of drag and lean, per character and band."""
    desired = arrays["desired_velocity"][..., [0, 2]].astype(float)
    asked = np.linalg.norm(desired, axis=-1)
    moving = asked > STANDS
    along = np.sum(arrays["velocity"][..., [0, 2]] * desired, -1) / np.where(moving, asked, 1.0)
    speed = np.linalg.norm(arrays["velocity"][..., [0, 2]], axis=-1)
    drag = np.linalg.norm(arrays["drag_force"].astype(float), axis=-1)
    power, lean = arrays["drag_power"], np.degrees(arrays["pitch"])
    phase = arrays["phase"]
    for name in ("all", *BANDS):
        inside = alive if name == "all" else band == BANDS.index(name)
        cycles = whole_cycles(phase, inside)
        yield "speed", "m/s", name, _mean(speed, cycles)
        with np.errstate(invalid="ignore", divide="ignore"):
            yield "relative_speed", "1", name, _mean(along, cycles & moving) / _mean(asked, cycles & moving)
        wet = inside & (band > 0)
        if name != "dry":
            yield "drag_force", "N", name, _mean(drag, wet)
            yield "drag_power", "W", name, _mean(power, wet)
        yield "lean", "deg", name, _mean(lean, inside)


def _mean(values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Mean [n] over the frames that `where` [t, n] picks; NaN without any."""
    count = where.sum(0)
    total = np.where(where, values, 0.0).sum(0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def whole_cycles(phase: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Frames [t, n] of the longest run of `inside` of each character, cut to whole cycles of its phase [t, n].

    A run of less than one cycle (a character that stands, a band crossed too fast) picks nothing.
    """
    count = phase.shape[1]
    picked = np.zeros(phase.shape, bool)
    step = np.diff(phase, axis=0)
    turns = np.vstack([np.zeros((1, count)), np.cumsum(step - np.round(step), 0)])
    edge = np.diff(np.pad(inside.astype(np.int8), ((1, 1), (0, 0))), axis=0)
    for person in range(count):
        first, last = np.nonzero(edge[:, person] > 0)[0], np.nonzero(edge[:, person] < 0)[0]
        if len(first) == 0:
            continue
        longest = int(np.argmax(last - first))
        a, b = int(first[longest]), int(last[longest])
        advance = turns[a:b, person] - turns[a, person]
        # Half a frame of grace: n cycles of k frames end one frame before the phase is back.
        grace = advance[-1] / max(b - a - 1, 1)
        whole = np.floor(advance[-1] + grace + 1e-6)
        if whole >= 1:
            end = int(np.argmax(advance + grace * 0.5 >= whole)) or b - a
            picked[a : a + end, person] = True
    return picked


__all__ = ["BANDS", "Row", "hip_height", "measure", "print_metrics", "whole_cycles", "write_metrics"]
