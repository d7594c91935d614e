"""Fewer triangles: rounds of independent edge collapses by quadric error (Garland and Heckbert 1997), all in NumPy.

Every round collapses only edges that are the cheapest of their neighbourhood, so the collapses of a round cannot
disturb each other and the mesh stays a closed 2-manifold (link condition, no flipped face). Deterministic.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_MAX_VALENCE = 24


@dataclass
class _Working:
    vertices: np.ndarray
    triangles: np.ndarray
    attributes: np.ndarray
    quadrics: np.ndarray  # [V, 4, 4]


def simplify(
    vertices: np.ndarray,
    triangles: np.ndarray,
    attributes: np.ndarray,
    target: int,
    roundness: float = 0.01,
    detail: float = 8.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [V, 3] and triangles [T, 3] with about `target` triangles (fewer by at most a few, more if stuck).

    attributes: [V, K]; edges over which they change cost more by `detail` (skin weights: joints keep their rings).
    roundness: weight of edge length to the fourth power against the quadric error (area × distance²): keeps triangles
    from degenerating into needles where the surface is flat.
    """
    work = _Working(vertices.copy(), triangles.copy(), attributes.copy(), _quadrics(vertices, triangles))
    stuck = 0
    while len(work.triangles) > target and stuck < 8:
        before = len(work.triangles)
        _round(work, target, roundness, detail, share=0.4 if stuck == 0 else 1.0)
        stuck = stuck + 1 if len(work.triangles) == before else 0
    used, inverse = np.unique(work.triangles, return_inverse=True)
    return work.vertices[used], inverse.reshape(-1, 3)


