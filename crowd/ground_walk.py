"""Whether a walk leaves the map it is meant for: told before the run, not refused."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from crowd.ground import Ground, level_at, without_height
from crowd.ground_layer import Layer

MOST_WALKS, MOST_SAMPLES = 256, 512  # looked at for gaps: characters of a herd, and places of each


def walk_notes(ground: Ground, walks: Mapping[str, np.ndarray]) -> list[str]:
    """At most one note on walks off the border of a map and one on walks over its gaps.

    walks: by herd, corners [n, m, 2] (x, z) of the way that each character will go, m >= 1.
    """
    notes = []
    grids = [(number, layer) for number, layer in enumerate(ground.layers) if layer.grid is not None and not layer.gap]
    for find in (_off, _gaps):
        found = (find(ground, number, layer, name, way) for number, layer in grids for name, way in walks.items())
        notes += [note for note in found if note][:1]
    return notes


def _off(ground: Ground, number: int, layer: Layer, name: str, way: np.ndarray) -> str | None:
    """The note for a herd that walks where a map has ended but its border goes on."""
    (x0, z0), (x1, z1) = bounds(layer)
    x, z = way[..., 0], way[..., 1]
    off = ((x < x0) | (x > x1) | (z < z0) | (z > z1)) & (level_at(ground, x, z) == number)
    if not off.any():
        return None
    who, corner = np.argwhere(off)[0]
    return (
        f"terrain smaller than the walk: {off.any(1).sum()} of '{name}' go off {layer.source or 'the rubble'}, one to "
        f"[{x[who, corner]:.1f}, {z[who, corner]:.1f}]; it covers x {x0:.1f} to {x1:.1f}, z {z0:.1f} to {z1:.1f} and "
        "goes on level from its border (another center_m, a larger map or a shorter way keep them on it)"
    )


def _gaps(ground: Ground, number: int, layer: Layer, name: str, way: np.ndarray) -> str | None:
    """The note for a herd that walks over cells without height."""
    if layer.missing is None:
        return None
    some = way[:: max(1, len(way) // MOST_WALKS)]
    steps = np.linalg.norm(np.diff(some, axis=1), axis=2).max(initial=0.0) / np.abs(layer.cell).min()
    share = np.linspace(0.0, 1.0, int(np.clip(2 * steps, 2, MOST_SAMPLES)))[:, None, None]
    legs = [a + (b - a) * share for a, b in zip(some.swapaxes(0, 1)[:-1], some.swapaxes(0, 1)[1:], strict=True)]
    points = np.concatenate([leg.reshape(-1, 2) for leg in legs] or [some.reshape(-1, 2)])
    on = without_height(ground, points)
    if not on.any():
        return None
    x, z = points[np.argmax(on)]
    return (
        f"'{name}' walk where {layer.source} has no height (first at [{x:.1f}, {z:.1f}]); the nearest one is used there"
    )


def bounds(layer: Layer) -> tuple[np.ndarray, np.ndarray]:
    """Low and high corner (x, z) of a grid, m."""
    assert layer.grid is not None
    far = layer.origin + layer.cell * (np.array(layer.grid.shape[::-1]) - 1)
    return np.minimum(layer.origin, far), np.maximum(layer.origin, far)
