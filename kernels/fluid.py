"""Coefficients of drag as functions of density (Eq. 8)."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

REFERENCE_AREA = 0.2  # m2: B is the offset force on this much projected area (`area` mode)
FADE_SPEED = 0.01  # m/s: the offset force fades below it, by |u|^2 / (|u|^2 + u_0^2)
STILL_SPEED = 1e-4  # m/s: slower triangles do not count (rounding makes planted ones relevant at random)


def sigmoid(density: Float[Array, "*#b"], a: Array, b: Array, c: Array) -> Float[Array, "*b"]:
    """a / (1 + exp(-b (rho - c))), for b of either sign; does not overflow."""
    return a * 0.5 * (1.0 + jnp.tanh(0.5 * b * (density - c)))
