"""Steer: the velocity and heading asked for, and the command that follows them within limits per second."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
from jax import Array

from crowd.assets import HerdAssets
from crowd.components import effort, guide
from crowd.layout import HerdLayout, Layout
from crowd.params import Character, Events, Params
from crowd.state import State
from kernels import controllers, steering
from kernels.trig import arctan2, sin_cos
from kernels.wall import Wall

STANDS = 1e-4  # m2/s2: a squared speed too low to have a direction


def steer(
    layout: Layout,
    herd: HerdLayout,
    assets: HerdAssets,
    params: Params,
    character: Character,
    state: State,
    wall: Wall,
) -> tuple[State, Array]:
    """The state with what this frame asks for and commands, and the course [2, n]: the velocity the body follows.

    The course is the command's mean over the frame, turned to the heading where that follows the way one walks.
    """
    asked = wall(lambda c, s: _asked(layout, herd, assets, params, c, s), character, state)
    state = dataclasses.replace(state, **asked)
    command, mean = wall(lambda c, s: _commanded(layout.dt, herd, assets, c, s), character, state)
    state = dataclasses.replace(state, command=command)
    turned, course = wall(lambda c, s, m: _turned(layout.dt, herd, assets, c, s, m), character, state, mean)
    return dataclasses.replace(state, **turned), course


def _asked(
    layout: Layout, herd: HerdLayout, assets: HerdAssets, params: Params, character: Character, state: State
) -> dict[str, Array]:
    """Events first; what still has a way to go is guided along it."""
    if layout.turns:
        state = _events(params.events, herd, character, state)
    if herd.waypoints:
        state = guide.towards_waypoint(herd, assets, character, state)
    if herd.path:
        state = guide.along_path(layout.dt, herd, assets, character, state)
    if herd.track:
        state = guide.on_track(layout.frame_s, layout.dt, assets, character, state)
    names = ("desired", "waypoint", "along", "follows", "looks", "facing")
    return {name: getattr(state, name) for name in names}


def _commanded(
    dt: float | Array, herd: HerdLayout, assets: HerdAssets, character: Character, state: State
) -> tuple[Array, Array]:
    """[2, n] m/s: the command at the end of the frame, and its mean over it. Load and effort may leave less to it."""
    wanted = state.desired
    if {"load", "transitions"} & set(herd.responses):
        wanted = wanted * effort.left(assets, character, state)
    if not herd.limits:
        return wanted, wanted
    return steering.approach(state.command, wanted, character.acceleration, character.deceleration, dt)


def _turned(
    dt: float | Array, herd: HerdLayout, assets: HerdAssets, character: Character, state: State, mean: Array
) -> tuple[dict[str, Array], Array]:
    """Facing and heading after the frame, and the course."""
    x, z = state.command
    moves = x * x + z * z > STANDS
    facing = jnp.where(state.follows & moves, arctan2(x, z), state.facing)
    if herd.faces == "point":
        facing = jnp.where(state.looks, _towards(assets.look_at[:, None], state), facing)
    most = character.turn_rate * dt
    heading = state.heading + jnp.clip(controllers.wrap(facing - state.heading), -most, most)
    return dict(facing=facing, heading=heading), _course(state.follows, facing - heading, mean)


def _towards(point: Array, state: State) -> Array:
    """[n] rad, direction of a point; on the point itself the facing stays."""
    x, z = point[0] - state.position[0], point[1] - state.position[2]
    off = x * x + z * z > 1e-6
    return jnp.where(off, arctan2(x, z), state.facing)


def _course(follows: Array, error: Array, mean: Array) -> Array:
    """[2, n] m/s: along the heading while still turning towards the command, slower the more there is to turn."""
    sin, cos = sin_cos(error)
    x, z = mean
    turned = jnp.stack([x * cos - z * sin, z * cos + x * sin]) * jnp.clip(cos, 0.2, 1.0)
    return jnp.where(follows, turned, mean)


def _events(events: Events, herd: HerdLayout, character: Character, state: State) -> State:
    """Velocity events of this frame; they end a walk along way-points, a path or a trajectory.

    Characters face where the event says; without, the herd's `facing` holds again.
    """
    sin, cos = sin_cos(state.heading)
    desired, waypoint, follows, looks, facing = (
        getattr(state, name) for name in ("desired", "waypoint", "follows", "looks", "facing")
    )
    for event in range(events.turn_frame.shape[0]):
        now = (events.turn_frame[event] == state.frame) & (character.turn[event] > 0)
        own = events.turn_local[event] > 0
        x, z = events.turn[event, 0], events.turn[event, 1]
        local = jnp.stack([x * cos + z * sin, z * cos - x * sin])
        world = jnp.stack([x + 0 * sin, z + 0 * sin])
        desired = jnp.where(now, jnp.where(own, local, world) * character.speed, desired)
        waypoint = jnp.where(now, -1, waypoint)
        faces = events.turn_faces[event] > 0
        facing = jnp.where(now & faces, events.turn_facing[event] + jnp.where(own, state.heading, 0.0), facing)
        follows = jnp.where(now, ~faces & (herd.faces in ("along", "track")), follows)
        looks = jnp.where(now, ~faces & (herd.faces == "point"), looks)
    return dataclasses.replace(state, desired=desired, waypoint=waypoint, follows=follows, looks=looks, facing=facing)
