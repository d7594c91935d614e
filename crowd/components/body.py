"""Body: the abstract rigid body under its velocity and orientation controllers (Eq. 1 and 2)."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
from jax import Array

from crowd.components.forces import Wrench
from crowd.components.sense import Surroundings
from crowd.components.steer import heading_velocity
from crowd.layout import Layout
from crowd.params import Character, Params
from crowd.state import FAULT_BODY, State
from kernels import controllers


def body(
    layout: Layout, params: Params, character: Character, state: State, wrench: Wrench, place: Surroundings
) -> State:
    """Position, velocity, yaw and pitch after the frame. Gains differ along and across the heading.

    A character whose body would stop being finite keeps its last valid state, and its fault bit.
    """
    dt = layout.dt
    ok = state.fault == 0
    sin, cos = jnp.sin(state.heading), jnp.cos(state.heading)

    def to_heading(v: Array) -> tuple[Array, Array]:
        return v[0] * sin + v[1] * cos, v[0] * cos - v[1] * sin

    def to_world(ahead: Array, left: Array) -> Array:
        return jnp.stack([ahead * sin + left * cos, ahead * cos - left * sin])

    velocity, desired = to_heading(state.velocity), to_heading(heading_velocity(state))
    force = to_heading(wrench.force)
    moved = [
        controllers.velocity(
            velocity[axis],
            desired[axis],
            force[axis],
            wrench.force_slope,
            character.mass,
            gain,
            character.damping,
            dt,
        )
        for axis, gain in enumerate((character.gain_forward, character.gain_side))
    ]
    new_velocity = to_world(moved[0][0], moved[1][0])
    way = to_world(moved[0][1], moved[1][1])
    yaw_goal = state.yaw + controllers.wrap(state.heading - state.yaw)
    yaw, yaw_rate = controllers.orientation(
        state.yaw,
        state.yaw_rate,
        yaw_goal,
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
        jnp.zeros_like(state.pitch),
        wrench.torque[1],
        wrench.torque_slope[1],
        character.pitch_inertia,
        character.pitch_gain,
        character.pitch_damping,
        dt,
    )
    lag = dt / (dt + params.control.ground_time)
    height = state.position[1] + (place.ground - state.position[1]) * lag
    follow = dt / (dt + params.control.filter_time)
    new = dict(
        position=jnp.stack([state.position[0] + way[0], height, state.position[2] + way[1]]),
        velocity=new_velocity,
        smoothed=state.smoothed + (new_velocity - state.smoothed) * follow,
        yaw=yaw,
        yaw_rate=yaw_rate,
        pitch=pitch,
        pitch_rate=pitch_rate,
    )
    check = new["position"].sum(0) + new_velocity.sum(0) + yaw + yaw_rate + pitch + pitch_rate + state.heading
    finite = jnp.isfinite(check)
    kept = {name: jnp.where(ok & finite, value, getattr(state, name)) for name, value in new.items()}
    return dataclasses.replace(state, **kept, fault=state.fault | jnp.where(finite, 0, FAULT_BODY))
