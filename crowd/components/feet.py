"""Feet: legs bend to their handles by analytic inverse kinematics, starting from the clip's own leg pose."""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from crowd.assets import HerdAssets, World
from crowd.components import clearance, high_step, sense
from crowd.components.footsteps import Mix
from crowd.components.pose import Hung
from crowd.layout import HerdLayout, Layout
from crowd.params import Character, Params
from crowd.state import State
from kernels import ik, quat
from kernels.rows import parted, picked
from kernels.trig import sin_cos
from kernels.vec import TINY, axis, dot, unit
from kernels.wall import Wall

STRETCH = 0.998  # of a leg's length: the body comes down when a leg would need more
BEND_SHARE = 0.05  # of a leg's length: keeps the bend plane defined where the clip's leg is straight
MOST_DROP = 0.3  # of the hips' height


class Segments(NamedTuple):
    """Rigid parts of limbs that inverse kinematics turned: S segments."""

    turn: Array  # [4, S, n]
    before: Array  # [3, S, n] m, joint the segment turns about, as the clip has it
    after: Array  # [3, S, n] m, where that joint goes


class Feet(NamedTuple):
    """Legs after inverse kinematics, relative to the character's position."""

    segments: Segments  # of all legs: upper, lower, foot
    shift: Array  # [3, n] m, how the body moves so that its legs reach
    ball: Array  # [3, L, n] m
    ankle: Array  # [3, L, n] m
    over_reach: Array  # [L, n] m
    handle: Array  # [3, L, n] m, where the contact point should be; all relative to the character's position
    planted: Array  # [L, n] bool
    heel: Array | None = None  # [3, L, n] m, of the posed foot (semi-procedural)
    toe: Array | None = None


def _swing_height(herd: HerdLayout, assets: HerdAssets, character: Character, state: State, blend: Mix) -> Array:
    """[L, n] m, height of each contact point above the ground: the clips' own, at the leg's own progress."""
    steps = herd.swing_samples - 1
    at = jnp.clip(state.gait.progress, 0.0, 1.0) * steps
    first = jnp.clip(jnp.floor(at).astype(jnp.int32), 0, steps - 1)
    share = at - first
    leg = jnp.arange(herd.legs).reshape(-1, 1) * (herd.gaits * herd.swing_samples)
    total = jnp.zeros_like(at)
    for k in range(herd.gaits):
        index = leg + k * herd.swing_samples + first
        height = assets.swing_height[index] * (1.0 - share) + assets.swing_height[index + 1] * share
        total = total + blend.share[k] * height
    return total * character.scale


class _Goal(NamedTuple):
    """Where a leg starts from and where its ankle should go, relative to the character's position."""

    hip: Array  # [3, L, n] m, as the clip has it
    upper: Array  # [3, L, n] m, hip to knee, as the clip has it
    lower: Array  # [3, L, n] m, knee to ankle
    contact: Array  # [3, L, n] m, where the contact point should be
    foot: Array  # [3, L, n] m, contact point to ankle
    level: Array  # [4, L, n] turn of the foot


def feet(
    layout: Layout,
    which: int,
    assets: HerdAssets,
    world: World,
    params: Params,
    character: Character,
    state: State,
    blend: Mix,
    hung: Hung,
    depth: Array,
    wall: Wall,
) -> Feet:
    """Legs after the clip's pose: bent to their handles, or left as the clip has them (`gait: clip`).

    The contact point goes to the handle; the foot keeps the clip's attitude about it (heel lift) without the body's
    pitch and yaw, laid onto the slope. Bones between hip and knee or knee and ankle keep the clip's pose.

    depth [n]: m, of the fluid above the character's ground, -inf when dry.
    """
    del params
    herd, transforms = layout.herds[which], hung.transforms
    if layout.gait == "clip":
        joints = picked(transforms, np.array([*herd.ankles, *herd.balls]), wall)
        return wall(functools.partial(_as_played, assets), character, state, blend, *parted(joints, 2, wall))
    ground = wall(lambda s: sense.ground(layout, world, s.gait.handle, s.position[1]), state)
    lift = wall(lambda c, s, b: _swing_height(herd, assets, c, s, b), character, state, blend)
    if layout.regions and "high_step" in herd.responses:
        flight = state.gait.progress
        lift = wall(lambda *now: high_step.raised(*now), character, depth, jnp.zeros_like(lift), lift, flight)
    level = wall(_levelled, state, ground[1])
    joints = picked(transforms, np.array([*herd.hips, *herd.knees, *herd.ankles, *herd.balls]), wall)
    goal = wall(functools.partial(_goal, assets), character, state, parted(joints, 4, wall), ground[0], lift, level)
    if "clearance" in herd.responses:
        kept = clearance.kept(herd, character, state, goal.contact, goal.foot, state.gait.progress, wall)
        goal = goal._replace(contact=kept)
    shift = wall(_down, wall(functools.partial(_short, assets), character, state, goal))
    knee, reached, missed = wall(lambda *now: _reached(assets, *now), state, goal, shift)
    segments = wall(_segments, goal, shift, knee, reached)
    ball = wall(lambda reached, goal: reached - goal.foot, reached, goal)
    return Feet(segments, shift, ball, reached, missed, goal.contact, state.gait.progress >= 1.0)


