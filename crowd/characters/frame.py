"""The file frame of a rig and the character frame; global motion of joints and motion told joint to parent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowd.posing import conjugate, multiply, rotate


@dataclass(frozen=True, eq=False)
class Frame:
    """File frame (turned) to character frame: x -> (x - origin) * metres."""

    origin: np.ndarray  # [3]
    metres: float

    def place(self, position: np.ndarray) -> np.ndarray:
        return (position - self.origin) * self.metres


def global_motion(
    frame: Frame, order: list[int], rotation: np.ndarray, position: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rotations [..., J, 4] and positions [..., J, 3], m, of the joints `order` in the character frame."""
    q = _picked(rotation, order, np.array([1.0, 0, 0, 0]))
    return q, _picked(frame.place(position), order, np.zeros(3))


def _picked(values: np.ndarray, order: list[int], root: np.ndarray) -> np.ndarray:
    """Columns `order` of [..., J, C]; -1 is the added root with value `root`."""
    out = values[..., [max(j, 0) for j in order], :].copy()
    for k, joint in enumerate(order):
        if joint < 0:
            out[..., k, :] = root
    return out


def local_motion(rotation: np.ndarray, position: np.ndarray, parents: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Joint-to-parent rotation and translation of global ones [..., J, 4] and [..., J, 3]."""
    q, t = rotation.copy(), position.copy()
    for joint, parent in enumerate(parents):
        if parent >= 0:
            back = conjugate(rotation[..., parent, :])
            q[..., joint, :] = multiply(back, rotation[..., joint, :])
            t[..., joint, :] = rotate(back, position[..., joint, :] - position[..., parent, :])
    return q / np.linalg.norm(q, axis=-1, keepdims=True), t
