"""Velocity and orientation controllers of the abstract body (Eq. 1 and 2), integrated exactly over a frame."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from kernels.trig import sin_cos


def _decay(z: Float[Array, "*b"]) -> tuple[Float[Array, "*b"], Float[Array, "*b"]]:
    """(1 - exp(-z)) / z and (1 - (1 - exp(-z)) / z) / z, finite at z = 0 (1 and 1/2)."""
    small = z < 1e-2
    safe = jnp.where(small, 1.0, z)
    first = jnp.where(small, 1.0 - z * (0.5 - z * (1.0 / 6.0 - z / 24.0)), (1.0 - jnp.exp(-safe)) / safe)
    second = jnp.where(
        small,
        0.5 - z * (1.0 / 6.0 - z * (1.0 / 24.0 - z / 120.0)),
        (1.0 - (1.0 - jnp.exp(-safe)) / safe) / safe,
    )
    return first, second


def velocity(
    v: Float[Array, "*b"],
    desired: Float[Array, "*b"],
    force: Float[Array, "*b"],
    drag: Float[Array, "*b"],
    mass: Float[Array, "*b"],
    gain: Float[Array, "*b"],
    damping: Float[Array, "*b"],
    dt: float | Array,
) -> tuple[Float[Array, "*b"], Float[Array, "*b"]]:
    """One component of the velocity after dt, and the way travelled meanwhile (m).

    Eq. 1 is implicit, F = k (v_d - v) - b dv/dt, hence (m + b) dv/dt = F_ext - c (v - v_0) + k (v_d - v), where
    c >= 0 is the slope of the external force with the body's own velocity (drag): the body never overshoots the flow,
    however large the force. Steady state v_d + F_ext / k; time constant (m + b) / (k + c). Exact for any k, b, c >= 0.
    """
    inertia = mass + damping
    acceleration = (force + gain * (desired - v)) / inertia
    first, second = _decay((gain + drag) / inertia * dt)
    return v + acceleration * dt * first, v * dt + acceleration * dt * dt * second


def orientation(
    angle: Float[Array, "*b"],
    rate: Float[Array, "*b"],
    desired: Float[Array, "*b"],
    torque: Float[Array, "*b"],
    drag: Float[Array, "*b"],
    inertia: Float[Array, "*b"],
    gain: Float[Array, "*b"],
    damping: Float[Array, "*b"],
    dt: float | Array,
) -> tuple[Float[Array, "*b"], Float[Array, "*b"]]:
    """Angle and rate after dt of I a'' = tau - c (a' - a'_0) + k (a_d - a) - b a' (Eq. 2).

    `desired` is the nearest equivalent of the wanted angle (wrap the difference first). c >= 0: slope of the torque
    with the rate. Closed form for under-, critically and over-damped gains; finite for k = b = 0.
    """
    gain_safe = jnp.maximum(gain, 1e-3)
    rest = desired + (torque + drag * rate) / gain_safe
    half = 0.5 * (damping + drag) / inertia
    square = (gain_safe / inertia - half * half) * dt * dt  # (omega dt)^2, negative when over-damped
    decay = half * dt
    root = jnp.sqrt(jnp.abs(square) + 1e-12)
    near = jnp.abs(square) < 1e-4
    under = square > 0
    # over-damped: exp(-decay) cosh(root) and exp(-decay) sinh(root)/root from two decaying exponentials
    slow, fast = jnp.exp(root - decay), jnp.exp(-root - decay)
    e = jnp.exp(-decay)
    sin, cos = sin_cos(root)
    cosine = jnp.where(under, e * cos, 0.5 * (slow + fast))
    sine = jnp.where(under, e * sin, 0.5 * (slow - fast)) / root
    cosine = jnp.where(near, e * (1.0 - 0.5 * square), cosine)
    sine = jnp.where(near, e * (1.0 - square / 6.0), sine)
    offset = angle - rest
    spin = rate * dt + decay * offset
    new_offset = offset * cosine + spin * sine
    new_rate = (spin * cosine - offset * square * sine) / dt - half * new_offset
    return rest + new_offset, new_rate


def low_pass(dt: float | Array, time: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """Share of the way to its input that a first-order low-pass of this time constant goes in dt; 1 at time 0."""
    return -jnp.expm1(-dt / jnp.maximum(time, 1e-9))


def approach(rate: float, dt: float | Array) -> float | Array:
    """Share of the way to its input that Euler's step of dt goes at a rate in 1/s; a plain number where dt is one."""
    return min(rate * dt, 1.0) if isinstance(dt, float) else jnp.minimum(rate * dt, 1.0)


def wrap(angle: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """The same angle in [-pi, pi)."""
    turn = 2.0 * jnp.pi
    return angle - turn * jnp.floor(angle / turn + 0.5)
