"""Steer: the velocity and heading asked for, from constant velocities, way-points and events."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
from jax import Array

from crowd.assets import HerdAssets
from crowd.layout import HerdLayout, Layout
from crowd.params import Character, Events, Params
from crowd.state import State
from kernels import controllers

ARRIVAL = 0.3  # m: a way-point counts as reached


def steer(
    layout: Layout, herd: HerdLayout, assets: HerdAssets, params: Params, character: Character, state: State
) -> dict[str, Array]:
    """`desired`, `waypoint`, `facing`, `heading` and `follows` of this frame: fields of the state."""
    if layout.turns:
        state = _turned(params.events, character, state)
    if herd.waypoints:
        state = _towards_waypoint(herd, assets, character, state)
    speed2 = state.desired[0] ** 2 + state.desired[1] ** 2
    asked = jnp.where(speed2 > 1e-4, jnp.arctan2(state.desired[0], jnp.where(speed2 > 1e-4, state.desired[1], 1.0)), 0)
    facing = jnp.where(state.follows & (speed2 > 1e-4), asked, state.facing)
    error = controllers.wrap(facing - state.heading)
    most = params.control.turn_rate * layout.dt
    heading = state.heading + jnp.clip(error, -most, most)
    return dict(desired=state.desired, waypoint=state.waypoint, follows=state.follows, facing=facing, heading=heading)


def heading_velocity(state: State) -> Array:
    """Desired velocity [2, n] for the body: along the heading while still turning towards it."""
    error = state.facing - state.heading
    cos, sin = jnp.cos(error), jnp.sin(error)
    x, z = state.desired
    # turned back by the error so that the character walks the way it faces, slower the more it has to turn
    slow = jnp.clip(cos, 0.2, 1.0)
    turned = jnp.stack([x * cos - z * sin, z * cos + x * sin]) * slow
    return jnp.where(state.follows, turned, state.desired)


def _turned(events: Events, character: Character, state: State) -> State:
    """Velocity events of this frame; they end a walk along way-points and make the heading follow."""
    sin, cos = jnp.sin(state.heading), jnp.cos(state.heading)
    desired, waypoint, follows = state.desired, state.waypoint, state.follows
    for event in range(events.turn_frame.shape[0]):
        now = (events.turn_frame[event] == state.frame) & (character.turn[event] > 0)
        x, z = events.turn[event, 0], events.turn[event, 1]
        local = jnp.stack([x * cos + z * sin, z * cos - x * sin])
        world = jnp.stack([x + 0 * sin, z + 0 * sin])
        value = jnp.where(events.turn_local[event] > 0, local, world) * character.speed
        desired = jnp.where(now, value, desired)
        waypoint = jnp.where(now, -1, waypoint)
        follows = follows | now
    return dataclasses.replace(state, desired=desired, waypoint=waypoint, follows=follows)


def _towards_waypoint(herd: HerdLayout, assets: HerdAssets, character: Character, state: State) -> State:
    """Desired velocity towards the next way-point; the one after it once that is near; stand at the last."""
    active = state.waypoint >= 0
    index = jnp.clip(state.waypoint, 0, herd.waypoints - 1)
    goal = assets.waypoints[:, index, 0] + character.offset
    way = goal - state.position[jnp.array([0, 2])]
    distance = jnp.sqrt(way[0] ** 2 + way[1] ** 2 + 1e-12)
    near = active & (distance < ARRIVAL)
    following = index + 1
    if herd.loop:
        following = jnp.where(following >= herd.waypoints, 0, following)
        last = jnp.zeros_like(near)
    else:
        last = following >= herd.waypoints
    speed = character.way_speed * jnp.where(last, jnp.clip(distance, 0.0, 1.0), 1.0)
    desired = jnp.where(near & last, 0.0, way / distance * speed)
    return dataclasses.replace(
        state,
        desired=jnp.where(active, desired, state.desired),
        waypoint=jnp.where(near & ~last, following, state.waypoint),
    )
