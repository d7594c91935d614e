"""Footing: every leg's footprint behind and ahead, parked legs and foot events (4.3 to 4.7, 4.15)."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
from jax import Array

from crowd.assets import StrideAssets, World
from crowd.components import clearance, sense
from crowd.components.motions import Blend
from crowd.layout import HerdLayout, Layout
from crowd.params import Character, StrideControl
from crowd.state import State, Strides
from kernels import controllers, footprint, leg_cycle
from kernels.footprint import Footprint, Hit, about
from kernels.leg_cycle import Cycle
from kernels.vec import TINY
from kernels.wall import Wall

SEEK_FEET = 3.0  # feet per second: the least speed at which a print follows its prediction


def footprints(
    layout: Layout,
    herd: HerdLayout,
    assets: StrideAssets,
    world: World,
    control: StrideControl,
    character: Character,
    state: State,
    blend: Blend,
    cycle: Cycle,
    cycle_s: Array,
    wall: Wall,
) -> State:
    """The state with this frame's prints, leg cycles and foot phases. cycle_s [n]: duration of a cycle, s."""
    at = state.position[:, None]

    def ground(points: Array, at: Array) -> Hit:
        height, slope = sense.ground(layout, world, (points + at)[::2], (points + at)[1])
        return Hit(height - at[1], slope)

    def height(points: Array, at: Array) -> Array:
        return sense.height(layout, world, (points + at[:, None])[::2], (points + at[:, None])[1]) - at[1]

    heel, yaw = wall(
        lambda c, *now: _predicted(layout, c, control, *now),
        character,
        state,
        blend,
        cycle,
        cycle_s,
    )
    if "clearance" in herd.responses:
        heel = clearance.uncrossed(herd, character, state, blend, heel, yaw, blend.foot, wall)
    at_heel = wall(ground, heel, at)
    toe = wall(lambda heel, b, yaw: heel + about(b.foot, yaw), heel, blend, yaw)
    at_toe = wall(ground, toe, at)

    def placed(heel: Array, yaw: Array, foot: Array, at_heel: Hit, at_toe: Hit, scale: Array) -> Footprint:
        window = world.max_step_height * scale
        return footprint.placed(heel, yaw, foot, at_heel, at_toe, world.min_normal_y, window)

    print_ = wall(placed, heel, yaw, blend.foot[::2], at_heel, at_toe, character.scale)
    points = wall(footprint.sole_points, print_)
    there = wall(height, points, at)
    print_ = wall(footprint.settled, print_, points, there)
    taken, behind, ahead = wall(_handed_on, state, cycle)
    seek = wall(lambda c, s: _seek(assets, c, s.gait), character, state)
    keys = blend.keys
    flown = wall(leg_cycle.ilerp, keys.liftoff, keys.strike, cycle.time)
    local, aim = (wall(lambda place, at: place - at, place, at) for place in (ahead.position, state.gait.goal))
    position, aim, fresh = footprint.smoothed(
        local, aim, print_.position, cycle.time, keys.strike, flown, cycle.begins, seek, cycle_s, cycle.designated,
        layout.dt, wall,
    )  # fmt: skip
    aims = wall(lambda time, strike: time < strike, cycle.time, keys.strike)
    ahead = wall(_of_goal, fresh, print_, ahead, position)
    if "clearance" in herd.responses:
        ahead = clearance.apart(herd, character, state, blend, ahead, wall)
    ahead = wall(_kept, aims, ahead, state, at)
    legs = wall(lambda *now: _legs(control, *now), character, state, blend, cycle, taken, behind, ahead)
    goal = wall(lambda aims, aim, at, goal: jnp.where(aims, aim + at, goal), aims, aim, at, state.gait.goal)
    changes = dict(
        from_position=behind.position, from_yaw=behind.yaw, from_normal=behind.normal,
        from_foot=behind.foot,
        to_position=ahead.position, to_yaw=ahead.yaw, to_normal=ahead.normal, to_foot=ahead.foot,
        goal=goal, designated=cycle.designated, **legs,
    )  # fmt: skip
    return dataclasses.replace(state, gait=dataclasses.replace(state.gait, **changes))


def relative(state: State) -> tuple[Footprint, Footprint]:
    """The prints behind and ahead of every leg, relative to the character's position."""
    own: Strides = state.gait
    at = state.position[:, None]
    return (
        Footprint(own.from_position - at, own.from_yaw, own.from_normal, own.from_foot),
        Footprint(own.to_position - at, own.to_yaw, own.to_normal, own.to_foot),
    )


def yaw_due(character: Character, state: State) -> Array:
    """[n] rad, where the body's yaw goes: to the heading asked for, less what it stays behind one that turns evenly."""
    late = character.yaw_damping / jnp.maximum(character.yaw_gain, 1e-3)
    return state.facing - state.gait.facing_rate * late


