"""Ground of a scenario on the host: one description that the kernels use too, and heights in NumPy.

Levels are those of `kernels.terrain`: profiles along an axis, waves, and grids that go on level beyond their border.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crowd.errors import fail
from crowd.ground_grids import height_map, rubble
from crowd.ground_layer import Layer, cells, heights, there
from crowd.ground_mesh import mesh_layers
from crowd.scenario_ground import (
    Flat,
    HeightMap,
    Layers,
    Mesh,
    Ramp,
    Rubble,
    Sines,
    Slope,
    Slopes,
    Stairs,
    Steps,
    Surface,
)  # fmt: skip
from crowd.scenario_ground import Ground as GroundModel


@dataclass(frozen=True, eq=False)
class Ground:
    """Levels of the ground; the first one is everywhere."""

    layers: tuple[Layer, ...]
    max_step_height: float = 1.0  # m: a level further above a character is not the one it stands on
    max_slope: float = math.radians(60.0)  # rad, steepest ground that feet are laid on
    notes: tuple[str, ...] = ()  # what the user should know

    @property
    def min_normal_y(self) -> float:
        """Cosine of the steepest slope that feet are laid on."""
        return math.cos(self.max_slope)


def build_ground(
    model: GroundModel, folder: Path, seed: int = 0, max_step_height: float = 1.0, max_slope: float = math.radians(60)
) -> Ground:
    """The ground a scenario asks for; files are looked for in `folder`. Raises `InputError` for bad files."""
    models = model.layers if isinstance(model, Layers) else (model,)
    layers: list[Layer] = []
    notes: list[str] = []
    for number, each in enumerate(models):
        made, told = _made(each, folder, seed, number)
        area = each.area_m
        if area is not None:
            corners = np.array([area.x[0], area.z[0]]), np.array([area.x[1], area.z[1]])
            made = [dataclasses.replace(layer, area=corners) for layer in made]
        layers += made
        notes += told
    first = next((number for number, layer in enumerate(layers) if layer.everywhere), None)
    if first is None:
        raise fail("world.ground.layers", "every layer has an area_m; one without is needed: ground everywhere")
    layers.insert(0, layers.pop(first))
    notes += [note for layer in layers if (note := _steep(layer, max_slope))]
    return Ground(tuple(layers), max_step_height, max_slope, tuple(notes))


def height(
    ground: Ground, x: np.ndarray | float, z: np.ndarray | float, altitude: np.ndarray | float | None = None
) -> np.ndarray:
    """Height in m at world points; x, z and altitude broadcast.

    altitude: world height of who asks. Of several levels the highest one not more than `max_step_height` above that is
    meant, the lowest one where none is; None: the highest of all.
    """
    return _level(ground, x, z, altitude)[1]


def level_at(
    ground: Ground, x: np.ndarray | float, z: np.ndarray | float, altitude: np.ndarray | float | None = None
) -> np.ndarray:
    """Number of the layer that `height` is of."""
    return _level(ground, x, z, altitude)[0]


def refuse_missing(ground: Ground, points: np.ndarray, where: str) -> None:
    """`InputError` when one of the points [n, 2] (x, z) lies where the height map has no height."""
    on = without_height(ground, points)
    if on.any():
        x, z = points[np.argmax(on)]
        raise fail(where, f"{on.sum()} characters start where the height map has no height (one at [{x:.1f}, {z:.1f}])")


def without_height(ground: Ground, points: np.ndarray) -> np.ndarray:
    """Which of the points [n, 2] (x, z) lie on a filled gap of a height map."""
    x, z = points.T
    level = level_at(ground, x, z)
    on = np.zeros(len(points), bool)
    for number, layer in enumerate(ground.layers):
        if layer.missing is not None:
            u, v = cells(layer, x, z)
            on |= (level == number) & layer.missing[np.rint(v).astype(int), np.rint(u).astype(int)]
    return on


def _level(
    ground: Ground, x: np.ndarray | float, z: np.ndarray | float, altitude: np.ndarray | float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Number of the layer meant at world points, and its height."""
    points = [np.asarray(v, float) for v in (x, z)] + ([] if altitude is None else [np.asarray(altitude, float)])
    x, z, *rest = np.broadcast_arrays(*points)
    level, found = np.zeros(x.shape, int), heights(ground.layers[0], x, z)
    reach = rest[0] + ground.max_step_height if rest else np.inf
    for number, layer in enumerate(ground.layers[1:], 1):
        other = heights(layer, x, z)
        within, below = other <= reach, found <= reach
        use = there(layer, x, z) & np.where(within, ~below | (other > found), ~below & (other < found))
        level, found = np.where(use, number, level), np.where(use, other, found)
    return level, found


