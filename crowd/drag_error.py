"""What a herd's drag mesh costs: force and torque against those of the whole skin, on the host, before any run.

Every case is a pose of a clip with its limbs in motion, a direction and a speed of the body, and a depth of water.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from crowd import posing
from crowd.mesh_assets import owners
from crowd.metrics import Row
from crowd.scene import HerdScene, Scene
from crowd.triangle_statistics import wet_parts
from crowd.types import Clip, Mesh
from kernels.fluid import FADE_SPEED, REFERENCE_AREA, STILL_SPEED

WATER = (998.0, 1.08, 0.0)  # density kg/m3, C_D0 and B in N, where the scenario has no fluid
PHASES = 4  # of each gait's clip
DIRECTIONS = 6
SPEEDS = (0.4, 1.3)  # m/s, of a person's size
DEPTHS = (0.25, 0.5, 0.75, 1.1)  # of the height


class Moment(NamedTuple):
    """Bones at a moment and just before it."""

    now: tuple[np.ndarray, np.ndarray]  # rotation [J, 4] and position [J, 3] of each, character frame
    before: tuple[np.ndarray, np.ndarray]
    passed: float  # s between


@dataclass(frozen=True)
class DragError:
    """Differences over k cases, as shares of the root mean square of the exact ones."""

    force: np.ndarray  # [k] of |F - F_exact|
    torque: np.ndarray  # [k] about the middle of the hips

    @property
    def rms_force(self) -> float:
        """Relative RMS error of the force."""
        return float(np.sqrt((self.force**2).mean()))

    @property
    def rms_torque(self) -> float:
        """The same of the torque."""
        return float(np.sqrt((self.torque**2).mean()))


def drag_error(scene: Scene, herd: HerdScene, mesh: Mesh, rigid: bool) -> DragError:
    """Of a mesh that stands for the herd's skin, every triangle on one bone if rigid, against the skinned skin.

    The drag is that of `area` mode with triangles clipped at the surface, in the scenario's densest fluid. At scale 1.
    """
    fluid = _fluid(scene)
    exact, found = (
        _wrenches(herd, body, stiff, fluid) for body, stiff in ((herd.archetype.mesh, False), (mesh, rigid))
    )
    size = np.sqrt((exact**2).sum(2).mean(0))  # [2] of forces and torques
    error = np.linalg.norm(found - exact, axis=2) / np.maximum(size, 1e-12)
    return DragError(error[:, 0], error[:, 1])


def detail_notes(scene: Scene) -> list[str]:
    """A line for each herd whose drag is on another mesh than its skin, or rigid by `detail`."""
    return [f"{herd.name}: {_told(scene, herd)}" for herd in _detailed(scene)]


def detail_rows(scene: Scene) -> list[Row]:
    """The same for the table of metrics: single cases, then the root mean square over them; in per cent."""
    rows = []
    for herd in _detailed(scene):
        error = drag_error(scene, herd, herd.drag_mesh, _stiff(scene, herd))
        for name, values in (("drag_force_error", error.force), ("drag_torque_error", error.torque)):
            percent = 100.0 * values
            middle, high = np.quantile(percent, [0.5, 0.95])
            most, mean = float(percent.max()), float(percent.mean())
            rows.append(Row(herd.name, "all", name, "%", mean, float(middle), float(high), most, len(percent)))
            rms = float(np.sqrt((percent**2).mean()))
            rows.append(Row(herd.name, "all", f"{name}_rms", "%", rms, rms, rms, rms, 1))
    return rows


def _detailed(scene: Scene) -> Iterator[HerdScene]:
    for herd in scene.herds:
        detail = herd.model.detail
        if scene.scenario.world.fluids and detail is not None and (detail.triangles or detail.mesh):
            yield herd


def _stiff(scene: Scene, herd: HerdScene) -> bool:
    return herd.drag_kind(scene.scenario) == "rigid"


def _told(scene: Scene, herd: HerdScene) -> str:
    kind, mesh, skin = herd.drag_kind(scene.scenario), herd.drag_mesh, herd.archetype.mesh
    error = drag_error(scene, herd, mesh, kind == "rigid")
    told = f"drag on {len(mesh.triangles):,} {kind} triangles"
    told += f": force {_percent(error.rms_force)}, torque {_percent(error.rms_torque)} off (relative RMS)"
    told += f" against the skin's {len(skin.triangles):,}"
    if kind == "rigid" and mesh is not skin:
        part = drag_error(scene, herd, mesh, False)
        told += f"; {_percent(part.rms_force)} and {_percent(part.rms_torque)} if they were skinned"
    asked = herd.model.detail.triangles if herd.model.detail is not None else None
    if asked is not None and len(mesh.triangles) > asked:
        told += f"; {asked:,} were asked for, with fewer the surface would open or fold"
    elif asked is not None and mesh is skin:
        told += f"; {asked:,} were asked for, it has no more"
    return told


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def _fluid(scene: Scene) -> tuple[float, float, float]:
    """Density, C_D0 and B of the densest fluid of the scenario."""
    table = scene.scenario.fluid_table
    found = [table.fluid(one) for region in scene.scenario.world.fluids for one in (region, *region.layers)]
    if not found:
        return WATER
    fluid = max(found, key=lambda one: one.density_kg_m3)
    assert fluid.drag_coefficient is not None and fluid.offset_force_n is not None
    return fluid.density_kg_m3, fluid.drag_coefficient, fluid.offset_force_n


def _velocities(herd: HerdScene) -> np.ndarray:
    """[v, 3] m/s of the body."""
    angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    ways = np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], 1)
    speeds = np.array(SPEEDS) * np.sqrt(herd.archetype.height / 1.7)  # Froude
    return (speeds[:, None, None] * ways).reshape(-1, 3)


def _moments(herd: HerdScene) -> list[Moment]:
    """Standing, and PHASES of every gait's cycle."""
    clips = [Clip("", "walk", gait.period, gait.rotation, gait.translation) for gait in herd.gaits]
    found = []
    for clip, phases in [(herd.idle, 1), *((clip, PHASES) for clip in clips)]:
        turn, at = posing.world_transforms(herd.archetype.skeleton, posing.clip_motion(clip))
        count = len(clip.rotation)
        for phase in range(phases):
            now = phase * count // phases
            found.append(Moment((turn[now], at[now]), (turn[now - 1], at[now - 1]), clip.duration / count))
    return found


