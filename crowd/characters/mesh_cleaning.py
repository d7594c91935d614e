"""Imported meshes made fit for drag: welded, without degenerate triangles, normals outwards; and their volume."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crowd.errors import fail
from crowd.posing import skin
from crowd.types import Mesh

WELD = 1e-5  # of the mesh's size: vertices closer than this with equal weights are one
THIN = 1e-10  # of the size squared: triangles smaller than this are dropped


def cleaned(mesh: Mesh, rest_q: np.ndarray, rest_p: np.ndarray, notes: list[str], where: str) -> Mesh:
    """The mesh welded, without empty triangles and with outward normals; `notes` tells what was changed.

    rest_q, rest_p: rest pose of the joints [J, 4], [J, 3] in the character frame. where: names the file in messages.
    Raises InputError when no triangle has an area.
    """
    before = len(mesh.triangles)
    mesh = _welded(mesh)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    size = max(float(np.ptp(mesh.vertices, axis=0).max()), 1e-12)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    fine = (area > THIN * size * size) & (np.sort(mesh.triangles, 1)[:, :2] != np.sort(mesh.triangles, 1)[:, 1:]).all(1)
    triangles = mesh.triangles[fine]
    if len(triangles) == 0:
        raise fail(where, f"none of the {before} triangles has an area")
    if before - len(triangles) > 0.01 * before:
        notes.append(f"{before - len(triangles)} of {before} triangles have no area and were dropped")
    posed = skin(mesh, rest_q, rest_p)
    flips = _inward(posed, triangles)
    triangles = np.where(flips[:, None], triangles[:, ::-1], triangles)
    if flips.any():
        notes.append(f"{int(flips.sum())} triangles faced inwards and were turned round")
    used, index = np.unique(triangles, return_inverse=True)
    return Mesh(
        mesh.vertices[used],
        index.reshape(-1, 3).astype(np.int32),
        mesh.joints[used].astype(np.int32),
        mesh.weights[used],
        mesh.inverse_bind,
    )


def _welded(mesh: Mesh) -> Mesh:
    size = max(float(np.ptp(mesh.vertices, axis=0).max()), 1e-12)
    order = np.argsort(np.where(mesh.weights > 0, mesh.joints, 1 << 30), 1, kind="stable")
    joints = np.take_along_axis(np.where(mesh.weights > 0, mesh.joints, 0), order, 1)
    weights = np.take_along_axis(mesh.weights, order, 1)
    keys = np.concatenate([np.round(mesh.vertices / (WELD * size)), joints, np.round(weights * 1000)], 1)
    _, first, inverse = np.unique(keys.astype(np.int64), axis=0, return_index=True, return_inverse=True)
    return replace(
        mesh,
        vertices=mesh.vertices[first],
        triangles=inverse.reshape(-1)[mesh.triangles],
        joints=np.where(mesh.weights > 0, mesh.joints, 0)[first],
        weights=mesh.weights[first],
    )


def _parts(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Part number [T] of every triangle: triangles that share a place are one part."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    size = max(float(np.ptp(vertices, axis=0).max()), 1e-12)
    _, place = np.unique(np.round(vertices / (1e-4 * size)).astype(np.int64), axis=0, return_inverse=True)
    corner = place.reshape(-1)[triangles]
    count = int(corner.max()) + 1 if len(corner) else 0
    ones = np.ones(2 * len(corner))
    ends = np.concatenate([corner[:, 0], corner[:, 0]]), np.concatenate([corner[:, 1], corner[:, 2]])
    _, label = connected_components(coo_matrix((ones, ends), (count, count)), directed=False)
    return label[corner[:, 0]] if len(corner) else np.zeros(0, int)


def signed_volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    """Volume inside triangles, positive where normals point outwards; open parts are measured from their middle."""
    corners = vertices[triangles] - vertices[triangles].reshape(-1, 3).mean(0)
    return float(np.einsum("tc,tc->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0)


def _inward(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Triangles [T] of parts whose volume is clearly negative."""
    label = _parts(vertices, triangles)
    flips = np.zeros(len(triangles), bool)
    for part in np.unique(label):
        own = label == part
        box = np.prod(np.maximum(np.ptp(vertices[triangles[own]].reshape(-1, 3), axis=0), 1e-12))
        flips[own] = signed_volume(vertices, triangles[own]) < -0.02 * box
    return flips


def volume(mesh: Mesh, rest_q: np.ndarray, rest_p: np.ndarray) -> tuple[float, bool]:
    """Volume in m3 of the rest pose, summed over the parts of the mesh, and whether all of them are closed."""
    posed = skin(mesh, rest_q, rest_p)
    label = _parts(posed, mesh.triangles)
    parts = [mesh.triangles[label == part] for part in np.unique(label)]
    return sum(abs(signed_volume(posed, part)) for part in parts), _closed(posed, mesh.triangles)


def _closed(vertices: np.ndarray, triangles: np.ndarray) -> bool:
    size = max(float(np.ptp(vertices, axis=0).max()), 1e-12)
    _, place = np.unique(np.round(vertices / (1e-5 * size)).astype(np.int64), axis=0, return_inverse=True)
    corner = place.reshape(-1)[triangles]
    edges = np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]])
    forward = edges[:, 0] * (place.max() + 1) + edges[:, 1]
    backward = edges[:, 1] * (place.max() + 1) + edges[:, 0]
    return bool(np.array_equal(np.sort(forward), np.sort(backward)))
