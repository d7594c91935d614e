"""Sense: the ground and the fluid where a character stands."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from crowd.assets import GroundLayer, World
from crowd.components import buoyancy, currents
from crowd.layout import GroundLayout, Layout
from crowd.params import Fluids, Layers
from kernels import terrain
from kernels.drag import Fluid
from kernels.fluid import sigmoid
from kernels.trig import sin_cos
from kernels.wall import Wall, apart, no_wall


class Surroundings(NamedTuple):
    """Ground height and slope, and the fluid, at the character's position. Heights are in the world."""

    ground: Array  # [n] m
    slope: Array  # [2, n] d(height)/d(x, z)
    fluid: Fluid  # surface in the world, -inf when dry
    here: currents.Here | None = None  # where fluid is not level or not steady
    under: tuple[Fluid, ...] = ()  # layers below the top fluid, from the top down
    densities: tuple[Array, ...] = ()  # [n] kg/m3 of the fluid and of those under it, where buoyancy is asked for
    tension: Array | None = None  # [n] N/m, where some are small enough


def ground(layout: Layout, world: World, place: Array, altitude: Array | None = None) -> tuple[Array, Array]:
    """Height [*b] and slope [2, *b] of the ground at world places [2, *b] (x, z).

    altitude: world height [*b] of who asks. Where the ground has several levels, the highest one not more than
    `world.max_step_height` above that is meant, the lowest one where none is; None: the highest of all.
    """
    wall = apart if layout.walls else no_wall
    found, slope, _ = _layer(layout.ground[0], world.layers[0], place, wall)
    for shape, layer in zip(layout.ground[1:], world.layers[1:], strict=True):
        height, rise, there = _layer(shape, layer, place, wall)
        use = terrain.upper(_reach(world, altitude), found, height, there)
        found = jnp.where(use, height, found)
        slope = jnp.where(use, rise, slope)
    return found, slope


def height(layout: Layout, world: World, place: Array, altitude: Array | None = None) -> Array:
    """Height [*b] alone of the ground at world places [2, *b]; see `ground`."""
    wall = apart if layout.walls else no_wall
    found, _ = _layer_height(layout.ground[0], world.layers[0], place, wall)
    for shape, layer in zip(layout.ground[1:], world.layers[1:], strict=True):
        other, there = _layer_height(shape, layer, place, wall)
        found = jnp.where(terrain.upper(_reach(world, altitude), found, other, there), other, found)
    return found


def _reach(world: World, altitude: Array | None) -> Array | None:
    return None if altitude is None else altitude + world.max_step_height


def _layer(shape: GroundLayout, layer: GroundLayer, place: Array, wall: Wall) -> tuple[Array, Array, Array]:
    """Height and slope of one level, and where it exists."""
    there = _covered(shape, layer, place)
    if shape.kind == "grid":
        cell = _cell(shape, layer, place)
        posts = terrain.posts(layer.grid, shape.shape[1], cell.corner, wall)
        found, by_u, by_v = terrain.grid_ground(posts, cell)
        there = there & terrain.whole(posts, cell, layer.gap) if shape.gaps else there
        return found, jnp.stack([by_u / layer.cell[0], by_v / layer.cell[1]]), there
    if shape.kind == "sines":
        found, by_x, by_z = terrain.sines(layer.parameters, place[0], place[1])
        return found + layer.base, jnp.stack([by_x, by_z]), there
    found, slope = terrain.profile(shape.kind, layer.parameters, _along(layer, place))
    found = found if shape.kind == "flat" else found + layer.base
    return found, jnp.stack([slope * layer.axis[0], slope * layer.axis[1]]), there


def _layer_height(shape: GroundLayout, layer: GroundLayer, place: Array, wall: Wall) -> tuple[Array, Array]:
    """Height of one level, and where it exists."""
    there = _covered(shape, layer, place)
    if shape.kind == "grid":
        cell = _cell(shape, layer, place)
        posts = terrain.posts(layer.grid, shape.shape[1], cell.corner, wall)
        there = there & terrain.whole(posts, cell, layer.gap) if shape.gaps else there
        return terrain.grid_height(posts, cell), there
    if shape.kind == "sines":
        return terrain.sines_height(layer.parameters, place[0], place[1]) + layer.base, there
    found = terrain.profile_height(shape.kind, layer.parameters, _along(layer, place))
    return found if shape.kind == "flat" else found + layer.base, there


def _cell(shape: GroundLayout, layer: GroundLayer, place: Array) -> terrain.Cell:
    u, v = (place[0] - layer.origin[0]) / layer.cell[0], (place[1] - layer.origin[1]) / layer.cell[1]
    return terrain.locate(shape.shape, u, v, shape.post)


