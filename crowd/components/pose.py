"""Pose: the clips at the clock's phase, hung from the abstract body."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from crowd.assets import HerdAssets
from crowd.layout import HerdLayout
from crowd.params import Character
from crowd.state import State
from kernels import clips, quat
from kernels.rows import merged, picked
from kernels.skeleton import forward_kinematics
from kernels.vec import plus
from kernels.wall import Wall


class Poses(NamedTuple):
    """What the gait wants the body to look like."""

    column: Array  # [2, slots, n] int32 table columns of the clips that play
    share: Array  # [2, slots, n]
    up: tuple[Array, Array] | None  # [3, n] unit up axes of body and legs, world; None: vertical


class Hung(NamedTuple):
    """The clips' pose on the body, before inverse kinematics; relative to the character's position, world axes."""

    rotation: Array  # [4, J, n] joint to parent, not normalised
    translation: Array  # [3, moving, n] m, joint to parent, unscaled
    transforms: Array  # [7, J, n] rotation and position of every joint
    position: Array  # [3, n] m, of the frame the skeleton hangs from
    orientation: Array  # [4, n]


def pose(herd: HerdLayout, assets: HerdAssets, character: Character, state: State, poses: Poses, wall: Wall) -> Hung:
    """The clips sampled, blended and hung from the body, which turns about its hips."""
    rotation = clips.blend(assets.rotation_table, poses.column, poses.share, wall)
    translation = clips.blend(assets.translation_table, poses.column, poses.share, wall)

    def standing(yaw: Array, up: tuple[Array, Array] | None) -> tuple[Array, Array]:
        if up is None:
            turn = quat.about_y(yaw)
            return turn, turn
        return quat.upright(up[1], yaw), quat.upright(up[0], yaw)

    def place(legs: Array, turn: Array, scale: Array) -> Array:
        # the body tilts about its hips, the hips lean with the legs about the ground (4.12)
        strides = assets.strides if poses.up else None
        pivot = strides.pivot * scale if strides else jnp.stack([0 * scale, assets.pivot_height * scale, 0 * scale])
        return plus(quat.rotate(legs, pivot), quat.rotate(turn, -pivot))

    moving = np.array(herd.moving, int)
    still = np.setdiff1d(np.arange(herd.joints), moving)
    moved = wall(lambda translation, scale: translation * scale, translation, character.scale)
    rest = picked(assets.rest_translation, still, wall)
    resting = wall(lambda rest, scale: rest * scale, rest, character.scale)
    offset = merged([moved, resting], [moving, still], wall)
    legs, body = wall(standing, state.yaw, poses.up)
    orientation = wall(lambda body, pitch: quat.multiply(body, quat.about_x(pitch)), body, state.pitch)
    position = wall(place, legs, orientation, character.scale)
    transforms = forward_kinematics(herd.parents, rotation, offset, orientation, position, wall)
    return Hung(rotation, translation, transforms, position, orientation)
