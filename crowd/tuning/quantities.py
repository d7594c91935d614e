"""What a rollout is measured by: signals of every frame, and the quantities made of them over a window."""

from __future__ import annotations

from typing import Literal, get_args

import jax.numpy as jnp
from jax import Array

from crowd.state import State
from kernels.trig import sin_cos
from kernels.vec import TINY

Quantity = Literal["speed", "relative_speed", "drag_force", "lean_deg", "settling_s", "median_drag_coefficient"]
"""speed: along the heading, m/s; relative_speed: over the one asked for; drag_force: N; lean_deg: forward;
settling_s: of the velocity after a disturbance (`settled`); median_drag_coefficient: over triangles (Table 1)."""

SIMULATED: tuple[str, ...] = tuple(name for name in get_args(Quantity) if name != "median_drag_coefficient")
SETTLED = 8.0  # 2 % settling time of exp(-t/T), 4 T, over the centroid of its square, T/2


def signals(state: State) -> dict[str, Array]:
    """[n] each, at the end of a frame."""
    sin, cos = sin_cos(state.heading)
    ahead = state.velocity[0] * sin + state.velocity[1] * cos
    asked = jnp.sqrt(state.command[0] ** 2 + state.command[1] ** 2 + TINY)
    error = state.velocity - state.command
    x, y, z = state.force
    return dict(
        speed=ahead,
        relative_speed=ahead / jnp.maximum(asked, 1e-3),
        drag_force=jnp.sqrt(x * x + y * y + z * z + TINY),
        lean_deg=state.pitch * (180.0 / jnp.pi),
        error=error[0] * error[0] + error[1] * error[1],
    )


def over_window(quantity: str, signal: dict[str, Array], window: Array, time: Array) -> Array:
    """[n] quantity of signals [t, n]. window [t]: Hann, sum 1; time [t]: s since its beginning."""
    if quantity == "settling_s":
        return settled(signal["error"], time)
    return (window[:, None] * signal[quantity]).sum(0)


def settled(error: Array, time: Array) -> Array:
    """[n] s within which a velocity error comes down to 2 %, from its square [t, n] since a disturbance at time 0.

    Of an exponential exactly; of anything else that of the exponential with the same centroid. Smooth, unlike the last
    moment outside a band.
    """
    return SETTLED * (time[:, None] * error).sum(0) / (error.sum(0) + 1e-9)
