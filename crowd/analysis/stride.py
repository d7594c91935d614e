"""One stride of an in-place clip, and where its feet are: what every analysis of clips begins with."""

from __future__ import annotations

import numpy as np

from crowd import posing
from crowd.resampling import resample, resample_rotation
from crowd.types import Archetype, Clip, Skeleton

MOST_STRIDES = 6
SEARCHED = 360  # samples of a clip that tell its strides apart; divisible by every stride count tried


def stride_count(archetype: Archetype, clip: Clip) -> int:
    """How many equal strides the clip holds (1 where they differ)."""
    contact, _ = feet(archetype, *resampled(clip, SEARCHED))
    spread = np.mean((contact - contact.mean(0)) ** 2)
    for strides in range(MOST_STRIDES, 1, -1):
        by_stride = contact.reshape(strides, SEARCHED // strides, *contact.shape[1:])
        # feet out of step by half a cycle differ by about twice their spread; equal strides hardly at all
        if np.mean((by_stride - np.roll(by_stride, 1, 0)) ** 2) < 0.25**2 * spread:
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

    Only the joints above them are computed, those of one depth at a time: few joints and few calls.
    """
    depth: dict[int, int] = {-1: -1}
    for joint in joints:
        chain = []
        while joint not in depth:
            chain.append(joint)
            joint = skeleton.parents[joint]
        for number, each in enumerate(reversed(chain), depth[joint] + 1):
            depth[each] = number
    q, p = np.zeros_like(rotation), np.zeros_like(translation)
    for level in range(max(depth.values()) + 1):
        row = [joint for joint, at in depth.items() if at == level]
        above = [skeleton.parents[joint] for joint in row]
        if level == 0:
            q[:, row], p[:, row] = rotation[:, row], translation[:, row]
            continue
        q[:, row] = posing.multiply(q[:, above], rotation[:, row])
        p[:, row] = p[:, above] + posing.rotate(q[:, above], translation[:, row])
    return q[:, joints], p[:, joints]


def leg_lengths(archetype: Archetype) -> np.ndarray:
    """Length of each leg along its bones from hip to contact point [L], m, in the rest pose; at least 1 mm."""
    skeleton, legs = archetype.skeleton, archetype.legs
    if not legs:
        return np.zeros(0)
    joints = [getattr(leg, name) for name in ("ball", "ankle", "knee", "hip") for leg in legs]
    rotation, position = transforms(skeleton, skeleton.rest_rotation[None], skeleton.rest_translation[None], joints)
    offsets = np.array([leg.ball_offset for leg in legs])
    tips = position[0, : len(legs)] + posing.rotate(rotation[0, : len(legs)], offsets)
    chain = np.concatenate([tips[None], position[0].reshape(4, len(legs), 3)])
    bones = np.linalg.norm(np.diff(np.delete(chain, 1, 0), axis=0), axis=-1)
    return np.maximum(bones.sum(0), 1e-3)
