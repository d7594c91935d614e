"""Alignment: hips, legs and feet of the clips' pose brought onto the footbases (4.11 to 4.14, 5).

Two passes: the first finds about where each leg will be, and from that the foot's attitude; the second solves the legs
for the foot as it then is. All relative to the character's position, world axes.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from crowd.assets import HerdAssets, StrideAssets, World
from crowd.components.feet import Feet, Segments
from crowd.components.pose import Hung
from crowd.components.strides import Stride
from crowd.layout import HerdLayout, Layout
from crowd.params import Character, Params, StrideControl
from crowd.state import State
from kernels import foot_alignment, ik, quat
from kernels.foot_alignment import STRAIGHT
from kernels.footprint import tilted
from kernels.vec import TINY, dot, unit
from kernels.wall import Wall

BEND_SHARE = 0.02  # of a bone's length: keeps the bend plane defined where the clip's leg is straight


class _Leg(NamedTuple):
    """A leg as the clip has it, under a body that stands as the legs' up axis says."""

    points: Array  # [3, B + 1, L, n] m, joints from hip to ankle
    heel: Array  # [3, L, n] m, from the ankle
    toe: Array  # [3, L, n] m, from the ankle
    foot: Array  # [4, L, n] rotation of the ankle
    undo: Array  # [4, n] takes the hung body's axes to the legs'


class _Base(NamedTuple):
    """The footbases after the adjustment was weighted (4.11)."""

    position: Array  # [3, L, n] m
    plate: Array  # [3, L, n] m
    normal: Array  # [3, L, n]
    attitude: Array  # [4, L, n] q R^-1: from the upright body to the footbase
    turn: Array  # [L, n] rad, yaw against the body


def feet(
    layout: Layout,
    which: int,
    assets: HerdAssets,
    world: World,
    params: Params,
    character: Character,
    state: State,
    stride: Stride,
    hung: Hung,
    wall: Wall,
) -> Feet:
    """Legs after inverse kinematics, and how far the hips move."""
    del world
    herd, own, control = layout.herds[which], assets.strides, params.strides[which]
    assert own is not None
    picked = wall(lambda transforms: _picked(herd, transforms), hung.transforms)
    undo = wall(_undo, state, hung.orientation, stride.up)
    leg = wall(lambda *now: _leg(own, character.scale, *now), picked, undo)
    base = wall(lambda *now: _weighted(own, control, character, *now), state, stride, leg)
    longest = STRAIGHT * own.reach * character.scale
    length = own.length * character.scale

    def target(leg: _Leg, base: _Base, turn: Array | None) -> Array:
        heel, toe = (leg.heel, leg.toe) if turn is None else (quat.rotate(turn, v) for v in (leg.heel, leg.toe))
        return base.position + foot_alignment.plate_offset(heel, toe, base.plate, base.normal, length) - heel

    def reachable(leg: _Leg, target: Array, stride: Stride) -> Array:
        softness = 1.0 if layout.compat else 4.0 * stride.flight * (1.0 - stride.flight)
        return _reachable(leg, target, stride.up[1], longest, softness)

    def lift(leg: _Leg, target: Array, up: Array) -> Array:
        pose = leg.points[:, -1] - leg.points[:, 0]
        return foot_alignment.hip_lift(leg.points[:, 0], target, up, jnp.sqrt(dot(pose, pose) + TINY), longest)

    goal = wall(lambda leg, base, s: reachable(leg, target(leg, base, None), s), leg, base, stride)
    raised = wall(lift, leg, goal, stride.up[1])
    knee, ankle, _ = wall(lambda *now: _bent(assets, own, *now), state, leg, goal, raised, stride.up[1])
    turn = wall(_foot_turn, leg, base, knee, ankle, stride.lifted)
    goal = wall(lambda leg, base, turn, s: reachable(leg, target(leg, base, turn), s), leg, base, turn, stride)
    raised = wall(lift, leg, goal, stride.up[1])
    knee, ankle, missed = wall(lambda *now: _bent(assets, own, *now), state, leg, goal, raised, stride.up[1])
    shift = wall(lambda up, raised: up * raised, stride.up[1], raised)
    turns = wall(_turns, state, leg, base, knee, ankle, turn, shift)
    segments = wall(_segments, picked, leg, turns, knee, ankle, shift)
    shown = wall(lambda *now: _shown(length, *now), leg, base, ankle, turn)
    ball, heel, toe = shown
    handle = wall(lambda base: base.position + 0.5 * base.plate, base)
    return Feet(segments, shift, ball, ankle, missed, handle, stride.planted, heel, toe)


