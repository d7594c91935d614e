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
from kernels import chain_ik, foot_alignment, ik, quat
from kernels.foot_alignment import STRAIGHT
from kernels.footprint import tilted
from kernels.trig import sin_cos
from kernels.vec import TINY, axis, dot, unit
from kernels.wall import Wall

MOST_DROP = 0.5  # of the legs' length in the clip: how far the hips come down at most
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
    depth: Array,
    wall: Wall,
) -> Feet:
    """Legs after inverse kinematics, and how far the hips move."""
    del world, depth
    herd, own, control = layout.herds[which], assets.strides, params.strides[which]
    assert own is not None
    picked = wall(lambda transforms: _picked(herd, transforms), hung.transforms)
    undo = wall(_undo, state, hung.orientation, stride.up)
    leg = wall(lambda *now: _leg(own, character.scale, *now), picked, undo)
    base = wall(lambda *now: _weighted(own, control, character, *now), state, stride, leg)
    nearest, longest = own.nearest * character.scale, STRAIGHT * own.reach * character.scale
    length = own.length * character.scale

    def target(leg: _Leg, base: _Base, turn: Array | None) -> Array:
        heel, toe = (leg.heel, leg.toe) if turn is None else (quat.rotate(turn, v) for v in (leg.heel, leg.toe))
        return base.position + foot_alignment.plate_offset(heel, toe, base.plate, base.normal, length) - heel

    def reachable(leg: _Leg, target: Array, stride: Stride) -> Array:
        softness = 1.0 if layout.compat else 4.0 * stride.flight * (1.0 - stride.flight)
        return _reachable(leg, target, stride.up[1], longest, softness)

    def lift(leg: _Leg, target: Array, up: Array) -> Array:
        pose = leg.points[:, -1] - leg.points[:, 0]
        length = jnp.sqrt(dot(pose, pose) + TINY)
        hip = leg.points[:, 0]
        # a leg that is out of reach of its target at any height would bring the hips down to the ground
        lift = jnp.maximum(foot_alignment.hip_lift(hip, target, up, length, longest), -MOST_DROP * length.mean(0))
        return lift if layout.compat else foot_alignment.folded(lift, hip, target, up, nearest, longest)

    def solved(leg: _Leg, base: _Base, turn: Array | None) -> tuple[Array, Array, Array]:
        goal = wall(lambda leg, base, turn, s: reachable(leg, target(leg, base, turn), s), leg, base, turn, stride)
        shift = wall(lambda leg, goal, up: up * lift(leg, goal, up), leg, goal, stride.up[1])
        if not layout.compat:
            shift = wall(
                lambda leg, goal, shift: foot_alignment.drawn(leg.points[:, 0], goal, shift, nearest, longest),
                leg, goal, shift,
            )  # fmt: skip
        return *_bent(assets, state, leg, goal, shift, wall), shift

    points, missed, shift = solved(leg, base, None)
    turns = _turned(leg, points, shift, wall)
    foot = wall(_foot_turn, base, turns, stride.lifted)
    points, missed, shift = solved(leg, base, foot)
    turns = _turned(leg, points, shift, wall)
    twist = wall(_twist, state, base, points)
    turns = wall(lambda twist, turns: quat.multiply(twist[:, None], turns), twist, turns)
    points = wall(_twisted, twist, points)
    segments = wall(_segments, picked, leg, turns, foot, points)
    ankle = points[:, -1]
    ball, heel, toe = wall(lambda *now: _shown(length, *now), leg, base, ankle, foot)
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
    return quat.multiply(quat.upright(up[1], state.yaw), quat.conjugate(orientation))


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
    vertical = axis(stride.base.normal, 1)
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
    return _Base(place, plate, normal, quat.upright(normal, turn), turn)


def _reachable(leg: _Leg, target: Array, up: Array, longest: Array, softness: Array | float) -> Array:
    axis = up[:, None]
    way = leg.points[:, -1] - leg.points[:, 0]
    flat = way - axis * dot(way, axis)
    return foot_alignment.within_reach(
        leg.points[:, 0], target, axis, jnp.sqrt(dot(flat, flat) + TINY), longest, softness
    )


