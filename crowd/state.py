"""Exactly what is needed to resume, and what a frame derives. Trailing axis n, in tiles [tiles, ..., 128]."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
from jax import Array

from crowd.layout import HerdLayout, Layout
from crowd.tree import pytree

STRIDES = (
    "time", "designated", "parked", "phase", "steps", "goal",
    "from_position", "from_yaw", "from_normal", "from_foot", "to_position", "to_yaw", "to_normal", "to_foot",
)  # fmt: skip
FAULT_BODY, FAULT_DRAG = 1, 2  # sticky bits: which quantity stopped being finite
FAULT_NAMES = {FAULT_BODY: "position, velocity or heading", FAULT_DRAG: "drag"}


@pytree
class Footsteps:
    """The footstep controller, and the plain clip. L legs."""

    smoothed: Array  # [2, n] m/s, low-passed velocity that steps follow
    gait_speed: Array  # [n] m/s, low-passed desired speed that picks the gait
    idle: Array  # [n] weight of the idle clip
    progress: Array  # [L, n] of each leg's swing, 1 when planted
    handle: Array  # [2, L, n] m, world (x, z) of each foot handle
    target: Array  # [2, L, n] m, where it steps to
    foot_yaw: Array  # [L, n] rad, of each foot: fixed while planted, towards the body's in the swing


@pytree
class Strides:
    """The semi-procedural system. M motions, C channels (styles, then other clips), L legs."""

    before: Array  # [3, n] m/s, velocity of the frame before
    velocity: Array  # [3, n] m/s, smoothed
    acceleration: Array  # [3, n] m/s2, smoothed
    turn: Array  # [n] rad/s, smoothed yaw rate
    facing: Array  # [n] rad, heading asked for in the frame before
    facing_rate: Array  # [n] rad/s, how fast that turns, smoothed
    blend: Array  # [M, n] smoothed weights within each style
    channel: Array  # [C, n] weight of each style and of each other clip
    channel_goal: Array  # [n] int32, the channel that is faded in
    channel_rate: Array  # [n] 1/s
    channel_until: Array  # [n] s left of a clip that ends by itself, inf for styles
    channel_return: Array  # [n] int32, the style to go back to
    extra_time: Array  # [n] s, since the latest other clip began
    designated: Array  # [L, n] cycles since stance, by the clock
    time: Array  # [L, n] cycles since stance, the leg's own
    parked: Array  # [L, n] bool
    phase: Array  # [L, n] int32, of the foot: stance, lift, flight, land (kernels.leg_cycle)
    steps: Array  # [L, n] int32, taken
    from_position: Array  # [3, L, n] m, world, heel end of the footprint behind
    from_yaw: Array  # [L, n] rad
    from_normal: Array  # [3, L, n]
    from_foot: Array  # [2, L, n] m, heel to toe (x, z) in the frame of the yaw
    to_position: Array  # [3, L, n] m, world, of the footprint ahead
    to_yaw: Array  # [L, n] rad
    to_normal: Array  # [3, L, n]
    to_foot: Array  # [2, L, n] m
    goal: Array  # [3, L, n] m, world, where the footprint ahead is going
    ground_up: Array  # [3, n] up axis of the plane through the feet, of unit height, world
    leaning: Array  # [2, n] low-passed lean (left, ahead)


@pytree
class Responded:
    """What responses remember; None for those that a herd does not have. A arms."""

    gear: Array | None = None  # [n] int32, kernels.effort: as asked for, walking, resting
    width: Array | None = None  # [n] m that fluid seems to drag on, low-passed
    rested: Array | None = None  # [n] s, of the present rest
    raised: Array | None = None  # [A, n] how far each arm is raised, 0 to 1


@pytree
class Paced:
    """What was shown last, and what will be, of a herd that is not stepped every frame; see `crowd.pace`."""

    frame: Array  # [n] int32, frames shown; `State.frame` is ahead of it or the same
    since: Array  # [n] int32, frame of `before`; `after` is of `State.frame`
    before: tuple[dict[str, Array], Frame]  # the part of a state that is recorded, and a frame
    after: tuple[dict[str, Array], Frame]


@pytree
class State:
    """A character. V vertices (skinned drag) or J joints (rigid drag)."""

    frame: Array  # [n] int32, frames lived
    position: Array  # [3, n] m, world; y is the (smoothed) ground height that carries the body
    velocity: Array  # [2, n] m/s, world (x, z)
    desired: Array  # [2, n] m/s, asked for, world (x, z)
    command: Array  # [2, n] m/s, the same within the limits of acceleration: what the body follows
    waypoint: Array  # [n] int32, next way-point, 0 along a path or trajectory; -1: none
    along: Array  # [n] m, way done on the path
    facing: Array  # [n] rad, heading asked for
    heading: Array  # [n] rad, the same within the turn rate
    follows: Array  # [n] bool: heading follows the command
    looks: Array  # [n] bool: otherwise it turns to the herd's point or its trajectory's heading, not to `facing`
    yaw: Array  # [n] rad
    yaw_rate: Array
    pitch: Array  # [n] rad, positive leans forward
    pitch_rate: Array
    phase: Array  # [n] cycles, of the walking clips
    idle_phase: Array  # [n] cycles, of the standing clip
    gait: Any  # Footsteps or Strides
    force: Array  # [3, n] N, drag of the frame before
    torque: Array  # [2, n] N m, its yaw and pitch components
    drag_slope: Array  # [3, n] N s/m, N m s, N m s: how drag falls as velocity, yaw and pitch rate yield to it
    previous: Array  # [V, 3, n] or [7, J, n]: vertices or transforms, relative to the position
    fault: Array  # [n] int32
    responded: Responded = Responded()
    paced: Paced | None = None


@pytree
class Water:
    """A water surface that the crowd moves, [rows, columns]: the last of a run's states."""

    height: Array  # m, above the still surface
    motion: Array  # [2, rows, columns] m, (x, z), of the waves' kinetic energy (kernels.water)
    pushed: Array  # [2, rows, columns // 2 + 1] m, spectrum (real, imaginary) of what bodies pushed up so far
    frame: Array  # [1] int32, frames lived


