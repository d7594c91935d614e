"""Sense: the ground and the fluid where a character stands."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from crowd.assets import GroundLayer, World
from crowd.layout import GroundLayout, Layout
from crowd.params import Fluids
from kernels import terrain
from kernels.drag import Fluid
from kernels.fluid import sigmoid


class Surroundings(NamedTuple):
    """Ground height and slope, and the fluid, at the character's position. Heights are in the world."""

    ground: Array  # [n] m
    slope: Array  # [2, n] d(height)/d(x, z)
    fluid: Fluid  # surface in the world, -inf when dry


def ground(layout: Layout, world: World, place: Array, altitude: Array | None = None) -> tuple[Array, Array]:
    """Height [*b] and slope [2, *b] of the ground at world places [2, *b] (x, z).

    altitude: world height [*b] of who asks. Where the ground has several levels, the highest one not more than
    `world.max_step_height` above that is meant, the lowest one where none is; None: the highest of all.
    """
    found, slope = _layer(layout.ground[0], world.layers[0], place)
    reach = None if altitude is None else altitude + world.max_step_height
    for shape, layer in zip(layout.ground[1:], world.layers[1:], strict=True):
        height, rise = _layer(shape, layer, place)
        use = terrain.upper(reach, found, height, _there(shape, layer, place))
        found = jnp.where(use, height, found)
        slope = jnp.where(use, rise, slope)
    return found, slope


def height(layout: Layout, world: World, place: Array, altitude: Array | None = None) -> Array:
    """Height [*b] alone of the ground at world places [2, *b]; see `ground`."""
    found = _layer_height(layout.ground[0], world.layers[0], place)
    reach = None if altitude is None else altitude + world.max_step_height
    for shape, layer in zip(layout.ground[1:], world.layers[1:], strict=True):
        other = _layer_height(shape, layer, place)
        found = jnp.where(terrain.upper(reach, found, other, _there(shape, layer, place)), other, found)
    return found


def _cell(shape: GroundLayout, layer: GroundLayer, place: Array) -> terrain.Cell:
    u, v = (place[0] - layer.origin[0]) / layer.cell[0], (place[1] - layer.origin[1]) / layer.cell[1]
    return terrain.locate(shape.shape, u, v, shape.post)


def _along(layer: GroundLayer, place: Array) -> Array:
    return place[0] * layer.axis[0] + place[1] * layer.axis[1]


def _layer(shape: GroundLayout, layer: GroundLayer, place: Array) -> tuple[Array, Array]:
    """Height and slope of one level, wherever it is."""
    if shape.kind == "grid":
        found, by_u, by_v = terrain.grid_ground(layer.grid, shape.shape[1], _cell(shape, layer, place))
        return found, jnp.stack([by_u / layer.cell[0], by_v / layer.cell[1]])
    if shape.kind == "sines":
        found, by_x, by_z = terrain.sines(layer.parameters, place[0], place[1])
        return found + layer.base, jnp.stack([by_x, by_z])
    found, slope = terrain.profile(shape.kind, layer.parameters, _along(layer, place))
    found = found if shape.kind == "flat" else found + layer.base
    return found, jnp.stack([slope * layer.axis[0], slope * layer.axis[1]])


def _layer_height(shape: GroundLayout, layer: GroundLayer, place: Array) -> Array:
    if shape.kind == "grid":
        return terrain.grid_height(layer.grid, shape.shape[1], _cell(shape, layer, place))
    if shape.kind == "sines":
        return terrain.sines_height(layer.parameters, place[0], place[1]) + layer.base
    found = terrain.profile_height(shape.kind, layer.parameters, _along(layer, place))
    return found if shape.kind == "flat" else found + layer.base


def _there(shape: GroundLayout, layer: GroundLayer, place: Array) -> Array:
    """Where a level exists: in its rectangle, and off its gaps."""
    there = jnp.ones(place.shape[1:], bool)
    if shape.bounded:
        (x0, z0), (x1, z1) = layer.low, layer.high
        there = (place[0] >= x0) & (place[0] <= x1) & (place[1] >= z0) & (place[1] <= z1)
    if shape.gaps:
        cell = _cell(shape, layer, place)
        whole = layer.whole.at[cell.corner].get(mode="promise_in_bounds", wrap_negative_indices=False)
        there = there & cell.inside_u & cell.inside_v & whole
    return there


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
    level, slope = ground(layout, world, place, position[1])
    return Surroundings(level, slope, fluid(layout, fluids, place))