def _made(model: Surface, folder: Path, seed: int, number: int) -> tuple[list[Layer], list[str]]:
    """Levels of one kind of ground, and what the user should know."""
    match model:
        case Flat():
            return [Layer("flat", np.array([model.height_m]))], []
        case Slope():
            tangent = math.tan(math.radians(model.angle_deg))
            return [Layer("slope", np.array([tangent]), _axis(model.toward_deg), model.height_m)], []
        case Ramp():
            return [Layer("ramp", np.array([model.start_m, model.end_m, model.drop_m]))], []
        case Steps():
            return [Layer("steps", np.array([model.start_m, model.tread_m, model.rise_m, model.count]))], []
        case Stairs():
            return [Layer("steps", _stairs(model), _axis(model.toward_deg), model.height_m)], []
        case Slopes():
            return [Layer("stretches", _stretches(model), _axis(model.toward_deg), model.height_m)], []
        case Sines():
            return [Layer("sines", _waves(model), base=model.height_m)], []
        case Rubble():
            return [rubble(model, seed, number)], []
        case HeightMap():
            layer, notes = height_map(model, folder)
            return [layer], notes
        case Mesh():
            return mesh_layers(model, folder)
        case _:
            raise TypeError(f"{type(model).__name__} is no ground")


def _axis(toward_deg: float) -> np.ndarray:
    """Unit (x, z); whole quarter turns exactly, so that edges across an axis of the world lie on whole numbers."""
    quarter, rest = divmod(toward_deg, 90.0)
    if rest == 0.0:
        return np.array([(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][int(quarter) % 4])
    toward = math.radians(toward_deg)
    return np.array([math.sin(toward), math.cos(toward)])


def _stairs(model: Stairs) -> np.ndarray:
    values = [model.start_m, model.tread_m, model.rise_m, model.count]
    if model.landing_m is not None:
        values.append(model.start_m + (model.count - 1) * model.tread_m + model.landing_m)
    return np.array(values, float)


def _stretches(model: Slopes) -> np.ndarray:
    length = np.array([stretch.length_m for stretch in model.stretches])
    tangent = np.tan(np.radians([stretch.angle_deg for stretch in model.stretches]))
    start = model.start_m + np.cumsum(length) - length
    return np.stack([start, length, tangent], 1).ravel()


def _waves(model: Sines) -> np.ndarray:
    """[4, w] amplitude m, cycles/m along x and z, phase in cycles."""
    axis = np.array([_axis(wave.toward_deg) for wave in model.waves]).T
    per_metre = 1.0 / np.array([wave.wavelength_m for wave in model.waves])
    phase = np.array([wave.phase_deg / 360.0 % 1.0 for wave in model.waves])
    return np.stack([np.array([wave.amplitude_m for wave in model.waves]), *(axis * per_metre), phase])


def _steep(layer: Layer, limit: float) -> str | None:
    """A note when an analytic layer is somewhere steeper than feet are laid on."""
    values = layer.parameters
    if layer.kind == "sines":
        steepest = float((2 * np.pi * values[0] * np.hypot(values[1], values[2])).sum())
    elif layer.kind == "stretches":
        steepest = float(np.abs(values[2::3]).max())
    elif layer.kind == "ramp":
        steepest = abs(values[2]) / (values[1] - values[0])
    else:
        steepest = abs(values[0]) if layer.kind == "slope" else 0.0
    angle, most = math.degrees(math.atan(steepest)), math.degrees(limit)
    if angle <= most:
        return None
    return (
        f"world.ground: up to {angle:.0f} deg steep; feet are laid onto ground up to {most:.0f} (world.max_slope_deg)"
    )
