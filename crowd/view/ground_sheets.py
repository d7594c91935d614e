"""The levels of a ground as triangles: edges where it has edges, decks with a side and an underside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowd.ground import Ground
from crowd.ground_layer import Layer, heights, there
from crowd.view.camera import Camera

LINES = 420  # across what is seen near by, along each axis
HORIZON = 1500.0  # m
DECK = 0.2  # m, thickness of a level over others
CORNERS = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])


@dataclass(frozen=True, eq=False)
class Sheet:
    """Triangles [T, 3, 3] m of a level, with their unit normals."""

    corners: np.ndarray
    normals: np.ndarray
    deck: bool  # over others: throws a shadow


def ground_sheets(ground: Ground, camera: Camera, points: np.ndarray) -> list[Sheet]:
    """All levels: fine around `points` [..., 3] and the camera, coarser to the horizon."""
    place = np.concatenate([points.reshape(-1, 3), [camera.eye, camera.target]])[:, [0, 2]]
    return [_sheet(layer, place, number > 0) for number, layer in enumerate(ground.layers)]


def _sheet(layer: Layer, place: np.ndarray, deck: bool) -> Sheet:
    if layer.grid is None and layer.kind != "sines":
        corners, normals = _profile(layer, place)
    else:
        corners, normals = _field(layer, place)
    if layer.area is not None:
        corners, normals = clipped(corners, normals, *layer.area)
    if deck and len(corners):
        corners, normals = _thick(corners, normals)
    return Sheet(corners, normals, deck)


def _lines(place: np.ndarray, low: float, high: float, step: float = 0.1) -> np.ndarray:
    """Coordinates of lines across one axis: even between the places [n] seen, ever wider beyond; low and high cut."""
    near, far = place.min() - 2.0, place.max() + 2.0
    inner = np.linspace(near, far, int(np.clip((far - near) / step, 40, LINES)))
    outer = np.geomspace(inner[1] - inner[0], HORIZON, 60)
    lines = np.concatenate([near - outer[::-1], inner, far + outer])
    return _with_ends(lines[(lines > low) & (lines < high)], low, high)


def _with_ends(lines: np.ndarray, low: float, high: float) -> np.ndarray:
    """Lines in order, with those of the limits that are finite."""
    return np.unique([*lines, *(limit for limit in (low, high) if np.isfinite(limit))])


def _limits(layer: Layer, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Low and high coordinate along two axes [2, 2] (rows) of what a level covers; infinite without a rectangle."""
    if layer.area is None:
        return np.full(2, -np.inf), np.full(2, np.inf)
    low, high = layer.area
    corners = (low + (high - low) * CORNERS) @ axes.T
    return corners.min(0), corners.max(0)


