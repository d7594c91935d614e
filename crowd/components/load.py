"""Load: a character with what it carries. Absent from the program of a herd without a load."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
from jax import Array

from crowd.params import Character, Events
from kernels import carrying
from kernels.vec import TINY

HANDLING = 0.5  # s that picking up and putting down take


def laden(dt: float | Array, events: Events, character: Character, frame: Array) -> Character:
    """The character with the mass and inertia of its load in this frame, and a load of as much as is carried then.

    Inertia grows by m (ahead^2 + above^2) in pitch and m ahead^2 in yaw, about the hips (parallel axis). The weight on
    the feet is a share of both weights; the load is taken to stay above the surface.
    """
    load = character.responses.load
    assert load is not None
    mass = load.mass * _carried(dt, events, load.starts, load.event, frame)
    far = load.ahead * load.ahead
    share = 1.0 + mass / character.mass
    return dataclasses.replace(
        character,
        mass=character.mass + mass,
        yaw_inertia=character.yaw_inertia + mass * far,
        pitch_inertia=character.pitch_inertia + mass * (far + load.above * load.above),
        displaced=None if character.displaced is None else character.displaced * share,
        responses=dataclasses.replace(character.responses, load=dataclasses.replace(load, mass=mass)),
    )


def _carried(dt: float | Array, events: Events, starts: Array, meets: Array, frame: Array) -> Array:
    """[n] share of the load that is carried; events change it within HANDLING."""
    share = starts
    if events.loads is not None:
        for event in range(events.loads.frame.shape[0]):
            since = (frame - events.loads.frame[event]).astype(starts.dtype) * dt
            done = jnp.clip(since / HANDLING, 0.0, 1.0) * meets[event]
            share = share + (events.loads.carried[event] - share) * done
    return share


def torque(character: Character, pitch: Array) -> Array:
    """[n] N m, pitch torque of a laden character's load."""
    load = character.responses.load
    assert load is not None
    return carrying.torque(load.mass, load.ahead, load.above, pitch)


def posture(character: Character) -> Array:
    """[n] rad, the pitch that a laden character's controller asks for.

    On two legs it ends, under the load's torque, at the lean that balances trunk and load; on more it stays upright and
    the load tips it by torque over gain.
    """
    load = character.responses.load
    if load is None:
        return jnp.zeros_like(character.mass)
    lean = carrying.balanced(load.mass, load.ahead, load.above, load.trunk)
    held = lean - carrying.torque(load.mass, load.ahead, load.above, lean) / character.pitch_gain
    return jnp.where(load.balances > 0, held, 0.0)


def slowed(character: Character, asked: Array) -> Array:
    """[n] share of speeds [n] m/s asked for that a laden character walks at."""
    load = character.responses.load
    if load is None:
        return jnp.ones_like(asked)
    speed = jnp.sqrt(asked * asked + TINY)
    return carrying.slowed(speed, character.mass - load.mass, load.mass, load.size) / speed
