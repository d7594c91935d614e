"""A man made of boxes: small enough to reason about, complete enough for pictures, recordings and metrics."""

from __future__ import annotations

import numpy as np
import pytest

from crowd.types import Archetype, Clip, Leg, Mesh, Skeleton

FACES = np.array(
    [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3],
    np.int32,
).reshape(12, 3)
# joint, parent, offset to the parent, box low and high in the joint's frame
PARTS = (
    ("pelvis", -1, (0.0, 0.90, 0.0), (-0.15, -0.08, -0.09), (0.15, 0.10, 0.09)),
    ("chest", 0, (0.0, 0.12, 0.0), (-0.18, 0.0, -0.10), (0.18, 0.42, 0.10)),
    ("head", 1, (0.0, 0.46, 0.0), (-0.09, 0.0, -0.10), (0.09, 0.24, 0.10)),
    ("hip_l", 0, (0.09, -0.05, 0.0), (-0.07, -0.40, -0.07), (0.07, 0.0, 0.07)),
    ("knee_l", 3, (0.0, -0.41, 0.0), (-0.055, -0.36, -0.06), (0.055, 0.0, 0.06)),
    ("ankle_l", 4, (0.0, -0.37, 0.0), (-0.05, -0.07, -0.06), (0.05, 0.0, 0.20)),
    ("hip_r", 0, (-0.09, -0.05, 0.0), (-0.07, -0.40, -0.07), (0.07, 0.0, 0.07)),
    ("knee_r", 6, (0.0, -0.41, 0.0), (-0.055, -0.36, -0.06), (0.055, 0.0, 0.06)),
    ("ankle_r", 7, (0.0, -0.37, 0.0), (-0.05, -0.07, -0.06), (0.05, 0.0, 0.20)),
    ("arm_l", 1, (0.22, 0.38, 0.0), (-0.04, -0.60, -0.05), (0.04, 0.0, 0.05)),
    ("arm_r", 1, (-0.22, 0.38, 0.0), (-0.04, -0.60, -0.05), (0.04, 0.0, 0.05)),
)


def _about_x(angle: np.ndarray) -> np.ndarray:
    """Quaternions [..., 4] that swing a limb forward (toward +z) by `angle`."""
    zero = np.zeros_like(angle)
    return np.stack([np.cos(angle / 2), -np.sin(angle / 2), zero, zero], -1)


def make_box_man() -> Archetype:
    names = tuple(part[0] for part in PARTS)
    parents = tuple(part[1] for part in PARTS)
    translation = np.array([part[2] for part in PARTS])
    count = len(PARTS)
    skeleton = Skeleton(names, parents, np.tile([1.0, 0, 0, 0], (count, 1)), translation)
    world = np.zeros((count, 3))
    for joint, parent in enumerate(parents):
        world[joint] = translation[joint] + (world[parent] if parent >= 0 else 0.0)
    vertices, triangles, joints = [], [], []
    for joint, (*_, low, high) in enumerate(PARTS):
        corner = np.array([[(low, high)[(k >> b) & 1][b] for b in range(3)] for k in range(8)])
        vertices.append(corner + world[joint])
        triangles.append(FACES[:, ::-1] + 8 * joint)
        joints += [[joint, 0, 0, 0]] * 8
    weights = np.tile([1.0, 0, 0, 0], (8 * count, 1))
    inverse_bind = np.tile(np.eye(4), (count, 1, 1))
    inverse_bind[:, :3, 3] = -world
    mesh = Mesh(
        np.concatenate(vertices),
        np.concatenate(triangles).astype(np.int32),
        np.array(joints, np.int32),
        weights,
        inverse_bind,
    )
    cycle = 2 * np.pi * np.arange(30) / 30
    rotation = np.tile(skeleton.rest_rotation, (30, 1, 1))
    for side, shift in (("l", 0.0), ("r", np.pi)):
        rotation[:, names.index(f"hip_{side}")] = _about_x(0.45 * np.sin(cycle + shift))
        rotation[:, names.index(f"knee_{side}")] = _about_x(-0.5 * (1 + np.cos(cycle + shift)) / 2)
        rotation[:, names.index(f"arm_{side}")] = _about_x(-0.5 * np.sin(cycle + shift))
    walk = Clip("walk", "walk", 1.0, rotation, np.tile(translation, (30, 1, 1)), speed=1.2)
    legs = tuple(
        Leg(side, names.index(f"hip_{s}"), names.index(f"knee_{s}"), names.index(f"ankle_{s}"),
            names.index(f"ankle_{s}"), (0.0, -0.07, 0.14), sign)
        for side, s, sign in (("left", "l", 1), ("right", "r", -1))
    )  # fmt: skip
    return Archetype("box man", skeleton, mesh, legs, (), (walk,), 0, 1.72, 70.0)


@pytest.fixture(scope="session")
def box_man() -> Archetype:
    return make_box_man()
