"""One stride of an in-place clip, and where its feet are: what every analysis of clips begins with."""

from __future__ import annotations

import itertools

import numpy as np

from crowd import posing
from crowd.resampling import resample, resample_rotation
from crowd.types import Archetype, Clip, Skeleton

MOST_STRIDES = 6
COARSE = 48  # samples per stride that tell strides apart


def stride_count(archetype: Archetype, clip: Clip) -> int:
    """How many equal strides the clip holds (1 where they differ)."""
    for strides in range(MOST_STRIDES, 1, -1):
        rotation, translation = resampled(clip, strides * COARSE)
        contact, _ = feet(archetype, rotation, translation)
        spread = contact - contact.mean(0)
        by_stride = contact.reshape(strides, COARSE, *contact.shape[1:])
        change = by_stride - np.roll(by_stride, 1, 0)
        # feet out of step by half a cycle differ by about twice their spread; equal strides hardly at all
        if np.mean(change**2) < 0.25**2 * np.mean(spread**2):
            return strides
    return 1


def stride_poses(clip: Clip, strides: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Rotation [samples, J, 4] and translation [samples, J, 3] of the mean of a clip's strides."""
    rotation, translation = resampled(clip, strides * samples)
    if strides == 1:
        return rotation, translation
    q = rotation.reshape(strides, samples, *rotation.shape[1:])
    q = np.sum(np.where(np.sum(q * q[:1], -1, keepdims=True) < 0, -q, q), 0)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return q, translation.reshape(strides, samples, *translation.shape[1:]).mean(0)


def resampled(clip: Clip, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Rotation [samples, J, 4] and translation [samples, J, 3] of a cyclic clip at evenly spread times from 0 on."""
    at = np.arange(samples) * (len(clip.rotation) / samples)
    return resample_rotation(clip.rotation, at, True), resample(clip.translation, at, True)


def feet(archetype: Archetype, rotation: np.ndarray, translation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Contact points [F, L, 3] and ankles [F, L, 3] in the character frame, of poses [F, J, 4] and [F, J, 3]."""
    ball, ankle = ([getattr(leg, name) for leg in archetype.legs] for name in ("ball", "ankle"))
    offset = np.array([leg.ball_offset for leg in archetype.legs])
    joint_q, joint_p = transforms(archetype.skeleton, rotation, translation, [*ball, *ankle])
    count = len(ball)
    return joint_p[:, :count] + posing.rotate(joint_q[:, :count], offset), joint_p[:, count:]


def transforms(
    skeleton: Skeleton, rotation: np.ndarray, translation: np.ndarray, joints: list[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Rotation [F, n, 4] and position [F, n, 3], character frame, of some joints of poses [F, J, 4] and [F, J, 3].

    Only the joints above them are computed.
    """
    needed: set[int] = set()
    for joint in joints:
        while joint >= 0 and joint not in needed:
            needed.add(joint)
            joint = skeleton.parents[joint]
    rows = sorted(needed)
    place = {joint: row for row, joint in enumerate(rows)}
    parents = tuple(place.get(skeleton.parents[joint], -1) for joint in rows)
    part = Skeleton(tuple(skeleton.names[joint] for joint in rows), parents, np.zeros((0, 4)), np.zeros((0, 3)))
    count = len(rotation)
    still = posing.Motion(
        np.zeros((count, 3)), np.tile([1.0, 0, 0, 0], (count, 1)), rotation[:, rows], translation[:, rows],
        np.ones(count),
    )  # fmt: skip
    joint_q, joint_p = posing.world_transforms(part, still)
    wanted = [place[joint] for joint in joints]
    return joint_q[:, wanted], joint_p[:, wanted]


def leg_lengths(archetype: Archetype) -> np.ndarray:
    """Length of each leg along its bones from hip to contact point [L], m, in the rest pose; at least 1 mm."""
    joint_q, joint_p = posing.world_transforms(archetype.skeleton, posing.rest_motion(archetype.skeleton))
    lengths = []
    for leg in archetype.legs:
        tip = joint_p[leg.ball] + posing.rotate(joint_q[leg.ball], np.array(leg.ball_offset))
        chain = [tip, joint_p[leg.ankle], joint_p[leg.knee], joint_p[leg.hip]]
        lengths.append(sum(np.linalg.norm(a - b) for a, b in itertools.pairwise(chain)))
    return np.maximum(np.array(lengths), 1e-3)
