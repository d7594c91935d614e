"""A rain of impulses: each character is struck at random, by its own numbers alone."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from kernels.trig import sin_cos

TURN = 6.283185307179586


def impulses(
    key: Array, number: Int[Array, "n"], frame: Int[Array, "n"], rate: Array, size: Array, dt: float | Array
) -> Float[Array, "2 n"]:
    """Impulse (x, z) in N s on each character in a frame; mostly 0.

    A character is struck with probability 1 - exp(-rate dt), in any direction, by 0.5 to 1.5 times `size`. The draw
    comes from the key, the character's number and the frame: it is the same whoever else there is.
    """

    def drawn(number: Array, frame: Array) -> Array:
        return jax.random.uniform(jax.random.fold_in(jax.random.fold_in(key, number), frame), (3,))

    chance, way, strength = jax.vmap(drawn, out_axes=1)(number, frame)
    struck = jnp.where(chance < -jnp.expm1(-rate * dt), size * (0.5 + strength), 0.0)
    sine, cosine = sin_cos(TURN * way)
    return jnp.stack([struck * sine, struck * cosine])
