"""Ground height and slope at points of the ground plane: profiles along a line, and grids."""

from __future__ import annotations

from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array, Float

Kind = Literal["flat", "slope", "ramp", "steps", "grid"]


def profile(kind: Kind, parameters: Float[Array, "4"], s: Float[Array, "*b"]) -> tuple[Array, Array]:
    """Height and slope of an analytic ground at distance s along its axis, m.

    flat: (height); slope: (tangent); ramp: (start, end, drop): level, down by drop, level;
    steps: (start, tread, rise, count): the first riser stands at `start`.
    """
    if kind == "flat":
        return jnp.zeros_like(s) + parameters[0], jnp.zeros_like(s)
    if kind == "slope":
        return s * parameters[0], jnp.zeros_like(s) + parameters[0]
    if kind == "ramp":
        start, end, drop = parameters[0], parameters[1], parameters[2]
        length = end - start
        t = (s - start) / length
        inside = (t > 0) & (t < 1)
        return -drop * jnp.clip(t, 0.0, 1.0), jnp.where(inside, -drop / length, 0.0)
    start, tread, rise, count = parameters
    step = jnp.clip(jnp.floor((s - start) / tread) + 1.0, 0.0, count)
    return step * rise, jnp.zeros_like(s)


def bilinear(
    grid: Float[Array, "cells"], shape: tuple[int, int], u: Float[Array, "*b"], v: Float[Array, "*b"]
) -> tuple[Array, Array, Array]:
    """Height and its derivatives by u and v of a flattened [rows, columns] grid at column u and row v (in cells).

    Outside the grid the border goes on level.
    """
    rows, columns = shape
    u_in, v_in = jnp.clip(u, 0.0, columns - 1.0), jnp.clip(v, 0.0, rows - 1.0)
    i = jnp.clip(jnp.floor(u_in).astype(jnp.int32), 0, columns - 2)
    j = jnp.clip(jnp.floor(v_in).astype(jnp.int32), 0, rows - 2)
    a, b = u_in - i, v_in - j
    corner = j * columns + i
    h00, h01 = grid[corner], grid[corner + 1]
    h10, h11 = grid[corner + columns], grid[corner + columns + 1]
    height = (h00 * (1 - a) + h01 * a) * (1 - b) + (h10 * (1 - a) + h11 * a) * b
    along_u = jnp.where(u == u_in, (h01 - h00) * (1 - b) + (h11 - h10) * b, 0.0)
    along_v = jnp.where(v == v_in, (h10 - h00) * (1 - a) + (h11 - h01) * a, 0.0)
    return height, along_u, along_v