def _bent(assets: HerdAssets, state: State, leg: _Leg, target: Array, shift: Array, wall: Wall) -> tuple[Array, Array]:
    """Joints [3, B + 1, L, n] of legs that reach their targets from hips moved by `shift`, and what is missing."""
    if leg.points.shape[1] == 3:
        return wall(lambda *now: _two_bones(assets, *now), state, leg, target, shift)
    moved = wall(lambda points, shift: points + shift[:, None, None], leg.points, shift)
    return chain_ik.chain(moved, target, wall=wall)


def _two_bones(assets: HerdAssets, state: State, leg: _Leg, target: Array, shift: Array) -> tuple[Array, Array]:
    upper = leg.points[:, 1] - leg.points[:, 0]
    lower = leg.points[:, 2] - leg.points[:, 1]
    a, b = jnp.sqrt(dot(upper, upper) + TINY), jnp.sqrt(dot(lower, lower) + TINY)
    whole = upper + lower
    off = upper - dot(upper, whole) / (dot(whole, whole) + TINY) * whole
    usual = quat.rotate(quat.about_y(state.yaw)[:, None], assets.bend)
    hip = leg.points[:, 0] + shift[:, None]
    knee, ankle, missed = ik.two_bone(hip, target, off + BEND_SHARE * (a + b) * usual, a, b)
    return jnp.stack([hip, knee, ankle], 1), missed


def _turned(leg: _Leg, points: Array, shift: Array, wall: Wall) -> Array:
    """[4, B, L, n] rotation of every bone from the clip's pose."""
    if points.shape[1] > 3:
        before = wall(lambda points, shift: points + shift[:, None, None], leg.points, shift)
        return chain_ik.turns(before, points, wall)

    def between(before: Array, after: Array) -> Array:
        return quat.between(unit(before[:, 1:] - before[:, :-1]), unit(after[:, 1:] - after[:, :-1]))

    return wall(between, leg.points, points)


def _foot_turn(base: _Base, turns: Array, lifted: Array) -> Array:
    """[4, L, n] rotation that the foot makes from the clip's pose (4.13, first pass)."""
    carried = quat.multiply(quat.about_y(base.turn), turns[:, -1])
    return foot_alignment.foot_orientation(carried, base.attitude, lifted)


def _twist(state: State, base: _Base, points: Array) -> Array:
    """[4, L, n] turn of each leg about its own axis by half of its foot's yaw (4.13, second pass)."""
    sin, cos = sin_cos(state.yaw)
    ahead = jnp.broadcast_to(jnp.stack([sin, jnp.zeros_like(sin), cos])[:, None], base.plate.shape)
    foot = quat.rotate(quat.about_y(base.turn), ahead)
    return foot_alignment.leg_yaw(points[:, -1] - points[:, 0], ahead, foot)


def _twisted(twist: Array, points: Array) -> Array:
    """[3, B + 1, L, n] joints after the legs turned about their axes: hip and ankle stay."""
    hip = points[:, :1]
    return hip + quat.rotate(twist[:, None], points - hip)


def _segments(picked: _Picked, leg: _Leg, turns: Array, foot: Array, points: Array) -> Segments:
    """Every bone and the foot, from the pose as it hangs."""
    whole = jnp.concatenate([turns, foot[:, None]], 1)
    whole = quat.multiply(whole, leg.undo[:, None, None])
    parts = (whole, picked.points, points)
    return Segments(*(part.reshape(part.shape[0], -1, part.shape[-1]) for part in parts))


def _shown(length: Array, leg: _Leg, base: _Base, ankle: Array, turn: Array) -> tuple[Array, Array, Array]:
    """Middle of the footbase, heel and toe of the foot as it is posed."""
    heel, toe = quat.rotate(turn, leg.heel), quat.rotate(turn, leg.toe)
    offset = foot_alignment.plate_offset(heel, toe, base.plate, base.normal, length)
    return ankle + heel - offset + 0.5 * base.plate, ankle + heel, ankle + toe
