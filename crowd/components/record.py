"""Record: what a frame shows of itself, in world coordinates."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from crowd.components.feet import Feet
from crowd.components.pose import Hung
from crowd.components.sense import Surroundings
from crowd.components.skin import Load
from crowd.layout import HerdLayout, Layout
from crowd.params import Character
from crowd.state import Frame, State
from kernels import quat


def frame(
    layout: Layout,
    herd: HerdLayout,
    character: Character,
    state: State,
    place: Surroundings,
    hung: Hung,
    legs: Feet,
    transforms: Array,
    load: Load,
) -> Frame:
    """The recorded view of a frame. Joint rotations are taken back to the parents' frames."""
    del character
    at = state.position
    joint_rotation, joint_translation = jnp.zeros((4, 0, *at.shape[1:])), jnp.zeros((3, 0, *at.shape[1:]))
    orientation = hung.orientation
    if layout.record_pose:
        above = np.array([max(parent, 0) for parent in herd.parents])
        rooted = np.array([parent < 0 for parent in herd.parents]).reshape(-1, 1)
        parent = jnp.where(rooted, orientation[:, None], transforms[:4][:, above])
        joint_rotation = quat.multiply(quat.conjugate(parent), transforms[:4])
        joint_translation = hung.translation
    lowered = jnp.stack([jnp.zeros_like(legs.drop), legs.drop, jnp.zeros_like(legs.drop)])
    place_w = at[:, None]
    return Frame(
        drag_force=load.force,
        drag_torque=load.torque,
        center_of_pressure=load.center_of_pressure + at,
        depth=jnp.maximum(place.fluid.surface - place.ground, 0.0),
        ball=legs.ball + place_w,
        ankle=legs.ankle + place_w,
        handle=legs.handle + place_w,
        planted=legs.planted,
        over_reach=legs.over_reach,
        pose_position=hung.position + at - lowered,
        pose_orientation=orientation,
        joint_rotation=joint_rotation,
        joint_translation=joint_translation,
    )
