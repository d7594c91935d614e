"""Plots of a run: speed, drag, centre of pressure, footprints, speed against depth. matplotlib without a display."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from crowd.metrics import STANDS
from crowd.recorded_scene import HerdLike, SceneLike
from crowd.stances import find_stances
from crowd.view.crowd_picture import surfaces
from crowd.view.palette import GRID, INK, LEFT, QUIET, RIGHT, herd_color

MOST_FRAMES, MOST_CHARACTERS = 2000, 1024  # read for a plot; of longer runs and larger herds an even selection
MOST_CYCLES = 2  # herds whose gait cycle is shown: more curves could not be told apart
DPI = 120


class Sampled:
    """Arrays of a herd, thinned evenly so that plots of any run fit in memory."""

    def __init__(self, run: Any, herd: HerdLike):
        self.herd = herd
        self._arrays = run.herds[herd.name]
        total = len(run.time)
        self.frames = slice(0, total, max(1, -(-total // MOST_FRAMES)))
        self.people = slice(0, herd.count, max(1, -(-herd.count // MOST_CHARACTERS)))
        self.time = np.asarray(run.time)[self.frames]
        self.alive = np.asarray(self._arrays["fault"][self.frames, self.people]) == 0

    def __getitem__(self, name: str) -> np.ndarray:
        """Array [t, n, ...] in double precision; NaN where the character is frozen."""
        value = np.asarray(self._arrays[name][self.frames, self.people], float)
        alive = self.alive.reshape(self.alive.shape + (1,) * (value.ndim - 2))
        return np.where(alive, value, np.nan)


def figure(width: float, height: float, rows: int = 1, columns: int = 1, **options: Any) -> tuple[Figure, np.ndarray]:
    """A figure in the report's style (inches) and its axes [rows, columns]."""
    made = Figure(figsize=(width, height), dpi=DPI, layout="constrained")
    FigureCanvasAgg(made)
    axes = made.subplots(rows, columns, squeeze=False, **options)
    for each in axes.flat:
        each.grid(True, color=GRID, linewidth=0.7)
        each.set_axisbelow(True)
        each.tick_params(colors=QUIET, labelsize=9)
        for side in ("top", "right"):
            each.spines[side].set_visible(False)
        for side in ("left", "bottom"):
            each.spines[side].set_color(GRID)
    return made, axes


def finish(made: Figure, path: Path, title: str, axes: Axes | None = None, columns: int = 6) -> Path:
    """Title, legend under it (of the lines in `axes`), and the file."""
    made.suptitle(title, x=0.01, ha="left", fontsize=12, color=INK, fontweight="bold")
    if axes is not None:
        handles, labels = axes.get_legend_handles_labels()
        if handles:
            made.legend(handles, labels, loc="outside upper right", ncols=columns, frameon=False, fontsize=9)
    made.savefig(path, metadata={"Software": ""})
    return path


def _label(axes: Axes, x: str, y: str) -> None:
    axes.set_xlabel(x, color=INK, fontsize=10)
    axes.set_ylabel(y, color=INK, fontsize=10)


def mean_over(values: np.ndarray) -> np.ndarray:
    """Mean [t] over the characters of values [t, n] that are not NaN; NaN without any."""
    count = np.isfinite(values).sum(1)
    return np.where(count > 0, np.nansum(values, 1) / np.maximum(count, 1), np.nan)


def _band(axes: Axes, time: np.ndarray, values: np.ndarray, color: str, name: str) -> None:
    """Mean line [t] of values [t, n] and the band that holds four fifths of the characters."""
    some = np.isfinite(values).any(1)
    if not some.any():
        return
    full = np.full((3, len(values)), np.nan)
    full[0, some] = mean_over(values[some])
    full[1:, some] = np.nanquantile(values[some], [0.1, 0.9], axis=1)
    axes.fill_between(time, full[1], full[2], color=color, alpha=0.18, linewidth=0)
    axes.plot(time, full[0], color=color, linewidth=1.8, label=name)


def speed(run: Any, scene: SceneLike, path: Path) -> Path:
    """Speed against time: mean and band per herd, what was asked for dashed; below it the depth."""
    made, axes = figure(9.0, 5.4, 2, 1, sharex=True, height_ratios=(3, 1))
    top, below = axes[:, 0]
    for number, herd in enumerate(scene.herds):
        data, color = Sampled(run, herd), herd_color(number)
        _band(top, data.time, np.linalg.norm(data["velocity"][..., [0, 2]], axis=-1), color, herd.name)
        asked = mean_over(np.linalg.norm(data["desired_velocity"][..., [0, 2]], axis=-1))
        top.plot(data.time, asked, color=color, linewidth=1.1, linestyle=(0, (5, 3)))
        _band(below, data.time, data["depth"], color, herd.name)
    top.plot([], [], color=QUIET, linewidth=1.1, linestyle=(0, (5, 3)), label="asked for")
    top.set_ylim(bottom=0)
    below.set_ylim(bottom=0)
    _label(top, "", "speed in m/s")
    _label(below, "time in s", "depth in m")
    return finish(made, path, "Speed", top)


