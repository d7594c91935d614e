"""Plot of a water surface from above: its height at the liveliest moment, the same as shaded relief, and the tracks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LightSource

from crowd.recorded_scene import SceneLike
from crowd.report_plots import Sampled, figure, finish
from crowd.types import WaterFrames
from crowd.view.palette import INK, herd_color

MOST_LOOKED_AT = 200  # frames among which the liveliest is sought
STEEPER = 6.0  # exaggeration of the relief


def water(run: Any, scene: SceneLike, path: Path) -> Path | None:
    """The surface from above with the tracks of the characters up to that moment; None when nothing is there.

    +z is up the page, +x runs to the left, as in the plot of footprints. Left: height, colours cut at the most extreme
    thousandth. Right: the relief lit from the upper left, steeper than it is, in shades of grey.
    """
    surface: WaterFrames | None = getattr(run, "water", None)
    if surface is None or len(surface.time) == 0:
        return None
    frame = liveliest(surface)
    height = np.asarray(surface.height[frame], float)
    made, axes = figure(13.0, 6.2, 1, 2)
    left, right = axes[0]
    cell = float(surface.x[1] - surface.x[0])
    edges = tuple(float(edge) for line in (surface.x, surface.z) for edge in (line[0] - cell / 2, line[-1] + cell / 2))
    most = max(float(np.quantile(np.abs(height), 0.999)), 1e-4)
    drawn = left.imshow(height * 100, cmap="RdBu_r", vmin=-most * 100, vmax=most * 100, extent=edges, origin="lower")
    made.colorbar(drawn, ax=left, shrink=0.8, pad=0.02).set_label("height in cm", color=INK, fontsize=10)
    light = LightSource(azdeg=45.0, altdeg=40.0)
    shade = light.hillshade(height, vert_exag=STEEPER, dx=cell, dy=cell)
    right.imshow(shade, cmap="gray", vmin=0.2, vmax=1.0, extent=edges, origin="lower", interpolation="bilinear")
    for each in (left, right):
        _tracks(each, run, scene, float(surface.time[frame]))
        each.set_xlim(edges[1], edges[0])
        each.set_ylim(edges[2], edges[3])
        each.grid(False)
        each.set_xlabel("x in m", color=INK, fontsize=10)
    left.set_ylabel("z in m", color=INK, fontsize=10)
    return finish(made, path, f"Water from above at {surface.time[frame]:.1f} s", left)


def liveliest(surface: WaterFrames) -> int:
    """Number of the frame with the highest waves."""
    frames = np.unique(np.linspace(0, len(surface.time) - 1, MOST_LOOKED_AT).astype(int))
    power = [float(np.mean(np.square(np.asarray(surface.height[frame], float)))) for frame in frames.tolist()]
    return int(frames[int(np.argmax(np.nan_to_num(power)))])


def _tracks(axes: Axes, run: Any, scene: SceneLike, time: float) -> None:
    """Ways of all characters up to a moment, in their herd's colour, and a dot where each one is."""
    for number, herd in enumerate(scene.herds):
        data, color = Sampled(run, herd), herd_color(number)
        past = data["position"][data.time <= time + 1e-6]
        if len(past) == 0:
            continue
        axes.plot(past[..., 0], past[..., 2], color=color, linewidth=0.9, alpha=0.7)
        axes.plot(
            past[-1, :, 0], past[-1, :, 2], "o", color=color, markersize=5, markeredgecolor="white", label=herd.name
        )
