"""Plots of the semi-procedural gait of a character: leg cycles, weights of motions, footprints, foot heights (7.2)."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon, Rectangle, Wedge

from crowd.footfalls import EVENTS, transitions
from crowd.recorded_scene import HerdLike, SceneLike, motions_of
from crowd.report_plots import copy_style, figure, finish, speed_rings
from crowd.view.footprints import plate_corners
from crowd.view.palette import GRID, INK, QUIET, herd_color, leg_color

MOST_HERDS = 4  # shown in one picture
SPAN = 4.0  # s of the timeline, and of the footprints that are still shown
TRAIL = 3.0  # s of the velocity's past
# Marker and whether it is filled; hollow ones are smaller and lie over filled ones of the same frame.
MARKS = {"lift": ("^", False), "liftoff": ("^", True), "strike": ("v", True), "land": ("v", False)}
SHADES = (0.9, 0.45, 0.0, 0.45)  # of the bar under a foot: stance, lifting, flight, landing


class Walker:
    """Recorded arrays [t, ...] of one character of a semi-procedural herd, in double precision."""

    def __init__(self, run: Any, herd: HerdLike, character: int = 0):
        self.herd, self.character = herd, character
        self.time = np.asarray(run.time)
        self.arrays = run.herds[herd.name]
        self.scale = float(np.broadcast_to(herd.scale, herd.count)[character])
        self.legs = [leg.name for leg in herd.archetype.legs]

    def __getitem__(self, name: str) -> np.ndarray:
        return np.asarray(self.arrays[name][:, self.character], float)

    @cached_property
    def local_velocity(self) -> np.ndarray:
        """[t, 2] m/s to the left and forward, at the size of the clips."""
        velocity, yaw = self["velocity"], self["yaw"]
        x, z, sin, cos = velocity[:, 0], velocity[:, 2], np.sin(yaw), np.cos(yaw)
        return np.stack([x * cos - z * sin, x * sin + z * cos], -1) / self.scale

    @property
    def has_prints(self) -> bool:
        """Whether footprints were recorded; they are left out with the poses."""
        return "footprint_from" in self.arrays

    def busy_frame(self) -> int:
        """The frame nearest to the middle of the run in which no leg rests; without any the middle one."""
        busy = np.flatnonzero(~self["parked"].astype(bool).any(1) & (self["fault"] == 0))
        middle = len(self.time) // 2
        return int(busy[np.argmin(np.abs(busy - middle))]) if len(busy) else middle

    def window(self, frame: int) -> np.ndarray:
        """Frames of the SPAN seconds around a frame; as many at the ends of the run."""
        last = max(float(self.time[-1]) - SPAN, float(self.time[0]))
        start = np.clip(float(self.time[frame]) - 0.5 * SPAN, float(self.time[0]), last)
        return np.flatnonzero((self.time >= start - 1e-9) & (self.time <= start + SPAN + 1e-9))


def gait(run: Any, scene: SceneLike, path: Path, character: int = 0, moment: float | None = None) -> Path | None:
    """One character of each semi-procedural herd at a moment (s): rings, weights, footprints, and its foot heights.

    moment: by default near the middle of the run, when no leg rests. None, and no file, without such herds.
    """
    herds = [(number, herd) for number, herd in enumerate(scene.herds) if motions_of(herd)][:MOST_HERDS]
    if not herds or len(run.time) == 0:
        return None
    made, axes = figure(14.0, 7.4 * len(herds), 2 * len(herds), 3, height_ratios=(4.6, 2.6) * len(herds))
    for row, (number, herd) in enumerate(herds):
        walker = Walker(run, herd, min(character, herd.count - 1))
        frame = walker.busy_frame() if moment is None else int(np.argmin(np.abs(walker.time - moment)))
        for each, name in zip(axes[2 * row], ("leg cycles", "weights of motions", "footprints"), strict=True):
            each.set_title(f"{name} at {walker.time[frame]:.2f} s", fontsize=10, color=INK, loc="left")
        draw_cycles(axes[2 * row, 0], walker, frame)
        draw_weights(axes[2 * row, 1], walker, frame, herd_color(number))
        draw_footprints(axes[2 * row, 2], walker, frame)
        for each in axes[2 * row + 1]:
            made.delaxes(each)
        wide: Axes = made.add_subplot(axes[2 * row + 1, 0].get_gridspec()[2 * row + 1, :])
        copy_style(wide)
        wide.set_title(f"{herd.name}, character {walker.character}", fontsize=10, color=INK, loc="left")
        draw_heights(wide, walker, frame, scene)
    return finish(made, path, "Gait")


def draw_cycles(axes: Axes, walker: Walker, frame: int) -> None:
    """A ring per leg, clockwise from the stance at the top: flight in colour, ticks at liftoff and strike.

    The large dot is where the leg is, the small one where the common clock has it; a resting leg's dot is hollow.
    """
    keys = blended_keys(walker, frame)
    time, designated, parked = (walker[name][frame] for name in ("cycle_time", "cycle_designated", "parked"))
    for leg, name in enumerate(walker.legs):
        radius, color = 1.0 - 0.75 * leg / max(len(walker.legs), 3), leg_color(leg)
        liftoff, strike = keys[leg, [1, 4]]
        _ring(axes, radius, 0.0, 1.0, GRID)
        _ring(axes, radius, liftoff, strike, color)
        for at, text in ((liftoff, "liftoff"), (strike, "strike")):
            inner, outer = (_on_ring(radius + step, at) for step in (-0.07, 0.07))
            axes.plot([inner[0], outer[0]], [inner[1], outer[1]], color=color, linewidth=1.6)
            if leg == 0:
                axes.annotate(text, _on_ring(radius + 0.18, at), fontsize=8, color=QUIET, ha="center", va="center")
        axes.plot(*_on_ring(radius, designated[leg]), "o", color=INK, markersize=5, zorder=4)
        fill = "white" if parked[leg] else color
        axes.plot(*_on_ring(radius, time[leg]), "o", color=color, markerfacecolor=fill, markersize=13, zorder=3)
        axes.plot([], [], "o", color=color, markersize=8, label=name)
    axes.plot([], [], "o", color=INK, markersize=5, label="by the clock")
    axes.annotate("stance", (0.0, 1.18), fontsize=8, color=QUIET, ha="center", va="center")
    axes.legend(loc="lower left", frameon=False, fontsize=8, ncols=2)
    axes.set_aspect("equal")
    axes.set_xlim(-1.35, 1.35)
    axes.set_ylim(-1.35 - 0.1 * (len(walker.legs) + 1), 1.35)
    axes.axis("off")


def _on_ring(radius: float, share: float) -> tuple[float, float]:
    angle = 2.0 * np.pi * share
    return float(radius * np.sin(angle)), float(radius * np.cos(angle))


def _ring(axes: Axes, radius: float, start: float, end: float, color: str) -> None:
    """Part of a ring between two shares of the circle."""
    width = 0.05 if color != GRID else 0.03
    axes.add_patch(
        Wedge((0.0, 0.0), radius + width / 2, 90.0 - 360.0 * end, 90.0 - 360.0 * start, width=width, color=color,
              linewidth=0, alpha=0.55 if color != GRID else 1.0)
    )  # fmt: skip


def blended_keys(walker: Walker, frame: int) -> np.ndarray:
    """[L, 6] key times of the moving motions by their weights; of all such motions alike where none has any (3.5)."""
    motions = motions_of(walker.herd)
    walks = np.array([np.linalg.norm(motion.velocity) > 1e-6 for motion in motions])
    weight = np.where(walks, walker["weights"][frame], 0.0) + 1e-5 * walks
    if not walks.any():
        weight = np.ones(len(motions))
    return np.einsum("m,mlk->lk", weight / weight.sum(), np.array([motion.keytimes for motion in motions]))


def draw_weights(axes: Axes, walker: Walker, frame: int, color: str) -> None:
    """The plane of velocities, forward up and left to the left, at the size of the clips.

    A dot per motion in a square whose side goes with the square root of its weight; a cross at the present velocity,
    and a line of its past seconds.
    """
    motions = motions_of(walker.herd)
    weight = walker["weights"][frame]
    place = np.array([[motion.velocity[0], motion.velocity[2]] for motion in motions])
    velocity = walker.local_velocity
    fastest = max(float(np.linalg.norm(place, axis=1).max()), float(np.linalg.norm(velocity[frame])), 0.1)
    speed_rings(axes, fastest)
    taken: list[np.ndarray] = []
    for motion, at, share in sorted(zip(motions, place, weight, strict=True), key=lambda each: -each[2]):
        side = 0.45 * fastest * np.sqrt(max(share, 0.0))
        axes.add_patch(Rectangle(at - side / 2, side, side, color=color, alpha=0.35, linewidth=0))
        axes.plot(*at, "o", color=INK, markersize=4)
        shift = sum(np.all(np.abs(at - other) < [0.5 * fastest, 0.07 * fastest]) for other in taken)
        text = f"{motion.name} {share:.2f}" if share >= 0.005 else motion.name
        left = at[0] > 0.05 * fastest  # names of motions to the left stand there, clear of the ones in the middle
        axes.annotate(
            text, at, (-6 if left else 6, 5 - 11 * shift), textcoords="offset points", fontsize=8,
            color=INK if share >= 0.005 else QUIET, ha="right" if left else "left",
        )  # fmt: skip
        taken.append(at)
    past = (walker.time <= walker.time[frame]) & (walker.time >= walker.time[frame] - TRAIL)
    axes.plot(*velocity[past].T, color=color, linewidth=1.4)
    axes.plot(*velocity[frame], "x", color=color, markersize=11, markeredgewidth=2.5)
    axes.set_aspect("equal")
    axes.set_xlim(1.2 * fastest, -1.2 * fastest)
    axes.set_ylim(-1.2 * fastest, 1.2 * fastest)
    axes.set_xlabel("to the left in m/s", color=INK, fontsize=10)
    axes.set_ylabel("forward in m/s", color=INK, fontsize=10)


def draw_footprints(axes: Axes, walker: Walker, frame: int) -> None:
    """Seen from above, +z up the page: path, footprints behind (filled), ahead (outlined) and their goals (crosses).

    Earlier and later prints of the seconds around it are pale. Without recorded footprints the feet of the moment.
    """
    window, position = walker.window(frame), walker["position"]
    axes.plot(*position[window][:, [0, 2]].T, color=QUIET, linewidth=1.0)
    nose = 0.25 * walker.herd.archetype.height * walker.scale
    yaw, at = walker["yaw"][frame], position[frame, [0, 2]]
    tip = at + nose * np.array([np.sin(yaw), np.cos(yaw)])
    axes.annotate("", tuple(tip), tuple(at), arrowprops={"arrowstyle": "->", "color": INK, "linewidth": 1.6})
    axes.plot(*at, "o", color=INK, markersize=4)
    heel, toe = walker["heel"], walker["toe"]
    shown = [heel[frame], toe[frame]]
    for leg in range(len(walker.legs)):
        color = leg_color(leg)
        if not walker.has_prints:
            _print(axes, heel[frame, leg], toe[frame, leg] - heel[frame, leg], color, 0.8)
            continue
        behind, ahead = (
            (walker[f"footprint_{end}"][:, leg], walker[f"footprint_{end}_direction"][:, leg]) for end in ("from", "to")
        )
        for each in _apart(np.concatenate([behind[0][window], behind[1][window]], 1)):
            _print(axes, each[:3], each[3:], color, 0.18)
        _print(axes, behind[0][frame], behind[1][frame], color, 0.85)
        _print(axes, ahead[0][frame], ahead[1][frame], color, 0.0)
        goal = walker["footprint_goal"][frame, leg]
        axes.plot(goal[0], goal[2], "+", color=color, markersize=10, markeredgewidth=1.6)
        shown += [behind[0][frame, None], ahead[0][frame, None], goal[None]]
    if walker.has_prints:
        for text, fill in (("behind", QUIET), ("ahead", "none")):
            axes.add_patch(Rectangle((np.nan, np.nan), 1, 1, label=text, facecolor=fill, edgecolor=QUIET))
        axes.plot([], [], "+", color=QUIET, markersize=9, label="its goal")
        axes.legend(loc="upper left", frameon=False, fontsize=8)
    points = np.concatenate(shown)[:, [0, 2]]
    half = max(
        1.25 * float(np.nanmax(np.abs(points - at), initial=0.0)), 0.7 * walker.herd.archetype.height * walker.scale
    )
    axes.set_aspect("equal")
    axes.set_xlim(at[0] + half, at[0] - half)
    axes.set_ylim(at[1] - half, at[1] + half)
    axes.set_xlabel("x in m", color=INK, fontsize=10)
    axes.set_ylabel("z in m", color=INK, fontsize=10)


def _apart(rows: np.ndarray) -> np.ndarray:
    """Rows [t, k] that differ from the one before by more than 1 mm, the first included."""
    step = np.abs(np.diff(rows, axis=0)).max(1)
    return rows[np.concatenate([[True], step > 1e-3])]


def _print(axes: Axes, heel: np.ndarray, along: np.ndarray, color: str, filled: float) -> None:
    """A plate; filled: opacity, 0 for an outline."""
    corners = plate_corners(heel, along)[:, [0, 2]]
    patch = Polygon(corners, closed=True, edgecolor=color, linewidth=0 if filled else 1.4)
    patch.set_facecolor(color if filled else "none")
    patch.set_alpha(filled or None)
    axes.add_patch(patch)


def draw_heights(axes: Axes, walker: Walker, frame: int, scene: SceneLike) -> None:
    """A lane per leg over time: heel (line) and toe tip (dashed) over the ground, phases as a bar, events as markers.

    Up-pointing markers are lift (hollow) and liftoff, down-pointing ones strike and land (hollow); grey: the leg rests.
    """
    window = walker.window(frame)
    time = walker.time[window]
    height = {name: _over_ground(scene, walker[name][window], walker["position"][window]) for name in ("heel", "toe")}
    lane = 1.3 * max(max(float(np.nanmax(values, initial=0.0)) for values in height.values()), 0.02)
    phase, parked = walker["foot_phase"].astype(np.int8)[window], walker["parked"][window] > 0.5
    events = transitions(phase[:, None])
    for leg in range(len(walker.legs)):
        base, color = lane * (len(walker.legs) - 1 - leg), leg_color(leg)
        axes.axhline(base, color=GRID, linewidth=0.8)
        for name, style in (("heel", "-"), ("toe", (0, (4, 2)))):
            axes.plot(time, base + height[name][:, leg], color=color, linewidth=1.5, linestyle=style)
        _bar(axes, time, phase[:, leg], parked[:, leg], base - 0.12 * lane, lane, color)
        for number, event in enumerate(EVENTS):
            rows = events[(events[:, 2] == leg) & (events[:, 3] == number)]
            marker, full = MARKS[event]
            axes.plot(time[rows[:, 0]], np.full(len(rows), base - 0.12 * lane), marker, color=color,
                      markersize=8 if full else 4.5, markeredgewidth=0 if full else 1,
                      markerfacecolor=color if full else "white", zorder=4 if full else 5)  # fmt: skip
    for event, (marker, full) in MARKS.items():
        axes.plot([], [], marker, color=QUIET, markerfacecolor=QUIET if full else "white", markersize=6, label=event)
    for name, style in (("heel", "-"), ("toe tip", (0, (4, 2)))):
        axes.plot([], [], color=QUIET, linestyle=style, label=name)
    axes.axvline(walker.time[frame], color=INK, linewidth=0.8, linestyle=(0, (2, 2)))
    axes.set_yticks([lane * (len(walker.legs) - 1 - leg) for leg in range(len(walker.legs))], walker.legs)
    axes.set_ylim(-0.25 * lane, lane * len(walker.legs))
    axes.set_xlim(time[0], time[-1] + 1e-3)
    axes.set_xlabel("time in s", color=INK, fontsize=10)
    axes.set_ylabel(f"height over the ground\n(lane: {lane:.2g} m)", color=INK, fontsize=9)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8, ncols=6)


def _over_ground(scene: SceneLike, points: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Height [t, L] of points [t, L, 3] over the ground under them, on the character's level."""
    level = (position[:, None, 1],) if hasattr(scene, "terrain") else ()
    return points[..., 1] - scene.ground(points[..., 0], points[..., 2], *level)


def _bar(
    axes: Axes, time: np.ndarray, phase: np.ndarray, parked: np.ndarray, level: float, lane: float, color: str
) -> None:
    """Phases of a foot as a bar that fades out in flight, and grey where the leg rests."""
    change = np.flatnonzero(np.diff(phase) | np.diff(parked)) + 1
    starts, ends = np.concatenate([[0], change]), np.concatenate([change, [len(time) - 1]])
    for a, b in zip(starts, ends, strict=True):
        shade = SHADES[phase[a]]
        if shade > 0 and b > a:
            axes.plot(time[[a, b]], [level, level], color=QUIET if parked[a] else color, linewidth=5, alpha=shade,
                      solid_capstyle="butt")  # fmt: skip
