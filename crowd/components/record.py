"""Record: what a frame shows of itself, in world coordinates."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from crowd.components.feet import Feet
from crowd.components.pose import Hung
from crowd.components.sense import Surroundings
from crowd.components.skin import Load
from crowd.components.strides import Stride
from crowd.layout import HerdLayout, Layout
from crowd.state import Frame, State, StrideFrame
from kernels import quat
from kernels.wall import Wall


def joint_rotations(layout: Layout, herd: HerdLayout, hung: Hung, transforms: Array, wall: Wall) -> Array:
    """[4, J, n] rotation of each joint to its parent, after inverse kinematics; empty unless poses are recorded."""
    if not layout.record_pose:
        return jnp.zeros((4, 0, *transforms.shape[2:]), transforms.dtype)
    children = [joint for joint, parent in enumerate(herd.parents) if parent >= 0]
    roots = [joint for joint, parent in enumerate(herd.parents) if parent < 0]
    above = np.array([herd.parents[joint] for joint in children], int)
    back = np.argsort(np.array(roots + children))

    def gathered(orientation: Array, transforms: Array) -> Array:
        top = jnp.broadcast_to(orientation[:, None], (4, len(roots), *orientation.shape[1:]))
        return quat.conjugate(jnp.concatenate([top, transforms[:4][:, above]], 1)[:, back])

    parents = wall(gathered, hung.orientation, transforms)
    return wall(lambda parents, transforms: quat.multiply(parents, transforms[:4]), parents, transforms)


def frame(
    layout: Layout,
    state: State,
    place: Surroundings,
    hung: Hung,
    legs: Feet,
    joint_rotation: Array,
    load: Load,
    strides: StrideFrame | None,
    wall: Wall,
) -> Frame:
    """The recorded view of a frame."""
    none = jnp.zeros((3, 0, *state.phase.shape), load.force.dtype)
    in_world = wall(_in_world, state.position, place, hung, legs, load)
    return Frame(
        drag_force=load.force,
        drag_torque=load.torque,
        planted=legs.planted,
        over_reach=legs.over_reach,
        pose_orientation=hung.orientation,
        strides=strides,
        apparent_weight=load.apparent_weight,
        joint_rotation=joint_rotation,
        joint_translation=hung.translation if layout.record_pose else none,
        **in_world,
    )


def strides(state: State, stride: Stride, legs: Feet, wall: Wall) -> StrideFrame:
    """What the semi-procedural system derives in a frame."""

    def placed(position: Array, heel: Array, toe: Array) -> tuple[Array, Array]:
        return heel + position[:, None], toe + position[:, None]

    heel, toe = wall(placed, state.position, legs.heel, legs.toe)
    alignment = stride.blend.alignment
    weights = wall(lambda share, alignment: share * alignment, stride.blend.share, alignment)
    return StrideFrame(heel, toe, weights, alignment)


def _in_world(at: Array, place: Surroundings, hung: Hung, legs: Feet, load: Load) -> dict[str, Array]:
    """Places in the world, of a character at `at` [3, n]."""
    return dict(
        center_of_pressure=load.center_of_pressure + at,
        depth=jnp.maximum(place.fluid.surface - place.ground, 0.0),
        ball=legs.ball + at[:, None],
        ankle=legs.ankle + at[:, None],
        handle=legs.handle + at[:, None],
        pose_position=hung.position + at + legs.shift,
    )
