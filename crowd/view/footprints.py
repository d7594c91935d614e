"""Footprints as plates on the ground."""

from __future__ import annotations

import numpy as np

WIDTH = 0.36  # of a plate over its length


def plate_corners(heel: np.ndarray, along: np.ndarray, width: float = WIDTH) -> np.ndarray:
    """Corners [*b, 4, 3] of plates from their heel ends [*b, 3] and the way to their toe ends [*b, 3].

    Counter-clockwise seen from above, from the heel end's right; level across. A plate without length is a point.
    """
    heel, along = np.asarray(heel, float), np.asarray(along, float)
    left = 0.5 * width * np.stack([along[..., 2], 0 * along[..., 1], -along[..., 0]], -1)
    return np.stack([heel - left, heel + along - left, heel + along + left, heel + left], -2)