def _goal(
    assets: HerdAssets,
    character: Character,
    state: State,
    joints: list[Array],
    height: Array,
    lift: Array,
    level: Array,
) -> _Goal:
    """joints: transforms [7, L, n] of hips, knees, ankles and balls; height: ground [L, n] under the handles, in the
    world; lift: height of the contact points above it."""
    hips, knees, ankles = (joint[4:] for joint in joints[:3])
    contact = _contact(assets, character, joints[3])
    place = state.gait.handle - state.position[::2][:, None]
    goal = jnp.stack([place[0], height - state.position[1] + lift, place[1]])
    return _Goal(hips, knees - hips, ankles - knees, goal, quat.rotate(level, ankles - contact), level)


def _reached(assets: HerdAssets, state: State, goal: _Goal, shift: Array) -> tuple[Array, Array, Array]:
    """Knees, reached ankles and what is missing, after the body came down."""
    upper = jnp.sqrt(dot(goal.upper, goal.upper) + TINY)
    lower = jnp.sqrt(dot(goal.lower, goal.lower) + TINY)
    pole = _pole(assets, state, goal.upper, goal.upper + goal.lower, upper + lower)
    return ik.two_bone(moved(goal.hip, shift), goal.contact + goal.foot, pole, upper, lower)


def _segments(goal: _Goal, shift: Array, knee: Array, reached: Array) -> Segments:
    hip = moved(goal.hip, shift)
    knee_before = goal.hip + goal.upper
    return Segments(
        jnp.concatenate(
            [
                quat.between(unit(goal.upper), unit(knee - hip)),
                quat.between(unit(goal.lower), unit(reached - knee)),
                goal.level,
            ],
            1,
        ),
        jnp.concatenate([goal.hip, knee_before, knee_before + goal.lower], 1),
        jnp.concatenate([hip, knee, reached], 1),
    )


def moved(position: Array, shift: Array) -> Array:
    """Positions [3, k, n] of a body that moved by `shift` [3, n]."""
    return position + shift[:, None]


def _down(drops: Array) -> Array:
    """[3, n]: down by the most of [L, n]."""
    most = functools.reduce(jnp.maximum, jnp.unstack(drops))
    return jnp.stack([jnp.zeros_like(most), -most, jnp.zeros_like(most)])


def _levelled(state: State, slope: Array) -> Array:
    """[4, L, n]: takes a foot from the turned and pitched body's frame to its own yaw on the ground under it."""
    half = -0.5 * state.pitch
    sin, cos = sin_cos(state.yaw)
    s, c = sin_cos(half)
    unpitch = jnp.stack([c, cos * s, 0 * s, -sin * s])[:, None]
    unpitch = quat.multiply(quat.about_y(state.gait.foot_yaw - state.yaw), unpitch)
    up = unit(jnp.stack([-slope[0], jnp.ones_like(slope[0]), -slope[1]]))
    flat = axis(up, 1)
    return quat.multiply(quat.between(flat, up), unpitch)


def _short(assets: HerdAssets, character: Character, state: State, goal: _Goal) -> Array:
    """[L, n] m by which the hips must come down so that a leg reaches; legs in mid-swing do not ask for it."""
    way = goal.contact + goal.foot - goal.hip
    length = jnp.sqrt(dot(goal.upper, goal.upper) + TINY) + jnp.sqrt(dot(goal.lower, goal.lower) + TINY)
    most = STRETCH * length
    vertical = jnp.sqrt(jnp.maximum(most * most - way[0] ** 2 - way[2] ** 2, (0.3 * length) ** 2))
    ends = jnp.abs(2.0 * state.gait.progress - 1.0)
    need = jnp.maximum(-way[1] - vertical, 0.0) * ends * ends
    return jnp.minimum(need, MOST_DROP * assets.pivot_height * character.scale)


def _pole(assets: HerdAssets, state: State, upper: Array, leg: Array, length: Array) -> Array:
    """[3, L, n] the clip's knee off its hip-ankle line, with a little of the leg's usual bend."""
    along = dot(upper, leg) / (dot(leg, leg) + TINY)
    off = upper - along * leg
    usual = quat.rotate(quat.about_y(state.yaw)[:, None], assets.bend)
    return off + BEND_SHARE * length * usual


def _contact(assets: HerdAssets, character: Character, balls: Array) -> Array:
    """[3, L, n] contact points of feet with these transforms of the balls."""
    return balls[4:] + quat.rotate(balls[:4], assets.ball_offset * character.scale)


def _as_played(assets: HerdAssets, character: Character, state: State, blend: Mix, ankles: Array, balls: Array) -> Feet:
    """Legs as the clip has them; contact follows from its phase. They skate when the speed is not the clip's."""
    contact = _contact(assets, character, balls)
    since = state.phase - blend.lift
    since = since - jnp.floor(since)
    planted = (since >= 1.0 - blend.duty) | (state.gait.idle > 0.5)
    zero = jnp.zeros_like(since)
    still = jnp.zeros((4, 0, *state.phase.shape), contact.dtype)
    none = jnp.zeros((3, 0, *state.phase.shape), contact.dtype)
    return Feet(Segments(still, none, none), _down(zero), contact, ankles[4:], zero, contact, planted)
