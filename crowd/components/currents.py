"""Currents: fluid whose surface or flow differs within a body or with time. Absent from the program without any."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from crowd.layout import Layout
from crowd.params import Fluids
from kernels import river, turbulence, waves
from kernels.river import River
from kernels.wall import Wall


class Here(NamedTuple):
    """The fluid region of a character."""

    region: Array  # [n] its number, -1 for none
    still: Array  # [n] m, height of its level surface in the world; -inf for none
    ground: Array  # [n] m, of the ground under it


def region(layout: Layout, fluids: Fluids, place: Array, ground: Array) -> Here:
    """The last region that holds each of the world places [2, n]."""
    x, z = place
    found, still = jnp.full_like(x, -1.0), jnp.full_like(x, -jnp.inf)
    for number in range(layout.regions):
        low, high = fluids.low[:, number], fluids.high[:, number]
        inside = (x >= low[0]) & (x <= high[0]) & (z >= low[1]) & (z <= high[1])
        found, still = jnp.where(inside, number, found), jnp.where(inside, fluids.surface[number], still)
    return Here(found, still, ground)


def seconds(layout: Layout, frame: Array) -> Array:
    """Time in s at the end of a frame, or of the frames that a step takes: what it records."""
    if layout.tick:
        return frame.astype(jnp.float32) * layout.tick + layout.dt
    return (frame + 1).astype(jnp.float32) * layout.dt


def rise(layout: Layout, fluids: Fluids, here: Here, place: Array, time: Array) -> Array:
    """[n] m, of the surface above the still level at world places [2, n]."""
    if fluids.trains is None:
        return jnp.zeros_like(time)
    return waves.rise(_amplitude(fluids, here), waves.phases(fluids.trains.waves, place, time))


def field(
    layout: Layout, fluids: Fluids, here: Here, position: Array, time: Array, points: Array, wall: Wall
) -> tuple[Array, Array]:
    """Height of the surface [p, n] above the position, m, and velocity [3, p, n] beside the region's flow, m/s.

    position: [3, n] of the characters in the world; points: [3, p, n] about it.
    """
    place = position[::2]
    still = here.still - position[1]
    level, flow = jnp.broadcast_to(still, points.shape[1:]), jnp.zeros_like(points)
    if fluids.trains is not None:
        trains = fluids.trains.waves
        amplitude, phase = _amplitude(fluids, here), waves.phases(trains, place, time)
        moved = waves.motion(trains, amplitude, phase, points, still, wall)
        level, flow = level + moved[0], flow + moved[1:]
    if fluids.rivers is not None:
        flow = flow + wall(_stream, fluids.rivers, here, position, points)
    if fluids.turbulence is not None:
        eddies = fluids.turbulence.eddies
        amplitude = jnp.where(here.region == fluids.turbulence.region[:, None], eddies.amplitude[:, None], 0.0)
        phase = turbulence.phases(eddies, place, time)
        swirl = turbulence.velocity(eddies, amplitude, phase, points, wall)
        flow = flow + jnp.stack([swirl[0], jnp.zeros_like(swirl[0]), swirl[1]])
    return jnp.maximum(level, -1e3), flow


def _stream(rivers: River, here: Here, position: Array, points: Array) -> Array:
    """[3, p, n] m/s of the river of each character's region at points about it."""
    number = jnp.maximum(here.region, 0.0).astype(jnp.int32)
    one = River(*(x[..., number] for x in rivers))
    one = one._replace(speed=jnp.where(here.region < 0, 0.0, one.speed))
    place = jnp.stack([position[0] + points[0], position[2] + points[2]])
    depth = jnp.where(here.region < 0, 1.0, here.still - here.ground)
    speed = one.speed * river.across(one, place) * river.down(one, points[1] + position[1] - here.ground, depth)
    return jnp.stack([speed * one.direction[0], jnp.zeros_like(speed), speed * one.direction[1]])


def _amplitude(fluids: Fluids, here: Here) -> Array:
    """[W, n] m, 0 outside the region of a component."""
    trains = fluids.trains
    assert trains is not None
    return jnp.where(here.region == trains.region[:, None], trains.waves.amplitude[:, None], 0.0)
