"""Leg clearance: no foot is put down across another, and none swings through one that is in its way.

Legs are seen from above as their feet, segments in the ground plane: shanks stand over them, so what passes a foot
passes the leg.
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from kernels.vec import TINY

SHORT = 1e-6  # m2, of the squared length: points of no length keep finite gradients, feet are off by a few micrometres
OUT = 0.25  # of the gap: how strongly feet give way to their own side, which decides where segments cross


def beside(
    place: Float[Array, "2 *b"],
    other: Float[Array, "2 *b"],
    left: Float[Array, "2 *#b"],
    side: Float[Array, "*#b"],
    gap: Float[Array, "*#b"],
) -> Float[Array, "2 *b"]:
    """The place (x, z) moved to its own side of another until they are `gap` m apart across; as it is when they are.

    left: unit vector to the left; side: 1 for a left leg, -1 for a right one, 0 for one that has no side.
    """
    across = (place[0] - other[0]) * left[0] + (place[1] - other[1]) * left[1]
    return place + left * (side * jnp.maximum(gap - side * across, 0.0))


def between(
    start: Float[Array, "2 *b"],
    end: Float[Array, "2 *b"],
    other_start: Float[Array, "2 *b"],
    other_end: Float[Array, "2 *b"],
) -> Float[Array, "2 *b"]:
    """From the nearest point of another segment to that of the own one (x, z); zero where they cross.

    The nearest points by Ericson, Real-Time Collision Detection, section 5.1.9; segments may be points.
    """
    own, its = end - start, other_end - other_start
    apart = start - other_start
    a, e = own[0] * own[0] + own[1] * own[1] + SHORT, its[0] * its[0] + its[1] * its[1] + SHORT
    b = own[0] * its[0] + own[1] * its[1]
    c, f = own[0] * apart[0] + own[1] * apart[1], its[0] * apart[0] + its[1] * apart[1]
    square = a * e - b * b
    s = jnp.clip((b * f - c * e) / jnp.maximum(square, 1e-6 * a * e), 0.0, 1.0)
    t = jnp.clip((b * s + f) / e, 0.0, 1.0)
    s = jnp.clip((b * t - c) / a, 0.0, 1.0)
    return apart + own * s - its * t


def given_way(way: Float[Array, "2 *b"], out: Float[Array, "2 *b"], gap: Float[Array, "*#b"]) -> Float[Array, "2 *b"]:
    """How far (x, z) a foot gives way that should be `gap` m from another and is `way` from it; 0 when it is.

    out: unit vector away from the body's middle, the way that feet take where they would meet.
    """
    distance = jnp.sqrt(way[0] * way[0] + way[1] * way[1] + TINY)
    x, z = way + out * (OUT * gap)
    size = jnp.sqrt(x * x + z * z + TINY)
    return jnp.stack([x, z]) / size * jnp.maximum(gap - distance, 0.0)
