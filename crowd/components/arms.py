"""Arms: hands and forearms that the clip would have under the surface are raised above it (section 4.2)."""

from __future__ import annotations

import dataclasses
import functools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from crowd.assets import HerdAssets
from crowd.components.feet import Segments, moved
from crowd.components.pose import Hung
from crowd.layout import HerdLayout
from crowd.params import Character, Params
from crowd.state import State
from kernels import arm_limits, controllers, ik, quat
from kernels.rows import parted, picked
from kernels.vec import TINY, axis, dot, plus, smoothstep, unit, with_row
from kernels.wall import Wall

FADE = 0.3  # of the arm's length: depth of the hand over which the response fades in
ELBOW_UP = 0.3  # against 1 outward: which way a raised elbow points
HAND = 0.25  # of the arm's length (shoulder to wrist): how far a hanging hand reaches below its wrist
WHOLE = 4.0  # over this share of the response the clip's own arm gives way
ASIDE = 0.65  # of the arm's length: how far hands move outward, so that forearms lie level


class _Goal(NamedTuple):
    """An arm as the clip has it on the moved body, and where its hand should go."""

    shoulder: Array  # [3, A, n] m
    upper: Array  # [3, A, n] m, shoulder to elbow
    lower: Array  # [3, A, n] m, elbow to hand
    hand: Array  # [3, A, n] m, goal of the hand
    pole: Array  # [3, A, n] m, which way the elbow goes
    response: Array  # [A, n] 0 dry to 1 raised


def arms(
    dt: float | Array,
    herd: HerdLayout,
    assets: HerdAssets,
    params: Params,
    character: Character,
    state: State,
    hung: Hung,
    shift: Array,
    surface: Array,
    wall: Wall,
) -> tuple[State, Segments]:
    """Upper arms, forearms and hands; the state remembers how far they are raised, where the herd asks for that.

    surface [n]: relative to the character's position, -inf when dry (then nothing moves). The goal is the clip's hand
    raised to the surface and a margin and moved aside; the elbow points outward and up. It fades in with the depth of
    the hand or elbow, whichever is deeper; out of reach the arm points to the goal.

    With `responses.arms` it fades in and out with play and a time constant, and the hand goes no further than shoulder
    and elbow let it (`kernels.arm_limits`).
    """
    joints = picked(hung.transforms[4:], np.array([*herd.shoulders, *herd.elbows, *herd.hands]), wall)
    now = (character, parted(joints, 3, wall), shift, surface)
    below = wall(functools.partial(_below, assets, params), *now)
    if "arms" not in herd.responses:
        raised = wall(lambda c, below: _response(below, assets.arm_length * c.scale), character, below)
    else:
        raised = wall(lambda c, s, below: _raised(dt, assets, c, s, below), character, state, below)
        state = dataclasses.replace(state, responded=dataclasses.replace(state.responded, raised=raised))
    goal = wall(functools.partial(_goal, assets, params), raised, state, *now)
    if "arms" in herd.responses:
        goal = wall(lambda c, g, facing: _within(assets, c, g, facing), character, goal, hung.orientation)
    bent = wall(_bent, goal)
    turns = wall(_turns, goal, *bent)
    return state, wall(_segments, goal, turns, shift)


def _below(
    assets: HerdAssets, params: Params, character: Character, joints: list[Array], shift: Array, surface: Array
) -> Array:
    """[A, n] m: how far the lower of elbow and hand is below where it is wanted.

    joints [3, A, n] each: shoulders, elbows and hands as the clip has them.
    """
    lowest = jnp.minimum(*(moved(joint, shift)[1] for joint in joints[1:]))
    return _level(assets, params, character, surface) - lowest


def _level(assets: HerdAssets, params: Params, character: Character, surface: Array) -> Array:
    """[A, n] m: height that elbow and hand are to have."""
    return jnp.maximum(surface, -1e3) + params.control.arm_margin + HAND * assets.arm_length * character.scale


def _raised(dt: float | Array, assets: HerdAssets, character: Character, state: State, below: Array) -> Array:
    """[A, n] how far arms are raised after the frame: with play of a band of depths, and slowly."""
    own, before = character.responses.arms, state.responded.raised
    assert own is not None and before is not None
    size = assets.arm_length * character.scale
    wanted = arm_limits.play(before, _response(below, size), _response(below + own.band, size))
    return before + (wanted - before) * controllers.low_pass(dt, own.time)


