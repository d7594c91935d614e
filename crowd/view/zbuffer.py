"""Which triangle is seen in each pixel: a z-buffer in NumPy.

Triangles become fragments (the pixels they cover) in batches; the nearest fragment of each pixel wins. The
result is the triangle's number and its depth per pixel; colours are computed afterwards, once per pixel.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

BATCH = 1 << 19  # pixels of bounding boxes at a time: keeps memory small and near the processor
TOLERANCE = 1e-9  # barycentric: pixel centres on an edge count as inside


@dataclass(frozen=True)
class Visible:
    """Per pixel (row-major, top row first): triangle number [h, w] int64 (-1: none) and nearness [h, w] (0: none)."""

    triangle: np.ndarray
    nearness: np.ndarray


def edge_functions(xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric coordinates as affine functions of the pixel, from corners [T, 3, 2].

    Returns coefficients [T, 3, 2] (per pixel in x, y, relative to the first corner) and offsets [T, 3]: coordinate k at
    p is offset_k + coefficient_k . (p - corner_0). A triangle without area gets NaN.
    """
    a, b = xy[:, 1] - xy[:, 0], xy[:, 2] - xy[:, 0]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    inverse = 1.0 / np.where(np.abs(area) > 1e-9, area, np.nan)
    second = np.stack([b[:, 1], -b[:, 0]], -1) * inverse[:, None]
    third = np.stack([-a[:, 1], a[:, 0]], -1) * inverse[:, None]
    offsets = np.zeros((len(xy), 3))
    offsets[:, 0] = 1.0
    return np.stack([-second - third, second, third], 1), offsets


def _batches(counts: np.ndarray) -> Iterator[slice]:
    """Slices of triangles with about BATCH fragments each (a single larger triangle is a batch of its own)."""
    ends = np.cumsum(counts)
    first = 0
    while first < len(counts):
        done = ends[first - 1] if first else 0
        last = max(int(np.searchsorted(ends, done + BATCH, "right")), first + 1)
        yield slice(first, last)
        first = last


def rasterize(xy: np.ndarray, nearness: np.ndarray, size: tuple[int, int]) -> Visible:
    """Z-buffer of triangles with pixel positions [T, 3, 2] and nearness [T, 3], both affine in the picture.

    nearness: larger is nearer, > 0 (perspective: 1 / depth; parallel light: height towards the lamp). Pixel centres on
    an edge count as inside, so neighbours leave no gap. Triangles with a corner that is not finite, with a nearness
    <= 0 or without area are skipped. Ties go to the larger triangle number, so the result does not depend on batching.
    """
    width, height = size
    buffer = np.zeros(width * height, np.uint64)
    usable = np.asarray(np.isfinite(xy).all((1, 2)) & (nearness > 0).all(1))
    # Pixel centres lie at +0.5.
    low = np.ceil(np.where(usable[:, None], xy.min(1), 1.0) - 0.5)
    high = np.floor(np.where(usable[:, None], xy.max(1), 0.0) - 0.5)
    low = np.maximum(low, 0.0)
    high = np.minimum(high, [width - 1, height - 1])
    span = high - low + 1
    number = np.nonzero(usable & (span > 0).all(1))[0]
    if len(number) == 0:
        return Visible(np.full((height, width), -1), np.zeros((height, width), np.float32))
    slope, offset = edge_functions(xy[number])
    seen = np.isfinite(slope).all((1, 2))  # not the ones seen edge on
    number, slope, offset = number[seen], slope[seen], offset[seen]
    low, span = low[number].astype(np.int64), span[number].astype(np.int64)
    at_low = offset + np.einsum("tkc,tc->tk", slope, low + 0.5 - xy[number, 0])
    near = nearness[number]
    near_slope, near_low = np.einsum("tkc,tk->tc", slope, near), np.sum(at_low * near, 1)
    counts = span[:, 0] * span[:, 1]
    for part in _batches(counts):
        pixel, which, depth = _fragments(
            low[part], span[part], at_low[part], slope[part], near_low[part], near_slope[part], width
        )
        key = (depth.view(np.uint32).astype(np.uint64) << np.uint64(32)) | (number[part][which] + 1).astype(np.uint64)
        np.maximum.at(buffer, pixel, key)
    triangle = (buffer & np.uint64(0xFFFFFFFF)).astype(np.int64) - 1
    depth = (buffer >> np.uint64(32)).astype(np.uint32).view(np.float32)
    return Visible(triangle.reshape(height, width), depth.reshape(height, width))


def _fragments(
    low: np.ndarray,
    span: np.ndarray,
    at_low: np.ndarray,
    slope: np.ndarray,
    near_low: np.ndarray,
    near_slope: np.ndarray,
    width: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pixels covered by a batch: flat pixel number, triangle within the batch, nearness (float32).

    Each triangle is cut into its pixel rows, and each row into the run of pixels between its edges.
    """
    rows = span[:, 1]
    which = np.repeat(np.arange(len(rows)), rows)
    row = np.arange(len(which)) - np.repeat(np.cumsum(rows) - rows, rows)
    first, last = np.zeros(len(which)), (span[:, 0] - 1).astype(float)[which]
    for k in range(3):
        value, step = at_low[which, k] + slope[which, k, 1] * row + TOLERANCE, slope[which, k, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            cross = -value / step
        first = np.where(step > 0, np.maximum(first, cross), first)
        last = np.where(step < 0, np.minimum(last, cross), last)
        last[(step == 0) & (value < 0)] = -1.0
    first, last = np.ceil(first).astype(np.int64), np.floor(last).astype(np.int64)
    length = np.maximum(last - first + 1, 0)
    near_row = near_low[which] + near_slope[which, 1] * row + near_slope[which, 0] * first
    pixel_row = (low[which, 1] + row) * width + low[which, 0] + first
    run = np.repeat(np.arange(len(length), dtype=np.int32), length)
    along = np.arange(len(run), dtype=np.int32) - np.repeat((np.cumsum(length) - length).astype(np.int32), length)
    depth = near_row[run] + near_slope[which, 0][run] * along
    return pixel_row[run] + along, which[run], np.maximum(depth, 1e-30).astype(np.float32)
