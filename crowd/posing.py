"""Forward kinematics and skinning on the host (NumPy): for pictures, metrics, clip analysis and tests."""

from __future__ import annotations

import numpy as np

from crowd.types import Clip, Mesh, Motion, Skeleton


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector product of [..., 3]; four times faster than np.cross on the small arrays of one rig."""
    ax, ay, az = np.moveaxis(a, -1, 0)
    bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], -1)


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Hamilton product of quaternions [..., 4]: first b, then a."""
    w, u = a[..., :1], a[..., 1:]
    s, v = b[..., :1], b[..., 1:]
    scalar = w * s - np.sum(u * v, -1, keepdims=True)
    return np.concatenate([scalar, w * v + s * u + cross(u, v)], -1)


def conjugate(q: np.ndarray) -> np.ndarray:
    """Inverse of unit quaternions [..., 4]."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Vectors [..., 3] turned by unit quaternions [..., 4]."""
    u = q[..., 1:]
    t = 2.0 * cross(u, v)
    return v + q[..., :1] * t + cross(u, t)


def matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrices [..., 3, 3] of unit quaternions [..., 4]."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, -1) for row in rows], -2)


def quaternion(m: np.ndarray) -> np.ndarray:
    """Unit quaternions [..., 4] (w >= 0) of rotation matrices [..., 3, 3], stable at every angle."""
    m00, m11, m22 = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    candidates = np.stack(
        [
            np.stack(
                [
                    1 + m00 + m11 + m22,
                    m[..., 2, 1] - m[..., 1, 2],
                    m[..., 0, 2] - m[..., 2, 0],
                    m[..., 1, 0] - m[..., 0, 1],
                ],
                -1,
            ),
            np.stack(
                [
                    m[..., 2, 1] - m[..., 1, 2],
                    1 + m00 - m11 - m22,
                    m[..., 0, 1] + m[..., 1, 0],
                    m[..., 0, 2] + m[..., 2, 0],
                ],
                -1,
            ),
            np.stack(
                [
                    m[..., 0, 2] - m[..., 2, 0],
                    m[..., 0, 1] + m[..., 1, 0],
                    1 - m00 + m11 - m22,
                    m[..., 1, 2] + m[..., 2, 1],
                ],
                -1,
            ),
            np.stack(
                [
                    m[..., 1, 0] - m[..., 0, 1],
                    m[..., 0, 2] + m[..., 2, 0],
                    m[..., 1, 2] + m[..., 2, 1],
                    1 - m00 - m11 + m22,
                ],
                -1,
            ),
        ],
        -2,
    )
    best = np.argmax(np.stack([m00 + m11 + m22, m00, m11, m22], -1), -1)
    q = np.take_along_axis(candidates, best[..., None, None], -2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0, -q, q)


def rest_motion(skeleton: Skeleton) -> Motion:
    """The rest pose of one character at the origin."""
    return Motion(
        np.zeros(3), np.array([1.0, 0, 0, 0]), skeleton.rest_rotation, skeleton.rest_translation, np.array(1.0)
    )


def clip_motion(clip: Clip) -> Motion:
    """A clip played on the spot: leading shape (F,)."""
    count = len(clip.rotation)
    return Motion(
        np.zeros((count, 3)), np.tile([1.0, 0, 0, 0], (count, 1)), clip.rotation, clip.translation, np.ones(count)
    )


def world_transforms(skeleton: Skeleton, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """World rotation [*b, J, 4] and position [*b, J, 3] of every joint."""
    rotations: list[np.ndarray] = []
    positions: list[np.ndarray] = []
    scale = np.asarray(motion.scale)[..., None]
    for joint, parent in enumerate(skeleton.parents):
        above_q = motion.orientation if parent < 0 else rotations[parent]
        above_p = motion.position if parent < 0 else positions[parent]
        positions.append(above_p + rotate(above_q, motion.translation[..., joint, :] * scale))
        rotations.append(multiply(above_q, motion.rotation[..., joint, :]))
    return np.stack(rotations, -2), np.stack(positions, -2)


def skin(mesh: Mesh, rotation_w: np.ndarray, position_w: np.ndarray, scale: np.ndarray | float = 1.0) -> np.ndarray:
    """Linear blend skinning: world vertices [*b, V, 3] from joint transforms [*b, J, 4] and [*b, J, 3]."""
    homogeneous = np.concatenate([mesh.vertices, np.ones((len(mesh.vertices), 1))], 1)
    rotations = matrix(rotation_w)
    size = np.asarray(scale)[..., None, None]
    out = 0.0
    for k in range(mesh.joints.shape[1]):
        joint = mesh.joints[:, k]
        local = np.einsum("vrc,vc->vr", mesh.inverse_bind[joint][:, :3], homogeneous)
        placed = np.einsum("...vrc,vc->...vr", rotations[..., joint, :, :], local) * size + position_w[..., joint, :]
        out = out + mesh.weights[:, k, None] * placed
    return np.asarray(out)
