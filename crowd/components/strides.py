"""Strides: the semi-procedural gait. Weights of the motions, leg cycles, footprints and where every footbase goes.

Sections of its specification: tracker 4.1, weights 3.4, leg data 3.5, clock 3.6 and 3.7, leg cycles 4.3 and 4.6,
footprints 4.4, 4.5 and 4.7, supporting height 4.8, up axes 4.9, flight 4.10, events 4.15.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from crowd.assets import HerdAssets, StrideAssets, World
from crowd.components import clearance, footing, high_step, motions
from crowd.components.motions import Blend
from crowd.components.pose import Poses
from crowd.layout import HerdLayout, Layout
from crowd.params import Character, Params, StrideControl
from crowd.state import State, Strides
from kernels import body_tilt, controllers, flight, leg_cycle
from kernels.flight import Footbase
from kernels.footprint import Footprint, about
from kernels.trig import sin_cos
from kernels.vec import TINY, with_row
from kernels.wall import Wall

FASTEST_FACING = 10.0  # rad/s
SLOWER = 10.0 / 3.0  # than the velocity: how acceleration and yaw rate are smoothed
TURNS = 0.1  # rad, or m/s to a side: from here on a resting character knows which leg goes first
WHOLE = 0.999  # of the adjustment: with less, feet move as another clip has them
READY = 0.3  # cycles since stance: where that leg waits


class Stride(NamedTuple):
    """Where feet and body go, relative to the character's position."""

    base: Footbase
    lifted: Array  # [L, n] 0: the ground's attitude, 1: the leg's
    flight: Array  # [L, n] share of the flight
    planted: Array  # [L, n] bool
    turn: Array  # [L, n] rad, yaw of the footbase against the body's
    up: tuple[Array, Array]  # [3, n] unit up axes of body and legs
    alignment: Array  # [n] 1 adjusted, 0 as animated
    blend: Blend


def gait(
    layout: Layout,
    which: int,
    assets: HerdAssets,
    world: World,
    params: Params,
    character: Character,
    state: State,
    climb: Array,
    depth: Array,
    wall: Wall,
) -> tuple[State, Stride, Poses]:
    """State, footbases and poses after the frame. climb [n]: m/s, how fast the character's ground rises; depth [n]: m,
    of the fluid above it, -inf when dry."""
    herd, control, dt = layout.herds[which], params.strides[which], layout.dt
    own = assets.strides
    assert own is not None
    reaction = character.responses.reaction
    state = _with(state, **wall(lambda s, climb, reaction: _tracked(dt, reaction, s, climb), state, climb, reaction))
    state = _with(
        state,
        **wall(
            lambda c, s: motions.channels(herd, dt, params.styles[which], c.style, s.frame, s.gait), character, state
        ),
    )
    state = _with(state, blend=motions.weights(layout, herd, own, control, character, state, wall))
    blend = wall(lambda c, s: motions.blended(layout, herd, own, control, c, s), character, state)
    cycle_s = wall(lambda c, s, b: _cycle_duration(layout.compat, own, control, c, s, b), character, state, blend)
    clocks = wall(lambda s, b, cycle_s: _clocks(herd, own, dt, s, b, cycle_s), state, blend, cycle_s)
    state = dataclasses.replace(state, phase=clocks["phase"], idle_phase=clocks["idle_phase"])
    state = _with(state, extra_time=clocks["extra_time"])
    cycle = wall(
        lambda s, b: leg_cycle.advance(s.phase, b.phase, s.gait.designated, s.gait.time, s.gait.parked, b.keys.strike),
        state,
        blend,
    )
    state = footing.footprints(layout, herd, own, world, control, character, state, blend, cycle, cycle_s, wall)
    stride = _stride(layout, herd, own, control, character, state, blend, cycle_s, depth, wall)
    leaning, ground_up, base, up, shares = stride
    state = _with(state, leaning=leaning, ground_up=ground_up)
    column, share = wall(lambda s, b: motions.columns(herd, own, s, b), state, blend)
    planted, lifted, flown, turn = shares
    out = Stride(base, lifted, flown, planted, turn, up, blend.alignment, blend)
    return state, out, Poses(column, share, up)


def _with(state: State, **changes: Array) -> State:
    """The state with fields of its gait replaced."""
    return dataclasses.replace(state, gait=dataclasses.replace(state.gait, **changes))


