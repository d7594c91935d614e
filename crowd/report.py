"""The report of a run: plots and pictures as PNG files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from crowd import report_gait, report_plots, report_water
from crowd.recorded_scene import SceneLike
from crowd.view.crowd_picture import crowd_pictures, has_poses
from crowd.view.debug_picture import debug_herds, debug_pictures
from crowd.view.raster import contact_sheet

PLOTS: dict[str, Callable[[Any, SceneLike, Path], Path]] = {
    "speed": report_plots.speed,
    "drag": report_plots.drag,
    "center_of_pressure": report_plots.center_of_pressure,
    "speed_depth": report_plots.speed_depth,
    "footprints": report_plots.footprints,
}
IN_FLUID = ("drag", "center_of_pressure", "speed_depth")  # say nothing when everybody stays dry


def write_report(run: Any, scene: SceneLike | None, out: str | Path, pictures: Any = None) -> dict[str, Path]:
    """Write the plots and the picture strip of a run into the folder `out`, which is made; returns the files by name.

    run: a `crowd.simulate.Result` or a `crowd.recorded.Recording`. scene: None for the run's own. pictures: the
    scenario's `pictures` (moments, size, herd to follow); default the scene's; without poses or with `pictures: null`
    there is no strip, and when nobody enters a fluid there are no plots of it; `gait` is there for semi-procedural
    herds, `water` for a moving surface, and `debug` when `pictures.debug` asks for it. A run without a
    recorded frame gets no report: an empty dictionary.
    """
    scene = run.scene if scene is None else scene
    assert scene is not None
    if len(run.time) == 0:
        return {}
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    wet = any(np.nanmax(np.asarray(run.herds[herd.name]["depth"]), initial=0.0) > 0 for herd in scene.herds)
    plots = {name: plot for name, plot in PLOTS.items() if wet or name not in IN_FLUID}
    files = {name: plot(run, scene, out / f"{name}.png") for name, plot in plots.items()}
    if (gait := report_gait.gait(run, scene, out / "gait.png")) is not None:
        files["gait"] = gait
    if (water := report_water.water(run, scene, out / "water.png")) is not None:
        files["water"] = water
    wanted = pictures if pictures is not None else _wanted(run, scene)
    if wanted is not None and has_poses(run):
        files |= write_pictures(run, scene, out, wanted)
        if wanted.debug and debug_herds(scene):
            files["debug"] = write_debug(run, scene, out / "debug.png", wanted)
    return files


def write_pictures(run: Any, scene: SceneLike, out: Path, wanted: Any) -> dict[str, Path]:
    """Pictures of the skinned crowd at the moments asked for: one file each, and all of them as `pictures.png`."""
    moments = moments_of(wanted, np.asarray(run.time))
    shots = crowd_pictures(run, scene, moments, (wanted.width_px, wanted.height_px), wanted.follow)
    files, images, labels = {}, [], []
    for time, wide, near in shots:
        for kind, image in (("crowd", wide), ("near", near)):
            name = f"{kind}_{time:06.2f}s"
            files[name] = out / f"{name}.png"
            image.save(files[name])
            images.append(image)
            labels.append(f"{time:.1f} s" if kind == "crowd" else "")
    files["pictures"] = out / "pictures.png"
    contact_sheet(images, labels, columns=2).save(files["pictures"])
    return files


def write_debug(run: Any, scene: SceneLike, path: Path, wanted: Any) -> Path:
    """A row per semi-procedural herd: its first character with footprints and ghost, at the moments asked for."""
    moments = moments_of(wanted, np.asarray(run.time))
    size = (wanted.height_px, wanted.height_px)
    images, labels, columns = [], [], 1
    for herd in debug_herds(scene):
        shots = debug_pictures(run, scene, herd, moments, size)
        columns = len(shots)
        images += [image for _, image in shots]
        labels += [f"{herd.name} {time:.2f} s" for time, _ in shots]
    contact_sheet(images, labels, columns).save(path)
    return path


def moments_of(wanted: Any, time: np.ndarray) -> list[float]:
    """Moments asked for that the run reached; without any, four spread evenly up to its end."""
    asked = [float(moment) for moment in wanted.at_s if moment <= time[-1] + 0.5]
    return asked or [float(moment) for moment in np.linspace(time[0], time[-1], 4)]


def _wanted(run: Any, scene: SceneLike) -> Any:
    """The scenario's `pictures`, from the scene or from the recorded configuration; None for none."""
    scenario = getattr(scene, "scenario", None)
    if scenario is not None:
        return scenario.pictures
    from ruamel.yaml import YAML

    from crowd.scenario import Pictures

    text = getattr(run, "attributes", {}).get("config", "")
    config = YAML(typ="safe", pure=True).load(text) or {}
    section = config.get("pictures", {})
    return None if section is None else Pictures.model_validate(section)
