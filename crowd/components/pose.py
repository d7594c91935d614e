"""Pose: the clips at the clock's phase, hung from the abstract body."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from crowd.assets import HerdAssets
from crowd.layout import HerdLayout
from crowd.params import Character
from crowd.state import State
from kernels import clips, quat
from kernels.skeleton import forward_kinematics
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
    rotation = wall(clips.blend, assets.rotation_table, poses.column, poses.share)
    translation = wall(clips.blend, assets.translation_table, poses.column, poses.share)

    def offsets(translation: Array, rest: Array, scale: Array) -> Array:
        full = jnp.broadcast_to(rest, (3, herd.joints, scale.shape[-1]))
        return full.at[:, jnp.array(herd.moving, int)].set(translation) * scale

    def hung(yaw: Array, pitch: Array, scale: Array, up: tuple[Array, Array] | None) -> tuple[Array, Array]:
        turn = quat.multiply(quat.about_y(yaw), quat.about_x(pitch))
        if up is None or assets.strides is None:
            zero = jnp.zeros_like(yaw)
            pivot = jnp.stack([zero, assets.pivot_height * scale, zero])
            return pivot - quat.rotate(turn, pivot), turn
        # the body tilts about its hips, the hips lean with the legs about the ground (4.12)
        vertical = jnp.zeros_like(up[0]).at[1].set(1.0)
        pivot = assets.strides.pivot * scale
        hips = quat.rotate(quat.between(vertical, up[1]), quat.rotate(quat.about_y(yaw), pivot))
        turn = quat.multiply(quat.between(vertical, up[0]), turn)
        return hips - quat.rotate(turn, pivot), turn

    offset = wall(offsets, translation, assets.rest_translation, character.scale)
    position, orientation = wall(hung, state.yaw, state.pitch, character.scale, poses.up)
    transforms = forward_kinematics(herd.parents, rotation, offset, orientation, position, wall)
    return Hung(rotation, translation, transforms, position, orientation)
