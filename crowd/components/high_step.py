"""High steps in shallow water. Absent from the program of a herd without `responses.high_step`."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from crowd.params import Character
from kernels import high_step


def raised(character: Character, depth: Array, ground: Array, height: Array, flight: Array) -> Array:
    """[L, n] m, heights of feet [L, n] on their way out of the water and back into it.

    depth [n]: of the fluid where the character stands, -inf when dry; ground [L, n]: what heights are counted from, so
    that `depth` above it is the surface; flight [L, n]: share of the flight done.
    """
    own = character.responses.high_step
    assert own is not None
    share = high_step.share(depth, own.most)
    return ground + high_step.raised(height - ground, jnp.maximum(depth, 0.0) + own.clearance, flight, share)
