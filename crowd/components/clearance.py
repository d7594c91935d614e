"""Clearance between legs. Absent from the program of a herd without `responses.leg_clearance`."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from crowd.components.motions import Blend
from crowd.layout import HerdLayout
from crowd.params import Character
from crowd.state import State, Strides
from kernels import leg_clearance
from kernels.footprint import Footprint, about
from kernels.rows import picked
from kernels.trig import sin_cos
from kernels.vec import TINY
from kernels.wall import Wall

OWN_SIDE = 0.3  # of the gap: how much nearer than to another's middle a foot's own side has to be


def uncrossed(
    herd: HerdLayout, character: Character, state: State, blend: Blend, heel: Array, yaw: Array, foot: Array, wall: Wall
) -> Array:
    """Predicted heel ends [3, L, n], relative to the position, moved so that no foot crosses its partner's.

    yaw [L, n], foot [3, L, n]: heel to toe end, of the predicted prints; feet are where their middles are.
    """

    def middles(state: State, blend: Blend) -> Array:
        place, sole = _standing(state, blend)
        return place + 0.5 * sole

    def beside(character: Character, heel: Array, yaw: Array, foot: Array, other: Array) -> Array:
        half = 0.5 * about(foot, yaw)[::2]
        sin, cos = sin_cos(yaw)
        gap = jnp.stack([_gap(herd, character, i, p) for i, p in enumerate(herd.partners)])
        moved = leg_clearance.beside(heel[::2] + half, other, jnp.stack([cos, -sin]), _sides(herd), gap) - half
        return jnp.stack([moved[0], heel[1], moved[1]])

    other = picked(wall(middles, state, blend), np.array(herd.partners), wall)
    return wall(beside, character, heel, yaw, foot, other)


def apart(
    herd: HerdLayout, character: Character, state: State, blend: Blend, ahead: Footprint, wall: Wall
) -> Footprint:
    """Prints ahead [L, n], relative to the position, that give way to where the legs near them stand or will land."""

    def soles(state: State, blend: Blend, ahead: Footprint) -> tuple[Array, ...]:
        place, sole = _standing(state, blend)
        start = ahead.position[::2]
        return start, start + _level(ahead.foot, ahead.yaw), place, place + sole

    ends = _pairs(herd, wall, *wall(soles, state, blend, ahead))
    way = wall(lambda *now: _ways(herd, *now), character, state, *ends)
    moved = wall(lambda place, way: _shifted(place, _summed(herd, way)), ahead.position, way)
    return ahead._replace(position=moved)


def _standing(state: State, blend: Blend) -> tuple[Array, Array]:
    """Heel ends [2, L, n], relative to the position, and soles of the prints on which legs stand or will land."""
    own: Strides = state.gait
    stands = own.time <= blend.keys.liftoff
    place = jnp.where(stands, own.from_position[::2], own.to_position[::2]) - state.position[::2][:, None]
    return place, jnp.where(stands, _level(own.from_foot, own.from_yaw), _level(own.to_foot, own.to_yaw))


def kept(
    herd: HerdLayout, character: Character, state: State, heel: Array, sole: Array, flight: Array, wall: Wall
) -> Array:
    """Feet [3, L, n] in flight that give way to those near them. sole [3, L, n]: from there to the other end, m;
    flight [L, n]: share done, 0 or 1 for feet that stand."""

    def together(heel: Array, flight: Array, way: Array) -> Array:
        return _shifted(heel, _summed(herd, way) * (1.0 - (2.0 * flight - 1.0) ** 4))

    start, end = wall(lambda heel, sole: (heel[::2], (heel + sole)[::2]), heel, sole)
    ends = _pairs(herd, wall, start, end, start, end)
    way = wall(lambda *now: _ways(herd, *now), character, state, *ends)
    return wall(together, heel, flight, way)


def _pairs(
    herd: HerdLayout, wall: Wall, start: Array, end: Array, other_start: Array, other_end: Array
) -> tuple[Array, ...]:
    """[2, P, n] each: both ends of the first foot of every pair of near ones, and of the second, out of [2, L, n]."""
    one, other = (np.array(legs) for legs in zip(*herd.near, strict=True))
    rows = ((start, one), (end, one), (other_start, other), (other_end, other))
    return tuple(picked(x, legs, wall) for x, legs in rows)


def _ways(herd: HerdLayout, character: Character, state: State, *ends: Array) -> Array:
    """[2, P, n] m, how far the first foot of each pair gives way; ends: both ends of its and of the other's segment."""
    response = character.responses.clearance
    assert response is not None
    sin, cos = sin_cos(state.yaw)
    own_side = jnp.stack([cos, -sin])[:, None] * _sides(herd)[np.array([one for one, _ in herd.near])]
    start, end, other_start, other_end = ends
    # feet that meet go apart by their middles, and to their own side where those are one above the other
    x, z = 0.5 * (start + end - other_start - other_end) + OWN_SIDE * response.gap * own_side
    out = jnp.stack([x, z]) / jnp.sqrt(x * x + z * z + TINY)
    return leg_clearance.given_way(leg_clearance.between(*ends), out, response.gap)


def _shifted(place: Array, way: Array) -> Array:
    """Places [3, L, n] moved along the level by [2, L, n]."""
    return jnp.stack([place[0] + way[0], place[1], place[2] + way[1]])


def _summed(herd: HerdLayout, way: Array) -> Array:
    """[2, L, n] sum over the pairs of each leg."""
    legs: list[Array] = [jnp.zeros_like(way[:, 0])] * herd.legs
    for pair, (leg, _) in enumerate(herd.near):
        legs[leg] = legs[leg] + way[:, pair]
    return jnp.stack(legs, 1)


def _gap(herd: HerdLayout, character: Character, leg: int, partner: int) -> Array:
    """[n] m, to keep between a leg and its partner; 0 where it has none."""
    response = character.responses.clearance
    assert response is not None
    pair = (leg, partner)
    return response.gap[herd.near.index(pair)] if pair in herd.near else jnp.zeros_like(character.scale)


def _sides(herd: HerdLayout) -> Array:
    """[L, 1] 1 for left legs, -1 for right ones, 0 for those without a partner on the other side."""
    paired = [0 if herd.partners[leg] == leg else side for leg, side in enumerate(herd.sides)]
    return jnp.array(paired, jnp.float32).reshape(-1, 1)


def _level(foot: Array, yaw: Array) -> Array:
    """[2, L, n] heel to toe end (x, z) in the world."""
    return about(jnp.stack([foot[0], jnp.zeros_like(yaw), foot[1]]), yaw)[::2]
