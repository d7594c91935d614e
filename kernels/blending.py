"""Gradient bands: weights of clips with known velocities for a wanted velocity (locomotion specification 3.1, 3.2).

Each sample has a band that falls from 1 at the sample to 0 at every other one: straight in the velocity plane
(`cartesian`) or in speed and direction (`polar`). Whatever depends on samples only is computed once, as arrays `[m]` or
`[m, m]`; a character costs one atan2, and a few multiplications for each pair.

What the specification leaves open (3.3) is closed here, unless `compat`:
- samples closer than DUPLICATE take no band of each other; they share one;
- without an idle sample directions mean nothing near standstill, so weights fade there to shares of speed alone;
- a direction of more than half a turn from i to j is the same as a shorter one the other way round: across the line
  opposite to a sample its band would jump, unless others hide that, so it is ramped from one side to the other, over
  SEAM or as far as there is no other sample.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from kernels.trig import arctan2
from kernels.vec import smoothstep
from kernels.wall import Wall, no_wall

NOTHING = 1e-10  # (m/s)^2; slower samples and queries stand still (specification 0.2)
DUPLICATE = 1e-3  # of the mean speed, or half as many radians; no band fits between samples that close
OPPOSITE = 0.99 * np.pi  # between directions; beyond, both ways round are as short
SEAM = np.pi / 8  # largest half width of the ramp opposite to a sample
FADE = 0.25  # of the slowest sample's speed: below, weights fade to those of standstill
LEAST = 0.05  # sum of bands; below, the weights of standstill fill up
_FAR = 1e3  # more than any band


class Bands(NamedTuple):
    """Polar samples, prepared: h_ij = at_rest - by_turn a - by_turned |a| - by_speed r, a: angle from sample i."""

    angle: Float[Array, "m"]  # of the sample from +z to +x, rad
    speed: Float[Array, "m"]  # m/s; 1 for idle
    idle: Bool[Array, "m"]
    copies: Float[Array, "m"]  # samples at this place, itself included
    at_rest: Float[Array, "m m"]
    by_turn: Float[Array, "m m"]  # 1/rad
    by_turned: Float[Array, "m m"]  # 1/rad
    by_speed: Float[Array, "m m"]  # s/m
    seam: Float[Array, "m"]  # half width of the ramp opposite to the sample, rad
    still: Float[Array, "m"]  # weights at standstill without an idle sample
    fade: Float[Array, ""]  # m/s; 0 with an idle sample


def cartesian(samples: Float[Array, "2 m"], query: Float[Array, "2 *b"], wall: Wall = no_wall) -> Float[Array, "m *b"]:
    """Weights by straight bands (3.1): at least 0, sum 1. samples, query: x and z of velocities, m/s."""
    band = wall(_straight, samples, query)
    return wall(lambda band, total: band / total, band, wall(_total, band))


def _straight(samples: Float[Array, "2 m"], query: Float[Array, "2 *b"]) -> Float[Array, "m *b"]:
    """h_i, at least 0 (and at least 1/2 for the sample nearest to the query); samples at one place share theirs."""
    x, z = samples
    dx, dz = x - x[:, None], z - z[:, None]  # [i, j] from i to j
    apart = dx * dx + dz * dz
    energy = x * x + z * z
    same = apart <= DUPLICATE**2 * 0.5 * (energy + energy[:, None]) + NOTHING
    scale = jnp.where(same, 0.0, 1.0 / jnp.where(same, 1.0, apart))
    at_rest = jnp.where(same, _FAR, 1.0 + (x[:, None] * dx + z[:, None] * dz) * scale)
    by_x, by_z = dx * scale, dz * scale
    wide = _trailing(query.ndim - 1)
    band = jnp.full((len(x), *query.shape[1:]), _FAR)
    for j in range(len(x)):
        band = jnp.minimum(band, wide(at_rest[:, j]) - wide(by_x[:, j]) * query[0] - wide(by_z[:, j]) * query[1])
    return jnp.maximum(band, 0.0) / wide(same.sum(1).astype(x.dtype))


def polar(samples: Float[Array, "2 m"], query: Float[Array, "2 *b"], compat: bool = False) -> Float[Array, "m *b"]:
    """Weights by bands in speed and direction (3.2): at least 0, sum 1. samples, query: x and z of velocities, m/s.

    compat: the specification to the letter, with its jumps, and sum 0 at standstill without an idle sample.
    """
    return weights(bands(samples), query, compat)


def bands(samples: Float[Array, "2 m"]) -> Bands:
    """What `weights` needs of the samples: compute it once for all characters. One of the samples may be 0 (idle)."""
    x, z = samples
    energy = x * x + z * z
    idle = energy < NOTHING
    speed = jnp.sqrt(jnp.where(idle, 1.0, energy))
    angle = arctan2(x, z)
    turn = _wrapped(angle - angle[:, None])  # [i, j] from i to j
    mean = 0.5 * (speed + speed[:, None])
    faster = (speed - speed[:, None]) / mean
    square = 4.0 * turn * turn + faster * faster
    either = idle | idle[:, None]
    same = jnp.where(either, idle & idle[:, None], square < DUPLICATE**2)
    none = either | same
    scale = jnp.where(none, 0.0, 1.0 / jnp.where(none, 1.0, square))
    by_speed = faster / mean * scale
    at_rest = jnp.where(none, _FAR, 1.0 + by_speed * speed[:, None])
    opposite = jnp.abs(turn) >= OPPOSITE
    copies = same.sum(1).astype(x.dtype)
    still = jnp.clip(at_rest.min(1), 0.0, 1.0) / copies
    return Bands(
        angle=angle,
        speed=speed,
        idle=idle,
        copies=copies,
        at_rest=at_rest,
        by_turn=jnp.where(opposite, 0.0, 4.0 * turn * scale),
        by_turned=jnp.where(opposite, 4.0 * jnp.abs(turn) * scale, 0.0),
        by_speed=by_speed,
        seam=jnp.where(opposite | none, SEAM, jnp.minimum(SEAM, np.pi - jnp.abs(turn))).min(1),
        still=still / still.sum(),
        fade=jnp.where(idle.any(), 0.0, FADE * speed.min()),
    )


def weights(
    bands: Bands, query: Float[Array, "2 *b"], compat: bool = False, wall: Wall = no_wall
) -> Float[Array, "m *b"]:
    """`polar` for prepared samples. Continuous in the query; at standstill the derivative is taken as 0."""
    energy = query[0] * query[0] + query[1] * query[1]
    stands = energy < NOTHING
    speed = jnp.where(stands, 0.0, jnp.sqrt(jnp.where(stands, 1.0, energy)))
    direction = wall(_direction, query)
    walking = wall(_walking, bands, direction, speed)
    band = wall(partial(_heights, compat=compat), bands, direction, speed, walking)
    return wall(partial(_shares, compat=compat), bands, band, wall(_total, band), speed)


def _direction(query: Float[Array, "2 *b"]) -> Float[Array, "*b"]:
    """Angle from +z to +x, rad; 0 at standstill."""
    return arctan2(query[0], query[1])


def _walking(bands: Bands, direction: Float[Array, "*b"], speed: Float[Array, "*b"]) -> Float[Array, "m *b"]:
    """h of each sample that moves against an idle one; what it leaves of 1 is the idle sample's against it."""
    wide = _trailing(direction.ndim)
    turn = jnp.where(speed > 0, _wrapped(direction - wide(bands.angle)), 0.0)
    return 4.0 * speed / (wide(bands.speed) * (turn * turn + 4.0))


