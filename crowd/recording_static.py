"""What does not change in a recording: who is who, bodies, skeletons, skins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import zarr

from crowd.recorded_scene import HerdLike, motions_of
from crowd.recording_layout import LABELS, STATIC_MEANINGS, STATIC_UNITS

CHARACTER_DIM = ("character",)
KEYS = ("lift", "liftoff", "postlift", "preland", "strike", "land")


def write_static(root: zarr.Group, herds: Sequence[HerdLike]) -> None:
    """What all characters have into the root, the rest into a new group for each herd."""
    names = [herd.name for herd in herds]
    first = np.cumsum([0, *(herd.count for herd in herds)])
    fixed(root, "character", np.arange(first[-1], dtype=np.int32), CHARACTER_DIM, "1", "number in the run")
    index = np.repeat(np.arange(len(herds), dtype=np.int32), [herd.count for herd in herds])
    fixed(root, "herd", index, CHARACTER_DIM, "1", "index into the attribute `herds`")
    fixed(root, "herd_name", _strings(np.repeat(names, [herd.count for herd in herds])), CHARACTER_DIM)
    _labels(root, ("component",))
    for name, unit in STATIC_UNITS.items():
        value = np.concatenate([np.broadcast_to(np.asarray(getattr(h, name), np.float32), h.count) for h in herds])
        fixed(root, name, value, CHARACTER_DIM, unit, STATIC_MEANINGS[name])
    for herd, start in zip(herds, first, strict=False):
        _write_herd(root.create_group(herd.name), herd, int(start))


def fixed(
    group: zarr.Group, name: str, data: np.ndarray, dims: tuple[str, ...], unit: str = "", description: str = ""
) -> None:
    """A whole array with its dimensions' names, unit and meaning."""
    text: dict[str, Any] = {"units": unit} if unit else {}
    text |= {"description": description} if description else {}
    group.create_array(name, data=data, dimension_names=dims, attributes=text)


def _strings(names: Sequence[str] | np.ndarray) -> np.ndarray:
    return np.asarray(names, dtype=np.dtypes.StringDType())


def _labels(group: zarr.Group, dims: tuple[str, ...]) -> None:
    for dim in dims:
        fixed(group, dim, _strings(LABELS[dim]), (dim,))


def _write_herd(group: zarr.Group, herd: HerdLike, first: int) -> None:
    """Names, legs, skeleton and skin of one herd."""
    archetype, mesh, skeleton = herd.archetype, herd.archetype.mesh, herd.archetype.skeleton
    group.attrs.update(
        {
            "archetype": archetype.name,
            "source": archetype.source,
            "height": float(archetype.height),
            "mass": float(archetype.mass),
            "pelvis": int(archetype.pelvis),
            "description": "feet and poses of one herd; `character` counts through all herds of the recording",
        }
    )
    fixed(group, "character", np.arange(first, first + herd.count, dtype=np.int32), CHARACTER_DIM)
    _labels(group, ("component", "quaternion"))
    fixed(group, "joint", _strings(skeleton.names), ("joint",))
    moving = np.asarray(herd.moving, np.int32)
    fixed(group, "moving", moving, ("moving",), "1", "joints that move in the parent's frame")
    fixed(group, "leg", _strings([leg.name for leg in archetype.legs]), ("leg",))
    if motions := motions_of(herd):
        fixed(group, "motion", _strings([motion.name for motion in motions]), ("motion",))
        velocity = np.array([motion.velocity for motion in motions])
        fixed(group, "motion_velocity", velocity, ("motion", "component"), "m s-1", "of each motion at scale 1")
        keys = np.array([motion.keytimes for motion in motions])
        fixed(group, "motion_keys", keys, ("motion", "leg", "key"), "1", "cycles since stance")
        fixed(group, "key", _strings(KEYS), ("key",))
    for name, unit in STATIC_UNITS.items():
        value = np.broadcast_to(np.asarray(getattr(herd, name), np.float32), herd.count)
        fixed(group, name, value, CHARACTER_DIM, unit, STATIC_MEANINGS[name])
    fixed(group, "parent", np.asarray(skeleton.parents, np.int32), ("joint",), "1", "parent joint, -1 for the root")
    fixed(group, "rest_rotation", skeleton.rest_rotation, ("joint", "quaternion"), "1", "joint to parent, wxyz")
    fixed(group, "rest_translation", skeleton.rest_translation, ("joint", "component"), "m", "in the parent's frame")
    parts = [[leg.hip, leg.knee, leg.ankle, leg.ball, leg.side] for leg in archetype.legs]
    names = _strings(["hip", "knee", "ankle", "ball", "side"])
    fixed(group, "leg_part", names, ("leg_part",))
    fixed(group, "leg_joint", np.asarray(parts, np.int32).reshape(-1, 5), ("leg", "leg_part"), "1",
           "joint numbers; side: +1 left, -1 right")  # fmt: skip
    offsets = np.asarray([leg.ball_offset for leg in archetype.legs], np.float64).reshape(-1, 3)
    fixed(group, "ball_offset", offsets, ("leg", "component"), "m", "contact point in the frame of the ball joint")
    fixed(group, "mesh_vertex", mesh.vertices, ("vertex", "component"), "m", "bind pose")
    fixed(group, "mesh_triangle", np.asarray(mesh.triangles, np.int32), ("triangle", "corner"), "1", "vertex numbers")
    fixed(group, "mesh_joint", np.asarray(mesh.joints, np.int32), ("vertex", "influence"), "1", "joints of the skin")
    fixed(group, "mesh_weight", mesh.weights, ("vertex", "influence"), "1", "weights of the skin; rows sum to 1")
    fixed(group, "inverse_bind", mesh.inverse_bind, ("joint", "row", "column"), "1", "bind pose to joint frame")
