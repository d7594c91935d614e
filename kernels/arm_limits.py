"""Arms that are raised: hysteresis of when, and how far shoulders and elbows let a hand go."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from kernels.vec import TINY, axis, dot

SOFT = 0.06  # of the arm's length: width over which a limit of its reach sets in


def play(value: Float[Array, "*b"], low: Float[Array, "*b"], high: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """The value, moved as little as brings it between low and high: a link with play (backlash).

    With low <= high two readings of one quantity, shifted against each other by a band, the value goes up with the low
    one and comes down with the high one, and stands still while the quantity wavers by less than the band.
    """
    return jnp.minimum(jnp.maximum(value, low), high)


def span(upper: Float[Array, "*#b"], lower: Float[Array, "*#b"], cos_elbow: Float[Array, "*#b"]) -> Float[Array, "*#b"]:
    """m from shoulder to hand of an arm whose elbow has this angle (law of cosines; 180 degrees: stretched)."""
    return jnp.sqrt(upper * upper + lower * lower - 2.0 * upper * lower * cos_elbow + TINY)


def limited(
    hand: Float[Array, "3 *b"],
    nearest: Float[Array, "*#b"],
    longest: Float[Array, "*#b"],
    tan_back: Float[Array, "*#b"],
) -> Float[Array, "3 *b"]:
    """A hand's place from its shoulder (out of the body, up, ahead; trunk's axes), brought where the joints let it go.

    Out: never across the upright plane through the shoulder that bounds the trunk and head on its side, so that neither
    hand nor forearm passes through them. Ahead: at most the angle of `tan_back` behind the plane of the shoulders. Then
    the distance, between nearest and longest, which the direction survives; limits of distance set in softly and are
    never passed. A hand on its shoulder goes to `nearest`, straight out.
    """
    out, up, ahead = hand
    out = jnp.maximum(out, 0.0)
    aside = jnp.sqrt(out * out + up * up + TINY)
    ahead = jnp.maximum(ahead, -tan_back * aside)
    allowed = jnp.stack([out, up, ahead])
    distance = jnp.sqrt(dot(allowed, allowed) + TINY)
    none = distance < 1e-4 * longest
    direction = jnp.where(none, axis(hand, 0), allowed / distance)
    soft = SOFT * longest
    near = 0.5 * (distance + nearest + jnp.sqrt((distance - nearest) ** 2 + soft * soft))
    far = 0.5 * (near + longest - jnp.sqrt((near - longest) ** 2 + soft * soft))
    return direction * jnp.maximum(far, nearest)
