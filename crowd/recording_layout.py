"""What a recording holds: every array with its dimensions, unit and meaning. One table for writer and reader."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Column:
    """An array that grows with time. `dims` without the leading time; `component` has length 3, `quaternion` 4."""

    dims: tuple[str, ...]
    unit: str
    description: str
    dtype: type = np.float32
    optional: bool = False  # left out when the recording does without poses
    strides: bool = False  # of the semi-procedural gait only
    asked: str = ""  # only where the scenario asks for this: "buoyancy", or a herd's "transitions"


SIZES = {"component": 3, "quaternion": 4}
LABELS = {"component": ("x", "y", "z"), "quaternion": ("w", "x", "y", "z")}
KIND = "crowd-recording-"
FORMAT = f"{KIND}2"
GROUND = "_ground"  # group; no herd can have this name

CHARACTER, VECTOR = ("character",), ("character", "component")

# At the root of the recording, all herds one after the other.
ROOT: dict[str, Column] = {
    "position": Column(VECTOR, "m", "point of the character on the ground, world (y up, +z forward)"),
    "velocity": Column(VECTOR, "m s-1", "velocity of the character"),
    "yaw": Column(CHARACTER, "rad", "heading; 0 faces +z, positive turns left, toward +x"),
    "pitch": Column(CHARACTER, "rad", "lean of the abstract body, positive forward"),
    "desired_velocity": Column(VECTOR, "m s-1", "velocity asked for"),
    "phase": Column(CHARACTER, "1", "phase of the gait cycle, 0 to 1"),
    "drag_force": Column(VECTOR, "N", "force of the fluid on the character"),
    "drag_torque": Column(VECTOR, "N m", "torque of the fluid about the middle of the hips"),
    "center_of_pressure": Column(VECTOR, "m", "mean place of the drag force, world; NaN when dry"),
    "drag_power": Column(CHARACTER, "W", "power the body spends against the drag, -F.v"),
    "depth": Column(CHARACTER, "m", "fluid above the ground under the character, 0 when dry"),
    "fault": Column(CHARACTER, "1", "fault bits; not 0: frozen at the last valid pose", np.int32),
}

LEG, LEG_VECTOR = ("character", "leg"), ("character", "leg", "component")

# In the group of each herd.
HERD: dict[str, Column] = {
    "contact": Column(LEG, "1", "foot handle planted", np.bool_),
    "handle": Column(LEG_VECTOR, "m", "foot handle, world"),
    "ball": Column(LEG_VECTOR, "m", "contact point of the foot after inverse kinematics, world"),
    "ankle": Column(LEG_VECTOR, "m", "ankle after inverse kinematics, world"),
    "over_reach": Column(LEG, "m", "how far the foot handle is out of the leg's reach"),
    "apparent_weight": Column(CHARACTER, "1", "share of the weight that the feet carry", asked="buoyancy"),
    "gear": Column(
        CHARACTER,
        "1",
        "what fluid leaves: 0 as asked for, 1 walking instead of more, 2 resting",
        np.int8,
        asked="transitions",
    ),
    "pose_position": Column(VECTOR, "m", "frame the skeleton hangs from, world", optional=True),
    "pose_orientation": Column(
        ("character", "quaternion"), "1", "rotation of the skeleton's frame to world, wxyz", optional=True
    ),
    "joint_rotation": Column(
        ("character", "joint", "quaternion"), "1", "rotation of each joint to its parent, wxyz", optional=True
    ),
    "moving_translation": Column(
        ("character", "moving", "component"),
        "m",
        "place in the parent's frame, unscaled, of the joints `moving`; others stay at `rest_translation`",
        optional=True,
    ),
}

MOTION = ("character", "motion")

# In the group of each herd that walks by the semi-procedural system.
HERD |= {
    "heel": Column(LEG_VECTOR, "m", "heel of the posed foot, world", strides=True),
    "toe": Column(LEG_VECTOR, "m", "tip of the posed foot, world", strides=True),
    "cycle_time": Column(LEG, "1", "cycles since the leg's stance, as the leg goes", strides=True),
    "cycle_designated": Column(LEG, "1", "cycles since the leg's stance, by the common clock", strides=True),
    "parked": Column(LEG, "1", "the leg rests", np.bool_, strides=True),
    "foot_phase": Column(LEG, "1", "0 stance, 1 lifting, 2 in flight, 3 landing", np.int8, strides=True),
    "steps": Column(LEG, "1", "steps taken", np.int32, strides=True),
    "weights": Column(MOTION, "1", "share of every motion in the pose", strides=True),
    "alignment": Column(CHARACTER, "1", "share of the foot adjustment: 0 as the clips have it", strides=True),
    "footprint_from": Column(LEG_VECTOR, "m", "heel end of the footprint behind, world", optional=True, strides=True),
    "footprint_from_direction": Column(LEG_VECTOR, "m", "its heel end to its toe end", optional=True, strides=True),
    "footprint_to": Column(LEG_VECTOR, "m", "heel end of the footprint ahead, world", optional=True, strides=True),
    "footprint_to_direction": Column(LEG_VECTOR, "m", "its heel end to its toe end", optional=True, strides=True),
    "footprint_goal": Column(LEG_VECTOR, "m", "where the footprint ahead is going, world", optional=True, strides=True),
}

STATIC_UNITS = {"scale": "1", "mass": "kg", "reference_speed": "m s-1"}
STATIC_MEANINGS = {
    "scale": "size of the character over its archetype's",
    "mass": "mass of the character",
    "reference_speed": "walking speed of the clip at the character's size",
}
