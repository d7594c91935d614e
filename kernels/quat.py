"""Unit quaternions `[4, *b]`, wxyz, Hamilton; `q_ab` takes vectors of frame b to frame a."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from kernels.trig import sin_cos
from kernels.vec import TINY


def multiply(a: Float[Array, "4 *b"], b: Float[Array, "4 *c"]) -> Float[Array, "4 *d"]:
    """Hamilton product: first b, then a."""
    aw, ax, ay, az = jnp.unstack(a)
    bw, bx, by, bz = jnp.unstack(b)
    return jnp.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ]
    )


def conjugate(q: Float[Array, "4 *b"]) -> Float[Array, "4 *b"]:
    """Inverse of a unit quaternion."""
    w, x, y, z = jnp.unstack(q)
    return jnp.stack([w, -x, -y, -z])


def rotate(q: Float[Array, "4 *b"], v: Float[Array, "3 *c"]) -> Float[Array, "3 *d"]:
    """v' = v + w t + u x t with t = 2 u x v and q = (w, u)."""
    w, x, y, z = jnp.unstack(q)
    vx, vy, vz = jnp.unstack(v)
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return jnp.stack([vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx])


def normalize(q: Float[Array, "4 *b"]) -> Float[Array, "4 *b"]:
    """The unit quaternion nearest to q; finite at zero."""
    w, x, y, z = jnp.unstack(q)
    return q / jnp.sqrt(w * w + x * x + y * y + z * z + TINY)


def matrix(q: Float[Array, "4 *b"]) -> Float[Array, "3 3 *b"]:
    """Rotation matrix, indexed [column, row]: `m[c]` is where axis c goes."""
    w, x, y, z = jnp.unstack(q)
    columns = [
        [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
        [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
        [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
    ]
    return jnp.stack([jnp.stack(column) for column in columns])


def about_y(angle: Float[Array, "*b"]) -> Float[Array, "4 *b"]:
    """Yaw: +z turns towards +x (to the left) for a positive angle, in radians."""
    half = 0.5 * angle
    sin, cos = sin_cos(half)
    zero = jnp.zeros_like(half)
    return jnp.stack([cos, zero, sin, zero])


def about_x(angle: Float[Array, "*b"]) -> Float[Array, "4 *b"]:
    """Pitch: +y turns towards +z (leans forward) for a positive angle, in radians."""
    half = 0.5 * angle
    sin, cos = sin_cos(half)
    zero = jnp.zeros_like(half)
    return jnp.stack([cos, sin, zero, zero])


def upright(up: Float[Array, "3 *b"], yaw: Float[Array, "*b"]) -> Float[Array, "4 *b"]:
    """Yaw, and then the smallest rotation that takes +y to the unit vector `up`; for -y the yaw alone."""
    ux, uy, uz = jnp.unstack(up)
    sin, cos = sin_cos(0.5 * yaw)
    w = jnp.maximum(1.0 + uy, 0.0) + 1e-7  # rounding may leave it negative
    size = jnp.sqrt(w * w + ux * ux + uz * uz)
    w, x, z = w / size, uz / size, -ux / size
    return jnp.stack([w * cos, x * cos - z * sin, w * sin, x * sin + z * cos])


def between(a: Float[Array, "3 *b"], b: Float[Array, "3 *b"]) -> Float[Array, "4 *b"]:
    """Smallest rotation that takes unit vector a to unit vector b, without trigonometry.

    For exactly opposite vectors every axis is as good; the result is then the identity. Unit however near to opposite.
    """
    ax, ay, az = jnp.unstack(a)
    bx, by, bz = jnp.unstack(b)
    w = jnp.maximum(1.0 + ax * bx + ay * by + az * bz, 0.0) + 1e-7  # rounding may leave it negative
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return jnp.stack([w, x, y, z]) / jnp.sqrt(w * w + x * x + y * y + z * z)