def _profile(layer: Layer, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A profile drawn out across its axis: straight pieces between its corners, upright where it jumps."""
    axes = np.array([layer.axis, [layer.axis[1], -layer.axis[0]]])
    seen, (low, high) = place @ axes.T, _limits(layer, axes)
    along = np.unique(np.concatenate([_lines(seen[:, 0], low[0], high[0], 0.5), _knots(layer, low[0], high[0])]))
    across = _lines(seen[:, 1], low[1], high[1], 0.5)
    # Heights just inside both ends of every piece: at a riser they are not those of the neighbours.
    ends = np.stack([along[:-1], along[1:]], 1)
    inside = ends + np.diff(ends, axis=1) * np.array([1e-3, -1e-3])
    place_in = inside[..., None] * layer.axis
    level = heights(layer, place_in[..., 0], place_in[..., 1])
    if layer.kind != "steps":
        level = level + (level[:, 1:] - level[:, :1]) * np.array([-1e-3, 1e-3]) / (1 - 2e-3)
    rises = np.abs(level[1:, 0] - level[:-1, 1]) > 1e-6
    upright = np.stack([level[:-1, 1], level[1:, 0]], 1)[rises], np.repeat(along[1:-1][rises, None], 2, 1)
    level, ends = np.concatenate([level, upright[0]]), np.concatenate([ends, upright[1]])
    run, rise = np.diff(ends, axis=1)[:, 0], np.diff(level, axis=1)[:, 0]
    length = np.maximum(np.hypot(run, rise), 1e-12)
    normal = np.stack([-rise / length * layer.axis[0], run / length, -rise / length * layer.axis[1]], 1)
    sides = np.stack([across[:-1], across[1:]], 1)
    # Corners [piece, strip, end, side, xyz].
    ground = ends[:, None, :, None, None] * axes[0] + sides[None, :, None, :, None] * axes[1]
    tall = np.broadcast_to(level[:, None, :, None, None], (*ground.shape[:-1], 1))
    quads = np.concatenate([ground[..., :1], tall, ground[..., 1:]], -1).reshape(len(ends), len(across) - 1, 4, 3)
    normals = np.broadcast_to(normal[:, None, None], quads.shape)
    return _triangles(quads.reshape(-1, 4, 3)), _triangles(normals.reshape(-1, 4, 3))


def _knots(layer: Layer, low: float, high: float) -> np.ndarray:
    """Places along the axis where a profile bends or jumps."""
    values = layer.parameters
    knots = np.zeros(0)
    if layer.kind == "ramp":
        knots = values[:2]
    elif layer.kind == "stretches":
        knots = np.concatenate([values[::3], values[::3] + values[1::3]])
    elif layer.kind == "steps":
        knots = (values[[0, 4][: len(values) - 3]][:, None] + values[1] * np.arange(values[3])).ravel()
    return knots[(knots > low) & (knots < high)]


def _field(layer: Layer, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Waves with smooth normals; a grid by its own cells where they are large enough, each face with its normal."""
    low, high = _limits(layer, np.eye(2))
    lines = [_lines(place[:, axis], low[axis], high[axis]) for axis in (0, 1)]
    if layer.grid is not None:
        lines = [_posts(layer, axis, lines[axis], low[axis], high[axis]) for axis in (0, 1)]
    x, z = np.meshgrid(*lines, indexing="ij")
    sheet = np.stack([x, heights(layer, x, z), z], -1)
    quads = np.stack([sheet[:-1, :-1], sheet[1:, :-1], sheet[:-1, 1:], sheet[1:, 1:]], 2)
    if layer.grid is not None:
        middle = quads.mean(2)
        quads = quads[there(layer, middle[..., 0], middle[..., 2])]
        corners = _triangles(quads.reshape(-1, 4, 3))
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        normal = normal * np.where(normal[:, 1:2] < 0, -1.0, 1.0)
        return corners, np.repeat(normal[:, None], 3, 1)
    rise_x, rise_z = (np.gradient(sheet[..., 1], line, axis=axis) for axis, line in enumerate(lines))
    normal = np.stack([-rise_x, np.ones_like(rise_x), -rise_z], -1)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    normals = np.stack([normal[:-1, :-1], normal[1:, :-1], normal[:-1, 1:], normal[1:, 1:]], 2)
    return _triangles(quads.reshape(-1, 4, 3)), _triangles(normals.reshape(-1, 4, 3))


def _posts(layer: Layer, axis: int, lines: np.ndarray, low: float, high: float) -> np.ndarray:
    """The lines with those of a grid's posts; between posts not finer than 0.1 m."""
    assert layer.grid is not None
    cell, count = abs(layer.cell[axis]), layer.grid.shape[1 - axis]
    first = min(layer.origin[axis], layer.origin[axis] + layer.cell[axis] * (count - 1))
    posts = first + cell * np.arange(count)
    posts = posts[(posts > max(lines[0], low)) & (posts < min(lines[-1], high))]
    if len(posts) < 2 or len(posts) > 2 * LINES:
        return lines
    off = lines[(lines < posts[0] - 1e-6) | (lines > posts[-1] + 1e-6)]
    parts = int(np.clip(min(LINES // len(posts), cell / 0.1), 1, LINES))
    fine = posts[:-1, None] + cell * np.arange(parts) / parts
    return _with_ends(np.concatenate([off, fine.ravel(), posts[-1:]]), low, high)


def _triangles(quads: np.ndarray) -> np.ndarray:
    """[Q, 4, 3] corners 00, 10, 01, 11 to [2 Q, 3, 3]."""
    return quads[:, [[0, 2, 3], [0, 3, 1]]].reshape(-1, 3, 3)


def clipped(
    corners: np.ndarray, normals: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Triangles cut to a rectangle of the ground plane, low and high corner (x, z)."""
    both = np.concatenate([corners, normals], -1)
    for axis, limit, sign in ((0, low[0], 1), (2, low[1], 1), (0, high[0], -1), (2, high[1], -1)):
        inside = sign * (both[:, :, axis] - limit)
        count = (inside >= 0).sum(1)
        kept = [both[count == 3]]
        for wanted in (1, 2):
            part, depth = both[count == wanted], inside[count == wanted]
            lone = np.argmax((depth >= 0) == (wanted == 1), axis=1)  # the one corner on its side
            turn = (lone[:, None] + np.arange(3)) % 3
            part, depth = np.take_along_axis(part, turn[..., None], 1), np.take_along_axis(depth, turn, 1)
            share = (depth[:, :1] / (depth[:, :1] - depth[:, 1:]))[..., None]
            cut = part[:, :1] + (part[:, 1:] - part[:, :1]) * share
            if wanted == 1:
                kept.append(np.concatenate([part[:, :1], cut], 1))
            else:
                kept.append(np.stack([cut[:, 0], part[:, 1], part[:, 2]], 1))
                kept.append(np.stack([cut[:, 0], part[:, 2], cut[:, 1]], 1))
        both = np.concatenate(kept)
    return both[..., :3], both[..., 3:]


def _thick(corners: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A sheet made a slab: an underside below it, and a side along its border."""
    down = np.array([0.0, -DECK, 0.0])
    edge = np.stack([corners, np.roll(corners, -1, 1)], 2).reshape(-1, 2, 3)
    inner = np.roll(corners, -2, 1).reshape(-1, 3)  # the third corner of each edge's triangle
    key = np.round(edge, 4)
    swap = (key[:, 0] > key[:, 1])[:, 0] | (
        (key[:, 0, 0] == key[:, 1, 0])
        & ((key[:, 0, 2] > key[:, 1, 2]) | ((key[:, 0, 2] == key[:, 1, 2]) & (key[:, 0, 1] > key[:, 1, 1])))
    )
    key = np.where(swap[:, None, None], key[:, ::-1], key).reshape(-1, 6)
    _, number, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    # Upright edges have no side of their own: those of the treads beside them cover it.
    border = (count[number.reshape(-1)] == 1) & (np.ptp(edge[..., [0, 2]], axis=1).max(1) > 1e-6)
    p, q = edge[border, 0], edge[border, 1]
    out = np.stack([q[:, 2] - p[:, 2], np.zeros(len(p)), p[:, 0] - q[:, 0]], 1)
    out = out / np.linalg.norm(out, axis=1, keepdims=True)
    out = out * np.where(((inner[border] - p) * out).sum(1, keepdims=True) > 0, -1.0, 1.0)
    side = _triangles(np.stack([p, q, p + down, q + down], 1))
    side_normal = np.repeat(np.repeat(out, 2, 0)[:, None], 3, 1)
    return np.concatenate([corners, corners + down, side]), np.concatenate([normals, -normals, side_normal])
