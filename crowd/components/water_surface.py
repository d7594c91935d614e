"""The water surface that all herds share: bodies make waves and stop them, and may stand in them."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from crowd.assets import Assets, WaterBody
from crowd.components.sense import Surroundings
from crowd.layout import Layout
from crowd.params import Character, Params
from crowd.state import Frame, State, Water
from kernels import water
from kernels.trig import sin_cos
from kernels.wall import Wall
from kernels.water import Waves

BLOCKING = 30.0  # 1/s, how fast water comes to rest inside a body
UPPER = 0.15  # m, the layer in which bodies move waves as short as theirs


class Felt(NamedTuple):
    """The surface as characters feel it in one frame."""

    fields: Array  # [3, rows, columns] height m, velocity (x, z) m/s
    origin: Array  # [2] m, middle of the first cell
    cell: Array  # [] m
    most: Array  # [] m, higher and deeper waves are not felt


def prepared(layout: Layout, assets: Assets, params: Params) -> Waves:
    """What a step does to every wave: once for all frames."""
    assert layout.water is not None and assets.water is not None and params.water is not None
    numbers = params.water.depth, _upper(params), params.water.current
    return water.waves(layout.water.shape, assets.water.cell, layout.dt, *numbers)


def felt(layout: Layout, assets: Assets, params: Params, state: Water, waves: Waves, wall: Wall) -> Felt | None:
    """Height and flow of the surface before the herds step; None without feedback."""
    assert layout.water is not None and assets.water is not None and params.water is not None
    if not layout.water.feedback:
        return None
    flow = wall(water.surface_flow, state.motion, waves)
    fields = jnp.concatenate([state.height[None], flow])
    return Felt(fields, assets.water.origin, assets.water.cell, 0.5 * params.water.depth)


def sensed(place: Surroundings, position: Array, surface: Felt, wall: Wall) -> Surroundings:
    """The surroundings of characters at [3, n] m with the waves in their fluid; none beyond the grid."""
    rows, columns = surface.fields.shape[1:]
    u = (position[0] - surface.origin[0]) / surface.cell
    v = (position[2] - surface.origin[1]) / surface.cell
    rise, flow_x, flow_z = water.sample(surface.fields, u, v, wall)
    inside = (u >= 0) & (u <= columns - 1) & (v >= 0) & (v <= rows - 1)
    rise = jnp.clip(jnp.where(inside, rise, 0.0), -surface.most, surface.most)
    flow = jnp.where(inside, jnp.stack([flow_x, jnp.zeros_like(flow_x), flow_z]), 0.0)
    fluid = place.fluid
    return place._replace(fluid=fluid._replace(surface=fluid.surface + rise, flow=fluid.flow + flow))


def moved(
    layout: Layout,
    assets: Assets,
    params: Params,
    states: tuple[State, ...],
    frames: tuple[Frame, ...],
    state: Water,
    waves: Waves,
    wall: Wall,
) -> Water:
    """The surface one frame on, after all herds have stepped."""
    assert layout.water is not None and assets.water is not None and params.water is not None
    shape = layout.water.shape
    u, v, shares = wall(lambda p, s, f: _columns(layout, assets, p, s, f), params, states, frames)
    bodies = wall(lambda u, v, shares: jnp.stack([water.splat(shape, u, v, share) for share in shares]), u, v, shares)
    now = wall(water.pushed, params.water.strength * bodies, waves)
    before = jnp.where(state.frame > 0, state.pushed[0] + 1j * state.pushed[1], now)
    height, motion = wall(water.propagate, state.height, state.motion, before, now, waves)
    blocked = BLOCKING * jnp.minimum(bodies[0], 1.0) + wall(water.breaking, height, assets.water.cell)
    height, motion = wall(
        lambda h, m, calm, lost: water.damped(h, m, calm, lost, layout.dt), height, motion, assets.water.calm, blocked
    )
    return Water(height, motion, jnp.stack([now.real, now.imag]), state.frame + 1)


class Columns(NamedTuple):
    """Upright columns of k parts of every character: place (x, z), lower and upper end in the world, m, section, m2."""

    place: Array  # [tiles, 2, k, n]
    bottom: Array  # [tiles, k, n]
    top: Array
    area: Array


def _upper(params: Params) -> Array:
    """Thickness of the upper layer, m."""
    assert params.water is not None
    return jnp.minimum(UPPER, 0.5 * params.water.depth)


def _columns(
    layout: Layout, assets: Assets, params: Params, states: tuple[State, ...], frames: tuple[Frame, ...]
) -> tuple[Array, Array, Array]:
    """Of all herds' columns [k], one after the other: place in cells, share [2, k] of a cell's water in each layer."""
    assert layout.water is not None and assets.water is not None and params.water is not None
    upper, level = _upper(params), params.water.surface
    parts = []
    for which, body in enumerate(assets.water.bodies):
        character, state, frame = params.characters[which], states[which], frames[which]
        real = jnp.arange(state.phase.size).reshape(state.phase.shape) < layout.water.counts[which]
        for part in (_legs(body, character, state, frame, level), _trunk(body, character, state, frame)):
            above = jnp.minimum(part.top, level) - jnp.maximum(part.bottom, level - upper)
            below = jnp.minimum(part.top, level - upper) - part.bottom
            x, z = part.place[:, 0], part.place[:, 1]
            wet = [part.area * jnp.maximum(each, 0.0) for each in (above, below)]
            sound = (real & (state.fault == 0))[:, None] & jnp.isfinite(x + z + wet[0] + wet[1])
            parts.append(jnp.stack([jnp.where(sound, value, 0.0).reshape(-1) for value in (x, z, *wet)]))
    x, z, above, below = jnp.concatenate(parts, 1)
    cell, origin = assets.water.cell, assets.water.origin
    shares = jnp.stack([above / upper, below / (params.water.depth - upper)]) / (cell * cell)
    return (x - origin[0]) / cell, (z - origin[1]) / cell, shares


def _legs(body: WaterBody, character: Character, state: State, frame: Frame, level: Array) -> Columns:
    """Each leg from its ankle to its hip or the trunk's underside; it stands where the middle of its wet part is."""
    scale = character.scale[:, None]
    x, z = _turned(body.hips[0] * scale, body.hips[2] * scale, state.yaw[:, None])
    hip = jnp.stack([x, body.hips[1] * scale, z], 1) + frame.pose_position[:, :, None]
    ankle = frame.ankle[:, 1]
    length = jnp.maximum(hip[:, 1] - ankle, 0.05 * scale)
    share = 0.5 * jnp.clip((level - ankle) / length, 0.0, 1.0)
    place = frame.ankle + (hip - frame.ankle) * share[:, None]
    top = ankle + jnp.minimum(length, jnp.maximum(frame.pose_position[:, 1:2] + body.bottom * scale - ankle, 0.0))
    return Columns(place[:, ::2], ankle, top, body.leg_area * scale * scale)


def _trunk(body: WaterBody, character: Character, state: State, frame: Frame) -> Columns:
    """The thirds of the trunk."""
    scale = character.scale[:, None]
    x, z = _turned(body.trunk[0] * scale, body.trunk[1] * scale, state.yaw[:, None])
    place = jnp.stack([x, z], 1) + frame.pose_position[:, ::2, None]
    bottom, top = (frame.pose_position[:, 1:2] + end * scale + 0.0 * x for end in (body.bottom, body.top))
    return Columns(place, bottom, top, body.trunk_area / 3.0 * scale * scale)


def _turned(x: Array, z: Array, yaw: Array) -> tuple[Array, Array]:
    """Offsets in the character's frame, turned into the world's."""
    sin, cos = sin_cos(yaw)
    return x * cos + z * sin, z * cos - x * sin
