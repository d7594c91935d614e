"""High steps: feet are lifted out of shallow water and put down into it steeply, instead of dragged through."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from kernels.vec import smoothstep

FADE = 0.5  # of the depth up to which feet are lifted: how much deeper they no longer are
SHALLOW = 0.1  # of that depth: in less water it only begins


def share(depth: Float[Array, "*b"], most: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """How far feet are lifted out of water of a depth (m; -inf when dry): 1 up to `most` m, 0 in none and much more."""
    depth = jnp.maximum(depth, -most)
    return smoothstep(depth / (SHALLOW * most)) * (1.0 - smoothstep((depth - most) / (FADE * most)))


def raised(
    height: Float[Array, "*b"], needed: Float[Array, "*#b"], flight: Float[Array, "*b"], share: Float[Array, "*#b"]
) -> Float[Array, "*b"]:
    """Height of a foot in flight, m: at least `needed` in the middle of it, less by the fourth power towards its ends.

    So it leaves and meets the water steeply and never jumps; flight: share of it done, 0 or 1 for a foot that stands.
    """
    off = 2.0 * jnp.clip(flight, 0.0, 1.0) - 1.0
    arch = 1.0 - (off * off) ** 2
    return height + share * jnp.maximum(needed * arch - height, 0.0)
