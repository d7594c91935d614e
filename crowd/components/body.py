"""Body: the abstract rigid body under its velocity and orientation controllers (Eq. 1 and 2)."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
from jax import Array

from crowd.components.forces import Wrench
from crowd.components.load import posture
from crowd.components.sense import Surroundings
from crowd.layout import Layout
from crowd.params import Character, Params
from crowd.state import FAULT_BODY, State
from kernels import controllers
from kernels.trig import sin_cos
from kernels.wall import Wall


def body(
    layout: Layout,
    params: Params,
    character: Character,
    state: State,
    course: Array,
    wrench: Wrench,
    place: Surroundings,
    wall: Wall,
) -> State:
    """Position, velocity, yaw and pitch after the frame. Gains differ along and across the heading.

    course: [2, n] m/s, world (x, z), the velocity to follow: see `steer`.

    A character whose body would stop being finite keeps its last valid state, and its fault bit.
    """
    moved = wall(lambda c, s, v, w: _moved(layout.dt, c, s, v, w), character, state, course, wrench)
    turned = wall(lambda c, s, w: _turned(layout.dt, c, s, w), character, state, wrench)
    new = wall(lambda s, m, t, p: _entered(layout.dt, params, s, m, t, p), state, moved, turned, place)
    return dataclasses.replace(state, **wall(_kept, state, new))


def _moved(dt: float | Array, character: Character, state: State, course: Array, wrench: Wrench) -> Array:
    """[4, n]: velocity (x, z) after the frame and the way (x, z) meanwhile, from the controllers along both axes."""
    sin, cos = sin_cos(state.heading)

    def to_heading(v: Array) -> tuple[Array, Array]:
        return v[0] * sin + v[1] * cos, v[0] * cos - v[1] * sin

    velocity, desired = to_heading(state.velocity), to_heading(course)
    force = to_heading(wrench.force)
    mass, damping, slope = character.mass, character.damping, wrench.force_slope
    (ahead, way_ahead), (left, way_left) = (
        controllers.velocity(velocity[axis], desired[axis], force[axis], slope, mass, gain, damping, dt)
        for axis, gain in enumerate((character.gain_forward, character.gain_side))
    )
    return jnp.stack(
        [
            ahead * sin + left * cos,
            ahead * cos - left * sin,
            way_ahead * sin + way_left * cos,
            way_ahead * cos - way_left * sin,
        ]
    )


def _turned(dt: float | Array, character: Character, state: State, wrench: Wrench) -> Array:
    """[4, n]: yaw, its rate, pitch and its rate after the frame."""
    yaw, yaw_rate = controllers.orientation(
        state.yaw,
        state.yaw_rate,
        state.yaw + controllers.wrap(state.heading - state.yaw),
        wrench.torque[0],
        wrench.torque_slope[0],
        character.yaw_inertia,
        character.yaw_gain,
        character.yaw_damping,
        dt,
    )
    pitch, pitch_rate = controllers.orientation(
        state.pitch,
        state.pitch_rate,
        posture(character),
        wrench.torque[1],
        wrench.torque_slope[1],
        character.pitch_inertia,
        character.pitch_gain,
        character.pitch_damping,
        dt,
    )
    return jnp.stack([yaw, yaw_rate, pitch, pitch_rate])


def _entered(
    dt: float | Array, params: Params, state: State, moved: Array, turned: Array, place: Surroundings
) -> dict[str, Array]:
    """Fields of the state that move, and the ground height and velocity that follow them slowly."""
    velocity, way = moved[:2], moved[2:]
    height = state.position[1] + (place.ground - state.position[1]) * controllers.low_pass(
        dt, params.control.ground_time
    )
    return dict(
        position=jnp.stack([state.position[0] + way[0], height, state.position[2] + way[1]]),
        velocity=velocity,
        yaw=turned[0],
        yaw_rate=turned[1],
        pitch=turned[2],
        pitch_rate=turned[3],
    )


def _kept(old: State, new: dict[str, Array]) -> dict[str, Array]:
    """The new fields where they are finite and nothing was wrong before; elsewhere the old ones and the fault bit."""
    total = new["position"].sum(0) + new["velocity"].sum(0) + old.heading
    finite = jnp.isfinite(total + new["yaw"] + new["yaw_rate"] + new["pitch"] + new["pitch_rate"])
    use = finite & (old.fault == 0)
    kept = {name: jnp.where(use, value, getattr(old, name)) for name, value in new.items()}
    return kept | {"fault": old.fault | jnp.where(finite, 0, FAULT_BODY)}