def _heights(
    bands: Bands, direction: Float[Array, "*b"], speed: Float[Array, "*b"], walking: Float[Array, "m *b"], compat: bool
) -> Float[Array, "m *b"]:
    """h_i, between 0 and 1; samples at one place share theirs."""
    wide = _trailing(direction.ndim)
    standing = jnp.ones_like(speed)
    for j in range(len(bands.angle)):
        standing = jnp.where(bands.idle[j], standing, jnp.minimum(standing, 1.0 - walking[j]))
    band = _nearest(bands, _wrapped(direction - wide(bands.angle)), speed, compat)
    band = jnp.where(bands.idle.any(), jnp.minimum(band, walking), band)
    return jnp.clip(jnp.where(wide(bands.idle), standing, band), 0.0, 1.0) / wide(bands.copies)


def _shares(
    bands: Bands, band: Float[Array, "m *b"], total: Float[Array, "*b"], speed: Float[Array, "*b"], compat: bool
) -> Float[Array, "m *b"]:
    """h_i / sum h, and what stands in for it at standstill."""
    if compat:
        return band / jnp.where(total > 0, total, 1.0)
    still = _trailing(speed.ndim)(bands.still)
    share = (band + still * jnp.maximum(LEAST - total, 0.0)) / jnp.maximum(total, LEAST)
    fade = jnp.where(bands.fade > 0, bands.fade, 1.0)
    trust = jnp.where(bands.fade > 0, smoothstep(speed / fade), 1.0)
    return still + (share - still) * trust


def _nearest(bands: Bands, turn: Float[Array, "m *b"], speed: Float[Array, "*b"], compat: bool) -> Float[Array, "m *b"]:
    """min over j of h_ij, samples that move only, between 0 and 1; `turn` from each sample to the query."""
    wide = _trailing(turn.ndim - 1)
    turned = jnp.abs(turn)
    full = jnp.where(turn > 0, 2 * np.pi, -2 * np.pi)
    here = there = jnp.full(turn.shape, _FAR)
    for j in range(len(bands.angle)):
        by_turn, by_turned = wide(bands.by_turn[:, j]), wide(bands.by_turned[:, j])
        at_rest = wide(bands.at_rest[:, j])
        height = at_rest - wide(bands.by_speed[:, j]) * speed - by_turned * turned - by_turn * turn
        if compat:  # a query at standstill counts as in the direction of j
            way = wide(_wrapped(bands.angle[j] - bands.angle))
            height = jnp.where(speed > 0, height, at_rest - by_turned * jnp.abs(way) - by_turn * way)
        here = jnp.minimum(here, height)
        there = jnp.minimum(there, height + by_turn * full)  # the same direction, reached the other way round
    here, there = jnp.clip(here, 0.0, 1.0), jnp.clip(there, 0.0, 1.0)
    if compat:
        return here
    seam = wide(bands.seam)
    return here + (there - here) * (0.5 / seam) * jnp.maximum(turned - (np.pi - seam), 0.0)


def _trailing(count: int):
    """Appends as many axes, for the characters."""
    return lambda x: x.reshape(*x.shape, *(1,) * count)


def _wrapped(angle: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """The same direction between -pi and pi."""
    return angle - 2 * np.pi * jnp.round(angle / (2 * np.pi))


def _total(x: Float[Array, "m *b"]) -> Float[Array, "*b"]:
    """Sum over the first axis, one after the other."""
    total = x[0]
    for i in range(1, len(x)):
        total = total + x[i]
    return total