def _quadrics(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    double_area = np.linalg.norm(normal, axis=1)
    unit = normal / np.maximum(double_area, 1e-30)[:, None]
    plane = np.concatenate([unit, -np.sum(unit * a, 1, keepdims=True)], 1)
    outer = plane[:, :, None] * plane[:, None, :] * (double_area / 6.0)[:, None, None]
    quadrics = np.zeros((len(vertices), 4, 4))
    for k in range(3):
        np.add.at(quadrics, triangles[:, k], outer)
    return quadrics


def _padded(keys: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """Rows of values that share a key, padded with -1: [count, width]."""
    order = np.argsort(keys, kind="stable")
    keys, values = keys[order], values[order]
    start = np.searchsorted(keys, np.arange(count))
    slot = np.arange(len(keys)) - start[keys]
    table = np.full((count, int(slot.max()) + 1), -1)
    table[keys, slot] = values
    return table


def _round(work: _Working, target: int, roundness: float, detail: float, share: float) -> None:
    count = len(work.vertices)
    half = np.concatenate([work.triangles[:, [0, 1]], work.triangles[:, [1, 2]], work.triangles[:, [2, 0]]])
    keys = np.unique(half.min(1) * count + half.max(1))
    edges = np.stack([keys // count, keys % count], 1)
    neighbours = _padded(edges.ravel(), edges[:, ::-1].ravel(), count)
    faces = _padded(work.triangles.ravel(), np.repeat(np.arange(len(work.triangles)), 3), count)
    place, cost = _placements(work, edges, roundness, detail)
    allowed = _topology_ok(edges, neighbours)
    cost = np.where(allowed, cost, np.inf)
    rank = np.empty(len(edges), int)
    rank[np.argsort(cost, kind="stable")] = np.arange(len(edges))
    limit = int(share * np.isfinite(cost).sum())
    tried = np.flatnonzero((rank < max(limit, 1)) & np.isfinite(cost))
    tried = tried[_keeps_facing(work, edges[tried], place[tried], faces)]
    chosen = _independent(edges, rank, tried, neighbours, count)
    chosen = chosen[: max((len(work.triangles) - target + 1) // 2, 1)]  # each removes two triangles
    _collapse(work, edges[chosen], place[chosen])


def _placements(work: _Working, edges: np.ndarray, roundness: float, detail: float) -> tuple[np.ndarray, np.ndarray]:
    """Best position of each collapsed edge and its cost."""
    u, v = edges.T
    quadric = work.quadrics[u] + work.quadrics[v]
    middle = 0.5 * (work.vertices[u] + work.vertices[v])
    a, b = quadric[:, :3, :3], quadric[:, :3, 3]
    pull = 1e-2 * np.trace(a, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    place = np.linalg.solve(a + pull, (np.einsum("eij,ej->ei", pull, middle) - b)[..., None])[..., 0]
    length = np.linalg.norm(work.vertices[u] - work.vertices[v], axis=1)
    far = np.linalg.norm(place - middle, axis=1) > 1.5 * length
    place = np.where(far[:, None], middle, place)
    homogeneous = np.concatenate([place, np.ones((len(place), 1))], 1)
    error = np.einsum("ei,eij,ej->e", homogeneous, quadric, homogeneous)
    change = np.sum((work.attributes[u] - work.attributes[v]) ** 2, 1)
    return place, np.maximum(error, 0.0) + roundness * length**4 * (1.0 + detail * change)


def _topology_ok(edges: np.ndarray, neighbours: np.ndarray) -> np.ndarray:
    """Link condition (just two common neighbours) and valences."""
    u, v = edges.T
    near_u, near_v = neighbours[u], neighbours[v]
    shared = (near_v[:, :, None] == near_u[:, None, :]).any(2) & (near_v >= 0)
    valence = np.sum(neighbours >= 0, 1)
    smallest = np.where(shared, valence[near_v], 99).min(1)
    return (shared.sum(1) == 2) & (smallest > 3) & (valence[u] + valence[v] - 4 <= _MAX_VALENCE)


def _keeps_facing(work: _Working, edges: np.ndarray, place: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """True where no triangle that survives the collapse turns by more than about 75 degrees or degenerates."""
    ok = np.ones(len(edges), bool)
    for end, other in ((0, 1), (1, 0)):
        ring = faces[edges[:, end]]
        corners = work.triangles[ring]
        alive = (ring >= 0) & ~(corners == edges[:, other][:, None, None]).any(2)
        old = work.vertices[corners]
        moving = corners == edges[:, end][:, None, None]
        new = np.where(moving[..., None], place[:, None, None, :], old)
        before = np.cross(old[..., 1, :] - old[..., 0, :], old[..., 2, :] - old[..., 0, :])
        after = np.cross(new[..., 1, :] - new[..., 0, :], new[..., 2, :] - new[..., 0, :])
        size = np.linalg.norm(before, axis=-1) * np.linalg.norm(after, axis=-1)
        ok &= ~(alive & (np.sum(before * after, -1) <= 0.25 * size)).any(1)
    return ok


def _independent(
    edges: np.ndarray, rank: np.ndarray, tried: np.ndarray, neighbours: np.ndarray, count: int
) -> np.ndarray:
    """Edges (cheapest first), no end of one next to an end of another: the triangles they touch are disjoint.

    Two may share a neighbour; of n neighbours it loses at most n / 3, so none drops below three.
    """
    high = len(edges)
    least = np.full(count + 1, high)  # the last entry answers for padding
    for k in range(2):
        np.minimum.at(least, edges[tried, k], rank[tried])
    least[:count] = np.minimum(least[:count], least[neighbours].min(1))
    u, v = edges[tried].T
    chosen = tried[(least[u] == rank[tried]) & (least[v] == rank[tried])]
    return chosen[np.argsort(rank[chosen])]


def _collapse(work: _Working, edges: np.ndarray, place: np.ndarray) -> None:
    keep, gone = edges.T
    work.vertices[keep] = place
    work.quadrics[keep] += work.quadrics[gone]
    work.attributes[keep] = 0.5 * (work.attributes[keep] + work.attributes[gone])
    target = np.arange(len(work.vertices))
    target[gone] = keep
    triangles = target[work.triangles]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    used, inverse = np.unique(triangles, return_inverse=True)
    work.triangles = inverse.reshape(-1, 3)
    work.vertices, work.quadrics = work.vertices[used], work.quadrics[used]
    work.attributes = work.attributes[used]
