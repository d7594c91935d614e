"""A belt: a small patch of many triangles at the front of any body, for statistics over triangles.

The printed median drag coefficients of mud and goo (Table 1 of the character-fluid paper) are those of a mesh most of
whose triangles lie in a small detail that moves with the root. The patch is added to the finished mesh: cleaning and
simplification, which would merge its triangles, have been done by then.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from crowd import posing
from crowd.errors import fail
from crowd.types import Archetype, Mesh

AREA = 17.5e-4  # m2, of a person's; with it both medians come out (configs/tune_belt.yaml)
HIP = 0.90  # m, height of that person's hips
ASPECT = 4 / 9  # width over height
TOP = 0.947  # of the hips' height: under water where it reaches the hips, also as they sink in a step
GAP = 0.002  # m for a person: between the skin and the patch


def with_belt(archetype: Archetype, triangles: int = 2000, area: float | None = None, where: str = "belt") -> Archetype:
    """The archetype with a patch of so many triangles at the front of its trunk, facing +z in the rest pose.

    triangles: even. area: m2; None: AREA by the square of the hips' height. The patch is bound to one bone of the
    trunk, the one whose skin it lies in front of. Raises InputError at `where` if no trunk is there.
    """
    rest = posing.rest_motion(archetype.skeleton)
    turn, at = posing.world_transforms(archetype.skeleton, rest)
    hip = float(at[[leg.hip for leg in archetype.legs], 1].mean())
    size = AREA * (hip / HIP) ** 2 if area is None else area
    width, height = np.sqrt(size * ASPECT), np.sqrt(size / ASPECT)
    grid, faces = _patch(triangles, width, height)
    grid[:, 1] += TOP * hip - height
    skin = posing.skin(archetype.mesh, turn, at, np.ones(()))
    depth, joint = _front(archetype, skin, grid[:: max(1, len(grid) // 60)])
    if joint < 0:
        low, high = TOP * hip - height, TOP * hip
        raise fail(
            where, f"'{archetype.name}' has no trunk at {low:.2f} to {high:.2f} m, just under its hips, to wear it on"
        )
    grid[:, 2] = depth + GAP * hip / HIP
    own = posing.rotate(posing.conjugate(turn[joint]), grid - at[joint])
    bind = np.linalg.inv(archetype.mesh.inverse_bind[joint])
    return dataclasses.replace(
        archetype, mesh=_joined(archetype.mesh, own @ bind[:3, :3].T + bind[:3, 3], faces, joint)
    )


def _patch(triangles: int, width: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [V, 3] from (-width / 2, 0) to (width / 2, height), z 0, and triangles [T, 3] facing +z."""
    cells = triangles // 2
    pairs = [(n, cells // n) for n in range(1, cells + 1) if cells % n == 0]
    across, up = min(pairs, key=lambda pair: abs(np.log(pair[0] / pair[1] * height / width)))
    x, y = np.meshgrid((np.arange(across + 1) / across - 0.5) * width, np.arange(up + 1) / up * height)
    corner = (np.arange(up)[:, None] * (across + 1) + np.arange(across)).reshape(-1, 1)
    lower, upper = corner + np.array([0, 1, across + 2]), corner + np.array([0, across + 2, across + 1])
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1), np.concatenate([lower, upper]).astype(np.int32)


def _front(archetype: Archetype, skin: np.ndarray, points: np.ndarray) -> tuple[float, int]:
    """z of the foremost trunk skin behind points [k, 3] (x and y count), and the bone it hangs on; -1: none."""
    mesh, trunk = archetype.mesh, _trunk(archetype)
    share = np.zeros((len(mesh.vertices), archetype.skeleton.count))
    np.add.at(share, (np.arange(len(share))[:, None], mesh.joints), mesh.weights)
    weight = share[mesh.triangles].mean(1) * trunk  # [T, J]
    use = weight.sum(1) > 0.1
    a, b, c = np.moveaxis(skin[mesh.triangles[use]], 1, 0)
    best, joint = -np.inf, -1
    for x, y, _ in points:
        u, v, w = _barycentric(a[:, :2], b[:, :2], c[:, :2], np.array([x, y]))
        z = np.where(np.minimum(np.minimum(u, v), w) >= 0, u * a[:, 2] + v * b[:, 2] + w * c[:, 2], -np.inf)
        first = int(np.argmax(z)) if len(z) else -1
        if first >= 0 and z[first] > best:
            best, joint = float(z[first]), int(weight[use][first].argmax())
    return best, joint


def _barycentric(a: np.ndarray, b: np.ndarray, c: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, ...]:
    """Coordinates [T] of a point in triangles of the plane [T, 2]; -1 for triangles seen from the side."""

    def cross(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        return s[..., 0] * t[..., 1] - s[..., 1] * t[..., 0]

    whole = cross(b - a, c - a)
    flat = np.abs(whole) < 1e-12
    safe = np.where(flat, 1.0, whole)
    v, w = (np.where(flat, -1.0, part / safe) for part in (cross(p - a, c - a), cross(b - a, p - a)))
    return 1.0 - v - w, v, w


def _trunk(archetype: Archetype) -> np.ndarray:
    """[J] bones that carry two limbs or more, and the pelvis."""
    carried = np.zeros(archetype.skeleton.count, int)
    for first in [leg.hip for leg in archetype.legs] + [arm.shoulder for arm in archetype.arms]:
        joint = archetype.skeleton.parents[first]
        while joint >= 0:
            carried[joint] += 1
            joint = archetype.skeleton.parents[joint]
    carried[archetype.pelvis] = 2
    return carried >= 2


def _joined(mesh: Mesh, vertices: np.ndarray, faces: np.ndarray, joint: int) -> Mesh:
    slots = mesh.joints.shape[1]
    weights = np.zeros((len(vertices), slots))
    weights[:, 0] = 1.0
    return Mesh(
        np.concatenate([mesh.vertices, vertices]),
        np.concatenate([mesh.triangles, faces + len(mesh.vertices)]).astype(mesh.triangles.dtype),
        np.concatenate([mesh.joints, np.full((len(vertices), slots), joint)]).astype(mesh.joints.dtype),
        np.concatenate([mesh.weights, weights]),
        mesh.inverse_bind,
    )