def _response(below: Array, size: Array) -> Array:
    """0 to 1 for an elbow or hand this far below where it is wanted."""
    return smoothstep((below + 0.25 * FADE * size) / (FADE * size))


def _goal(
    assets: HerdAssets,
    params: Params,
    response: Array,
    state: State,
    character: Character,
    joints: list[Array],
    shift: Array,
    surface: Array,
) -> _Goal:
    """What each arm is to do; response [A, n]: how far it is raised."""
    shoulder, elbow, hand = (moved(joint, shift) for joint in joints)
    size = assets.arm_length * character.scale
    short = _level(assets, params, character, surface) - hand[1]
    rise = 0.5 * (short + jnp.sqrt(short * short + (0.1 * size) ** 2))
    outward = quat.rotate(quat.about_y(state.yaw)[:, None], assets.arm_outward)
    goal = hand + outward * (ASIDE * size * response)
    goal = with_row(goal, 1, goal[1] + rise * response)
    upper, reach = elbow - shoulder, hand - shoulder
    bent = upper - dot(upper, reach) / (dot(reach, reach) + TINY) * reach
    aside = with_row(outward, 1, outward[1] + ELBOW_UP) * size
    pole = bent + (aside - bent) * response + 0.02 * size * outward
    return _Goal(shoulder, upper, hand - elbow, goal, pole, response)


def _within(assets: HerdAssets, character: Character, goal: _Goal, facing: Array) -> _Goal:
    """The goal with hands where shoulder and elbow let them go; facing [4, n]: orientation of the trunk."""
    own = character.responses.arms
    assert own is not None
    upper, lower = (jnp.sqrt(dot(bone, bone) + TINY) for bone in (goal.upper, goal.lower))
    side = jnp.where(assets.arm_outward[0] < 0, -1.0, 1.0)
    x, y, z = quat.rotate(quat.conjugate(facing)[:, None], goal.hand - goal.shoulder)
    hand = jnp.stack([x * side, y, z])
    nearest, longest = (arm_limits.span(upper, lower, cos) for cos in (own.cos_bent, own.cos_stretched))
    allowed = arm_limits.limited(hand, nearest, longest, jnp.broadcast_to(own.tan_back, upper.shape))
    x, y, z = hand + (allowed - hand) * jnp.clip(goal.response * WHOLE, 0.0, 1.0)
    return goal._replace(hand=goal.shoulder + quat.rotate(facing[:, None], jnp.stack([x * side, y, z])))


def _bent(goal: _Goal) -> tuple[Array, Array]:
    """Elbow and hand [3, A, n] of an arm that reaches its goal."""
    upper = jnp.sqrt(dot(goal.upper, goal.upper) + TINY)
    lower = jnp.sqrt(dot(goal.lower, goal.lower) + TINY)
    elbow, hand, _ = ik.two_bone(goal.shoulder, goal.hand, goal.pole, upper, lower)
    return elbow, hand


def _turns(goal: _Goal, elbow: Array, hand: Array) -> tuple[Array, Array]:
    """Turns [4, A, n] of upper arm and forearm: none while the hand is dry, the clip's arms then stay as they are."""
    fade = jnp.clip(goal.response * WHOLE, 0.0, 1.0)
    identity = axis(jnp.zeros((4, *fade.shape), fade.dtype), 0)
    upper = quat.between(unit(goal.upper), unit(elbow - goal.shoulder))
    lower = quat.between(unit(goal.lower), unit(hand - elbow))
    return (
        quat.normalize(identity + (upper - identity) * fade),
        quat.normalize(identity + (lower - identity) * fade),
    )


def _segments(goal: _Goal, turns: tuple[Array, Array], shift: Array) -> Segments:
    upper, lower = turns
    elbow = plus(goal.shoulder, quat.rotate(upper, goal.upper))
    hand = plus(elbow, quat.rotate(lower, goal.lower))
    before = goal.shoulder + goal.upper
    return Segments(
        jnp.concatenate([upper, lower, lower], 1),
        moved(jnp.concatenate([goal.shoulder, before, before + goal.lower], 1), -shift),
        jnp.concatenate([goal.shoulder, elbow, hand], 1),
    )
