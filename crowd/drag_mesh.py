"""The mesh that the fluid drags on, of fewer triangles than the skin: quadric error, with the skin's weights."""

from __future__ import annotations

import dataclasses

import numpy as np

from crowd.characters.simplification import simplify
from crowd.types import Mesh

SLOTS = 4  # bones of a vertex
WELD = 1e-5  # of the mesh's size: vertices nearer than that are one
ROUNDS = 3  # of restoring the volume
BLOCK = 2_000_000  # pairs of points and triangles at a time


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
    vertices = _as_large(vertices, faces, volume(mesh.vertices, mesh.triangles))
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


def volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """m3 enclosed by a closed surface."""
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    return float((np.cross(a, b) * c).sum() / 6.0)


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


def _as_large(vertices: np.ndarray, triangles: np.ndarray, wanted: float) -> np.ndarray:
    """Vertices moved along their normals by the same small length each, so that the surface encloses `wanted` m3.

    Chords cut corners off; the drag of what they cut off is most of what decimation would lose.
    """
    for _ in range(ROUNDS):
        a, b, c = np.moveaxis(vertices[triangles], 1, 0)
        area = 0.5 * np.cross(b - a, c - a)
        normal = np.zeros_like(vertices)
        for corner in range(3):
            np.add.at(normal, triangles[:, corner], area)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        gain = float((area * normal[triangles].mean(1)).sum())  # m3 for a metre along the normals
        size = float(np.cbrt(max(wanted, 0.0)))
        move = (wanted - volume(vertices, triangles)) / max(gain, 1e-12)
        vertices = vertices + np.clip(move, -0.02 * size, 0.02 * size) * normal
    return vertices


def _carried(mesh: Mesh, dense: np.ndarray, points: np.ndarray) -> np.ndarray:
    """[P, J] weights of the skin at its points nearest to the given ones [P, 3]."""
    step = max(1, BLOCK // len(mesh.triangles))
    parts = [_nearest(mesh, points[first : first + step]) for first in range(0, len(points), step)]
    which, share = (np.concatenate(part) for part in zip(*parts, strict=True))
    return np.einsum("pk,pkj->pj", share, dense[mesh.triangles[which]])


def _nearest(mesh: Mesh, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The triangle nearest to each point [P, 3] and the barycentric coordinates [P, 3] of the nearest place on it.

    A place inside the triangle where the point stands over it, otherwise the best of its three edges.
    """
    corner = mesh.vertices[mesh.triangles]
    best, which, share = np.full(len(points), np.inf), np.zeros(len(points), int), np.zeros((len(points), 3))
    for weight in _candidates(corner, points):
        place = np.einsum("ptk,tkc->ptc", weight, corner)
        far = np.sum((place - points[:, None]) ** 2, -1)
        near = far.argmin(1)
        rows = np.arange(len(points))
        closer = far[rows, near] < best
        best = np.where(closer, far[rows, near], best)
        which = np.where(closer, near, which)
        share = np.where(closer[:, None], weight[rows, near], share)
    return which, share


def _candidates(corner: np.ndarray, points: np.ndarray) -> list[np.ndarray]:
    """Barycentric coordinates [P, T, 3] of places on triangles [T, 3, 3]: under the points, and on edges."""
    a, b, c = np.moveaxis(corner, 1, 0)
    u, v, w = b - a, c - a, points[:, None] - a
    uu, uv, vv = (np.sum(x * y, -1) for x, y in ((u, u), (u, v), (v, v)))
    wu, wv = np.sum(w * u, -1), np.sum(w * v, -1)
    whole = np.maximum(uu * vv - uv * uv, 1e-30)
    second, third = (vv * wu - uv * wv) / whole, (uu * wv - uv * wu) / whole
    inside = np.stack([1.0 - second - third, second, third], -1)
    inside = np.where((inside >= 0).all(-1, keepdims=True), inside, np.array([1.0, 0.0, 0.0]))
    found = [inside]
    for one, other in ((0, 1), (1, 2), (2, 0)):
        way = corner[:, other] - corner[:, one]
        along = np.sum((points[:, None] - corner[:, one]) * way, -1) / np.maximum(np.sum(way * way, -1), 1e-30)
        along = np.clip(along, 0.0, 1.0)
        weight = np.zeros((*along.shape, 3))
        weight[..., one], weight[..., other] = 1.0 - along, along
        found.append(weight)
    return found
