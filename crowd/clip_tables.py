"""The clips of a herd, sampled evenly: what its device tables are made of."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crowd.resampling import resample, resample_rotation
from crowd.types import Clip

if TYPE_CHECKING:
    from crowd.scene import HerdScene

SAMPLES = 64  # of every clip's table
MOVING = 1e-4  # m: a joint whose translation varies less is rigid


def poses(herd: HerdScene) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rotations [S, J, 4] and translations [S, J, 3] of every clip of the tables, in their order."""
    if herd.motions:
        return [motion.pose(SAMPLES) for motion in herd.motions] + [sampled(clip) for clip in herd.extras]
    return [(gait.rotation, gait.translation) for gait in herd.gaits] + [sampled(herd.idle)]


def sampled(clip: Clip) -> tuple[np.ndarray, np.ndarray]:
    """Rotations [S, J, 4] and translations [S, J, 3] of a clip; one that does not loop ends on its last frame."""
    count = len(clip.rotation)
    at = np.arange(SAMPLES) * (count / SAMPLES if clip.cyclic else (count - 1) / (SAMPLES - 1))
    return resample_rotation(clip.rotation, at, clip.cyclic), resample(clip.translation, at, clip.cyclic)


def moving(herd: HerdScene) -> tuple[int, ...]:
    """Joints whose translation leaves the rest pose's somewhere in the clips."""
    rest = herd.archetype.skeleton.rest_translation
    return tuple(
        np.flatnonzero(np.any([np.abs(table - rest).max((0, 2)) > MOVING for _, table in poses(herd)], axis=0)).tolist()
    )
