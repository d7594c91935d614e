"""What drag sees of single triangles (Table 1 of the character-fluid paper): medians, aggregate and skew, on the host.

Independent of the step: from recorded poses, in NumPy.
"""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np

from crowd import posing
from crowd.recorded_scene import HerdLike
from crowd.types import Motion
from kernels.fluid import REFERENCE_AREA, STILL_SPEED


class Triangles(NamedTuple):
    """Relevant triangles of all frames, one after the other: wet, facing the flow, moving."""

    area: np.ndarray  # [k] m2, of the wet part, projected along the flow
    speed2: np.ndarray  # [k] m2/s2


class Statistics(NamedTuple):
    """Over relevant triangles and time."""

    median: float  # of C_D,i
    aggregate: float  # F / (density sum A u2)
    skew: float  # median over mean of A u2
    count: int


def relevant(
    herd: HerdLike, arrays: Any, character: int, surface: float, flow: np.ndarray, rate: float, first: int = 1
) -> Triangles:
    """Relevant triangles of a character in recorded frames `first` and later, every frame recorded.

    surface: m, world; flow [3]: m/s; rate: Hz. Velocities are differences from the frame before; triangles are clipped
    at the surface, as by the drag.
    """
    one = slice(character, character + 1)
    names = ("pose_position", "pose_orientation", "joint_rotation", "joint_translation")
    position, orientation, rotation, translation = (
        np.asarray(arrays[name][first - 1 :, one], float)[:, 0] for name in names
    )
    scale = np.full(len(position), float(np.asarray(herd.scale)[character]))
    turn, at = posing.world_transforms(
        herd.archetype.skeleton, Motion(position, orientation, rotation, translation, scale)
    )
    vertices = posing.skin(herd.archetype.mesh, turn, at, scale)
    area, speed2 = [], []
    for before, now in itertools.pairwise(vertices):
        found = _of_frame(herd.archetype.mesh.triangles, now, (now - before) * rate - flow, surface)
        area.append(found.area)
        speed2.append(found.speed2)
    return Triangles(np.concatenate(area), np.concatenate(speed2))


def _of_frame(triangles: np.ndarray, vertices: np.ndarray, slip: np.ndarray, surface: float) -> Triangles:
    """Relevant ones of vertices [V, 3] that move with `slip` [V, 3] through the fluid."""
    corner, velocity = vertices[triangles], slip[triangles]
    depth = surface - corner[..., 1]
    share, weight = wet_parts(depth)
    wet = share > 1e-9
    centre = np.einsum("tk,tkc->tc", weight, velocity)[wet] / share[wet][:, None]
    normal = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[wet]
    speed2 = np.sum(centre**2, -1)
    facing = np.sum(normal * centre, -1) * share[wet]  # -N.u of the fluid past it, times the wet share
    use = (facing > 0) & (speed2 > STILL_SPEED**2)
    return Triangles(facing[use] / np.sqrt(speed2[use]), speed2[use])


def wet_parts(depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Wet share [t] of triangles with corner depths [t, 3], and the corners' barycentric integrals [t, 3]."""
    share, weight = np.zeros(len(depth)), np.zeros_like(depth)
    below = (depth > 0).sum(1)
    whole = below == 3
    share[whole], weight[whole] = 1.0, 1.0 / 3.0
    for count in (1, 2):
        some = np.flatnonzero(below == count)
        if not len(some):
            continue
        d = depth[some]
        tip = np.argmax(d, 1) if count == 1 else np.argmin(d, 1)  # the corner alone on its side
        rows = np.arange(len(some))
        others = np.stack([(tip + 1) % 3, (tip + 2) % 3], 1)
        cut = d[rows, tip][:, None] / (d[rows, tip][:, None] - d[rows[:, None], others])
        small = cut.prod(1)
        part = np.zeros_like(d)
        part[rows, tip] = small * (1.0 - cut.sum(1) / 3.0)
        part[rows[:, None], others] = (small[:, None] * cut) / 3.0
        share[some] = small if count == 1 else 1.0 - small
        weight[some] = part if count == 1 else 1.0 / 3.0 - part
    return share, weight


def statistics(found: Triangles, density: float, base: float, offset: float, mode: str = "area") -> Statistics:
    """Medians of C_D,i = base + B_i / (density A u2). offset: B, N per 0.2 m2 (`area`) or per triangle (`paper`)."""
    flux = found.area * found.speed2
    force = offset * (found.area / REFERENCE_AREA if mode == "area" else 1.0)
    single = base + force / np.maximum(density * flux, 1e-12)
    return Statistics(
        float(np.median(single)),
        float((single * flux).sum() / flux.sum()),
        float(np.median(flux) / flux.mean()),
        len(flux),
    )


def per_offset(found: Triangles, density: float, mode: str = "area") -> float:
    """How much a newton of B adds to the median of C_D,i."""
    part = found.speed2 * REFERENCE_AREA if mode == "area" else found.speed2 * found.area
    return float(1.0 / (density * np.median(part)))
