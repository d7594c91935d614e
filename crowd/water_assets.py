"""Bodies as the water surface sees them: upright columns of legs and trunk, measured on the skin in the rest pose."""

from __future__ import annotations

import numpy as np

from crowd import posing
from crowd.assets import WaterAssets, WaterBody
from crowd.ground_water import WaterGrid
from crowd.host_arrays import f32, i32
from crowd.layout import WaterLayout
from crowd.params import WaterParams
from crowd.scene import HerdScene, Scene
from crowd.state import Water
from crowd.types import Archetype
from kernels import water

SLICES = 16  # heights at which cross-sections are measured


def water_layout(scene: Scene) -> WaterLayout | None:
    """What the program has to know of the surface; None without one."""
    grid = scene.water
    if grid is None:
        return None
    return WaterLayout((len(grid.z), len(grid.x)), grid.feedback, tuple(herd.count for herd in scene.herds))


def water_assets(scene: Scene) -> WaterAssets | None:
    """The grid, and every herd's columns, on the host."""
    grid = scene.water
    if grid is None:
        return None
    return WaterAssets(
        calm=f32(_calm(grid)),
        origin=f32(np.array([grid.x[0], grid.z[0]])),
        cell=f32(grid.cell),
        bodies=tuple(_body(herd) for herd in scene.herds),
    )


def water_params(scene: Scene) -> WaterParams | None:
    """Numbers of the surface that may be swept."""
    grid = scene.water
    if grid is None:
        return None
    numbers = (grid.surface, grid.depth, grid.strength, grid.current)
    return WaterParams(*(f32(np.asarray(number)) for number in numbers))


def still_water(scene: Scene) -> tuple[Water, ...]:
    """The surface at the start, as the last of a run's states; nothing without one."""
    grid = scene.water
    if grid is None:
        return ()
    rows, columns = len(grid.z), len(grid.x)
    shapes = (rows, columns), (2, rows, columns), (2, rows, columns // 2 + 1)
    level, flow, spectrum = (f32(np.zeros(shape)) for shape in shapes)
    return (Water(level, flow, spectrum, i32([0])),)


def _calm(grid: WaterGrid) -> np.ndarray:
    """[rows, columns] 1/s, loss in the border and on the shore."""
    shape = (len(grid.z), len(grid.x))
    edge = np.asarray(water.border(shape, grid.border / grid.cell, grid.rate))
    return np.maximum(edge, grid.rate * grid.shore)


def _body(herd: HerdScene) -> WaterBody:
    archetype = herd.archetype
    rotation, place = posing.world_transforms(archetype.skeleton, posing.rest_motion(archetype.skeleton))
    skin = posing.skin(archetype.mesh, rotation, place)
    trunk = skin[~_on_limbs(archetype)]
    trunk = trunk if len(trunk) else skin
    (x0, bottom, z0), (x1, top, z1) = np.quantile(trunk, 0.05, 0), np.quantile(trunk, 0.95, 0)
    legs = section(skin, archetype.mesh.triangles, np.linspace(0.3, 0.7, SLICES) * bottom).mean()
    whole = section(skin, archetype.mesh.triangles, np.linspace(bottom, top, SLICES)).mean()
    spread = max(x1 - x0, z1 - z0) - min(x1 - x0, z1 - z0)
    along = np.array([-1.0, 0.0, 1.0]) * spread / 3.0
    middle = np.array([[x0 + x1], [z0 + z1]]) / 2.0
    offset = middle + (np.stack([along, 0 * along]) if x1 - x0 > z1 - z0 else np.stack([0 * along, along]))
    hips = place[[leg.hip for leg in archetype.legs]]
    values = (hips.T[..., None], max(legs, 0.0) / max(len(archetype.legs), 1), offset[..., None], max(whole, 0.0))
    return WaterBody(*(f32(value) for value in (*values, bottom, top)))


def _on_limbs(archetype: Archetype) -> np.ndarray:
    """[V] whether a vertex is carried by a leg or an arm."""
    limb = np.zeros(archetype.skeleton.count, bool)
    limb[[leg.hip for leg in archetype.legs] + [arm.shoulder for arm in archetype.arms]] = True
    for joint, parent in enumerate(archetype.skeleton.parents):
        limb[joint] |= parent >= 0 and limb[parent]
    mesh = archetype.mesh
    return limb[mesh.joints[np.arange(len(mesh.joints)), mesh.weights.argmax(1)]]


def section(vertices: np.ndarray, triangles: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Areas [h] m2 of a closed mesh cut at heights [h] m: what its skin below turns downward less what it turns upward.

    Triangles count by their centroid; the mean over some heights is good to a few per cent.
    """
    corners = vertices[triangles]
    normal = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 1]
    return -np.where(corners[:, :, 1].mean(1) < heights[:, None], normal, 0.0).sum(1)