def drag(run: Any, scene: SceneLike, path: Path) -> Path:
    """Drag force and power against time: mean and band per herd."""
    made, axes = figure(9.0, 5.4, 2, 1, sharex=True)
    top, below = axes[:, 0]
    for number, herd in enumerate(scene.herds):
        data, color = Sampled(run, herd), herd_color(number)
        _band(top, data.time, np.linalg.norm(data["drag_force"], axis=-1), color, herd.name)
        _band(below, data.time, data["drag_power"], color, herd.name)
    top.set_ylim(bottom=0)
    _label(top, "", "drag force in N")
    _label(below, "time in s", "drag power in W")
    return finish(made, path, "Drag", top)


def center_of_pressure(run: Any, scene: SceneLike, path: Path) -> Path:
    """Height of the centre of pressure against time per herd, and over the gait cycle of one character of two herds."""
    shown = 0
    made, axes = figure(11.0, 5.4, 2, 2, width_ratios=(3, 2))
    made.delaxes(axes[1, 0])
    made.delaxes(axes[0, 0])
    wide: Axes = made.add_subplot(axes[0, 0].get_gridspec()[:, 0])
    copy_style(wide)
    for number, herd in enumerate(scene.herds):
        data, color = Sampled(run, herd), herd_color(number)
        # A sole pressed a hair into ground that lies level with the surface is no wading.
        place, position = np.where(data["depth"][..., None] > 0, data["center_of_pressure"], np.nan), data["position"]
        height = place[..., 1] - position[..., 1]
        _band(wide, data.time, height, color, herd.name)
        deep = mean_over(np.where(np.isfinite(height), data["depth"], np.nan))
        wide.plot(data.time, deep, color=color, linewidth=1.0, linestyle=(0, (1, 2)))
        if shown < MOST_CYCLES:
            shown += _cycle(data, place, position, color, axes[0, 1], axes[1, 1])
    wide.plot([], [], color=QUIET, linewidth=1.0, linestyle=(0, (1, 2)), label="surface")
    wide.set_ylim(bottom=0)
    wide.set_xlim(float(run.time[0]), float(run.time[-1]) + 1e-3)
    _label(wide, "time in s", "height over the ground in m")
    _label(axes[0, 1], "", "height in m")
    _label(axes[1, 1], "phase of the gait cycle", "to the left in m")
    axes[0, 1].set_title("one character in its deepest seconds", fontsize=9, color=QUIET, loc="left")
    for each in (axes[0, 1], axes[1, 1]):
        each.set_xlim(0, 1)
    axes[0, 1].tick_params(labelbottom=False)
    return finish(made, path, "Centre of pressure", wide)


def speed_rings(axes: Axes, fastest: float) -> None:
    """Two to five rings of round speeds around the origin, up to the fastest (m/s)."""
    step = next(s * 10.0**e for e in range(-3, 4) for s in (1, 2, 5) if fastest / (s * 10.0**e) < 5)
    for ring in (step * k for k in range(1, int(fastest / step) + 1)):
        angle = np.linspace(0, 2 * np.pi, 181)
        axes.plot(ring * np.sin(angle), ring * np.cos(angle), color=GRID, linewidth=0.9, zorder=0)
        axes.annotate(f"{ring:g} m/s", (ring * 0.7071, -ring * 0.7071), fontsize=8, color=QUIET, ha="center")