class _Picked(NamedTuple):
    """Joints of the legs, out of the pose."""

    points: Array  # [3, B + 1, L, n]
    ankle: Array  # [4, L, n]
    ball: Array  # [7, L, n]


def _picked(herd: HerdLayout, transforms: Array) -> _Picked:
    chain = np.array(herd.chain).T  # [B + 1, L]
    return _Picked(
        transforms[4:][:, chain], transforms[:4][:, np.array(herd.ankles)], transforms[:, np.array(herd.balls)]
    )


def _undo(state: State, orientation: Array, up: tuple[Array, Array]) -> Array:
    """[4, n] rotation from the body as it hangs (tilted, pitched by drag) to the body as its legs know it."""
    vertical = jnp.zeros_like(up[1]).at[1].set(1.0)
    legs = quat.multiply(quat.between(vertical, up[1]), quat.about_y(state.yaw))
    return quat.multiply(legs, quat.conjugate(orientation))


def _leg(own: StrideAssets, scale: Array, picked: _Picked, undo: Array) -> _Leg:
    hip = picked.points[:, 0]
    turn = undo[:, None]
    points = hip[:, None] + quat.rotate(undo[:, None, None], picked.points - hip[:, None])
    ankle = picked.points[:, -1]
    heel = quat.rotate(picked.ankle, own.heel * scale)
    toe = picked.ball[4:] - ankle + quat.rotate(picked.ball[:4], own.toe * scale)
    return _Leg(points, quat.rotate(turn, heel), quat.rotate(turn, toe), quat.multiply(turn, picked.ankle), undo)


def _weighted(
    own: StrideAssets, control: StrideControl, character: Character, state: State, stride: Stride, leg: _Leg
) -> _Base:
    """Footbases between the clip's and the gait's own, no further from the clip's than allowed (4.11)."""
    share = stride.alignment
    vertical = jnp.zeros_like(stride.base.normal).at[1].set(1.0)
    normal = unit(vertical + (stride.base.normal - vertical) * share)
    turn = stride.turn * share
    size = jnp.sqrt(dot(stride.base.sole, stride.base.sole) + TINY)
    level = jnp.stack([stride.base.sole[0], jnp.zeros_like(size), stride.base.sole[2]])
    # the plate lies along its print's yaw; turned back by what the adjustment leaves out
    back = quat.about_y(turn - stride.turn)
    plate = tilted(quat.rotate(back, level / jnp.sqrt(dot(level, level) + TINY) * size), normal)
    plate = jnp.where(share >= 1.0, stride.base.sole, plate)
    ankle = leg.points[:, -1]
    offset = foot_alignment.plate_offset(leg.heel, leg.toe, plate, normal, own.length * character.scale)
    reference = ankle + leg.heel - offset
    place = reference + (stride.base.position - reference) * share
    place = foot_alignment.limited(place, reference, control.most_adjustment * character.scale)
    attitude = quat.multiply(quat.between(vertical, normal), quat.about_y(turn))
    return _Base(place, plate, normal, attitude, turn)


