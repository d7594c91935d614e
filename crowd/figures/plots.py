"""The paper's figures from our walks, as PNG."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from crowd.figures.pools import FLUIDS, Study, Walk
from crowd.figures.statements import TABLE, force, medians, pressure, torque
from crowd.report_plots import figure, finish
from crowd.view.palette import HERD_COLORS, INK, QUIET

SHOWN = 6.0  # s of a speed curve
BLUES = ("#c6dbef", "#9ecae1", "#6baed6", "#3182bd", "#08519c", "#08306b")  # shallow to deep
FLUID_COLORS = dict(zip(FLUIDS, ("#0072b2", "#a6611a", "#4d9221"), strict=True))


def figure_4(study: Study, path: Path) -> Path:
    """Centre of pressure over the cycle and against itself, for rising water."""
    made, axes = figure(12.0, 4.4, 1, 3, width_ratios=(2, 2, 1.6))
    height, lateral, loop = axes[0]
    for walk, color in zip(study.depth_series()[1:], BLUES[1:], strict=True):
        phase, up, left = pressure(walk)
        middle, mean_up, mean_left = _binned(phase, up, left)
        label = f"{walk.pool.depth} ({walk.depth:.2f} m)"
        height.plot(phase, up, ".", color=color, markersize=2, alpha=0.25)
        height.plot(middle, mean_up, color=color, linewidth=2, label=label)
        lateral.plot(phase, left, ".", color=color, markersize=2, alpha=0.25)
        lateral.plot(middle, mean_left, color=color, linewidth=2)
        closed = np.arange(len(middle) + 1) % len(middle)
        loop.plot(mean_left[closed], mean_up[closed], color=color, linewidth=2)
    _named(height, "phase of the gait cycle", "height over the ground, m")
    _named(lateral, "phase of the gait cycle", "to the left, m")
    _named(loop, "to the left, m", "height, m")
    loop.invert_xaxis()
    return finish(made, path, f"Fig. 4: centre of pressure ({study.archetype})", height)


def figure_6(study: Study, path: Path) -> Path:
    """Speed against time, one curve a depth."""
    made, axes = figure(9.0, 4.6)
    for walk, color in zip(study.depth_series(), BLUES, strict=True):
        _speed(axes[0, 0], walk, color, f"{walk.pool.depth} ({walk.depth:.2f} m): {100 * walk.remaining:.0f} %")
    return _finished(made, axes[0, 0], path, f"Fig. 6: speed in water of rising depth ({study.archetype})")


def figure_7(study: Study, path: Path) -> Path:
    """Speed against time in three fluids, knee-deep and waist-deep."""
    made, axes = figure(12.0, 4.6, 1, 2, sharey=True)
    for each, depth in zip(axes[0], ("knee", "waist"), strict=True):
        for fluid in FLUIDS:
            walk = study.walks[f"{fluid} {depth}"]
            _speed(each, walk, FLUID_COLORS[fluid], f"{fluid}: {100 * walk.remaining:.0f} %")
        each.set_title(f"{depth}-deep ({walk.depth:.2f} m)", fontsize=10, color=INK, loc="left")
        each.set_ylim(bottom=0)
        each.legend(frameon=False, fontsize=9, loc="lower right")
        _named(each, "time, s", "speed, m/s")
    return finish(made, path, f"Fig. 7: speed in three fluids ({study.archetype})")


def figure_8(study: Study, path: Path) -> Path:
    """Speed against time chest-deep, arms up and down."""
    made, axes = figure(9.0, 4.6)
    up, down = study.walks["water chest"], study.walks["arms down"]
    _speed(axes[0, 0], up, HERD_COLORS[4], f"arms up: {100 * up.remaining:.1f} %")
    _speed(axes[0, 0], down, HERD_COLORS[0], f"arms down: {100 * down.remaining:.1f} %")
    return _finished(made, axes[0, 0], path, f"Fig. 8: arms, chest-deep in water ({study.archetype})")


def table(study: Study, path: Path) -> Path:
    """Table 1, ours beside the paper's, as bars."""
    made, axes = figure(11.0, 4.2, 1, 2)
    speed, coefficient = axes[0]
    place = np.arange(len(FLUIDS))
    ours = [100 * study.walks[f"{fluid} waist"].remaining for fluid in FLUIDS]
    found = [medians(study, fluid) for fluid in FLUIDS]
    belt = [] if study.belt is None else [medians(study.belt, fluid).median for fluid in FLUIDS]
    for shift, values, color, label in (
        (-0.2, [100 * TABLE[fluid][1] for fluid in FLUIDS], QUIET, "paper (a person)"),
        (0.2, ours, HERD_COLORS[4], f"ours ({study.archetype})"),
    ):
        bars = speed.bar(place + shift, values, 0.38, color=color, label=label)
        speed.bar_label(bars, fmt="%.1f", fontsize=8)
    kinds = [
        ([TABLE[fluid][0] for fluid in FLUIDS], QUIET, None),
        ([one.median for one in found], HERD_COLORS[4], "median over triangles"),
        *([(belt, HERD_COLORS[0], "the same with a belt, B per triangle")] if belt else []),
        ([one.aggregate for one in found], HERD_COLORS[6], "aggregate"),
    ]
    for number, (values, color, label) in enumerate(kinds):
        shift = 0.21 * (number - 0.5 * (len(kinds) - 1))
        bars = coefficient.bar(place + shift, values, 0.2, color=color, label=label)
        coefficient.bar_label(bars, fmt="%.3g", fontsize=7)
    coefficient.set_yscale("log")
    for each in (speed, coefficient):
        each.set_xticks(place, FLUIDS)
        each.legend(frameon=False, fontsize=9)
    _named(speed, "", "remaining speed, %")
    _named(coefficient, "", "drag coefficient")
    return finish(made, path, f"Table 1: waist-deep ({study.archetype})")