@pytree
class StrideFrame:
    """What the semi-procedural system derives; prints, cycles and phases are in its state."""

    heel: Array  # [3, L, n] m, world, of the posed foot
    toe: Array  # [3, L, n] m, world
    weights: Array  # [M, n] of every motion in the pose
    alignment: Array  # [n] how much of the pose is adjusted


@pytree
class Frame:
    """Derived in one frame, for recording and for the next force."""

    drag_force: Array  # [3, n] N
    drag_torque: Array  # [3, n] N m
    center_of_pressure: Array  # [3, n] m, world; NaN when dry
    depth: Array  # [n] m
    ball: Array  # [3, L, n] m, world, after inverse kinematics
    ankle: Array  # [3, L, n] m, world
    handle: Array  # [3, L, n] m, world
    planted: Array  # [L, n] bool
    over_reach: Array  # [L, n] m
    pose_position: Array  # [3, n] m, world
    pose_orientation: Array  # [4, n]
    strides: StrideFrame | None  # of the semi-procedural system
    apparent_weight: Array | None  # [n] share of the weight on the feet, where buoyancy is asked for
    joint_rotation: Array  # [4, J, n] joint to parent; empty unless poses are recorded
    joint_translation: Array  # [3, moving, n] m, joint to parent, unscaled


def shown_state(state: State) -> dict[str, Array]:
    """The part of a state that is recorded."""
    names = ("position", "velocity", "yaw", "pitch", "desired", "phase", "fault")
    shown = {name: getattr(state, name) for name in names}
    if isinstance(state.gait, Strides):
        shown |= {f"gait_{name}": getattr(state.gait, name) for name in STRIDES}
    if state.responded.gear is not None:
        shown["gear"] = state.responded.gear
    return shown


def blank_frame(layout: Layout, herd: HerdLayout, state: State) -> Frame:
    """A frame of zeros for the characters of a state [(tiles,) ..., n]: where a recording starts from."""
    *tiles, width = state.phase.shape

    def zeros(*shape: int, kind: type = jnp.float32) -> Array:
        return jnp.zeros((*tiles, *shape, width), kind)

    posed = layout.record_pose
    return Frame(
        drag_force=zeros(3),
        drag_torque=zeros(3),
        center_of_pressure=zeros(3),
        depth=zeros(),
        ball=zeros(3, herd.legs),
        ankle=zeros(3, herd.legs),
        handle=zeros(3, herd.legs),
        planted=zeros(herd.legs, kind=jnp.bool_),
        over_reach=zeros(herd.legs),
        pose_position=zeros(3),
        pose_orientation=zeros(4),
        strides=_blank_strides(herd, zeros) if layout.gait == "semi_procedural" else None,
        apparent_weight=zeros() if layout.fluid.buoyancy else None,
        joint_rotation=zeros(4, herd.joints if posed else 0),
        joint_translation=zeros(3, len(herd.moving) if posed else 0),
    )


def begun(layout: Layout, herd: HerdLayout, state: State) -> State:
    """The state [tiles, ..., n] of a herd that is not stepped every frame, before its first step."""
    shown = (shown_state(state), blank_frame(layout, herd, state))
    return replace(state, paced=Paced(state.frame, state.frame, shown, shown))


def _blank_strides(herd: HerdLayout, zeros: Callable[..., Array]) -> StrideFrame:
    return StrideFrame(zeros(3, herd.legs), zeros(3, herd.legs), zeros(len(herd.motions)), zeros())
