"""Forces: what disturbs the abstract body. Each is an order-free contribution; the step sums those of the scenario."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from crowd.components import load as loads
from crowd.components.sense import Surroundings
from crowd.layout import Layout
from crowd.params import Character, Params
from crowd.state import State
from kernels.rain import impulses
from kernels.trig import sin_cos

GRAVITY = 9.81  # m/s2


class Wrench(NamedTuple):
    """Force in the ground plane and torque about yaw and pitch, with how fast they fall as the body yields to them."""

    force: Array  # [2, n] N, world (x, z)
    torque: Array  # [2, n] N m, (yaw, pitch)
    force_slope: Array  # [n] N s/m, >= 0
    torque_slope: Array  # [2, n] N m s, >= 0


def drag(layout: Layout, params: Params, character: Character, state: State, place: Surroundings) -> Wrench:
    """Fluid drag on the mesh as of the frame before (Eq. 6 and 7), with its slope for the semi-implicit step."""
    del layout, params, character, place
    return Wrench(state.force[::2], state.torque, state.drag_slope[0], state.drag_slope[1:])


def impulse(layout: Layout, params: Params, character: Character, state: State, place: Surroundings) -> Wrench:
    """Impulses of this frame, spread over it."""
    del place
    events = params.events
    sin, cos = sin_cos(state.yaw)
    total = jnp.zeros_like(state.velocity)
    for event in range(events.impulse_frame.shape[0]):
        now = jnp.where(events.impulse_frame[event] == state.frame, character.impulse[event], 0.0) / layout.dt
        x, z = events.impulse[event, 0], events.impulse[event, 2]
        local = jnp.stack([x * cos + z * sin, z * cos - x * sin])
        world = jnp.stack([x + 0 * sin, z + 0 * sin])
        total = total + jnp.where(events.impulse_local[event] > 0, local, world) * now
    return _plain(total)


def rain(layout: Layout, params: Params, character: Character, state: State, place: Surroundings) -> Wrench:
    """Random impulses of this frame, spread over it."""
    del place
    showers = params.events.rain
    assert showers is not None and character.number is not None and character.rain is not None
    total = jnp.zeros_like(state.velocity)
    for k in range(showers.rate.shape[0]):
        drop = impulses(showers.key[k], character.number, state.frame, showers.rate[k], showers.size[k], layout.dt)
        now = (state.frame >= showers.span[0, k]) & (state.frame < showers.span[1, k])
        total = total + jnp.where(now, character.rain[k], 0.0) * drop / layout.dt
    return _plain(total)


def slope(layout: Layout, params: Params, character: Character, state: State, place: Surroundings) -> Wrench:
    """Gravity's pull along the ground, m g grad(h) / (1 + |grad h|^2), as far as walking does not compensate it."""
    del layout, state
    steepness = 1.0 + place.slope[0] ** 2 + place.slope[1] ** 2
    return _plain(-place.slope * (params.control.slope_gain * GRAVITY * character.mass / steepness))


def load(layout: Layout, params: Params, character: Character, state: State, place: Surroundings) -> Wrench:
    """Weight of what is carried, about the hips: a torque in pitch. What it slows down is in what is commanded."""
    del layout, params, place
    none = _plain(jnp.zeros_like(state.velocity))
    if character.responses.load is None:  # another herd's
        return none
    return none._replace(torque=jnp.stack([jnp.zeros_like(state.pitch), loads.torque(character, state.pitch)]))


def _plain(force: Array) -> Wrench:
    zero = jnp.zeros_like(force[0])
    return Wrench(force, jnp.zeros_like(force), zero, jnp.zeros_like(force))


Force = Callable[[Layout, Params, Character, State, Surroundings], Wrench]
FORCES: dict[str, Force] = {"drag": drag, "impulse": impulse, "load": load, "rain": rain, "slope": slope}


def total(layout: Layout, params: Params, character: Character, state: State, place: Surroundings) -> Wrench:
    """Sum over the scenario's forces."""
    sum_ = _plain(jnp.zeros_like(state.velocity))
    for name in layout.forces:
        one = FORCES[name](layout, params, character, state, place)
        sum_ = Wrench(*(a + b for a, b in zip(sum_, one, strict=True)))
    return sum_
