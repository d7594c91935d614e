"""Vectors `[3, *b]` by component: on a CPU 10 to 100 times faster than sum, einsum or jnp.cross.

Components are taken apart by `jnp.unstack`: backwards, its parts are put together in one piece, where those of `v[0]`
or of `x, y, z = v` are each padded with zeros and added.

Stacking rows comes last: of rows that are stacked and then added to something, within one loop, XLA picks one for
every number, which is no loop over vectors any more and takes five times as long. `plus` adds the rows before.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

TINY = 1e-12  # added under square roots: value and gradient stay finite at zero


def dot(a: Float[Array, "3 *b"], b: Float[Array, "3 *c"]) -> Float[Array, "*d"]:
    """Inner product."""
    ax, ay, az = jnp.unstack(a)
    bx, by, bz = jnp.unstack(b)
    return ax * bx + ay * by + az * bz


def cross(a: Float[Array, "3 *b"], b: Float[Array, "3 *c"]) -> Float[Array, "3 *d"]:
    """Vector product a x b."""
    ax, ay, az = jnp.unstack(a)
    bx, by, bz = jnp.unstack(b)
    return jnp.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def plus(a: Float[Array, "k *b"], b: Float[Array, "k *c"]) -> Float[Array, "k *d"]:
    """a + b, row by row: for vectors that were put together just before, as rotated ones are."""
    return jnp.stack([x + y for x, y in zip(jnp.unstack(a), jnp.unstack(b), strict=True)])


def axis(like: Float[Array, "k *b"], row: int) -> Float[Array, "k *b"]:
    """As many unit vectors along the axis of that number."""
    return jnp.broadcast_to(_column(like, row), like.shape).astype(like.dtype)


def with_row(v: Float[Array, "k *b"], row: int, value: Float[Array, "*c"]) -> Float[Array, "k *b"]:
    """v with one row replaced: what `v.at[row].set(value)` gives without a scatter."""
    return jnp.where(_column(v, row), value, v)


def _column(like: Array, row: int) -> np.ndarray:
    """Which row it is, [k, 1, ...]."""
    return (np.arange(like.shape[0]) == row).reshape(-1, *(1,) * (like.ndim - 1))


def norm(v: Float[Array, "3 *b"]) -> Float[Array, "*b"]:
    """Length; 1e-6 (not 0) for the zero vector, with a finite gradient there."""
    return jnp.sqrt(dot(v, v) + TINY)


def unit(v: Float[Array, "3 *b"]) -> Float[Array, "3 *b"]:
    """Direction; the zero vector for the zero vector."""
    return v / norm(v)


def smoothstep(x: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """3 x^2 - 2 x^3 between 0 and 1, constant outside."""
    x = jnp.clip(x, 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)
