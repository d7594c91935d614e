"""Pictures of the motion analysis: foot paths from the side and from above, curves with key times, velocities."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from crowd.analysis.flight import TIMES
from crowd.analysis.motion import Motion
from crowd.analysis.motion_set import MotionSet
from crowd.analysis.samples import KEYTIMES, SAMPLES, LegAnalysis
from crowd.report_plots import figure, finish, speed_rings
from crowd.view.palette import GRID, INK, QUIET, herd_color

HEEL, TOE, BASE, STANCE = "#0072b2", "#d55e00", INK, "#009e73"
COLUMNS = 4  # legs side by side in one picture
EVERY = 5  # of the 50 samples, where the foot is drawn
KEY_MARKS = dict(zip(KEYTIMES, ("lift", "off", "post", "pre", "strike", "land"), strict=True))


def draw(found: MotionSet, folder: Path) -> list[Path]:
    """Draws every motion of a set, but no backwards twins, and the plane of velocities; the paths written."""
    paths = [velocities(found, folder / "velocities.png")]
    for number, motion in enumerate(found.motions):
        if motion.backwards:
            continue
        stem = f"{number:02d}_{re.sub(r'[^A-Za-z0-9]+', '_', motion.name).strip('_')}"
        legs = range(len(motion.keytimes))
        for start in range(0, len(legs), COLUMNS):
            part = legs[start : start + COLUMNS]
            suffix = f"_{start // COLUMNS + 1}" if len(legs) > COLUMNS else ""
            paths.append(feet(found, motion, part, folder / f"{stem}{suffix}.png"))
    return paths


def feet(found: MotionSet, motion: Motion, legs: Sequence[int], path: Path) -> Path:
    """One column per leg: its path from the side and from above, height and travel over the cycle, and balance."""
    made, axes = figure(max(3.9 * len(legs) + 0.4, 7.0), 10.5, 4, len(legs), height_ratios=(3, 3, 3, 2))
    ahead = motion.direction if np.any(motion.direction) else np.array([0.0, 0.0, 1.0])
    ahead = (-1 if motion.backwards else 1) * ahead / np.linalg.norm(ahead)
    left = np.array([ahead[2], 0.0, -ahead[0]])
    for column, leg in enumerate(legs):
        data = motion.analysis.legs[leg]
        _from_the_side(axes[0, column], data, ahead)
        _from_above(axes[1, column], data, ahead, left)
        _curves(axes[2, column], motion, leg)
        _balance(axes[3, column], motion, leg)
        axes[0, column].set_title(found.feet[leg].name, fontsize=11, color=INK, loc="center")
        axes[3, column].set_xlabel("leg-cycle time (0: stance)", color=INK, fontsize=9)
    for row, name in enumerate(
        ("from the side: height in m", "from above: to the left in m", "height in m", "balance")
    ):
        axes[row, 0].set_ylabel(name, color=INK, fontsize=10)
    told = f"{motion.name}: {motion.duration:.2f} s"
    if motion.kind == "walk":
        told += f", {motion.distance:.2f} m, {motion.speed:.2f} m/s"
    return finish(made, path, told, axes[0, 0], columns=4)


def _plates(axes: Axes, ends: np.ndarray, other: np.ndarray) -> None:
    """The foot as a segment from heel to toe, at a few samples."""
    for k in range(0, SAMPLES, EVERY):
        axes.plot(*zip(ends[k], other[k], strict=True), color=QUIET, alpha=0.35, linewidth=2.2, zorder=1)


def _from_the_side(axes: Axes, leg: LegAnalysis, ahead: np.ndarray) -> None:
    flat = [np.stack([points @ ahead, points[:, 1]], -1) for points in (leg.heel, leg.toe_tip, leg.footbase)]
    _plates(axes, flat[0], flat[1])
    for points, color, name, width in zip(flat, (HEEL, TOE, BASE), ("heel", "toe tip", "footbase"), (1.4, 1.4, 1.9),
                                          strict=True):  # fmt: skip
        axes.plot(points[:, 0], points[:, 1], color=color, linewidth=width, label=name)
    axes.axhline(0.0, color=QUIET, linewidth=0.9, zorder=0)
    axes.plot(*flat[2][leg.stance_index], "o", color=STANCE, markersize=8, label="stance", zorder=5)
    axes.margins(0.06, 0.12)
    _at_least(axes, 0.5 * float(np.linalg.norm(leg.foot_vector)))
    axes.set_xlabel("ahead in m", color=INK, fontsize=9)


def _at_least(axes: Axes, span: float) -> None:
    """Widens the vertical range, so that the noise of feet that stand is not drawn as large as a step."""
    low, high = axes.get_ylim()
    more = max(0.0, 0.5 * (span - (high - low)))
    axes.set_ylim(low - more, high + more)


def _from_above(axes: Axes, leg: LegAnalysis, ahead: np.ndarray, left: np.ndarray) -> None:
    def plan(points: np.ndarray) -> np.ndarray:
        return np.stack([points @ ahead, points @ left], -1)

    _plates(axes, plan(leg.heel), plan(leg.toe_tip))
    for points, color, width in ((leg.heel, HEEL, 1.4), (leg.toe_tip, TOE, 1.4), (leg.footbase, BASE, 1.9)):
        axes.plot(*plan(points).T, color=color, linewidth=width)
    axes.plot(*plan(leg.stance_position[None])[0], "o", color=STANCE, markersize=8, zorder=5)
    if np.any(leg.axis):
        ends = plan(np.stack([leg.farthest, leg.opposite]))
        axes.plot(*ends.T, color=QUIET, linewidth=1.2, linestyle=(0, (4, 2)))
        marks = plan(np.stack([leg.centre, leg.farthest, leg.opposite]))
        for (x, y), name in zip(marks, ("c", "P", "Q"), strict=True):
            axes.plot(x, y, "s", color=QUIET, markersize=4)
            axes.annotate(name, (x, y), (4, 4), textcoords="offset points", fontsize=9, color=INK)
    _at_least(axes, 0.35 * float(np.ptp(axes.get_xlim())))  # sideways sway, not blown up to the size of a stride
    dashed = "; dashed: movement axis" if np.any(leg.axis) else ""
    axes.set_xlabel(f"ahead in m{dashed}", color=INK, fontsize=9)


def _curves(axes: Axes, motion: Motion, leg: int) -> None:
    """Heights of heel, toe tip and flight over leg-cycle time; the share of the stride; key times."""
    data = motion.analysis.legs[leg]
    order = (data.stance_index + np.arange(SAMPLES + 1)) % SAMPLES
    time = np.append(TIMES, 1.0)
    axes.plot(time, data.heel[order, 1], color=HEEL, linewidth=1.3)
    axes.plot(time, data.toe_tip[order, 1], color=TOE, linewidth=1.3)
    axes.set_xlim(0, 1)
    _at_least(axes, 0.5 * float(np.linalg.norm(data.foot_vector)))
    if motion.kind == "grounded":
        return
    table = np.concatenate([motion.flight[:, leg], motion.flight[:1, leg] + np.array([0.0, 0.0, 1.0])])
    axes.plot(time, table[:, 1], color=BASE, linewidth=1.9)
    axes.axvspan(motion.keytimes[leg, 1], motion.keytimes[leg, 4], color=GRID, alpha=0.45, linewidth=0, zorder=0)
    travel = axes.twinx()
    travel.plot(time, table[:, 2], color=STANCE, linewidth=1.5, linestyle=(0, (5, 2)))
    travel.set_ylim(-0.15, 1.45)
    travel.set_yticks([0.0, 0.5, 1.0])
    travel.tick_params(colors=STANCE, labelsize=8)
    for side in ("top", "left", "right", "bottom"):
        travel.spines[side].set_visible(False)
    travel.set_ylabel("share of the stride (dashed)", color=STANCE, fontsize=8)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.28 * (high - low))
    _key_times(axes, motion.keytimes[leg])


def _key_times(axes: Axes, times: np.ndarray) -> None:
    """Dotted lines with names at the top, moved apart where they would overlap."""
    shown = np.array(times, float)
    gap = 0.065
    for _ in range(60):
        near = np.diff(shown) < gap
        if not near.any():
            break
        push = np.where(near, 0.5 * (gap - np.diff(shown)) + 1e-4, 0.0)
        shown[:-1] -= push
        shown[1:] += push
        shown = np.clip(shown, 0.02, 0.98)
    for time, place, name in zip(times, shown, KEY_MARKS.values(), strict=True):
        axes.axvline(time, color=QUIET, linewidth=0.8, linestyle=(0, (1, 2)))
        axes.text(
            place,
            0.985,
            f"{name} {time:.2f}",
            rotation=90,
            fontsize=7.5,
            color=INK,
            ha="center",
            va="top",
            transform=axes.get_xaxis_transform(),
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.75},
        )


def _balance(axes: Axes, motion: Motion, leg: int) -> None:
    data = motion.analysis.legs[leg]
    order = (data.stance_index + np.arange(SAMPLES + 1)) % SAMPLES
    axes.plot(np.append(TIMES, 1.0), data.balance[order], color=BASE, linewidth=1.6)
    axes.set_xlim(0, 1)
    axes.set_ylim(-0.03, 1.03)
    axes.set_yticks([0, 0.5, 1], ["heel", "flat", "toe"])
    if motion.kind == "walk":
        axes.axvspan(motion.keytimes[leg, 1], motion.keytimes[leg, 4], color=GRID, alpha=0.45, linewidth=0, zorder=0)


def velocities(found: MotionSet, path: Path) -> Path:
    """The plane of velocities: every motion where it travels to, forward up and left to the left."""
    made, axes = figure(7.2, 7.0)
    plot: Axes = axes[0, 0]
    fastest = max([motion.speed for motion in found.motions] + [1e-3])
    speed_rings(plot, fastest)
    groups = list(dict.fromkeys(found.groups))
    taken: list[tuple[float, float]] = []
    for motion, group in zip(found.motions, found.groups, strict=True):
        x, z = motion.velocity[0], motion.velocity[2]
        color = herd_color(groups.index(group) + 4)
        mark = {"marker": "o" if not motion.backwards else "D", "markersize": 8, "color": color}
        plot.plot(x, z, markerfacecolor=color if not motion.backwards else "white", linestyle="", **mark)
        shift = sum(abs(x - a) < 0.3 * fastest and abs(z - b) < 0.045 * fastest for a, b in taken)
        plot.annotate(motion.name, (x, z), (9, -4 - 12 * shift), textcoords="offset points", fontsize=9, color=INK)
        taken.append((x, z))
    size = 1.15 * fastest
    plot.set_xlim(size, -size)
    plot.set_ylim(-size, size)
    plot.set_aspect("equal")
    plot.set_xlabel("to the left in m/s", color=INK, fontsize=10)
    plot.set_ylabel("forward in m/s", color=INK, fontsize=10)
    return finish(made, path, f"{found.archetype.name}: velocities of its motions")