def copy_style(axes: Axes) -> None:
    axes.grid(True, color=GRID, linewidth=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(colors=QUIET, labelsize=9)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(GRID)


def _cycle(data: Sampled, place: np.ndarray, position: np.ndarray, color: str, high: Axes, aside: Axes) -> bool:
    """Points of one character's centre of pressure over its phase, and their mean curve; False when it stays dry."""
    wet = np.isfinite(place[..., 1])
    if not wet.any():
        return False
    person = int(np.argmax(np.where(wet, data["depth"], 0.0).sum(0)))
    frames = np.nonzero(wet[:, person])[0]
    depth = data["depth"][frames, person]
    frames = frames[depth >= 0.85 * depth.max()]
    yaw, phase = data["yaw"][frames, person], data["phase"][frames, person]
    offset = place[frames, person] - position[frames, person]
    left = offset[:, 0] * np.cos(yaw) - offset[:, 2] * np.sin(yaw)
    for axes, values in ((high, offset[:, 1]), (aside, left)):
        axes.plot(phase, values, ".", color=color, markersize=3, alpha=0.45)
        bins = np.minimum((phase * 24).astype(int), 23)
        count = np.bincount(bins, minlength=24)
        mean = np.bincount(bins, values, 24) / np.where(count > 0, count, np.nan)
        axes.plot((np.arange(24) + 0.5) / 24, mean, color=color, linewidth=1.8)
    return True


def speed_depth(run: Any, scene: SceneLike, path: Path) -> Path:
    """Speed over the speed asked for against depth: cloud of the characters' seconds, and their mean by depth."""
    made, axes = figure(7.5, 5.0)
    plot: Axes = axes[0, 0]
    for number, herd in enumerate(scene.herds):
        data, color = Sampled(run, herd), herd_color(number)
        relative, depth = _seconds(data)
        if len(depth) == 0:
            continue
        thin = max(1, len(depth) // 4000)
        plot.plot(depth[::thin], relative[::thin], ".", color=color, alpha=0.12, markersize=3, markeredgewidth=0)
        step = max(0.05, float(depth.max()) / 24)
        bins = np.floor(depth / step).astype(int)
        count = np.bincount(bins)
        keep = np.nonzero(count >= 5)[0]
        mean, middle = np.bincount(bins, relative)[keep] / count[keep], np.bincount(bins, depth)[keep] / count[keep]
        plot.plot(middle, mean, "o-", color=color, linewidth=1.8, markersize=4, label=herd.name)
    plot.axhline(1.0, color=QUIET, linewidth=0.8, linestyle=(0, (5, 3)))
    plot.set_ylim(0, max(1.2, min(plot.get_ylim()[1], 1.6)))
    _label(plot, "depth of the fluid at the character in m", "speed over the speed asked for")
    return finish(made, path, "Speed against depth", plot)


def _seconds(data: Sampled) -> tuple[np.ndarray, np.ndarray]:
    """Relative speed along the asked direction and depth, averaged over windows of about a second, flattened."""
    desired, velocity = data["desired_velocity"][..., [0, 2]], data["velocity"][..., [0, 2]]
    asked = np.linalg.norm(desired, axis=-1)
    moving = asked > STANDS
    relative = np.where(moving, np.sum(velocity * desired, -1) / np.where(moving, asked, 1.0) ** 2, np.nan)
    span = max(1, round(1.0 / max(float(np.median(np.diff(data.time))), 1e-6))) if len(data.time) > 1 else 1
    whole = len(relative) // span * span
    cut = (whole // span, span, relative.shape[1])
    speed_mean, depth_mean = relative[:whole].reshape(cut).mean(1), data["depth"][:whole].reshape(cut).mean(1)
    fine = np.isfinite(speed_mean) & np.isfinite(depth_mean)
    return speed_mean[fine], depth_mean[fine]


def footprints(run: Any, scene: SceneLike, path: Path) -> Path:
    """Seen from above: paths and planted feet of everybody, and a few metres of ground of each of two herds near by.

    Left feet blue, right feet orange, middle ones grey; +z is up the page, so +x runs to the left.
    """
    shown = list(enumerate(scene.herds))
    made, axes = figure(12.0, 6.4, 1, 1 + min(len(shown), 2), width_ratios=(5, *[3] * min(len(shown), 2)))
    whole, *near = axes[0]
    corners = []
    for number, herd in shown:
        data, color = Sampled(run, herd), herd_color(number)
        position, prints, side, owner = _prints(data)
        whole.plot(position[..., 0], position[..., 2], color=color, linewidth=0.6, alpha=0.45)
        whole.plot(*prints[:, [0, 2]].T, ".", color=color, markersize=1.2, alpha=0.6, markeredgewidth=0)
        whole.plot([], [], color=color, linewidth=2.0, label=herd.name)
        both = np.concatenate([position.reshape(-1, 3), prints])[:, [0, 2]]
        corners += [both[np.isfinite(both).all(1)]]
        if number < len(near):
            _near_by(near[number], whole, herd.name, position, prints, side, owner, scene)
    for value, (tint, text) in FEET.items():
        if any(leg.side == value for herd in scene.herds for leg in herd.archetype.legs):
            whole.plot([], [], "o", color=tint, markersize=5, label=text)
    _frame(whole, np.concatenate(corners))
    _tint_water(whole, scene)
    return finish(made, path, "Footprints from above", whole)


FEET = {1: (LEFT, "left foot"), -1: (RIGHT, "right foot"), 0: (QUIET, "middle foot")}


def _near_by(
    axes: Axes,
    whole: Axes,
    name: str,
    position: np.ndarray,
    prints: np.ndarray,
    side: np.ndarray,
    owner: np.ndarray,
    scene: SceneLike,
) -> None:
    """Paths and footprints on a small piece of ground, marked on the overview."""
    (left, right), (low, high) = _window(position)
    some = _apart(position, 0.5 * (left + right), 0.5 * (low + high))
    axes.plot(position[:, some, 0], position[:, some, 2], color=QUIET, linewidth=0.7, alpha=0.8)
    for value, (tint, _) in FEET.items():
        chosen = prints[(side == value) & np.isin(owner, some)]
        axes.plot(*chosen[:, [0, 2]].T, "o", color=tint, markersize=4.5, markeredgewidth=0, alpha=0.9)
    axes.set_aspect("equal")
    axes.set_xlim(right, left)
    axes.set_ylim(low, high)
    axes.set_title(name, fontsize=10, color=INK, loc="left")
    _label(axes, "x in m", "")
    _tint_water(axes, scene)
    whole.add_patch(Rectangle((left, low), right - left, high - low, fill=False, color=INK, linewidth=1.0, zorder=5))


def _frame(axes: Axes, points: np.ndarray) -> None:
    """Limits around points [P, 2], equal scales, no panel narrower than a third of its height."""
    low, high = (points.min(0), points.max(0)) if len(points) else (np.zeros(2), np.zeros(2))
    half = np.maximum(0.5 * (high - low) * 1.06, 2.0)
    half = np.maximum(half, half[::-1] * [0.55, 0.55])
    middle = 0.5 * (low + high)
    axes.set_aspect("equal")
    axes.set_xlim(middle[0] + half[0], middle[0] - half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
    _label(axes, "x in m", "z in m")


def _prints(data: Sampled) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Paths [t, n, 3], places [S, 3] where feet were planted, their side [S] and character [S]."""
    handle = data["handle"]
    stances = find_stances(np.nan_to_num(data["contact"]) > 0.5, data.alive)
    prints = handle[stances.first, stances.character, stances.leg]
    side = np.array([leg.side for leg in data.herd.archetype.legs], int)
    sides = side[stances.leg] if len(stances) else np.zeros(0, int)
    return data["position"], prints, sides, stances.character


def _apart(position: np.ndarray, x: float, z: float) -> list[int]:
    """Characters that come near the point x, z, nearest first, whose paths keep 0.5 m apart: single tracks."""
    distance = np.linalg.norm(position[..., [0, 2]] - [x, z], axis=-1)
    nearest = np.min(np.where(np.isfinite(distance), distance, np.inf), axis=0)
    chosen: list[int] = []
    for person in np.argsort(nearest, kind="stable")[:200].tolist():
        if nearest[person] > 3.5 or len(chosen) == 8:
            break
        path = position[:, person, [0, 2]]
        path = path[np.isfinite(path).all(1)]
        others = (position[:, other, [0, 2]][None, ::4] for other in chosen)
        if all(np.nanmin(np.linalg.norm(path[::4, None] - other, axis=-1), initial=np.inf) > 0.5 for other in others):
            chosen.append(person)
    return chosen


def _window(position: np.ndarray) -> tuple[tuple[float, float], tuple[float, float]]:
    """A piece of ground 4 m by 6 m around where the middle path of a herd is halfway."""
    half = position[len(position) // 2]
    half = half[np.isfinite(half).all(1)]
    if len(half) == 0:
        return (-2.0, 2.0), (-3.0, 3.0)
    middle = np.median(half, 0)
    x, _, z = half[int(np.argmin(np.linalg.norm(half - middle, axis=1)))]
    return (x - 2.0, x + 2.0), (z - 3.0, z + 3.0)


def _tint_water(axes: Axes, scene: SceneLike) -> None:
    """Colour what is under a fluid by its depth, keeping the limits."""
    (x0, x1), (z0, z1) = sorted(axes.get_xlim()), sorted(axes.get_ylim())
    limits, ratio = (axes.get_xlim(), axes.get_ylim()), axes.get_aspect()
    x, z = np.meshgrid(np.linspace(x0, x1, 240), np.linspace(z0, z1, 240))
    ground = np.broadcast_to(np.asarray(scene.ground(x, z), float), x.shape)
    picture = np.zeros((*x.shape, 4))
    for level in surfaces(scene):
        depth = level.height - ground
        wet = level.covers(x, z) & (depth > 0.004)
        tone = np.power(level.color, 1 / 2.2)
        picture[wet, :3] = tone / tone.max() * 0.85
        picture[wet, 3] = 0.10 + 0.40 * (1 - np.exp(-depth[wet] / 0.8))
    axes.imshow(picture, extent=(x0, x1, z0, z1), origin="lower", aspect=ratio, zorder=0)
    axes.set_xlim(limits[0])
    axes.set_ylim(limits[1])
