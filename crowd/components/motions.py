"""Motions: how much each analysed motion and each other clip plays, and what that says of the legs (3.4, 3.5)."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from crowd.assets import StrideAssets
from crowd.layout import HerdLayout, Layout
from crowd.params import Character, StrideControl, StyleEvents
from crowd.state import State, Strides
from kernels import blending, body_tilt, clips, leg_cycle
from kernels.footprint import about
from kernels.leg_cycle import KeyTimes
from kernels.trig import sin_cos
from kernels.wall import Wall

SLOTS = 4  # clips in a pose; of more the heaviest play
NO_WALK = 1e-5  # share of each walk when none has weight: a standing character keeps key times


class Blend(NamedTuple):
    """The mixture of motions, at the character's size. Leg data in the character frame."""

    share: Array  # [M, n] of all analysed motions, sum 1
    alignment: Array  # [n] share of analysed motions in the pose
    keys: KeyTimes  # [L, n]
    phase: Array  # [L, n] stance time on the clock
    stance: Array  # [3, L, n] m
    foot: Array  # [3, L, n] m, heel to toe


def mixed(table: Array, share: Array) -> Array:
    """[*t, n] weighted sum over motions of [M] or [M, L, 1]."""
    return sum((share[m] * table[m] for m in range(1, share.shape[0])), share[0] * table[0])


def channels(
    herd: HerdLayout, dt: float | Array, events: StyleEvents, chosen: Array, frame: Array, own: Strides
) -> dict[str, Array]:
    """Weights of styles and other clips after the frame: the goal's grows at its rate, the others make room (6.4, 6.5).

    events: those that meet the herd; chosen [E, n]: 1 where one meets the character. A clip gives way to the style that
    was there before it when its time is over.
    """
    styles = 1 + max(motion.style for motion in herd.motions)
    goal, rate, until, back, since = (
        own.channel_goal, own.channel_rate, own.channel_until, own.channel_return, own.extra_time
    )  # fmt: skip
    for event in range(events.frame.shape[0]):
        now = (events.frame[event] == frame) & (chosen[event] > 0)
        target = events.target[event]
        clip = target >= styles
        back = jnp.where(now & ~clip, target, back)
        goal = jnp.where(now, target, goal)
        rate = jnp.where(now, 1.0 / jnp.maximum(events.fade[event], dt), rate)
        until = jnp.where(now, events.hold[event], until)
        since = jnp.where(now & clip, 0.0, since)
    over = until <= 0.0
    goal, until = jnp.where(over, back, goal), jnp.where(over, jnp.inf, until - dt)
    number = jnp.arange(own.channel.shape[0]).reshape(-1, 1)
    mine = number == goal
    before = jnp.where(mine, own.channel, 0.0).sum(0)
    after = jnp.minimum(before + rate * dt, 1.0)
    room = jnp.where(before < 1.0, (1.0 - after) / jnp.where(before < 1.0, 1.0 - before, 1.0), 0.0)
    return dict(
        channel=jnp.where(mine, after, own.channel * room),
        channel_goal=goal, channel_rate=rate, channel_until=until, channel_return=back, extra_time=since,
    )  # fmt: skip


def weights(
    layout: Layout,
    herd: HerdLayout,
    own: StrideAssets,
    control: StrideControl,
    character: Character,
    state: State,
    wall: Wall,
) -> Array:
    """[M, n] smoothed weights within each style: gradient bands of the smoothed velocity (3.1, 3.2, 3.4)."""
    query = wall(_query, character, state)
    rows: list[Array | None] = [None] * len(herd.motions)
    for style in sorted({motion.style for motion in herd.motions}):
        members = [m for m, motion in enumerate(herd.motions) if motion.style == style]
        samples = own.velocity[:, jnp.array(members)]
        if layout.bands == "cartesian":
            found = blending.cartesian(samples, query, wall)
        else:
            found = blending.weights(wall(blending.bands, samples), query, layout.compat, wall)
        for place, m in enumerate(members):
            rows[m] = found[place]
    share = jnp.minimum(layout.dt / jnp.maximum(control.blend_time, 1e-6), 1.0)

    def smoothed(blend: Array, share: Array, *wanted: Array) -> Array:
        return blend + (jnp.stack(wanted) - blend) * share

    return wall(smoothed, state.gait.blend, share, *rows)


