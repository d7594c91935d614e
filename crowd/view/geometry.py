"""What a picture shows: bodies, ground and fluid surfaces, and the triangles they become."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from crowd.ground import Ground
from crowd.view.camera import Camera
from crowd.view.ground_sheets import Sheet, ground_sheets
from crowd.view.relief import Relief

Field = Callable[[np.ndarray, np.ndarray], np.ndarray]  # (x, z) in m to a height in m

GROUND = np.array([0.50, 0.465, 0.405])  # linear colour
DECK = np.array([0.44, 0.43, 0.42])  # of levels over others
GROUND_LINES = 420  # along each axis
CREASE = (0.55, 0.75)  # cosine between a face and the smooth normal: sharp below, smooth above


@dataclass(frozen=True, eq=False)
class Body:
    """Characters that share a mesh: world vertices [n, V, 3] m, triangles [T, 3], linear colours [n, 3].

    carriers [n, 3] m: where the characters are, of what they carry; None: where their own vertices are.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    color: np.ndarray
    carriers: np.ndarray | None = None

    @property
    def middle(self) -> np.ndarray:
        """[n, 3] m, about where each character is."""
        return self.vertices.mean(1) if self.carriers is None else self.carriers


@dataclass(frozen=True)
class Level:
    """A fluid surface over a rectangle of the ground plane (m), level or with waves at the moment of the picture."""

    height: float
    color: tuple[float, float, float] = (0.008, 0.12, 0.23)  # linear, where it is deep
    x: tuple[float, float] = (-np.inf, np.inf)
    z: tuple[float, float] = (-np.inf, np.inf)
    clarity: float = 1.3  # m of depth at which the bottom has almost gone
    under: tuple[Level, ...] = ()  # surfaces that take the place of this one where they are
    waves: tuple[tuple[float, float, float, float], ...] = ()  # amplitude m, kx rad/m, kz, phase rad
    relief: Relief | None = None  # waves on a grid

    @property
    def highest(self) -> float:
        """m, what its waves come to at most."""
        return sum(wave[0] for wave in self.waves) + (0.0 if self.relief is None else self.relief.highest)

    def rise(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        """[3, P] height above `height`, m, and slopes along x and z."""
        found = np.zeros((3, *x.shape), x.dtype) if self.relief is None else np.array(self.relief.at(x, z), x.dtype)
        for amplitude, kx, kz, phase in self.waves:
            angle = x * x.dtype.type(kx) + z * x.dtype.type(kz) + x.dtype.type(phase)
            found[0] += x.dtype.type(amplitude) * np.cos(angle)
            steep = np.sin(angle) * x.dtype.type(-amplitude)
            found[1] += steep * x.dtype.type(kx)
            found[2] += steep * x.dtype.type(kz)
        return found

    def covers(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Whether the points x, z lie in the rectangle and in none of those that take its place."""
        inside = (x >= self.x[0]) & (x <= self.x[1]) & (z >= self.z[0]) & (z <= self.z[1])
        for other in self.under:
            inside &= ~other.covers(x, z)
        return inside


@dataclass(frozen=True, eq=False)
class Geometry:
    """A scene to draw. `ground` maps x, z (arrays, m) to heights; None leaves the bodies in the air.

    terrain: the same ground with all its levels and edges, where it is known; `ground` alone is drawn as one sheet.
    """

    bodies: Sequence[Body] = ()
    ground: Field | None = None
    levels: Sequence[Level] = field(default=())
    terrain: Ground | None = None

    def above(self, points: np.ndarray) -> np.ndarray:
        """Height [S] in m of points [S, 3] over the ground seen from above: negative under a deck."""
        return points[:, 1] - self.ground(points[:, 0], points[:, 2]) if self.ground is not None else points[:, 1]


@dataclass(frozen=True, eq=False)
class Triangles:
    """Corners [T, 3, 3] m, unit normals there [T, 3, 3], colours [T, 3].

    First bodies, from number `ground` on decks, from number `lowest` on the ground under everything.
    """

    corners: np.ndarray
    normals: np.ndarray
    color: np.ndarray
    ground: int
    lowest: int


def vertex_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals [n, V, 3] of vertices [n, V, 3], weighted by area; vertices that coincide share theirs.

    A vertex no triangle uses, or one between opposite faces, gets zero.
    """
    corner = vertices[:, triangles]
    face = np.cross(corner[:, :, 1] - corner[:, :, 0], corner[:, :, 2] - corner[:, :, 0])
    _, shared = np.unique(np.round(vertices[0], 5), axis=0, return_inverse=True)
    shared = shared.reshape(-1)
    slots = shared[triangles.reshape(-1)]
    order = np.argsort(slots, kind="stable")
    starts = np.searchsorted(slots[order], np.arange(shared.max() + 1))
    used = np.bincount(slots, minlength=shared.max() + 1) > 0
    summed = np.zeros((len(vertices), shared.max() + 1, 3))
    if len(triangles):
        summed[:, used] = np.add.reduceat(face[:, order // 3], starts[used], axis=1)
    length = np.linalg.norm(summed, axis=-1, keepdims=True)
    return (summed / np.where(length > 0, length, 1.0))[:, shared]


def _corner_normals(body: Body, smooth: bool) -> np.ndarray:
    """Normals [n * T, 3, 3]: smooth over round parts, the face's own at sharp edges."""
    corner = body.vertices[:, body.triangles]
    face = np.cross(corner[:, :, 1] - corner[:, :, 0], corner[:, :, 2] - corner[:, :, 0])
    face = (face / np.maximum(np.linalg.norm(face, axis=-1, keepdims=True), 1e-12))[:, :, None]
    if not smooth:
        return np.repeat(face, 3, 2).reshape(-1, 3, 3)
    normal = vertex_normals(body.vertices, body.triangles)[:, body.triangles]
    agree = np.sum(normal * face, -1, keepdims=True)
    share = np.clip((agree - CREASE[0]) / (CREASE[1] - CREASE[0]), 0.0, 1.0)
    mixed = face + share * (normal - face)
    return (mixed / np.maximum(np.linalg.norm(mixed, axis=-1, keepdims=True), 1e-12)).reshape(-1, 3, 3)


def ground_sheet(ground: Field, camera: Camera, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners and normals [T, 3, 3] of the ground: fine around `points` and the camera, coarser to the horizon."""
    place = np.concatenate([points.reshape(-1, 3), [camera.eye, camera.target]])
    lines = []
    for axis in (0, 2):
        low, high = place[:, axis].min() - 2.0, place[:, axis].max() + 2.0
        inner = np.linspace(low, high, int(np.clip((high - low) / 0.1, 40, GROUND_LINES)))
        outer = np.geomspace(inner[1] - inner[0], 1500.0, 60)
        lines.append(np.concatenate([low - outer[::-1], inner, high + outer]))
    x, z = np.meshgrid(*lines, indexing="ij")
    sheet = np.stack([x, np.broadcast_to(np.asarray(ground(x, z), float), x.shape), z], -1)
    rise_x, rise_z = (np.gradient(sheet[..., 1], line, axis=axis) for axis, line in enumerate(lines))
    normal = np.stack([-rise_x, np.ones_like(rise_x), -rise_z], -1)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangles = np.concatenate([np.stack([a, d, c], -1).reshape(-1, 3), np.stack([a, c, b], -1).reshape(-1, 3)])
    return sheet.reshape(-1, 3)[triangles], normal.reshape(-1, 3)[triangles]


def collect(geometry: Geometry, camera: Camera, smooth: bool = True) -> Triangles:
    """All triangles of the picture. Bodies whose vertices are not finite (faulted characters) are left out."""
    corners, normals, colors = [np.zeros((0, 3, 3))], [np.zeros((0, 3, 3))], [np.zeros((0, 3))]
    for body in geometry.bodies:
        alive = np.isfinite(body.vertices).all((1, 2))
        if not alive.any() or len(body.triangles) == 0:
            continue
        body = Body(body.vertices[alive], body.triangles, body.color[alive])
        corners.append(body.vertices[:, body.triangles].reshape(-1, 3, 3))
        normals.append(_corner_normals(body, smooth))
        colors.append(np.repeat(body.color, len(body.triangles), 0))
    bodies = sum(len(part) for part in corners)
    decks = bodies
    for sheet in _sheets(geometry, camera, np.concatenate(corners)):
        corners.append(sheet.corners)
        normals.append(sheet.normals)
        colors.append(np.broadcast_to(DECK if sheet.deck else GROUND, (len(sheet.corners), 3)))
        decks += len(sheet.corners) if sheet.deck else 0
    return Triangles(np.concatenate(corners), np.concatenate(normals), np.concatenate(colors), bodies, decks)


def _sheets(geometry: Geometry, camera: Camera, points: np.ndarray) -> list[Sheet]:
    """The ground, decks first."""
    if geometry.terrain is not None:
        return sorted(ground_sheets(geometry.terrain, camera, points), key=lambda sheet: not sheet.deck)
    if geometry.ground is None:
        return []
    return [Sheet(*ground_sheet(geometry.ground, camera, points), deck=False)]
