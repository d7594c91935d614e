"""Effort: who is held back too much gives up jogging, then walking. Absent from the program unless asked for."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
from jax import Array

from crowd.assets import HerdAssets
from crowd.components import load
from crowd.components.sense import Surroundings
from crowd.params import Character
from crowd.state import Responded, State
from kernels import controllers, effort
from kernels.fluid import REFERENCE_AREA
from kernels.vec import TINY

SHALLOW = 0.1  # of the body's height: fluid less deep than this tells nothing of how wide one is
SLOW = 0.1  # of the height per second: nor does moving less fast than this through it
WIDEST = 1.5  # of the height: more is an impact, not a width


def responded(dt: float | Array, assets: HerdAssets, character: Character, state: State, place: Surroundings) -> State:
    """The state with width, gear and time of rest after the frame, from the drag of the frame before."""
    own, past = character.responses.transitions, state.responded
    assert own is not None and past.width is not None and past.gear is not None and past.rested is not None
    depth = jnp.clip(place.fluid.surface - place.ground, 0.0, own.height)
    x, z = state.velocity[0] - place.fluid.flow[0], state.velocity[1] - place.fluid.flow[2]
    speed = jnp.sqrt(x * x + z * z + TINY)
    resistance = -(state.force[0] * x + state.force[2] * z) / speed
    felt = effort.pressure(speed, place.fluid.density_drag, place.fluid.offset_force) * depth
    rests = past.gear == effort.RESTS
    tells = (depth > SHALLOW * own.height) & (speed > SLOW * own.height) & ~rests
    now = jnp.clip(resistance / jnp.where(tells, felt, 1.0), 0.0, WIDEST * own.height)
    rested = jnp.where(rests, past.rested + dt, 0.0)
    width = past.width + jnp.where(tells, (now - past.width) * controllers.low_pass(dt, own.react_time), 0.0)
    width = jnp.where(rested > own.rest_time, 0.0, width)  # who has rested tries as if nothing had been felt
    past = dataclasses.replace(past, width=width, rested=rested)
    gear = _gear(assets, character, past, state, place, depth)
    return dataclasses.replace(state, responded=dataclasses.replace(past, gear=gear))


def _gear(
    assets: HerdAssets, character: Character, past: Responded, state: State, place: Surroundings, depth: Array
) -> Array:
    """[n] gear after the frame."""
    own = character.responses.transitions
    assert own is not None and past.width is not None and past.gear is not None
    x, z = state.desired
    asked = jnp.sqrt(x * x + z * z + TINY)
    asked = asked * load.slowed(character, asked)
    walks = walking(assets, character)
    towards = -(place.fluid.flow[0] * x + place.fluid.flow[2] * z) / jnp.sqrt(x * x + z * z + TINY)
    area = past.width * depth
    quadratic, offset = area * place.fluid.density_drag, area * place.fluid.offset_force / REFERENCE_AREA
    jogged, walked = (
        effort.attainable(speed, towards, quadratic, offset, character.gain_forward)
        for speed in (asked, jnp.minimum(asked, walks))
    )
    return effort.gear(past.gear, jogged, walked, asked, walks, own.walk_below, own.stop_below, own.hysteresis)


def walking(assets: HerdAssets, character: Character) -> Array:
    """[n] m/s, the slowest clip's own speed at the character's size."""
    return assets.speed[0] * jnp.sqrt(character.scale)


def left(assets: HerdAssets, character: Character, state: State) -> Array:
    """[n] share of the desired velocity that is commanded, under load and in the present gear."""
    x, z = state.desired
    asked = jnp.sqrt(x * x + z * z + TINY)
    share = load.slowed(character, asked)
    gear = state.responded.gear
    if gear is None:
        return share
    walk = jnp.minimum(share, walking(assets, character) / asked)
    return jnp.where(gear == effort.RESTS, 0.0, jnp.where(gear == effort.WALKS, walk, share))
