"""Pose: the clips at the clock's phase, hung from the abstract body."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from crowd.assets import HerdAssets
from crowd.components.gait import Mix
from crowd.layout import HerdLayout
from crowd.params import Character
from crowd.state import State
from kernels import clips, quat
from kernels.skeleton import forward_kinematics
from kernels.wall import Wall


class Hung(NamedTuple):
    """The clips' pose on the body, before inverse kinematics; relative to the character's position, world axes."""

    rotation: Array  # [4, J, n] joint to parent, not normalised
    translation: Array  # [3, moving, n] m, joint to parent, unscaled
    transforms: Array  # [7, J, n] rotation and position of every joint
    position: Array  # [3, n] m, of the frame the skeleton hangs from
    orientation: Array  # [4, n]


def slots(herd: HerdLayout, state: State, blend: Mix) -> tuple[Array, Array]:
    """Table columns and shares [2, slots, n]: the two nearest gaits (or the only one) and the idle clip."""
    moving = 1.0 - state.idle
    phases, weights, which = [], [], []
    if herd.gaits == 1:
        which.append(jnp.zeros_like(state.fault))
        weights.append(moving)
        phases.append(state.phase)
    else:
        place = sum((k * blend.share[k] for k in range(1, herd.gaits)), jnp.zeros_like(state.phase))
        low = jnp.clip(jnp.floor(place).astype(jnp.int32), 0, herd.gaits - 2)
        upper = jnp.clip(place - low, 0.0, 1.0)
        which += [low, low + 1]
        weights += [moving * (1.0 - upper), moving * upper]
        phases += [state.phase, state.phase]
    which.append(jnp.full_like(state.fault, herd.gaits))
    weights.append(state.idle)
    phases.append(state.idle_phase)
    return clips.frame_weights(jnp.stack(which), jnp.stack(phases), jnp.stack(weights), herd.samples)


def pose(herd: HerdLayout, assets: HerdAssets, character: Character, state: State, blend: Mix, wall: Wall) -> Hung:
    """The clips sampled, blended and hung from the body, which turns about its hips."""
    column, share = wall(lambda state, blend: slots(herd, state, blend), state, blend)
    rotation = wall(clips.blend, assets.rotation_table, column, share)
    translation = wall(clips.blend, assets.translation_table, column, share)

    def offsets(translation: Array, rest: Array, scale: Array) -> Array:
        full = jnp.broadcast_to(rest, (3, herd.joints, scale.shape[-1]))
        return full.at[:, jnp.array(herd.moving, int)].set(translation) * scale

    def hung(yaw: Array, pitch: Array, scale: Array) -> tuple[Array, Array]:
        orientation = quat.multiply(quat.about_y(yaw), quat.about_x(pitch))
        zero = jnp.zeros_like(yaw)
        pivot = jnp.stack([zero, assets.pivot_height * scale, zero])
        return pivot - quat.rotate(orientation, pivot), orientation

    offset = wall(offsets, translation, assets.rest_translation, character.scale)
    position, orientation = wall(hung, state.yaw, state.pitch, character.scale)
    transforms = forward_kinematics(herd.parents, rotation, offset, orientation, position, wall)
    return Hung(rotation, translation, transforms, position, orientation)
