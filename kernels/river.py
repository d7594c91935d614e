"""Flow of a river: fastest in the middle, none at the banks; even or logarithmic down to the ground."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float


class River(NamedTuple):
    """Of one river; every field has the batch shape, or none."""

    direction: Array  # [2, *b] unit vector (x, z) that it goes along
    through: Array  # [2, *b] m, a point of its middle line
    speed: Array  # [*b] m/s, in the middle at the surface
    half_width: Array  # [*b] m
    roughness: Array  # [*b] m, where the logarithms begin
    across_log: Array  # [*b] 1: logarithmic across, 0: parabolic
    over_depth: Array  # [*b] 1: logarithmic over the depth, 0: even


def across(river: River, place: Float[Array, "2 *b"]) -> Float[Array, "*b"]:
    """Share of the middle's speed at places (x, z), m: 1 - s^2, or log(1 + d/r) / log(1 + b/r).

    s: distance from the middle line over the half width b; d: distance to the nearer bank. 0 on land.
    """
    x, z = place[0] - river.through[0], place[1] - river.through[1]
    aside = jnp.abs(x * river.direction[1] - z * river.direction[0])
    bank = jnp.maximum(river.half_width - aside, 0.0)
    s = jnp.minimum(aside / river.half_width, 1.0)
    logarithm = jnp.log1p(bank / river.roughness) / jnp.log1p(river.half_width / river.roughness)
    return jnp.where(river.across_log > 0, logarithm, 1.0 - s * s)


def down(river: River, height: Float[Array, "*b"], depth: Float[Array, "*c"]) -> Float[Array, "*b"]:
    """Share of the surface's speed at a height y over the ground, in water of a depth h (m).

    1, or log(1 + y/r) / log(1 + h/r).
    """
    deep = jnp.maximum(depth, 1e-3)
    y = jnp.clip(height, 0.0, deep)
    return jnp.where(river.over_depth > 0, jnp.log1p(y / river.roughness) / jnp.log1p(deep / river.roughness), 1.0)
