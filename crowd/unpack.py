"""From tiles on a device to the arrays users see: [time, character, ..., component], padding removed."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
from jax import Array

from crowd.layout import Layout
from crowd.scene import HerdScene
from crowd.state import State, StrideFrame, Strides

STRIDES = (
    "time", "designated", "parked", "phase", "steps", "goal",
    "from_position", "from_yaw", "from_normal", "from_foot", "to_position", "to_yaw", "to_normal", "to_foot",
)  # fmt: skip


def shown_state(state: State) -> dict[str, Array]:
    """The part of a state that is recorded."""
    names = ("position", "velocity", "yaw", "pitch", "desired", "phase", "fault")
    shown = {name: getattr(state, name) for name in names}
    if isinstance(state.gait, Strides):
        shown |= {f"gait_{name}": getattr(state.gait, name) for name in STRIDES}
    if state.responded.gear is not None:
        shown["gear"] = state.responded.gear
    return shown


def unpacked(herd: HerdScene, layout: Layout, which: int, shown: Any, recorded: int) -> dict[str, np.ndarray]:
    """Users' arrays [time, character, ..., component] of one herd, padding removed."""
    slim, frame = jax.tree.map(lambda leaf: _untiled(np.asarray(leaf)[:recorded], herd.count), shown)
    velocity = slim["velocity"]
    flat = np.stack([velocity[..., 0], np.zeros_like(velocity[..., 0]), velocity[..., 1]], -1)
    desired = slim["desired"]
    out = dict(
        position=slim["position"],
        velocity=flat,
        yaw=slim["yaw"],
        pitch=slim["pitch"],
        desired_velocity=np.stack([desired[..., 0], np.zeros_like(desired[..., 0]), desired[..., 1]], -1),
        phase=slim["phase"],
        drag_force=frame.drag_force,
        drag_torque=frame.drag_torque,
        center_of_pressure=frame.center_of_pressure,
        drag_power=-np.sum(frame.drag_force * flat, -1),
        depth=frame.depth,
        fault=slim["fault"],
        contact=frame.planted,
        handle=frame.handle,
        ball=frame.ball,
        ankle=frame.ankle,
        over_reach=frame.over_reach,
        pose_position=frame.pose_position,
        pose_orientation=frame.pose_orientation,
    )
    if frame.apparent_weight is not None:
        out["apparent_weight"] = frame.apparent_weight
    if "gear" in slim:
        out["gear"] = slim["gear"].astype(np.int8)
    if frame.strides is not None:
        out |= _strides(slim, frame.strides, layout.record_pose)
    if layout.record_pose:
        out["joint_rotation"] = frame.joint_rotation
        rest = herd.archetype.skeleton.rest_translation.astype(np.float32)
        translation = np.broadcast_to(rest, (*frame.joint_translation.shape[:2], *rest.shape)).copy()
        translation[:, :, list(layout.herds[which].moving)] = frame.joint_translation
        out["joint_translation"] = translation
    return out


def _strides(slim: dict[str, np.ndarray], frame: StrideFrame, footprints: bool) -> dict[str, np.ndarray]:
    """What the semi-procedural system shows."""
    out = dict(
        heel=frame.heel,
        toe=frame.toe,
        cycle_time=slim["gait_time"],
        cycle_designated=slim["gait_designated"],
        parked=slim["gait_parked"],
        foot_phase=slim["gait_phase"],
        steps=slim["gait_steps"],
        weights=frame.weights,
        alignment=frame.alignment,
    )
    if footprints:
        out |= dict(
            footprint_from=slim["gait_from_position"],
            footprint_from_direction=_sole(*(slim[f"gait_from_{part}"] for part in ("foot", "yaw", "normal"))),
            footprint_to=slim["gait_to_position"],
            footprint_to_direction=_sole(*(slim[f"gait_to_{part}"] for part in ("foot", "yaw", "normal"))),
            footprint_goal=slim["gait_goal"],
        )
    return {name: np.asarray(values) for name, values in out.items()}


def _sole(foot: np.ndarray, yaw: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """[..., 3] from heel end to toe end of a print: `kernels.footprint.Footprint.sole` on the host."""
    x, z = np.moveaxis(foot, -1, 0)
    sin, cos = np.sin(yaw), np.cos(yaw)
    x, z = x * cos + z * sin, z * cos - x * sin
    nx, ny, nz = np.moveaxis(normal, -1, 0)
    along = nx * x + nz * z
    return np.stack([x - nx * along / (1.0 + ny), -along, z - nz * along / (1.0 + ny)], -1)


def _untiled(values: np.ndarray, count: int) -> np.ndarray:
    """[t, tiles, *components first*, 128] to [t, n, *components last*]."""
    moved = np.moveaxis(values, -1, 2)
    flat = moved.reshape(values.shape[0], moved.shape[1] * moved.shape[2], *moved.shape[3:])[:, :count]
    # components first (3, joints) to last (joints, 3)
    return flat if flat.ndim < 4 else np.moveaxis(flat, 2, -1)
