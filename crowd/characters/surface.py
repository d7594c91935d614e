"""Closed surfaces of implicit bodies: a smooth union of tapered capsules, extracted with surface nets (NumPy, offline).

Surface nets (Gibson 1998, "Constrained elastic surface nets") put one vertex in every grid cell that the surface
crosses and one quad across every grid edge whose ends lie on different sides. One vertex per cell is a 2-manifold only
where the inside samples are *well-composed* (Latecki 1997: no two samples touch across an edge or a corner alone), so
the samples are repaired first and the result is watertight by construction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_FACES = ((1, 2), (0, 2), (0, 1))


@dataclass(frozen=True)
class Part:
    """A tapered capsule from `start` to `end` that moves with a joint; `stretch` scales it about its own start.

    start, end: [3] m, bind pose, character frame. radii: at start and at end, m. stretch: factors along the character
    axes x, y, z by which the cross-section is wider or flatter than round (the axis itself is not stretched).
    """

    joint: int
    start: tuple[float, float, float]
    end: tuple[float, float, float]
    radii: tuple[float, float]
    stretch: tuple[float, float, float] = (1.0, 1.0, 1.0)


def distance(part: Part, points: np.ndarray) -> np.ndarray:
    """Signed distance of points [..., 3] to a part, m (exact for equal radii and no stretch); negative inside."""
    start, axis = np.asarray(part.start), np.subtract(part.end, part.start)
    length2 = float(axis @ axis)
    offset = points - start
    along = np.clip(offset @ axis / length2, 0.0, 1.0) if length2 > 0.0 else np.zeros(points.shape[:-1])
    across = offset - along[..., None] * axis
    stretched = across / np.asarray(part.stretch)
    near, far = np.linalg.norm(across, axis=-1), np.linalg.norm(stretched, axis=-1)
    # Dividing by the factor along this very direction turns the stretched distance back into metres.
    factor = np.where(far > 1e-12, near / np.maximum(far, 1e-12), min(part.stretch))
    return (far - (part.radii[0] + along * (part.radii[1] - part.radii[0]))) * factor


def smooth_union(parts: Sequence[Part], points: np.ndarray, blend: float) -> np.ndarray:
    """Distance to the union of parts with creases rounded over about `blend` metres (log-sum-exp)."""
    total = np.zeros(points.shape[:-1])
    for part in parts:
        total += np.exp(np.clip(-distance(part, points) / blend, -80.0, 80.0))
    return -blend * np.log(total + 1e-300)


def sample(parts: Sequence[Part], cell: float, blend: float) -> tuple[np.ndarray, np.ndarray]:
    """Field [nx, ny, nz] on a grid around the parts and the grid's origin [3]."""
    ends = np.array([[part.start, part.end] for part in parts])
    reach = np.array([max(part.radii) * np.array(part.stretch) for part in parts])[:, None] + 3.0 * cell + 2.0 * blend
    low, high = (ends - reach).min((0, 1)), (ends + reach).max((0, 1))
    counts = np.ceil((high - low) / cell).astype(int) + 1
    axes = [low[axis] + cell * np.arange(counts[axis]) for axis in range(3)]
    total = np.zeros(tuple(counts))
    for part in parts:
        # exp(-distance / blend) is nothing at 20 blends from a part: only the box round it is visited.
        margin = max(part.radii) * np.array(part.stretch) + 20.0 * blend
        near = np.clip(np.floor((np.minimum(part.start, part.end) - margin - low) / cell).astype(int), 0, counts)
        far = np.clip(np.ceil((np.maximum(part.start, part.end) + margin - low) / cell).astype(int) + 1, 0, counts)
        grid = np.stack(np.meshgrid(*(axes[k][near[k] : far[k]] for k in range(3)), indexing="ij"), -1)
        box = tuple(slice(near[k], far[k]) for k in range(3))
        total[box] += np.exp(np.clip(-distance(part, grid) / blend, -80.0, 80.0))
    return -blend * np.log(total + 1e-300), low


