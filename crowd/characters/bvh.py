"""BVH files as rigs: forward kinematics of every frame, in the file's own units and axes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from crowd.characters.bvh_text import Bvh, parse
from crowd.characters.cycle import to_global
from crowd.characters.mocap import prepare
from crowd.characters.raw_rig import RawClip, RawRig
from crowd.posing import multiply
from crowd.resampling import align_hemispheres


def read_rig(path: Path, up: str | None = None, metres_per_unit: float | None = None) -> RawRig:
    """A BVH file as a rig that detection understands (see `mocap.prepare`). Raises InputError naming file and line."""
    return prepare(read(path), up, metres_per_unit)


def read(path: Path) -> RawRig:
    """The joints of a BVH file with its one motion, in file units and axes; End Sites are joints named "<joint> end".

    The rest pose is the tree's own: every rotation zero. Whether that is a pose to stand in, what up is and where the
    motion repeats is decided by `mocap.prepare`.
    Raises InputError naming file and line.
    """
    return to_rig(parse(path))


def to_rig(file: Bvh) -> RawRig:
    """Forward kinematics of every frame, in file units and axes."""
    rotation, translation = local_poses(file)
    names = [joint.name for joint in file.joints]
    parents = list(file.parents)
    for joint, offset in file.ends:
        if np.linalg.norm(offset) > 0:
            names.append(_unused(f"{file.joints[joint].name} end", names))
            parents.append(joint)
            still = np.broadcast_to(np.array([1.0, 0, 0, 0]), (len(rotation), 1, 4))
            rotation = np.concatenate([rotation, still], 1)
            translation = np.concatenate([translation, np.broadcast_to(offset, (len(translation), 1, 3))], 1)
    global_q, global_p = to_global(parents, rotation, translation)
    offsets = np.array([joint.offset for joint in file.joints] + [o for _, o in file.ends if np.linalg.norm(o) > 0])
    _, rest_p = to_global(parents, np.tile([1.0, 0, 0, 0], (1, len(names), 1)), offsets[None])
    duration = (len(file.frames) - 1) * file.frame_time
    clip = RawClip(file.path.stem, duration, global_p, global_q)
    identity = np.tile([1.0, 0, 0, 0], (len(names), 1))
    return RawRig(file.path, tuple(names), tuple(parents), rest_p[0], identity, (clip,), None, notes=file.notes)


def local_poses(file: Bvh) -> tuple[np.ndarray, np.ndarray]:
    """Joint-to-parent rotation [F, J, 4] (hemisphere-continuous) and translation [F, J, 3] of every frame.

    The format leaves open whether position channels add to the offset or replace it; per joint the reading whose
    typical translation is nearer to the offset is taken. (For roots the two differ by a constant shift only.)
    """
    count = len(file.frames)
    rotation = np.tile([1.0, 0, 0, 0], (count, len(file.joints), 1))
    translation = np.tile([joint.offset for joint in file.joints], (count, 1, 1)).astype(float)
    for index, joint in enumerate(file.joints):
        moved = np.zeros((count, 3))
        for column, channel in enumerate(joint.channels, joint.first):
            axis = "XYZ".index(channel[0])
            if channel.endswith("position"):
                moved[:, axis] = file.frames[:, column]
            else:
                half = np.radians(file.frames[:, column]) / 2
                turn = np.zeros((count, 4))
                turn[:, 0], turn[:, 1 + axis] = np.cos(half), np.sin(half)
                rotation[:, index] = multiply(rotation[:, index], turn)
        axes = ["XYZ".index(channel[0]) for channel in joint.channels if channel.endswith("position")]
        if axes:
            offset = np.array(joint.offset)[axes]
            typical = np.median(moved[:, axes], axis=0)
            replaces = np.linalg.norm(typical - offset) < np.linalg.norm(typical)
            translation[:, index, axes] = moved[:, axes] + (0 if replaces else offset)
    return align_hemispheres(rotation), translation


def _unused(name: str, names: list[str]) -> str:
    while name in names:
        name += " end"
    return name
