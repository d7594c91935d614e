"""An archetype's body as arrays: vertices on their bones, triangles from the feet upwards, blocks on one bone."""

from __future__ import annotations

from typing import Any

import numpy as np

from crowd import posing
from crowd.scene import HerdScene
from crowd.types import Clip, Mesh
from kernels.drag_moments import RigidMesh
from kernels.drag_rigid import padded_blocks, rigid_mesh

BLOCK = 12  # triangles per block of the rigid mesh
MOMENTS = 8  # of standing and of walking, over which heights are taken


def influences(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Bones [V, k] and, per influence, weighted bind-frame vertices and weights [k, 4, V]; k as small as possible."""
    order = np.argsort(-mesh.weights, axis=1, kind="stable")
    joints, weights = np.take_along_axis(mesh.joints, order, 1), np.take_along_axis(mesh.weights, order, 1)
    used = max(1, int((weights > 1e-4).sum(1).max()))
    joints, weights = joints[:, :used], weights[:, :used]
    weights = weights / weights.sum(1, keepdims=True)
    joints = np.where(weights > 0, joints, joints[:, :1])
    homogeneous = np.concatenate([mesh.vertices, np.ones((len(mesh.vertices), 1))], 1)
    local = np.einsum("vkrc,vc->vkr", mesh.inverse_bind[joints][:, :, :3], homogeneous)
    rows = np.concatenate([local, np.ones((*local.shape[:2], 1))], 2) * weights[..., None]
    return joints, rows.transpose(1, 2, 0)


def _moments(herd: HerdScene) -> tuple[np.ndarray, np.ndarray]:
    """World rotations [m, J, 4] and positions [m, J, 3] of the joints while a character stands and walks."""
    slowest, found = herd.gaits[0], []
    for rotation, translation in ((herd.idle.rotation, herd.idle.translation), (slowest.rotation, slowest.translation)):
        some = slice(None, None, max(1, len(rotation) // MOMENTS))
        motion = posing.clip_motion(Clip("", "other", 1.0, rotation[some], translation[some]))
        found.append(posing.world_transforms(herd.archetype.skeleton, motion))
    return np.concatenate([turn for turn, _ in found]), np.concatenate([at for _, at in found])


def _heights(herd: HerdScene) -> np.ndarray:
    """[T] m, how low the lowest corner of each triangle comes while a character stands and walks."""
    vertices = posing.skin(herd.drag_mesh, *_moments(herd))
    return vertices[:, herd.drag_mesh.triangles, 1].min((0, 2))


def upwards(herd: HerdScene) -> np.ndarray:
    """[T] order of the triangles, from the feet upwards: water wets some groups of them and spares the others."""
    return np.argsort(_heights(herd), kind="stable")


def blocks(herd: HerdScene) -> tuple[np.ndarray, RigidMesh]:
    """Each triangle on the bone that carries most of it, in blocks of one bone from the feet upwards.

    Returns the bone of each block and its constants; padding has no area.
    """
    mesh, height = herd.drag_mesh, _heights(herd)
    owner, found = owners(mesh), []
    for bone in np.unique(owner):
        mine = np.flatnonzero(owner == bone)
        mine = mine[np.argsort(height[mine], kind="stable")]
        for start in range(0, len(mine), BLOCK):
            part = mine[start : start + BLOCK]
            found.append((height[part].min(), bone, np.concatenate([part, np.full(BLOCK - len(part), -1)])))
    found.sort(key=lambda block: block[0])
    spare = padded_blocks(len(found)) - len(found)
    index = np.array([triangles for _, _, triangles in found] + [np.full(BLOCK, -1)] * spare)
    bones = np.array([bone for _, bone, _ in found] + [found[-1][1]] * spare)
    homogeneous = np.concatenate([mesh.vertices, np.ones((len(mesh.vertices), 1))], 1)
    corners = homogeneous[mesh.triangles[index]]  # [blocks, size, 3, 4]
    local = np.einsum("brc,bskc->bskr", mesh.inverse_bind[bones][:, :3], corners)
    constants = rigid_mesh(np.where((index < 0)[..., None, None], 0.0, local))
    return bones, RigidMesh(*(_array(values) for values in constants))


def owners(mesh: Mesh) -> np.ndarray:
    """[T] the bone that carries most of each triangle."""
    share = np.zeros((len(mesh.triangles), len(mesh.inverse_bind)))
    for corner in range(3):
        for k in range(mesh.joints.shape[1]):
            vertex = mesh.triangles[:, corner]
            np.add.at(share, (np.arange(len(share)), mesh.joints[vertex, k]), mesh.weights[vertex, k])
    return share.argmax(1)


def _array(values: Any) -> Any:
    return np.asarray(values, np.float32)
