"""Buoyancy: how much of its weight a character in fluid has on its feet. Absent from the program unless asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax.numpy as jnp
from jax import Array

from crowd.assets import HerdAssets
from crowd.layout import HerdLayout, Layout
from crowd.params import Character, Fluids
from kernels import buoyancy
from kernels.wall import Wall

if TYPE_CHECKING:
    from crowd.components.sense import Surroundings

GRAVITY = 9.81  # m/s2


def surroundings(layout: Layout, fluids: Fluids, place: Array) -> tuple[tuple[Array, ...], Array | None]:
    """([n] kg/m3 of the fluid at world places [2, n] and of each layer under it, [n] N/m surface tension)."""
    x, z = place
    rows = [fluids.density]
    if fluids.layers is not None:
        rows += [fluids.layers.density[number] for number in range(layout.fluid.layers)]
    rows += [fluids.tension] if fluids.tension is not None else []
    found = [jnp.zeros_like(x) for _ in rows]
    for region in range(layout.regions):
        low, high = fluids.low[:, region], fluids.high[:, region]
        inside = (x >= low[0]) & (x <= high[0]) & (z >= low[1]) & (z <= high[1])
        found = [jnp.where(inside, row[region], value) for row, value in zip(rows, found, strict=True)]
    tension = found.pop() if fluids.tension is not None else None
    return tuple(found), tension


def apparent_weight(
    layout: Layout,
    herd: HerdLayout,
    assets: HerdAssets,
    character: Character,
    place: Surroundings,
    surfaces: tuple[Array, ...],
    moved: Array,
    wall: Wall,
) -> Array:
    """[n] share of the weight on the feet: 1 in the air, below 0 for who would float.

    surfaces: of the fluid and of each layer, relative to the position; moved: the mesh now, as `skin.mesh` gives it.
    Pressure grows faster from the top of each layer on, by the difference of densities (Archimedes, layer by layer).
    """
    small = layout.fluid.tension[layout.herds.index(herd)] if layout.fluid.tension else False

    def found(surface: Array) -> tuple[Array, Array | None]:
        if layout.mesh == "rigid":
            bones, mesh = herd.block_bones.values, assets.rigid_mesh
            return buoyancy.rigid(bones, mesh, moved, character.scale, surface, small, wall)
        return buoyancy.skinned(herd.triangles.values, moved, surface, small, wall)

    lifted, above, length = jnp.zeros_like(character.mass), 0.0, None
    for density, surface in zip(place.densities, surfaces, strict=True):
        volume, line = found(surface)
        lifted = lifted + (density - above) * volume
        above, length = density, line if length is None else length
    assert character.displaced is not None
    weight = 1.0 - lifted / character.displaced
    if length is not None and place.tension is not None:
        weight = weight - place.tension * length / (character.mass * GRAVITY)
    return weight
