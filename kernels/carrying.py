"""Carrying: how far one leans to balance a load, what its weight turns, and how much slower one walks with it.

The body above its hips is an inverted pendulum: a trunk whose mass m_t has its middle at height c above the hips, and
the load m_l, fixed to it, at (ahead, above) of them.
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from kernels.trig import arctan2, sin_cos
from kernels.vec import TINY

GRAVITY = 9.81  # m/s2
MOST_LEAN = 0.7  # rad: heavier or further loads than this balances are not quite balanced
LEAST_SPEED = 0.2  # of the speed without a load
PANDOLF = 4.0 / 3.0  # m2/s2: 2.0 over 1.5, the constants of standing and walking with a load (Pandolf 1977)


def balanced(
    mass: Float[Array, "*b"], ahead: Float[Array, "*b"], above: Float[Array, "*b"], trunk: Float[Array, "*b"]
) -> Float[Array, "*b"]:
    """Lean (rad, positive forward) at which trunk and load together stand over the hips.

    trunk: m_t c in kg m. m_t c sin(lean) + m_l (ahead cos(lean) + above sin(lean)) = 0; 0 without a load (or with
    nothing above the hips at all), at most MOST_LEAN either way.
    """
    return jnp.clip(arctan2(-mass * ahead, trunk + mass * above), -MOST_LEAN, MOST_LEAN)


def torque(
    mass: Float[Array, "*b"], ahead: Float[Array, "*b"], above: Float[Array, "*b"], pitch: Float[Array, "*b"]
) -> Float[Array, "*b"]:
    """N m with which the load's weight turns a body of this pitch forward about its hips."""
    sin, cos = sin_cos(pitch)
    return GRAVITY * mass * (ahead * cos + above * sin)


def slowed(
    speed: Float[Array, "*b"], mass: Float[Array, "*b"], load: Float[Array, "*b"], size: Float[Array, "*b"]
) -> Float[Array, "*b"]:
    """Speed (m/s) that costs with the load what `speed` costs without: equal metabolic power.

    Pandolf, Givoni and Goldman 1977, level ground: M = 1.5 W + 2.0 (W + L) (L / W)^2 + eta (W + L) 1.5 v^2, eta = 1,
    solved for v. size: over a person's; speeds of other sizes go with its root. At least LEAST_SPEED of `speed`.
    """
    share = load / mass
    square = speed * speed / (1.0 + share) - PANDOLF * size * share * share
    least = LEAST_SPEED * speed
    return jnp.where(load > 0, jnp.sqrt(jnp.maximum(square, least * least) + TINY), speed)
