"""Sampling of poses between their frames: rotations along the shortest arc, everything else linearly."""

from __future__ import annotations

import numpy as np


def align_hemispheres(rotation: np.ndarray) -> np.ndarray:
    """Quaternions [F, ..., 4] with signs chosen so that neighbours along the first axis lie in one hemisphere.

    Equal rotations throughout; consecutive dot products become >= 0.
    """
    dots = np.sum(rotation[1:] * rotation[:-1], -1)
    signs = np.cumprod(np.where(dots < 0, -1.0, 1.0), 0)
    return np.concatenate([rotation[:1], rotation[1:] * signs[..., None]])


def slerp(a: np.ndarray, b: np.ndarray, t: np.ndarray | float) -> np.ndarray:
    """Unit quaternions [..., 4] on the shortest arc from a (t = 0) to b (t = 1); `t` broadcasts against [...].

    Nearly equal rotations are interpolated linearly and renormalised, which agrees to 1e-9 there.
    """
    t = np.asarray(t)[..., None]
    dot = np.sum(a * b, -1, keepdims=True)
    b = np.where(dot < 0, -b, b)
    angle = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    sine = np.sin(angle)
    near = sine < 1e-4
    safe = np.where(near, 1.0, sine)
    out = np.where(near, 1 - t, np.sin((1 - t) * angle) / safe) * a + np.where(near, t, np.sin(t * angle) / safe) * b
    return out / np.linalg.norm(out, axis=-1, keepdims=True)


def resample(values: np.ndarray, at: np.ndarray, cyclic: bool) -> np.ndarray:
    """Values [F, ...] linearly interpolated at fractional frames `at` [S].

    Cyclic: frame F is frame 0 again, `at` may be any number. Otherwise `at` is clamped to 0..F-1.
    """
    low, high, t = _neighbours(len(values), at, cyclic)
    t = t.reshape(-1, *[1] * (values.ndim - 1))
    return values[low] * (1 - t) + values[high] * t


def resample_rotation(rotation: np.ndarray, at: np.ndarray, cyclic: bool) -> np.ndarray:
    """Quaternions [F, ..., 4] interpolated at fractional frames `at` [S] (as `resample`), hemisphere-continuous."""
    low, high, t = _neighbours(len(rotation), at, cyclic)
    t = t.reshape(-1, *[1] * (rotation.ndim - 2))
    return align_hemispheres(slerp(rotation[low], rotation[high], t))


def _neighbours(count: int, at: np.ndarray, cyclic: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    at = np.mod(at, count) if cyclic else np.clip(at, 0, count - 1)
    low = np.floor(at).astype(int)
    t = at - low
    low = np.minimum(low, count - 1)  # np.mod(-1e-17, n) is n
    high = (low + 1) % count if cyclic else np.minimum(low + 1, count - 1)
    return low, high, t
