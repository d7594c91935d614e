"""Eddies in the ground plane: a sum of random waves of velocity, each across its own direction.

u = sum_m a_m (-k_z, k_x) / |k| cos(k.x - omega t + phase): every term is free of divergence, hence the sum. With equal
amplitudes a = 2 I / sqrt(M) each horizontal component has the root mean square I. omega = k.U carries the eddies along
with the mean flow U (Taylor's frozen turbulence), plus a rate of their own at which they change.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from kernels.trig import sin_cos
from kernels.wall import Wall, no_wall

TURN = 6.283185307179586


class Eddies(NamedTuple):
    """M modes."""

    amplitude: Array  # [M] m/s
    number: Array  # [2, M] rad/m (x, z)
    frequency: Array  # [M] rad/s, seen from the ground
    phase: Array  # [M] rad


def phases(eddies: Eddies, place: Float[Array, "2 *b"], time: Float[Array, "*b"]) -> Float[Array, "m *b"]:
    """k.x - omega t + phase of every mode at places (x, z) in m and times in s, within one turn."""
    tail = (-1, *(1,) * time.ndim)
    kx, kz, omega, phase = (
        x.reshape(tail) * (1.0 / TURN) for x in (eddies.number[0], eddies.number[1], eddies.frequency, eddies.phase)
    )
    cycles = kx * place[0] + kz * place[1] - omega * time + phase
    return (cycles - jnp.floor(cycles)) * TURN


def velocity(
    eddies: Eddies,
    amplitude: Float[Array, "m *b"],
    phase: Float[Array, "m *b"],
    points: Float[Array, "3 p *b"],
    wall: Wall = no_wall,
) -> Float[Array, "2 p *b"]:
    """m/s (x, z) at points about the place of `phase`, m; amplitude: m/s, 0 where there are no eddies."""
    x, z = points[0], points[2]

    def mode(total: tuple[Array, Array], one: tuple[Array, ...]) -> tuple[tuple[Array, Array], None]:
        amplitude, phase, kx, kz = one
        angle = wall(lambda phase, kx, kz, x, z: phase + kx * x + kz * z, phase, kx, kz, x, z)
        size = amplitude / jnp.sqrt(kx * kx + kz * kz)
        cosine = wall(lambda size, angle: size * sin_cos(angle)[1], size, angle)
        return wall(lambda a, b, cosine: (a - cosine * kz, b + cosine * kx), *total, cosine), None

    zero = jnp.zeros(points.shape[1:], points.dtype)
    total, _ = jax.lax.scan(mode, (zero, zero), (amplitude, phase, eddies.number[0], eddies.number[1]))
    return jnp.stack(total)
