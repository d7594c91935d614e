"""The ghost: the motions' pose without foot adjustment, tilt or hip lift, to stand beside the character (7.2).

It is computed from the motions' own clips with the recorded weights and clock, so it needs a live scene: a recording
holds no clips.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crowd import posing
from crowd.recorded_scene import HerdLike, motions_of
from crowd.resampling import resample, resample_rotation
from crowd.types import Motion
from crowd.view.geometry import Body

GREY = np.array([0.46, 0.47, 0.50])  # linear colour
LEAST = 0.02  # of the weights: below that there is no pose to show (a clip plays alone)


def has_clips(herd: HerdLike) -> bool:
    """Whether a herd's motions can be posed."""
    motions = motions_of(herd)
    return bool(motions) and all(hasattr(motion, "clip_phase") for motion in motions)


def unadjusted_pose(
    motions: Sequence[Any], weights: np.ndarray, clock: np.ndarray, time: float
) -> tuple[np.ndarray, np.ndarray]:
    """Joint rotations [n, J, 4] and translations [n, J, 3] of motions blended by weights [n, M] at clocks [n].

    time: s, of the recording; grounded motions are shown at time over duration, their own clock is not recorded.
    Quaternions are summed in the hemisphere of the heaviest motion's. Weights that are all zero give the first motion.
    """
    weights = np.where(weights > 0, weights, 0.0)
    weights = np.where(weights.sum(1, keepdims=True) > 0, weights, np.eye(len(motions))[:1])
    weights = weights / weights.sum(1, keepdims=True)
    rotations, translations = [], []
    for motion in motions:
        own = clock if motion.kind == "walk" else np.full_like(clock, time / motion.duration)
        at = motion.clip_phase(own) * len(motion.rotation)
        rotations.append(resample_rotation(motion.rotation, at, True))
        translations.append(resample(motion.translation, at, True))
    rotation, translation = np.stack(rotations), np.stack(translations)  # [M, n, J, .]
    lead = rotation[weights.argmax(1), np.arange(len(clock))]
    sign = np.where(np.sum(rotation * lead, -1, keepdims=True) < 0, -1.0, 1.0)
    blended = np.einsum("nm,mnjc->njc", weights, rotation * sign)
    blended /= np.maximum(np.linalg.norm(blended, axis=-1, keepdims=True), 1e-9)
    return blended, np.einsum("nm,mnjc->njc", weights, translation)


def ghost_bodies(herd: HerdLike, arrays: Any, time: np.ndarray, frame: int, people: slice, beside: float) -> list[Body]:
    """Ghosts of some characters at a recorded frame, upright at their position and yaw.

    beside: m to their left, at their size. None without clips or where the motions have no weight.
    """
    weights = np.asarray(arrays["weights"][frame, people], float)
    if not has_clips(herd) or weights.sum(1).max(initial=0.0) < LEAST:
        return []
    position, yaw, clock = (np.asarray(arrays[name][frame, people], float) for name in ("position", "yaw", "phase"))
    rotation, translation = unadjusted_pose(motions_of(herd), weights, clock, float(time[frame]))
    size = np.asarray(herd.scale, float)[people]
    zero = np.zeros_like(yaw)
    left = np.stack([np.cos(yaw), zero, -np.sin(yaw)], -1)
    turn = np.stack([np.cos(0.5 * yaw), zero, np.sin(0.5 * yaw), zero], -1)
    pose = Motion(position + left * (beside * size)[:, None], turn, rotation, translation, size)
    joints = posing.world_transforms(herd.archetype.skeleton, pose)
    vertices = posing.skin(herd.archetype.mesh, *joints, pose.scale)
    shown = weights.sum(1) >= LEAST
    return [Body(vertices[shown], np.asarray(herd.archetype.mesh.triangles), np.tile(GREY, (int(shown.sum()), 1)))]