def _along(layer: GroundLayer, place: Array) -> Array:
    return place[0] * layer.axis[0] + place[1] * layer.axis[1]


def _covered(shape: GroundLayout, layer: GroundLayer, place: Array) -> Array:
    """Where places lie in the rectangle of a level."""
    if not shape.bounded:
        return jnp.ones(place.shape[1:], bool)
    (x0, z0), (x1, z1) = layer.low, layer.high
    return (place[0] >= x0) & (place[0] <= x1) & (place[1] >= z0) & (place[1] <= z1)


def coefficients(fluids: Fluids, of: Fluids | Layers) -> tuple[Array, Array]:
    """C_D0 and B (N) of every fluid [R] of regions or their layers, from its density or as it says (Eq. 8)."""
    base = sigmoid(of.density, fluids.base_drag.a, fluids.base_drag.b, fluids.base_drag.c)
    offset = sigmoid(of.density, fluids.offset_force.a, fluids.offset_force.b, fluids.offset_force.c)
    return (
        jnp.where(of.drag_override < 0, base, of.drag_override),
        jnp.where(of.offset_override < 0, offset, of.offset_override),
    )


def fluid(layout: Layout, fluids: Fluids, place: Array) -> Fluid:
    """The fluid at world places [2, n]: that of the last region holding it; surface -inf outside all."""
    return _found(layout, fluids, place, fluids, fluids.surface, fluids.flow)


def _found(layout: Layout, fluids: Fluids, place: Array, of: Fluids | Layers, surface: Array, flow: Array) -> Fluid:
    """One fluid of each region at places: density and constants `of` it, surface [R] and flow [3, R]."""
    coefficient, offset = coefficients(fluids, of)
    x, z = place
    found = Fluid(jnp.zeros_like(x), jnp.zeros_like(x), jnp.full_like(x, -jnp.inf), jnp.zeros((3, *x.shape), x.dtype))
    for region in range(layout.regions):
        low, high = fluids.low[:, region], fluids.high[:, region]
        inside = (x >= low[0]) & (x <= high[0]) & (z >= low[1]) & (z <= high[1])
        found = Fluid(
            jnp.where(inside, coefficient[region] * of.density[region], found.density_drag),
            jnp.where(inside, offset[region], found.offset_force),
            jnp.where(inside, surface[region], found.surface),
            jnp.where(inside, flow[:, region].reshape(3, *(1,) * x.ndim), found.flow),
        )
    return found


def layers(layout: Layout, fluids: Fluids, place: Array) -> tuple[Fluid, ...]:
    """The fluids below the top one at world places [2, n], from the top down; surface: their tops."""
    found = []
    for number in range(layout.fluid.layers):
        one = jax.tree.map(lambda x, number=number: x[..., number, :], fluids.layers)
        found.append(_found(layout, fluids, place, one, one.top, one.flow))
    return tuple(found)


def sense(
    layout: Layout, world: World, fluids: Fluids, position: Array, yaw: Array, reach: Array, frame: Array
) -> Surroundings:
    """Everything about the place [3, n] a character stands at; frame: [n] frames it has lived.

    The slope is that of the ground within `reach` [n] m of it, along and across its yaw [n]: feet stand about there,
    and the pebble below the body's middle carries nothing.
    """
    place = position[::2]
    level = height(layout, world, place, position[1])
    slope = slope_about(layout, world, place, level, position[1], yaw, reach)
    found = fluid(layout, fluids, place)
    under = layers(layout, fluids, place)
    here, densities, tension = None, (), None
    if layout.fluid.buoyancy:
        densities, tension = buoyancy.surroundings(layout, fluids, place)
    if layout.fluid.moving:
        here = currents.region(layout, fluids, place, level)
        rise = currents.rise(layout, fluids, here, place, currents.seconds(layout, frame))
        found = found._replace(surface=found.surface + rise)
    return Surroundings(level, slope, found, here, under, densities, tension)


def slope_about(
    layout: Layout, world: World, place: Array, level: Array, altitude: Array, yaw: Array, reach: Array
) -> Array:
    """[2, n] slope by differences over `reach` to both sides; what is further up or down than that counts as that."""
    sin, cos = sin_cos(yaw)
    way = jnp.stack([jnp.stack([sin, cos]), jnp.stack([cos, -sin])], 1) * reach  # [2, ahead and left, n]
    points = jnp.stack([place[:, None] + way, place[:, None] - way], 1)  # [2, ends, ahead and left, n]
    found = height(layout, world, points, jnp.broadcast_to(altitude, points.shape[1:]))
    rise = jnp.clip(found - level, -reach, reach)
    ahead, left = (rise[0] - rise[1]) / (2.0 * reach)
    return jnp.stack([ahead * sin + left * cos, ahead * cos - left * sin])