def _tracked(dt: float | Array, reaction: Array | None, state: State, climb: Array) -> dict[str, Array]:
    """Velocity, acceleration and yaw rate, low-passed (4.1). The velocity is the body's own.

    reaction: [n] s, time constant of the velocity, acceleration and yaw rate have SLOWER times it; None: 0.1 s, as one
    share per frame. The first frame has no acceleration.
    """
    fast, slow = (controllers.approach(rate, dt) for rate in (10.0, 3.0))
    if reaction is not None:
        fast, slow = (controllers.low_pass(dt, times * reaction) for times in (1.0, SLOWER))
    own: Strides = state.gait
    now = jnp.stack([state.velocity[0], climb, state.velocity[1]])
    acceleration = jnp.where(state.frame > 0, (now - own.before) / dt, 0.0)
    swing = controllers.wrap(state.facing - own.facing) / dt
    swing = jnp.where(jnp.abs(swing) < FASTEST_FACING, swing, 0.0)  # a new heading is a jump, not a turn
    return dict(
        before=now,
        velocity=own.velocity + (now - own.velocity) * fast,
        acceleration=own.acceleration + (acceleration - own.acceleration) * slow,
        turn=own.turn + (state.yaw_rate - own.turn) * slow,
        facing=state.facing,
        facing_rate=own.facing_rate + (swing - own.facing_rate) * slow,
    )


def _cycle_duration(
    compat: bool, own: StrideAssets, control: StrideControl, character: Character, state: State, blend: Blend
) -> Array:
    """[n] s (3.6): from the velocity of this frame, of which the climb counts up to the level speed.

    With a reaction time: from the smoothed velocity, so that the cadence comes as late as the weights of motions.
    """
    x, y, z = state.gait.before if character.responses.reaction is None else state.gait.velocity
    level = jnp.sqrt(x * x + z * z + TINY)
    y = jnp.clip(y, -level, level)
    ax, _, az = state.gait.acceleration
    frequency, speed = motions.mixed(own.frequency, blend.share), motions.mixed(own.speed, blend.share)
    steady = leg_cycle.duration(
        frequency,
        speed * character.scale,
        jnp.sqrt(level * level + y * y),
        jnp.abs(state.gait.turn),
        jnp.sqrt(ax * ax + az * az + TINY),
        control.longest_cycle,
        control.most_turn,
        control.most_acceleration,
    )
    if compat:
        return steady
    stands = state.gait.time <= blend.keys.liftoff
    twist = jnp.where(stands, controllers.wrap(state.gait.from_yaw - footing.yaw_due(character, state)), 0.0)
    return steady / leg_cycle.hurry(twist, control.most_foot_turn)


def _clocks(
    herd: HerdLayout, own: StrideAssets, dt: float | Array, state: State, blend: Blend, cycle_s: Array
) -> dict[str, Array]:
    """Phases after the frame (3.7): the common clock stands while every leg rests."""
    moves = ~state.gait.parked.all(0) & (state.fault == 0)
    phase = jnp.where(moves, state.phase + dt / cycle_s, _ready(herd, state, blend))
    standing = sum((blend.share[m] for m, motion in enumerate(herd.motions) if not motion.walks), jnp.zeros_like(phase))
    rate = motions.mixed(own.rate, blend.share)
    usual = own.rate.max()
    idle = state.idle_phase + dt * jnp.where(standing > 1e-3, rate / jnp.maximum(standing, 1e-3), usual)
    return dict(
        phase=phase - jnp.floor(phase), idle_phase=idle - jnp.floor(idle), extra_time=state.gait.extra_time + dt
    )


def _ready(herd: HerdLayout, state: State, blend: Blend) -> Array:
    """[n] where the clock of a resting character waits, so that a leg on the side it turns or moves to goes first.

    The other leg would have to step across it.
    """
    sin, cos = sin_cos(state.yaw)
    turn = controllers.wrap(state.facing - state.yaw)
    left = state.desired[0] * cos - state.desired[1] * sin
    signal = jnp.where(jnp.abs(turn) > TURNS, turn, left)
    phase = state.phase
    for side in (1, -1):
        leg = next((i for i, s in enumerate(herd.sides) if s == side), None)
        if leg is not None:
            phase = jnp.where(signal * side > TURNS, blend.phase[leg] + READY, phase)
    return phase


