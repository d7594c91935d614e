"""Asked for against commanded: velocities within limits per second, places along tables, aiming along a curve.

Everything here is per second: the same run at 30 and at 240 Hz gets the same command at the same time.
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from kernels.vec import TINY


def approach(
    command: Float[Array, "2 *b"],
    desired: Float[Array, "2 *b"],
    acceleration: Float[Array, "*#b"],
    deceleration: Float[Array, "*#b"],
    dt: float | Array,
) -> tuple[Float[Array, "2 *b"], Float[Array, "2 *b"]]:
    """The command after dt on its straight way to the desired velocity, and its mean meanwhile (m/s).

    Along the straight line from one velocity to the other the speed first falls (up to the point nearest to standing),
    then rises: `deceleration` (m/s2) bounds the first part, `acceleration` the second. Exact for any dt: two halves
    make a whole, and a command that gets there is the desired velocity to the last bit.
    Spec 6.6 and its defect 8.2 p, a largest change per frame.
    """
    way = desired - command
    size = jnp.sqrt(way[0] ** 2 + way[1] ** 2 + TINY)
    unit = way / size
    falling = jnp.clip(-(command[0] * unit[0] + command[1] * unit[1]), 0.0, size)
    slowing, quickening = falling / deceleration, (size - falling) / acceleration
    first = jnp.minimum(slowing, dt)
    second = jnp.minimum(quickening, dt - first)
    down, up = deceleration * first, acceleration * second
    mean = (down * (dt - 0.5 * first) + up * (dt - first - 0.5 * second)) / dt
    there = slowing + quickening <= dt
    return jnp.where(there, desired, command + unit * (down + up)), command + unit * mean


def between(table: Float[Array, "k m *1"], at: Float[Array, "*b"]) -> Float[Array, "k *b"]:
    """Rows of a table at fractional samples `at`, linear between them and constant beyond its ends.

    The table is one for all characters (`[k, m, 1]`) or each one's own (`[k, m, n]`, for `at` [n]).
    """
    last = table.shape[1] - 1
    at = jnp.clip(at, 0.0, float(last))
    low = jnp.minimum(at.astype(jnp.int32), max(last - 1, 0))
    high = jnp.minimum(low + 1, last)
    if table.shape[-1] == 1:
        before, after = table[:, low, 0], table[:, high, 0]
    else:
        before = jnp.take_along_axis(table, low[None, None], 1)[:, 0]
        after = jnp.take_along_axis(table, high[None, None], 1)[:, 0]
    return before + (after - before) * (at - low.astype(at.dtype))


def braking(
    distance: Float[Array, "*b"], deceleration: Float[Array, "*#b"], time: Float[Array, "*#b"]
) -> Float[Array, "*b"]:
    """m/s, the most from which a character stops within `distance` (m).

    Far off sqrt(2 a d); near the end d / time, so that a body that follows with a lag does not pass it.
    """
    slow = deceleration * time
    return jnp.sqrt(slow * slow + 2.0 * deceleration * jnp.maximum(distance, 0.0)) - slow


def response_time(
    inertia: Float[Array, "*b"],
    gain_forward: Float[Array, "*b"],
    gain_side: Float[Array, "*b"],
    across: Float[Array, "*b"],
) -> Float[Array, "*b"]:
    """s, time constant of Eq. 1 at right angles to the way one walks; `across`: squared sine of way against heading."""
    return inertia / (gain_side + (gain_forward - gain_side) * across)


def pursuit(
    tangent: Float[Array, "2 *b"],
    soon: Float[Array, "2 *b"],
    off: Float[Array, "2 *b"],
    late: Float[Array, "*b"],
    preview: float,
) -> Float[Array, "2 *b"]:
    """Unit direction to ask for so that a body stays on a curve, or comes back to it.

    tangent, soon: unit tangents where the body is and `preview * late` further on; off: from the body to the curve (m);
    late: the way (m) in which the body's direction comes round to the one asked for, speed times time constant T.
    Where the curve turns by k per metre the direction leads by atan(k v T), exactly what the body lags behind; the way
    back aims 2 v T ahead, as in pure pursuit, which damps it by 1 / sqrt(2). Far from the curve straight towards it.
    """
    way = tangent + (soon - tangent) / preview + off / (2.0 * late)
    return way / jnp.sqrt(way[0] ** 2 + way[1] ** 2 + TINY)