def _reachable(leg: _Leg, target: Array, up: Array, longest: Array, softness: Array | float) -> Array:
    axis = up[:, None]
    way = leg.points[:, -1] - leg.points[:, 0]
    flat = way - axis * dot(way, axis)
    return foot_alignment.within_reach(
        leg.points[:, 0], target, axis, jnp.sqrt(dot(flat, flat) + TINY), longest, softness
    )


def _bent(
    assets: HerdAssets, own: StrideAssets, state: State, leg: _Leg, target: Array, raised: Array, up: Array
) -> tuple[Array, Array, Array]:
    """Knees, ankles and what is missing, of two-bone legs whose hips moved by `raised` along `up`."""
    upper = leg.points[:, 1] - leg.points[:, 0]
    lower = leg.points[:, 2] - leg.points[:, 1]
    a, b = jnp.sqrt(dot(upper, upper) + TINY), jnp.sqrt(dot(lower, lower) + TINY)
    whole = upper + lower
    off = upper - dot(upper, whole) / (dot(whole, whole) + TINY) * whole
    usual = quat.rotate(quat.about_y(state.yaw)[:, None], assets.bend)
    hip = leg.points[:, 0] + (up * raised)[:, None]
    return ik.two_bone(hip, target, off + BEND_SHARE * (a + b) * usual, a, b)


def _foot_turn(leg: _Leg, base: _Base, knee: Array, ankle: Array, lifted: Array) -> Array:
    """[4, L, n] rotation that the foot makes from the clip's pose (4.13, first pass)."""
    lower = leg.points[:, 2] - leg.points[:, 1]
    bend = quat.between(unit(lower), unit(ankle - knee))
    carried = quat.multiply(quat.about_y(base.turn), bend)
    return foot_alignment.foot_orientation(carried, base.attitude, lifted)


def _turns(
    state: State, leg: _Leg, base: _Base, knee: Array, ankle: Array, foot: Array, shift: Array
) -> tuple[Array, Array, Array, Array]:
    """Rotations [4, L, n] of both bones and the foot from the hung pose, and the knee after the leg's own yaw."""
    hip = leg.points[:, 0] + shift[:, None]
    sin, cos = jnp.sin(state.yaw), jnp.cos(state.yaw)
    ahead = jnp.stack([sin, jnp.zeros_like(sin), cos])[:, None]
    turned = quat.rotate(quat.about_y(base.turn), jnp.broadcast_to(ahead, base.plate.shape))
    twist = foot_alignment.leg_yaw(ankle - hip, jnp.broadcast_to(ahead, turned.shape), turned)
    upper, lower = leg.points[:, 1] - leg.points[:, 0], leg.points[:, 2] - leg.points[:, 1]
    bends = [
        quat.multiply(twist, quat.between(unit(before), unit(after)))
        for before, after in ((upper, knee - hip), (lower, ankle - knee))
    ]
    undo = leg.undo[:, None]
    first, second, third = (quat.multiply(q, undo) for q in (*bends, foot))
    return first, second, third, hip + quat.rotate(twist, knee - hip)


def _segments(
    picked: _Picked, leg: _Leg, turns: tuple[Array, ...], knee: Array, ankle: Array, shift: Array
) -> Segments:
    del knee
    first, second, third, knee = turns
    before = picked.points
    hip = leg.points[:, 0] + shift[:, None]
    return Segments(
        jnp.concatenate([first, second, third], 1),
        jnp.concatenate([before[:, 0], before[:, 1], before[:, 2]], 1),
        jnp.concatenate([hip, knee, ankle], 1),
    )


def _shown(length: Array, leg: _Leg, base: _Base, ankle: Array, turn: Array) -> tuple[Array, Array, Array]:
    """Middle of the footbase, heel and toe of the foot as it is posed."""
    heel, toe = quat.rotate(turn, leg.heel), quat.rotate(turn, leg.toe)
    offset = foot_alignment.plate_offset(heel, toe, base.plate, base.normal, length)
    return ankle + heel - offset + 0.5 * base.plate, ankle + heel, ankle + toe
