"""Body meshes of few, regular quads: rings round the bones, laid on the implicit body, limbs grown out of holes.

For characters drawn by hand (the built-in ones). Only the half x >= 0 is built: the trunk is a grid of open strips from
its front (or top) line round the side to its back (or bottom) line, a limb continues the border of a hole in that grid.
The surface stays closed and has no faces inside the body. Every vertex is where a ray from its ring's centre leaves the
smooth union of the parts, so shapes come from the same description as `body_mesh.from_parts`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crowd.characters.surface import Part, smooth_union

_SAMPLES = 96


class Loft:
    """Half a body being built. Rings are lists of vertex numbers; all faces look outward."""

    def __init__(self, parts: Sequence[Part], blend: float, floor: float | None = None):
        self.parts, self.blend, self.floor = tuple(parts), blend, floor
        self.places: list[np.ndarray] = []
        self.faces: list[tuple[int, ...]] = []

    def vertex(self, place: np.ndarray) -> int:
        """A new vertex."""
        self.places.append(np.asarray(place, float))
        return len(self.places) - 1

    def cast(
        self, centre: np.ndarray, directions: np.ndarray, joints: frozenset[int] | None = None, limit: float = 0.6
    ) -> np.ndarray:
        """Where rays from centre [3] along unit directions [n, 3] first leave the body, [n, 3].

        joints: only their parts count. A ray ends at the plane x = 0 at the latest; one that starts outside ends at its
        start.
        """
        parts = self.parts if joints is None else [part for part in self.parts if part.joint in joints]
        low, high = np.zeros(len(directions)), np.zeros(len(directions))
        steps = np.linspace(0.0, limit, _SAMPLES)
        outside = self._field(parts, centre + steps[:, None, None] * directions) >= 0.0
        first = np.where(outside.any(0), outside.argmax(0), _SAMPLES - 1)
        high, low = steps[first], steps[np.maximum(first - 1, 0)]
        for _ in range(24):
            middle = 0.5 * (low + high)
            out = self._field(parts, centre + middle[:, None] * directions) >= 0.0
            low, high = np.where(out, low, middle), np.where(out, middle, high)
        inward = directions[:, 0] < -1e-9
        wall = np.where(inward, (centre[0] - 0.05 * abs(centre[0])) / np.where(inward, -directions[:, 0], 1.0), limit)
        return centre + np.minimum(high, wall)[:, None] * directions

    def _field(self, parts: Sequence[Part], points: np.ndarray) -> np.ndarray:
        field = smooth_union(parts, points, self.blend)
        return field if self.floor is None else np.maximum(field, self.floor - points[..., 1])

    def strip(
        self, centre: Sequence[float], front: Sequence[float], angles: Sequence[float], joints: frozenset[int] | None
    ) -> list[int]:
        """Open ring from direction `front` (in the plane x = 0) over the side +x to its opposite; angles in degrees."""
        a = np.radians(np.asarray(angles, float))[:, None]
        axis = np.asarray(front, float) / np.linalg.norm(front)
        directions = np.cos(a) * axis + np.sin(a) * np.array([1.0, 0.0, 0.0])
        directions[[0, -1], 0] = 0.0
        return [self.vertex(place) for place in self.cast(np.asarray(centre, float), directions, joints)]

    def skin(self, lower: Sequence[int], upper: Sequence[int], skip: Sequence[int] = ()) -> None:
        """Quads between two strips, except at the columns in skip (a hole)."""
        for j in range(len(lower) - 1):
            if j not in skip:
                self.faces.append((lower[j], lower[j + 1], upper[j + 1], upper[j]))

    def cap(self, ring: Sequence[int], tip: np.ndarray, closed: bool) -> None:
        """Triangles from a ring or strip to a new vertex at its end."""
        top = self.vertex(tip)
        for j in range(len(ring) - (0 if closed else 1)):
            self.faces.append((ring[j], ring[(j + 1) % len(ring)], top))

    def limb(
        self, hole: Sequence[int], rings: Sequence[tuple[np.ndarray, np.ndarray]], joints: frozenset[int], tip: float
    ) -> None:
        """Grow a limb from the border of a hole (in the order of the faces it replaces) through rings (centre, normal).

        The last ring is closed with a point on its normal; tip: how far along that ray may look for the surface, m.
        """
        directions, before = self._spread(hole, rings[0][1]), rings[0][1]
        last = list(hole)
        for centre, normal in rings:
            directions = directions @ _turning(before, normal).T
            ring = [self.vertex(place) for place in self.cast(centre, directions, joints)]
            for j in range(len(ring)):
                k = (j + 1) % len(ring)
                self.faces.append((last[j], last[k], ring[k], ring[j]))
            last, before = ring, normal
        centre, normal = rings[-1]
        self.cap(last, self.cast(centre, np.asarray(normal)[None], joints, tip)[0], closed=True)

    def _spread(self, hole: Sequence[int], normal: np.ndarray) -> np.ndarray:
        """Evenly spread directions [n, 3] across normal that face the vertices of a hole as well as they can."""
        places = np.array([self.places[v] for v in hole])
        offset = places - places.mean(0)
        offset -= (offset @ normal)[:, None] * normal
        first = offset[0] / np.linalg.norm(offset[0])
        second = np.cross(normal, first)
        angle = np.unwrap(np.arctan2(offset @ second, offset @ first))
        step = np.copysign(2.0 * np.pi / len(hole), angle[-1] - angle[0])
        even = np.arange(len(hole)) * step
        even += np.mean(angle - even)
        return np.cos(even)[:, None] * first + np.sin(even)[:, None] * second

    def finish(self) -> tuple[np.ndarray, np.ndarray]:
        """Vertices [V, 3] and triangles [T, 3] of the half; quads are cut along their shorter diagonal."""
        places = np.array(self.places)
        places[np.abs(places[:, 0]) < 1e-9, 0] = 0.0
        triangles = []
        for face in self.faces:
            if len(face) == 3:
                triangles.append(face)
                continue
            a, b, c, d = face
            if np.linalg.norm(places[a] - places[c]) <= np.linalg.norm(places[b] - places[d]):
                triangles += [(a, b, c), (a, c, d)]
            else:
                triangles += [(a, b, d), (b, c, d)]
        return places, np.array(triangles)


def hole_border(rows: Sequence[Sequence[int]], columns: tuple[int, int]) -> list[int]:
    """Border of the hole between the first and the last of some neighbouring strips, columns first to last."""
    first, last = columns
    inner = rows[1:-1]
    return [
        *rows[0][first : last + 1],
        *(row[last] for row in inner),
        *reversed(rows[-1][first : last + 1]),
        *(row[first] for row in reversed(inner)),
    ]


def rings_along(
    start: np.ndarray, end: np.ndarray, fractions: Sequence[float], shift: Sequence[float] = (0.0, 0.0, 0.0)
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rings (centre, normal) across a bone at fractions of its length."""
    axis = end - start
    return [(start + f * axis + np.asarray(shift), axis / np.linalg.norm(axis)) for f in fractions]


def _turning(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Least rotation [3, 3] from one unit vector to another (not opposite)."""
    axis = np.cross(before, after)
    cosine = float(before @ after)
    skew = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + skew + skew @ skew / (1.0 + cosine)