def _critical(inside: np.ndarray) -> np.ndarray:
    """Outside samples to fill so that no two inside samples meet at an edge or a corner only."""
    fill = np.zeros_like(inside)
    corner = [
        inside[i : i - 1 or None, j : j - 1 or None, k : k - 1 or None] for i in (0, 1) for j in (0, 1) for k in (0, 1)
    ]
    views = [
        fill[i : i - 1 or None, j : j - 1 or None, k : k - 1 or None] for i in (0, 1) for j in (0, 1) for k in (0, 1)
    ]
    bits = np.array([4, 2, 1])
    for fixed in range(3):
        u, v = bits[list(_FACES[fixed])]
        for base in (0, bits[fixed]):
            square = [corner[base], corner[base + u], corner[base + u + v], corner[base + v]]
            crossed = (square[0] == square[2]) & (square[1] == square[3]) & (square[0] != square[1])
            for index in (base, base + u, base + u + v, base + v):
                views[index] |= crossed
    count = np.sum(corner, axis=0)
    for index in range(4):
        pair = corner[index] & corner[7 - index] & (count == 2)
        hollow = ~corner[index] & ~corner[7 - index] & (count == 6)
        for view in views:
            view |= pair | hollow
    return fill & ~inside


def make_well_composed(field: np.ndarray, cell: float) -> np.ndarray:
    """The field with the few ambiguous samples moved just inside. Terminates: samples are only ever added."""
    field = field.copy()
    while True:
        fill = _critical(field < 0.0)
        if not fill.any():
            return field
        field[fill] = -1e-3 * cell


def surface_nets(field: np.ndarray, origin: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [V, 3] and outward triangles [T, 3] of the zero level of a field (negative inside)."""
    inside = field < 0.0
    shape = np.array(field.shape)
    number = np.full(tuple(shape - 1), -1)
    total, hits = np.zeros((*number.shape, 3)), np.zeros(number.shape)
    for axis in range(3):
        u, v = _FACES[axis]
        low = [slice(None)] * 3
        high = [slice(None)] * 3
        low[axis], high[axis] = slice(0, -1), slice(1, None)
        a, b = field[tuple(low)], field[tuple(high)]
        crossed = inside[tuple(low)] != inside[tuple(high)]
        share = np.where(crossed, a / np.where(crossed, a - b, 1.0), 0.0)
        for du in (0, 1):
            for dv in (0, 1):
                part = [slice(None)] * 3
                part[u] = slice(du, -1 if du == 0 else None)
                part[v] = slice(dv, -1 if dv == 0 else None)
                c = crossed[tuple(part)]
                hits += c
                total[..., axis] += c * share[tuple(part)]
                total[..., u] += c * du
                total[..., v] += c * dv
    active = hits > 0
    number[active] = np.arange(active.sum())
    vertices = origin + cell * (np.argwhere(active) + total[active] / hits[active][:, None])
    return vertices, _split(vertices, _quads(inside, number))


def _quads(inside: np.ndarray, number: np.ndarray) -> np.ndarray:
    quads = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        low = [slice(1, -1)] * 3
        high = [slice(1, -1)] * 3
        low[axis], high[axis] = slice(0, -1), slice(1, None)
        first, second = inside[tuple(low)], inside[tuple(high)]
        at = np.argwhere(first != second)
        at[:, [u, v]] += 1  # index of the grid edge's lower end
        corners = []
        for du, dv in ((-1, -1), (0, -1), (0, 0), (-1, 0)):
            cell = at.copy()
            cell[:, u] += du
            cell[:, v] += dv
            corners.append(number[tuple(cell.T)])
        quad = np.stack(corners, -1)
        outward = first[first != second]  # solid on the lower side: the face looks along +axis
        quads.append(np.where(outward[:, None], quad, quad[:, ::-1]))
    return np.concatenate(quads)


def _split(vertices: np.ndarray, quads: np.ndarray) -> np.ndarray:
    """Triangles of quads, cut along the shorter diagonal."""
    a, b, c, d = (vertices[quads[:, k]] for k in range(4))
    short = (np.linalg.norm(a - c, axis=1) <= np.linalg.norm(b - d, axis=1))[:, None]
    first = np.where(short, quads[:, [0, 1, 2]], quads[:, [0, 1, 3]])
    second = np.where(short, quads[:, [0, 2, 3]], quads[:, [1, 2, 3]])
    return np.concatenate([first, second])