def _predicted(
    layout: Layout,
    character: Character,
    control: StrideControl,
    state: State,
    blend: Blend,
    cycle: Cycle,
    cycle_s: Array,
) -> tuple[Array, Array]:
    """Where the heel ends [3, L, n] will stand, relative to the position, and the feet's yaw [L, n] (4.4).

    The original extrapolates the smoothed yaw rate. Control knows more: the heading asked for and how that turns, so a
    sudden turn is stepped into at once, and none is stepped past its end.
    """
    own: Strides = state.gait
    left = (1.0 - cycle.designated) * cycle_s
    velocity = state.velocity[:, None]
    if layout.compat:
        angle = own.turn * left
        way = footprint.swept_one_sided(velocity, own.turn, left, cycle_s)
    else:
        most = character.turn_rate * left
        angle = controllers.wrap(yaw_due(character, state) - state.yaw) + own.facing_rate * left
        angle = jnp.clip(angle, -most, most)
        way = footprint.swept(velocity, angle, left)
    wanted = state.yaw + angle
    flown = leg_cycle.ilerp(blend.keys.liftoff, blend.keys.strike, cycle.time)
    seek = jnp.maximum(3.0 * jnp.abs(own.turn), control.most_turn / control.longest_cycle)
    most = seek * layout.dt / jnp.maximum(flown, 1e-3)
    yaw = jnp.where(cycle.time <= blend.keys.liftoff, wanted, footprint.turned_towards(own.to_yaw, wanted, most))
    place = about(blend.stance, yaw)
    return jnp.stack([place[0] + way[0], jnp.zeros_like(way[0]), place[2] + way[1]]), yaw


def _handed_on(state: State, cycle: Cycle) -> tuple[Array, Footprint, Footprint]:
    """Where a step begins: bool [L, n], and the prints behind and ahead in the world: ahead has become behind."""
    own: Strides = state.gait
    taken = cycle.begins & ~own.parked
    behind = Footprint(
        jnp.where(taken, own.to_position, own.from_position),
        jnp.where(taken, own.to_yaw, own.from_yaw),
        jnp.where(taken, own.to_normal, own.from_normal),
        jnp.where(taken, own.to_foot, own.from_foot),
    )
    return taken, behind, Footprint(own.to_position, own.to_yaw, own.to_normal, own.to_foot)


def _seek(assets: StrideAssets, character: Character, own: Strides) -> Array:
    """[L, n] m/s, how fast a print follows its prediction."""
    x, y, z = own.before
    speed = jnp.sqrt(x * x + y * y + z * z + TINY)
    ax, ay, az = own.acceleration
    rush = jnp.sqrt(ax * ax + ay * ay + az * az + TINY)
    return jnp.maximum(3.0 * speed + 0.1 * rush, SEEK_FEET * assets.length * character.scale)


def _of_goal(fresh: Array, print_: Footprint, ahead: Footprint, position: Array) -> Footprint:
    """Yaw, normal and foot are those of the goal, so that a print that has arrived lies on its own ground."""
    chosen = (jnp.where(fresh, new, old) for new, old in zip(print_[1:], ahead[1:], strict=True))
    return Footprint(position, *chosen)


def _kept(aims: Array, ahead: Footprint, state: State, at: Array) -> Footprint:
    """The print ahead in the world: as it was, to the last bit, once the foot has landed on it."""
    own: Strides = state.gait
    return Footprint(
        jnp.where(aims, ahead.position + at, own.to_position),
        jnp.where(aims, ahead.yaw, own.to_yaw),
        jnp.where(aims, ahead.normal, own.to_normal),
        jnp.where(aims, ahead.foot, own.to_foot),
    )


def _legs(
    control: StrideControl,
    character: Character,
    state: State,
    blend: Blend,
    cycle: Cycle,
    taken: Array,
    behind: Footprint,
    ahead: Footprint,
) -> dict[str, Array]:
    """Own times, parked legs, foot phases and step counts."""
    own: Strides = state.gait
    way = ahead.position - behind.position
    distance = jnp.sqrt(way[0] * way[0] + way[2] * way[2] + TINY)
    turn = jnp.abs(controllers.wrap(ahead.yaw - behind.yaw))
    parked, time = leg_cycle.parking(
        cycle, own.parked, distance, turn, control.least_step * character.scale, 0.5 * control.most_turn,
        blend.keys.strike,
    )  # fmt: skip
    phase = leg_cycle.foot_phase(own.phase, time, blend.keys)
    return dict(time=time, parked=parked, phase=phase, steps=own.steps + taken.astype(jnp.int32))