def _stride(
    layout: Layout,
    herd: HerdLayout,
    own: StrideAssets,
    control: StrideControl,
    character: Character,
    state: State,
    blend: Blend,
    cycle_s: Array,
    depth: Array,
    wall: Wall,
) -> tuple[Array, Array, Footbase, tuple[Array, Array], tuple[Array, ...]]:
    """Lean, ground axis, footbases, up axes and shares of each leg's cycle."""
    before, after = wall(footing.relative, state)
    stance = wall(lambda s, b: about(b.stance, s.yaw), state, blend)
    direction, way = wall(_way, state, cycle_s)
    held = flight.support(stance, before, after, state.gait.time, blend.keys, direction, way, wall)
    ground_up = wall(
        lambda footing, s, scale: body_tilt.ground_up(footing, s.gait.ground_up, control.upright * scale * scale),
        held.footing, state, character.scale,
    )  # fmt: skip
    leaning = wall(lambda s: _leaning(control, layout.dt, s), state)
    up = wall(lambda s, *now: _up(control, s, *now), state, ground_up, leaning, held.travel)
    shares = wall(_shares, state, blend)
    curve = wall(
        lambda table, b, flown: flight.trajectory(table, herd.flight_samples, b.share, flown),
        own.flight,
        blend,
        shares[2],
    )
    sized = wall(lambda curve, scale: jnp.stack([curve[0] * scale, curve[1] * scale, curve[2]]), curve, character.scale)
    base = flight.footbase(
        jnp.zeros_like(ground_up), state.yaw, stance, before, after, state.gait.time, blend.keys, sized, up[1],
        held.height, control.most_foot_turn, wall,
    )  # fmt: skip
    planted, lifted, flown = shares
    if "clearance" in herd.responses:
        base = base._replace(position=clearance.kept(herd, character, state, base.position, base.sole, flown, wall))
    if layout.regions and "high_step" in herd.responses:
        high = wall(_high, character, depth, base.position[1], before, after, flown)
        base = base._replace(position=with_row(base.position, 1, high))
    turn = wall(lambda base, yaw: base.yaw - yaw, base, state.yaw)
    return leaning, ground_up, base, up, (planted, lifted, flown, turn)


def _high(
    character: Character, depth: Array, height: Array, before: Footprint, after: Footprint, flown: Array
) -> Array:
    """[L, n] m, heights of feet that are lifted out of shallow water, from the ground between their prints."""
    ground = before.position[1] + (after.position[1] - before.position[1]) * flown
    return high_step.raised(character, depth, ground, height, flown)


def _way(state: State, cycle_s: Array) -> tuple[Array, Array]:
    """Direction [2, n] of travel in the world, and the way [n] in m in a cycle."""
    x, _, z = state.gait.before
    speed = jnp.sqrt(x * x + z * z + TINY)
    return jnp.stack([x, z]) / speed, speed * cycle_s


def _leaning(control: StrideControl, dt: float | Array, state: State) -> Array:
    x, _, z = state.gait.acceleration
    sin, cos = sin_cos(state.yaw)
    return body_tilt.lean(control.tilt, state.gait.leaning, jnp.stack([x * cos - z * sin, x * sin + z * cos]), dt)


def _up(control: StrideControl, state: State, ground_up: Array, leaning: Array, travel: Array) -> tuple[Array, Array]:
    """[3, n] up axes of body and legs, world."""
    x, _, z = state.gait.velocity
    back = -state.yaw
    body, legs = body_tilt.up_axes(
        control.tilt, about(ground_up, back), leaning, about(travel, back), jnp.sqrt(x * x + z * z + TINY)
    )
    return about(body, state.yaw), about(legs, state.yaw)


def _shares(state: State, blend: Blend) -> tuple[Array, Array, Array]:
    """Planted, lifted and share of the flight [L, n]. A foot that another clip moves is not planted."""
    time, keys = state.gait.time, blend.keys
    planted = (time <= keys.liftoff) | (time >= keys.strike)
    return (
        planted & (blend.alignment > WHOLE),
        leg_cycle.lifted(time, keys),
        leg_cycle.ilerp(keys.liftoff, keys.strike, time),
    )
