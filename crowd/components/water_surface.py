"""The water surface that all herds share: bodies make waves and stop them, and may stand in them."""

from __future__ import annotations

from typing import Any, NamedTuple

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


class Felt(NamedTuple):
    """The surface as characters feel it in one frame."""

    fields: Array  # [3, rows, columns] height m, velocity (x, z) m/s
    origin: Array  # [2] m, middle of the first cell
    cell: Array  # [] m
    most: Array  # [] m, higher and deeper waves are not felt


def prepared(layout: Layout, assets: Assets, params: Params) -> Waves:
    """What a step does to every wave: once for all frames."""
    assert layout.water is not None and assets.water is not None and params.water is not None
    return water.waves(layout.water.shape, assets.water.cell, layout.dt, params.water.depth, params.water.current)


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
    u, v, amount = wall(lambda *given: _columns(layout, assets, *given), params, states, frames)
    now = wall(lambda *given: water.splat(layout.water.shape, *given), u, v, amount)  # type: ignore[union-attr]
    before = jnp.where(state.frame > 0, state.displaced, now)
    gain = params.water.strength
    height, motion = wall(water.propagate, state.height, state.motion, gain * before, gain * now, waves)
    blocked = BLOCKING * jnp.minimum(now, 1.0)
    height, motion = wall(
        lambda *given: water.damped(*given, layout.dt), height, motion, assets.water.calm, blocked
    )  # fmt: skip
    return Water(height, motion, now, state.frame + 1)


def _columns(
    layout: Layout, assets: Assets, params: Params, states: tuple[State, ...], frames: tuple[Frame, ...]
) -> tuple[Array, Array, Array]:
    """Of all herds' columns [k], one after the other: place in cells, and share of a cell's water they take up."""
    assert layout.water is not None and assets.water is not None and params.water is not None
    parts = []
    for which, body in enumerate(assets.water.bodies):
        character, state, frame = params.characters[which], states[which], frames[which]
        columns = [_legs(body, character, state, frame, params.water.surface)]
        columns += [_trunk(body, character, state, frame, params.water.surface)]
        real = jnp.arange(state.phase.size).reshape(state.phase.shape) < layout.water.counts[which]
        there = real & (state.fault == 0)
        for place, volume in columns:
            sound = there[:, None] & jnp.isfinite(place[:, 0] + place[:, 1] + volume)
            kept = [jnp.where(sound, value, 0.0).reshape(-1) for value in (place[:, 0], place[:, 1], volume)]
            parts.append(jnp.stack(kept))
    x, z, volume = jnp.concatenate(parts, 1)
    cell, origin = assets.water.cell, assets.water.origin
    return (x - origin[0]) / cell, (z - origin[1]) / cell, volume / (cell * cell * params.water.depth)


def _legs(body: WaterBody, character: Character, state: State, frame: Frame, level: Array) -> tuple[Any, Array]:
    """Place (x, z) [tiles, 2, L, n] and volume [tiles, L, n] m3 under water of each leg, from its ankle to its hip.

    It stands where the middle of its wet part is.
    """
    scale = character.scale[:, None]
    x, z = _turned(body.hips[0] * scale, body.hips[2] * scale, state.yaw[:, None])
    hip = jnp.stack([x, body.hips[1] * scale, z], 1) + frame.pose_position[:, :, None]
    length = jnp.maximum(hip[:, 1] - frame.ankle[:, 1], 0.05 * scale)
    wet = jnp.clip(level - frame.ankle[:, 1], 0.0, length)
    share = 0.5 * wet / length
    place = frame.ankle + (hip - frame.ankle) * share[:, None]
    return place[:, ::2], body.leg_area * scale * scale * wet


def _trunk(body: WaterBody, character: Character, state: State, frame: Frame, level: Array) -> tuple[Any, Array]:
    """The same of the thirds of a trunk [tiles, 2, 3, n] and [tiles, 3, n]."""
    scale = character.scale[:, None]
    x, z = _turned(body.trunk[0] * scale, body.trunk[1] * scale, state.yaw[:, None])
    bottom = frame.pose_position[:, 1:2] + body.bottom * scale
    wet = jnp.clip(level - bottom, 0.0, (body.top - body.bottom) * scale)
    place = jnp.stack([x, z], 1) + frame.pose_position[:, ::2, None]
    return place, jnp.broadcast_to(body.trunk_area / 3.0 * scale * scale * wet, place[:, 0].shape)


def _turned(x: Array, z: Array, yaw: Array) -> tuple[Array, Array]:
    """Offsets in the character's frame, turned into the world's."""
    sin, cos = sin_cos(yaw)
    return x * cos + z * sin, z * cos - x * sin
