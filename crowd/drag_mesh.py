"""The mesh that the fluid drags on, of fewer triangles than the skin: quadric error, with the skin's weights."""

from __future__ import annotations

import dataclasses

import numpy as np

from crowd.characters.mesh_cleaning import signed_volume
from crowd.characters.simplification import simplify
from crowd.types import Mesh

SLOTS = 4  # bones of a vertex
WELD = 1e-5  # of the mesh's size: vertices nearer than that are one
ROUNDS = 6  # of restoring the volume


def decimated(mesh: Mesh, triangles: int) -> Mesh:
    """About `triangles` triangles (bind pose) for a mesh that has more; the mesh itself for one that has not.

    Fewer by one at most, more where collapses would open the surface or fold it: a closed surface stays closed and
    keeps its volume, an open one keeps its borders. Every vertex takes its bones from the nearest point of the skin.
    """
    if len(mesh.triangles) <= triangles:
        return mesh
    dense = np.zeros((len(mesh.vertices), len(mesh.inverse_bind)))
    np.add.at(dense, (np.arange(len(dense))[:, None], mesh.joints), mesh.weights)
    first, faces = _welded(mesh)
    vertices, faces = simplify(mesh.vertices[first], faces, dense[first], triangles)
    vertices = _as_large(vertices, faces, mesh)
    dense = _carried(mesh, dense, vertices)
    joints = np.argsort(-dense, axis=1, kind="stable")[:, :SLOTS]
    weights = np.take_along_axis(dense, joints, 1)
    weights = weights / weights.sum(1, keepdims=True)
    return dataclasses.replace(
        mesh,
        vertices=vertices,
        triangles=faces.astype(np.int32),
        joints=np.where(weights > 0, joints, joints[:, :1]).astype(np.int32),
        weights=weights,
    )


def _welded(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Indices [V'] of vertices at different places, and the triangles [T', 3] between them.

    Files have several vertices at one place where normals or textures change: seams, which nothing may collapse across.
    """
    size = float(np.ptp(mesh.vertices, axis=0).max())
    _, first, inverse = np.unique(
        np.round(mesh.vertices / (WELD * size)).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    order = np.argsort(first)  # in the order of the mesh: one without seams stays as it is
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    a, b, c = faces = place[inverse.reshape(-1)][mesh.triangles].T
    return first[order], faces.T[(a != b) & (b != c) & (c != a)]


def _as_large(vertices: np.ndarray, triangles: np.ndarray, skin: Mesh) -> np.ndarray:
    """Vertices moved along their normals, each by the same small length, until the surface encloses what the skin does.

    Chords cut corners off; the drag of what they cut off is most of what decimation would lose. No vertex leaves the
    box around the skin: tips, whose normals all point one way, would reach farther with every collapse.
    """
    wanted = signed_volume(skin.vertices, skin.triangles)
    low, high = skin.vertices.min(0), skin.vertices.max(0)
    for _ in range(ROUNDS):
        a, b, c = np.moveaxis(vertices[triangles], 1, 0)
        area = 0.5 * np.cross(b - a, c - a)
        normal = np.zeros_like(vertices)
        for corner in range(3):
            np.add.at(normal, triangles[:, corner], area)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        gain = float((area * normal[triangles].mean(1)).sum())  # m3 for a metre along the normals
        size = float(np.cbrt(max(wanted, 0.0)))
        move = (wanted - signed_volume(vertices, triangles)) / max(gain, 1e-12)
        vertices = np.clip(vertices + np.clip(move, -0.02 * size, 0.02 * size) * normal, low, high)
    return vertices


def _carried(mesh: Mesh, dense: np.ndarray, points: np.ndarray) -> np.ndarray:
    """[P, J] weights of the skin at its places nearest to the given points [P, 3]."""
    from trimesh.triangles import closest_point, points_to_barycentric

    corner = mesh.vertices[mesh.triangles]
    real = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1) > 0
    corner, faces = corner[real], mesh.triangles[real]
    found = np.empty((len(points), dense.shape[1]))
    for row, point in enumerate(points):
        place = closest_point(corner, np.broadcast_to(point, (len(corner), 3)))
        near = np.sum((place - point) ** 2, 1).argmin()
        share = points_to_barycentric(corner[near][None], place[near][None])[0]
        found[row] = np.clip(share, 0.0, 1.0) @ dense[faces[near]]
    return found
