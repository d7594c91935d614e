"""Guide: the velocity that leads to the next way-point, along a path's curve, or along a recorded trajectory."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
from jax import Array

from crowd.assets import HerdAssets
from crowd.layout import HerdLayout
from crowd.params import Character
from crowd.state import State
from kernels import steering
from kernels.trig import sin_cos
from kernels.vec import TINY

ARRIVAL = 0.3  # m: a way-point counts as reached
AT_END = 0.02  # m before the end of an open path: arrived
CATCH_UP = 3.0  # times the walking speed: how fast the place on a path may run ahead after a push
BRAKES = 1.0  # m/s2, towards the end of a path, unless the limits say less
LEAST_LATE = 0.05  # m, way in which the direction of walking comes round to the one asked for
PREVIEW = 0.5  # of that way: how far ahead the curve's direction is read
PULL = 1.0  # 1/s, towards the trajectory's place
MOST_PULL = 1.0  # m/s


def towards_waypoint(herd: HerdLayout, assets: HerdAssets, character: Character, state: State) -> State:
    """Desired velocity towards the next way-point; the one after it once that is near; stand at the last."""
    active = state.waypoint >= 0
    index = jnp.clip(state.waypoint, 0, herd.waypoints - 1)
    goal = assets.waypoints[:, index, 0] + character.offset
    way = goal - state.position[::2]
    distance = jnp.sqrt(way[0] ** 2 + way[1] ** 2 + TINY)
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


def along_path(dt: float | Array, herd: HerdLayout, assets: HerdAssets, character: Character, state: State) -> State:
    """Desired velocity along the curve and back to it, turned as much earlier as the body's direction is late.

    The way done grows with the character's own way along the curve's tangent, so one that is held back or pushed
    aside goes on from where it is.
    """
    active = state.waypoint >= 0
    place = jnp.stack([state.position[0], state.position[2]]) - character.offset
    point, tangent = _on_curve(herd, assets, state.along)
    ahead = (place[0] - point[0]) * tangent[0] + (place[1] - point[1]) * tangent[1]
    along = state.along + jnp.clip(ahead, 0.0, CATCH_UP * dt * character.way_speed)
    here, direction = _on_curve(herd, assets, along)
    speed, end = jnp.minimum(character.way_speed, here[2]), jnp.zeros_like(active)
    late = jnp.maximum(speed * _side_response(character, state), LEAST_LATE)
    there, soon = _on_curve(herd, assets, along + PREVIEW * late)
    speed = jnp.minimum(speed, there[2])
    if herd.closed:
        along = jnp.where(along >= assets.path_length, along - assets.path_length, along)
    else:
        along = jnp.minimum(along, assets.path_length)
        rest = assets.path_length - along
        end = rest < AT_END
        brakes = jnp.minimum(BRAKES, character.deceleration)
        speed = jnp.minimum(speed, steering.braking(rest, brakes, 3.0 * _response(character)))
    way = steering.pursuit(direction, soon, here[:2] - place, late, PREVIEW)
    desired = jnp.where(end, 0.0, way * speed)
    return dataclasses.replace(
        state,
        desired=jnp.where(active, desired, state.desired),
        along=jnp.where(active, along, state.along),
    )


def on_track(tick: float | Array, dt: float | Array, assets: HerdAssets, character: Character, state: State) -> State:
    """Desired velocity and facing of the trajectory: its velocity, as much earlier as the body is late, and a pull.

    Before the first and after the last sample the velocity is zero; the pull brings characters to that place.
    tick, dt: s, of a frame and of this step.
    """
    active = state.waypoint >= 0
    time = state.frame.astype(jnp.float32) * tick
    now = steering.between(character.track, time * assets.track_rate)
    soon = steering.between(character.track, (time + 0.5 * dt + _response(character)) * assets.track_rate)
    x, z = now[0] - state.position[0], now[1] - state.position[2]
    pull = PULL * jnp.minimum(1.0, MOST_PULL / (PULL * jnp.sqrt(x * x + z * z + TINY)))
    desired = jnp.stack([soon[2] + pull * x, soon[3] + pull * z])
    return dataclasses.replace(
        state,
        desired=jnp.where(active, desired, state.desired),
        facing=jnp.where(active & state.looks, now[4], state.facing),
    )


def _on_curve(herd: HerdLayout, assets: HerdAssets, along: Array) -> tuple[Array, Array]:
    """Place and most speed [3, n], and unit tangent [2, n], at arc lengths [n]; a closed curve begins again."""
    if herd.closed:
        along = along - assets.path_length * jnp.floor(along / assets.path_length)
    last = assets.path.shape[1] - 1
    at = along / assets.path_length * last
    point = steering.between(assets.path, at)
    low = jnp.clip(at.astype(jnp.int32), 0, last - 1)
    way = assets.path[:2, low + 1, 0] - assets.path[:2, low, 0]
    return point, way / jnp.sqrt(way[0] ** 2 + way[1] ** 2 + TINY)


def _response(character: Character) -> Array:
    """[n] s, time constant with which the body follows along its heading."""
    return (character.mass + character.damping) / character.gain_forward


def _side_response(character: Character, state: State) -> Array:
    """[n] s, the same at right angles to the way it was last asked to walk."""
    x, z = state.desired
    heading = jnp.stack(sin_cos(state.heading))
    square = x * x + z * z + 1e-6
    across = (x * heading[1] - z * heading[0]) ** 2 / square
    return steering.response_time(
        character.mass + character.damping, character.gain_forward, character.gain_side, across
    )