def torques(study: Study, path: Path) -> Path:
    """Force and pitch torque against depth: one grows, the other hardly."""
    made, axes = figure(9.0, 4.2, 1, 2)
    series = study.depth_series()
    depth = [walk.depth for walk in series]
    for each, measure, label in zip(axes[0], (force, torque), ("force, N", "pitch torque, N m"), strict=True):
        values = [measure(walk) for walk in series]
        each.fill_between(
            depth, [v.min() for v in values], [v.max() for v in values], color=BLUES[0], alpha=0.4, linewidth=0
        )
        each.plot(depth, [v.mean() for v in values], "o-", color=BLUES[3], linewidth=2)
        _named(each, "depth, m", label)
    return finish(made, path, f"Section 6: force and torque against depth ({study.archetype})")


def _speed(axes: Axes, walk: Walk, color: str, label: str) -> None:
    time = (1 + np.arange(len(walk.speed))) / 60.0
    shown = time <= SHOWN
    axes.plot(time[shown], walk.speed[shown], color=color, linewidth=1.7, label=label)


def _binned(phase: np.ndarray, *values: np.ndarray, bins: int = 40) -> tuple[np.ndarray, ...]:
    """Middles of phase bins and the mean of each value in them."""
    which = np.minimum((phase * bins).astype(int), bins - 1)
    count = np.bincount(which, minlength=bins)
    keep = count > 0
    means = (np.bincount(which, value, bins)[keep] / count[keep] for value in values)
    return ((np.arange(bins) + 0.5) / bins)[keep], *means


def _named(axes: Axes, x: str, y: str) -> None:
    axes.set_xlabel(x, color=INK, fontsize=10)
    axes.set_ylabel(y, color=INK, fontsize=10)


def _finished(made: Figure, axes: Axes, path: Path, title: str) -> Path:
    axes.set_ylim(bottom=0)
    axes.set_xlim(0, SHOWN)
    axes.legend(frameon=False, fontsize=9, loc="lower right")
    _named(axes, "time, s", "speed, m/s")
    return finish(made, path, title)


PLOTS = {
    "figure_4_center_of_pressure": figure_4,
    "section_6_torque": torques,
    "figure_6_depths": figure_6,
    "figure_7_fluids": figure_7,
    "figure_8_arms": figure_8,
    "table_1": table,
}