def _wrenches(herd: HerdScene, mesh: Mesh, rigid: bool, fluid: tuple[float, float, float]) -> np.ndarray:
    """[k, 2, 3] N and N m of all cases: force, and torque about the middle of the hips."""
    found = []
    for moment in _moments(herd):
        corner, before = _corners(mesh, rigid, *moment.now), _corners(mesh, rigid, *moment.before)
        hips = moment.now[1][[leg.hip for leg in herd.archetype.legs]].mean(0)
        for depth in DEPTHS:
            slip = (corner - before) / moment.passed
            found.append(_wrench(corner, slip, _velocities(herd), depth * herd.archetype.height, rigid, fluid, hips))
    return np.concatenate(found)


def _wrench(
    corner: np.ndarray,
    slip: np.ndarray,
    velocity: np.ndarray,
    surface: float,
    rigid: bool,
    fluid: tuple[float, float, float],
    hips: np.ndarray,
) -> np.ndarray:
    """[v, 2, 3] for bodies with so many velocities [v, 3]; slip: of the corners [T, 3, 3] of a body that stays."""
    share, weight = wet_parts(surface - corner[..., 1])
    wet = share > 1e-9
    corner, slip, share, weight = corner[wet], slip[wet], share[wet], weight[wet]
    if rigid:  # velocity and centre of the whole triangle
        weight = np.tile(share[:, None] / 3.0, (1, 3))
    mean = weight / share[:, None]
    centre = np.einsum("tk,tkc->tc", mean, corner)
    u = -(np.einsum("tk,tkc->tc", mean, slip) + velocity[:, None])
    area = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    projected = share * np.maximum(-np.einsum("vtc,tc->vt", u, area), 0.0)
    square = np.sum(u * u, -1)
    density, drag, offset = fluid
    factor = projected * (density * drag + offset / REFERENCE_AREA / (square + FADE_SPEED**2))
    force = np.where(square > STILL_SPEED**2, factor, 0.0)[..., None] * u
    total, magnitude = force.sum(1), np.linalg.norm(force, axis=2)
    arm = magnitude @ centre / np.maximum(magnitude.sum(1), 1e-12)[:, None] - hips  # Eq. 7: of the centre of pressure
    return np.stack([total, np.cross(arm, total)], 1)


def _corners(mesh: Mesh, rigid: bool, turn: np.ndarray, at: np.ndarray) -> np.ndarray:
    """[T, 3, 3] m, corners of the triangles, each on its own bone if rigid."""
    if not rigid:
        return posing.skin(mesh, turn, at)[mesh.triangles]
    bone = owners(mesh)
    homogeneous = np.concatenate([mesh.vertices, np.ones((len(mesh.vertices), 1))], 1)
    local = np.einsum("trc,tkc->tkr", mesh.inverse_bind[bone][:, :3], homogeneous[mesh.triangles])
    return posing.rotate(turn[bone][:, None], local) + at[bone][:, None]
