"""Parts that move with a joint the file does not hang them from: feet left under the root by inverse kinematics rigs.

Such a foot's place is nearly constant in the frame of the lower leg and not in that of its parent. It is re-hung there,
so that bending the leg takes the foot along.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crowd.characters.subject import Subject
from crowd.posing import conjugate, rotate

LOOSE = 0.03  # of the height: a part that wanders this far against its parent is detached
FIXED = 0.02  # of the height: and is fixed to a joint against which it wanders less than this
MAX_FRAMES = 600


def reattached(subject: Subject, given: dict[int, int] | None = None) -> tuple[Subject, dict[int, int]]:
    """The subject with detached parts re-hung, and {joint: new parent}. `given` overrides detection per joint."""
    moves: dict[int, int] = {}
    current = subject
    for joint in _tops(subject):
        found = (given or {}).get(joint)
        if found is None:
            found = _holder(current, joint)
        if found is not None:
            moves[joint] = found
            current = replace(current, parents=(*current.parents[:joint], found, *current.parents[joint + 1 :]))
    for joint, parent in (given or {}).items():
        if joint not in moves:
            moves[joint] = parent
            current = replace(current, parents=(*current.parents[:joint], parent, *current.parents[joint + 1 :]))
    return current, moves


def _tops(subject: Subject) -> list[int]:
    """Joints with skin in or below them that are not most of the body: candidates for being detached parts."""
    weight = subject.carries.astype(float)
    mesh = subject.raw.mesh
    if mesh is not None:
        weight = np.bincount(mesh.dominant, minlength=subject.raw.count).astype(float)
    total = weight.sum()
    return [j for j in range(subject.raw.count) if 0 < weight[subject.below(j)].sum() < 0.35 * total]


def wander(joint: int, frame: int, rotation: np.ndarray, position: np.ndarray) -> float:
    """Median distance of `joint` from its median place in the frame of joint `frame` (-1: the file frame)."""
    local = position[:, joint]
    if frame >= 0:
        local = rotate(conjugate(rotation[:, frame]), local - position[:, frame])
    return float(np.median(np.linalg.norm(local - np.median(local, 0), axis=1)))


def _holder(subject: Subject, joint: int) -> int | None:
    """The joint that carries `joint` in every clip in which it leaves its place under its parent, if there is one."""
    loose = []
    for clip in subject.raw.clips:
        step = max(1, len(clip.position) // MAX_FRAMES)
        rotation, position = clip.rotation[::step], clip.position[::step]
        if wander(joint, subject.parents[joint], rotation, position) > LOOSE * subject.height:
            loose.append((rotation, position))
    if not loose:
        return None
    rotation, position = (np.concatenate(part) for part in zip(*loose, strict=True))
    here = wander(joint, subject.parents[joint], rotation, position)
    own = set(subject.below(joint)) | set(subject.above(joint))
    spread = {
        int(c): wander(joint, int(c), rotation, position) for c in np.flatnonzero(subject.carries) if c not in own
    }
    if not spread or min(spread.values()) > min(FIXED * subject.height, 0.35 * here):
        return None
    best = min(spread.values())
    close = [c for c, value in spread.items() if value <= max(1.5 * best, 1e-3 * subject.height)]
    return max(close, key=lambda c: (len(subject.above(c)), -spread[c]))
