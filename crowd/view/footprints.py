"""Footprints as plates on the ground: those behind, those ahead and where these are going."""

from __future__ import annotations

from typing import Any

import numpy as np

from crowd.view.geometry import Body
from crowd.view.palette import leg_color, linear, srgb

WIDTH = 0.36  # of a plate over its length
RIM = 0.16  # of a plate's width: the frame of an outline, an arm of a cross
OVER = 0.012  # m that a plate stands out of the ground
PALE = 0.35  # how much lighter the prints ahead are


def plate_corners(heel: np.ndarray, along: np.ndarray, width: float = WIDTH) -> np.ndarray:
    """Corners [*b, 4, 3] of plates from their heel ends [*b, 3] and the way to their toe ends [*b, 3].

    Counter-clockwise seen from above, from the heel end's right; level across. A plate without length is a point.
    """
    heel, along = np.asarray(heel, float), np.asarray(along, float)
    left = 0.5 * width * np.stack([along[..., 2], 0 * along[..., 1], -along[..., 0]], -1)
    return np.stack([heel - left, heel + along - left, heel + along + left, heel + left], -2)


def plates(heel: np.ndarray, along: np.ndarray, color: np.ndarray, width: float = WIDTH) -> Body:
    """Filled plates [P] as thin boxes on the ground: heel ends and ways [P, 3] m, linear colours [P, 3]."""
    corners = plate_corners(heel, along, width).reshape(-1, 4, 3)
    return Body(_thick(corners), _prism([[0, 1, 2], [0, 2, 3]], 4), np.asarray(color, float).reshape(-1, 3))


def outlines(heel: np.ndarray, along: np.ndarray, color: np.ndarray, width: float = WIDTH) -> Body:
    """The same plates as frames, open in the middle."""
    outer = plate_corners(heel, along, width).reshape(-1, 4, 3)
    middle = outer.mean(1, keepdims=True)
    ahead, across = 0.5 * (outer[:, 1] - outer[:, 0]), 0.5 * (outer[:, 0] - outer[:, 3])
    rim = RIM * width  # of the length, the same all around
    sides = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
    inner = middle + sides[:, :1] * ahead[:, None] * (1 - 2 * rim) + sides[:, 1:] * across[:, None] * (1 - 2 * RIM)
    faces = [face for k in range(4) for face in ([k, (k + 1) % 4, 4 + (k + 1) % 4], [k, 4 + (k + 1) % 4, 4 + k])]
    corners = np.concatenate([outer, inner], 1)
    return Body(_thick(corners), _prism(faces, 8), np.asarray(color, float).reshape(-1, 3))


def crosses(place: np.ndarray, size: np.ndarray, color: np.ndarray) -> Body:
    """Upright crosses seen from above at places [P, 3] m, arms along x and z of `size` [P] m."""
    half, thin = 0.5, 0.5 * RIM
    flat = [(-half, -thin), (half, -thin), (half, thin), (-half, thin)]
    arms = np.array(flat + [(-z, x) for x, z in flat])
    corners = np.stack([arms[:, 0], 0 * arms[:, 0], arms[:, 1]], -1) * np.asarray(size, float).reshape(-1, 1, 1)
    faces = [[0, 2, 1], [0, 3, 2], [4, 6, 5], [4, 7, 6]]
    return Body(
        _thick(np.asarray(place, float).reshape(-1, 1, 3) + corners), _prism(faces, 8),
        np.asarray(color, float).reshape(-1, 3),
    )  # fmt: skip


def footprint_bodies(arrays: Any, frame: int, people: slice) -> list[Body]:
    """Footprints of some characters at a recorded frame, a colour per leg; none where they were not recorded.

    Behind: filled. Ahead: an outline in the paler colour. Where that is going: a cross.
    """
    if "footprint_from" not in arrays:
        return []
    parts = ("from", "from_direction", "to", "to_direction", "goal")
    behind, way, ahead, on, goal = (np.asarray(arrays[f"footprint_{part}"][frame, people], float) for part in parts)
    legs = behind.shape[1]
    own = np.tile(np.array([linear(srgb(leg_color(leg))) for leg in range(legs)]), (len(behind), 1))
    pale = own + PALE * (1.0 - own)
    size = 0.5 * np.linalg.norm(on, axis=-1)
    return [
        plates(behind.reshape(-1, 3), way.reshape(-1, 3), own),
        outlines(ahead.reshape(-1, 3), on.reshape(-1, 3), pale),
        crosses(goal.reshape(-1, 3), size.reshape(-1), own),
    ]


def _thick(corners: np.ndarray) -> np.ndarray:
    """Vertices [P, 2k, 3]: corners [P, k, 3] a little over the ground, then the same a little under it."""
    over = np.array([0.0, OVER, 0.0])
    return np.concatenate([corners + over, corners - over], 1)


def _prism(top: list[list[int]], corners: int) -> np.ndarray:
    """Triangles of a body whose upper face has the triangles `top` over so many corners; sides of every edge once."""
    edges = [(face[k], face[(k + 1) % 3]) for face in top for k in range(3)]
    rim = [(a, b) for a, b in edges if (b, a) not in edges]
    sides = [side for a, b in rim for side in ([a, a + corners, b + corners], [a, b + corners, b])]
    bottom = [[a + corners, c + corners, b + corners] for a, b, c in top]
    return np.array(top + sides + bottom, np.int32)
