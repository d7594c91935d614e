"""Effort: the speed that fluid leaves a character, known from the drag it last felt, and what it then gives up.

Drag on a wading body goes about as F = w h (C rho u^2 + B / A_ref): u its speed through the fluid, h how deep it
stands, w the width that it seems to have (legs that swing count for more than their own). Width is nearly a constant of
the body, whatever depth, speed and fluid, and is kept while one stands still; everything else is known at once.
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from kernels.fluid import REFERENCE_AREA
from kernels.vec import TINY

FREE, WALKS, RESTS = 0, 1, 2
FASTER = 1.05  # than a walk: a speed asked for that is a jog
HALF = 0.5  # of the speed asked for: a walk slower than this ends, too, however slow was asked for


def pressure(
    speed: Float[Array, "*b"], density_drag: Float[Array, "*b"], offset: Float[Array, "*b"]
) -> Float[Array, "*b"]:
    """Pa on whatever faces the flow: C rho u^2 + B / A_ref."""
    return density_drag * speed * speed + offset / REFERENCE_AREA


def attainable(
    wanted: Float[Array, "*b"],
    current: Float[Array, "*b"],
    quadratic: Float[Array, "*b"],
    offset: Float[Array, "*b"],
    gain: Float[Array, "*b"],
) -> Float[Array, "*b"]:
    """m/s over ground at which the velocity controller balances drag: gain (wanted - v) = quadratic u^2 + offset.

    u = v + current, the speed through fluid that comes towards the character at `current`. Where the offset alone is
    more than the controller has, u = 0: the speed is then -current, and not below. `wanted` without drag.
    """
    excess = gain * (wanted + current) - offset
    push = jnp.maximum(excess, 0.0)
    # the root of quadratic u^2 + gain u = push in the form that stays whole at quadratic = 0
    speed = 2.0 * push / (gain + jnp.sqrt(gain * gain + 4.0 * quadratic * push + TINY))
    return speed - current


def gear(
    before: Int[Array, "*b"],
    jog: Float[Array, "*b"],
    walk: Float[Array, "*b"],
    asked: Float[Array, "*b"],
    walking: Float[Array, "*b"],
    walk_below: Float[Array, "*#b"],
    stop_below: Float[Array, "*#b"],
    hysteresis: Float[Array, "*#b"],
) -> Int[Array, "*b"]:
    """FREE, WALKS or RESTS after a frame.

    asked, walking: m/s, speed asked for, and usual speed of a walk; jog, walk: attainable of what is asked for, and of
    the slower of both. One falls below a threshold, and rises above it times 1 + hysteresis: in between one stays as
    one is. Who asks for no more than a walk is FREE, or RESTS.
    """
    stop = jnp.minimum(stop_below, HALF * jnp.minimum(asked, walking))
    rests = walk < stop * jnp.where(before == RESTS, 1.0 + hysteresis, 1.0)
    walks = (asked > FASTER * walking) & (jog < walk_below * jnp.where(before >= WALKS, 1.0 + hysteresis, 1.0))
    return jnp.where(rests, RESTS, jnp.where(walks, WALKS, FREE)).astype(before.dtype)
