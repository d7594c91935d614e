"""Analytic two-bone inverse kinematics, without trigonometry."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from kernels.vec import TINY, dot

MARGIN = 1e-3  # of the chain's length kept from full stretch, so that the bend plane and the gradient stay defined


def two_bone(
    hip: Float[Array, "3 *b"],
    target: Float[Array, "3 *b"],
    pole: Float[Array, "3 *b"],
    upper: Float[Array, "*#b"],
    lower: Float[Array, "*#b"],
) -> tuple[Float[Array, "3 *b"], Float[Array, "3 *b"], Float[Array, "*b"]]:
    """Knee, reached foot, and how far the target lies out of reach (m, 0 within reach).

    The knee lies in the plane of hip, target and `pole` (a direction from the hip; the clip's own knee direction keeps
    the knee on its side). Law of cosines; one square root of each sum, so that the result does not depend on how XLA
    splits the program. A target out of reach is replaced by the nearest point on its line; a pole along that line
    gives some knee, and stays finite.
    """
    d = target - hip
    distance = jnp.sqrt(dot(d, d) + TINY)
    x = d / distance
    length = upper + lower
    reach = jnp.clip(distance, jnp.abs(upper - lower) + MARGIN * length, length * (1.0 - MARGIN))
    cos = (upper * upper + reach * reach - lower * lower) / (2.0 * upper * reach)
    sin = jnp.sqrt(jnp.maximum(1.0 - cos * cos, TINY))
    p = pole - dot(pole, x) * x
    y = p / jnp.sqrt(dot(p, p) + TINY)
    return hip + upper * (cos * x + sin * y), hip + reach * x, jnp.abs(distance - reach)
