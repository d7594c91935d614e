"""Linear waves on water of finite depth: a sum of sines that travel, with the motion of the water under them.

Airy's theory: a component rises by a cos(theta) with theta = k.x - omega t + phase, and sigma^2 = g k tanh(k h) in the
frame that drifts with the current U; seen from the ground omega = sigma + k.U. The water moves by
    a sigma cosh(k (y + h)) / sinh(k h) cos(theta)  along the wave, and
    a sigma sinh(k (y + h)) / sinh(k h) sin(theta)  upwards,
y <= 0 counted from the still level: free of divergence and of curl. Above that, in crests, it is taken as at y = 0.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from kernels.trig import sin_cos
from kernels.wall import Wall, no_wall

GRAVITY = 9.81  # m/s2
DEEP = 20.0  # k h and -k y beyond it make no difference in float32
TURN = 6.283185307179586


class Waves(NamedTuple):
    """W components."""

    amplitude: Array  # [W] m
    number: Array  # [2, W] rad/m, (x, z): the direction they go
    frequency: Array  # [W] rad/s, sigma: in the frame of the current
    apparent: Array  # [W] rad/s, omega: seen from the ground
    phase: Array  # [W] rad
    depth: Array  # [W] m, of the water under the still level


def dispersion(number: Float[Array, "*b"], depth: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """sigma = sqrt(g k tanh(k h)), rad/s."""
    return jnp.sqrt(GRAVITY * number * jnp.tanh(number * depth))


def phases(waves: Waves, place: Float[Array, "2 *b"], time: Float[Array, "*b"]) -> Float[Array, "w *b"]:
    """theta of every component at places (x, z) in m and times in s, within one turn."""
    tail = (-1, *(1,) * time.ndim)
    kx, kz, omega, phase = (
        x.reshape(tail) * (1.0 / TURN) for x in (waves.number[0], waves.number[1], waves.apparent, waves.phase)
    )
    cycles = kx * place[0] + kz * place[1] - omega * time + phase
    return (cycles - jnp.floor(cycles)) * TURN


def rise(amplitude: Float[Array, "w *b"], phase: Float[Array, "w *b"]) -> Float[Array, "*b"]:
    """Height of the surface above the still level, m."""
    return (amplitude * sin_cos(phase)[1]).sum(0)


def motion(
    waves: Waves,
    amplitude: Float[Array, "w *b"],
    phase: Float[Array, "w *b"],
    points: Float[Array, "3 p *b"],
    still: Float[Array, "*b"],
    wall: Wall = no_wall,
) -> Float[Array, "4 p *b"]:
    """Rise of the surface (m) above, and velocity (3, m/s) of the water at, points about the place of `phase`.

    points: m from that place; still: height of the still level above it, m; amplitude: m, 0 where there are no waves.
    """
    x, z = points[0], points[2]
    height = jnp.minimum(points[1] - still, 0.0)

    def component(total: tuple[Array, ...], one: tuple[Array, ...]) -> tuple[tuple[Array, ...], None]:
        amplitude, phase, kx, kz, sigma, depth = one
        number = jnp.sqrt(kx * kx + kz * kz)
        bottom = jnp.exp(-2.0 * jnp.minimum(number * depth, DEEP))
        speed = amplitude * sigma / (1.0 - bottom)
        # each of these is needed four times: without walls a CPU would compute it as often
        angle = wall(lambda phase, kx, kz, x, z: phase + kx * x + kz * z, phase, kx, kz, x, z)
        sine, cosine = wall(lambda angle: sin_cos(angle)[0], angle), wall(lambda angle: sin_cos(angle)[1], angle)
        up = wall(_decay, number, depth, height)
        down = wall(lambda bottom, up: bottom / up, bottom, up)
        along = wall(lambda s, up, down, cosine: s * (up + down) * cosine, speed / number, up, down, cosine)
        upward = wall(lambda s, up, down, sine: s * (up - down) * sine, speed, up, down, sine)
        rise, ahead, upwards, aside = total
        return wall(
            lambda *t: (t[0] + amplitude * cosine, t[1] + along * kx, t[2] + upward, t[3] + along * kz),
            rise,
            ahead,
            upwards,
            aside,
        ), None

    each = (amplitude, phase, waves.number[0], waves.number[1], waves.frequency, waves.depth)
    zero = jnp.zeros(points.shape[1:], points.dtype)
    total, _ = jax.lax.scan(component, (zero, zero, zero, zero), each)
    return jnp.stack(total)


def _decay(number: Array, depth: Array, height: Array) -> Array:
    """exp(k y), y at most the depth below the still level."""
    return jnp.exp(jnp.maximum(number * jnp.maximum(height, -depth), -DEEP))
