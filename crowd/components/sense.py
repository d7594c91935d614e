"""Sense: the ground and the fluid where a character stands."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from crowd.assets import World
from crowd.layout import Layout
from crowd.params import Fluids
from kernels import terrain
from kernels.drag import Fluid
from kernels.fluid import sigmoid


class Surroundings(NamedTuple):
    """Ground height and slope, and the fluid, at the character's position. Heights are in the world."""

    ground: Array  # [n] m
    slope: Array  # [2, n] d(height)/d(x, z)
    fluid: Fluid  # surface in the world, -inf when dry


def ground(layout: Layout, world: World, place: Array) -> tuple[Array, Array]:
    """Height [*b] and slope [2, *b] of the ground at world places [2, *b] (x, z)."""
    if layout.ground == "grid":
        u = (place[0] - world.origin[0]) / world.cell[0]
        v = (place[1] - world.origin[1]) / world.cell[1]
        height, by_u, by_v = terrain.bilinear(world.grid, layout.ground_shape, u, v)
        return height, jnp.stack([by_u / world.cell[0], by_v / world.cell[1]])
    s = place[0] * world.axis[0] + place[1] * world.axis[1]
    height, slope = terrain.profile(layout.ground, world.profile, s)
    return height, jnp.stack([slope * world.axis[0], slope * world.axis[1]])


def fluid(layout: Layout, fluids: Fluids, place: Array) -> Fluid:
    """The fluid at world places [2, n]: that of the last region holding it; surface -inf outside all."""
    coefficient = sigmoid(fluids.density, fluids.base_drag.a, fluids.base_drag.b, fluids.base_drag.c)
    offset = sigmoid(fluids.density, fluids.offset_force.a, fluids.offset_force.b, fluids.offset_force.c)
    coefficient = jnp.where(fluids.drag_override < 0, coefficient, fluids.drag_override)
    offset = jnp.where(fluids.offset_override < 0, offset, fluids.offset_override)
    x, z = place
    found = Fluid(jnp.zeros_like(x), jnp.zeros_like(x), jnp.full_like(x, -jnp.inf), jnp.zeros((3, *x.shape), x.dtype))
    for region in range(layout.regions):
        low, high = fluids.low[:, region], fluids.high[:, region]
        inside = (x >= low[0]) & (x <= high[0]) & (z >= low[1]) & (z <= high[1])
        found = Fluid(
            jnp.where(inside, coefficient[region] * fluids.density[region], found.density_drag),
            jnp.where(inside, offset[region], found.offset_force),
            jnp.where(inside, fluids.surface[region], found.surface),
            jnp.where(inside, fluids.flow[:, region].reshape(3, *(1,) * x.ndim), found.flow),
        )
    return found


def sense(layout: Layout, world: World, fluids: Fluids, position: Array) -> Surroundings:
    """Everything about the place [3, n] a character stands at."""
    place = position[jnp.array([0, 2])]
    height, slope = ground(layout, world, place)
    return Surroundings(height, slope, fluid(layout, fluids, place))