def _query(character: Character, state: State) -> Array:
    """[2, n] smoothed velocity (x, z) in the character's axes, at scale 1."""
    sin, cos = sin_cos(state.yaw)
    x, _, z = state.gait.velocity
    return jnp.stack([x * cos - z * sin, x * sin + z * cos]) / character.scale


def blended(
    layout: Layout, herd: HerdLayout, own: StrideAssets, control: StrideControl, character: Character, state: State
) -> Blend:
    """Leg data of the mixture. Key times come from walk cycles alone (3.5)."""
    gait: Strides = state.gait
    styles = max(motion.style for motion in herd.motions) + 1
    total = gait.channel[:styles].sum(0)
    nothing = total < 1e-6
    style = jnp.where(nothing, 1.0 / styles, gait.channel[:styles] / jnp.where(nothing, 1.0, total))
    share = jnp.stack([gait.blend[m] * style[motion.style] for m, motion in enumerate(herd.motions)])
    share = share / share.sum(0)
    walks = [motion.walks for motion in herd.motions]
    walking = jnp.stack([share[m] + NO_WALK if walk else jnp.zeros_like(share[m]) for m, walk in enumerate(walks)])
    walking = walking / walking.sum(0)
    keys = KeyTimes(*(mixed(table, walking) for table in own.keys))
    phase = leg_cycle.circular_mean(own.stance_cos, own.stance_sin, walking)
    stance, foot = (
        jnp.stack([mixed(table[k], share) for k in range(3)]) * character.scale for table in (own.stance, own.foot)
    )
    if not layout.compat:
        up = about(gait.ground_up, -state.yaw)
        stance = body_tilt.hugged(control.tilt, up, stance)
    return Blend(share, jnp.clip(total, 0.0, 1.0), keys, phase, stance, foot)


def columns(herd: HerdLayout, own: StrideAssets, state: State, blend: Blend) -> tuple[Array, Array]:
    """Table columns and shares [2, slots, n] of the clips that play."""
    gait: Strides = state.gait
    styles = max(motion.style for motion in herd.motions) + 1
    weight = [blend.share[m] * blend.alignment for m in range(len(herd.motions))]
    phase = [state.phase if motion.walks else state.idle_phase for motion in herd.motions]
    for number, cyclic in enumerate(herd.extras):
        weight.append(gait.channel[styles + number])
        at = gait.extra_time * own.extra_rate[number]
        phase.append(at - jnp.floor(at) if cyclic else jnp.clip(at, 0.0, 1.0 - 1.0 / herd.samples))
    which = [jnp.full_like(state.fault, m) for m in range(len(weight))]
    if len(weight) > SLOTS:
        which, phase, weight = _heaviest(weight, phase)
    total = sum(weight[1:], weight[0])
    shares = jnp.stack([w / total for w in weight])
    return clips.frame_weights(jnp.stack(which), jnp.stack(phase), shares, herd.samples)


def _heaviest(weight: list[Array], phase: list[Array]) -> tuple[list[Array], list[Array], list[Array]]:
    """The SLOTS heaviest clips, each less the weight of the next one: nothing jumps when two change places."""
    left, phases = jnp.stack(weight), jnp.stack(phase)
    number = jnp.arange(len(weight)).reshape(-1, *(1,) * (left.ndim - 1))
    which, chosen, heavy = [], [], []
    for _ in range(SLOTS):
        best = jnp.argmax(left, 0).astype(jnp.int32)
        mask = number == best
        which.append(best)
        heavy.append(jnp.where(mask, left, 0.0).sum(0))
        chosen.append(jnp.where(mask, phases, 0.0).sum(0))
        left = jnp.where(mask, -1.0, left)
    floor = jnp.maximum(left.max(0), 0.0)
    return which, chosen, [jnp.maximum(w - floor, 0.0) + 1e-9 for w in heavy]
