"""Sampling cyclic clips from one table, and blending them."""

from __future__ import annotations

import functools

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from kernels.wall import Wall, no_wall


def frame_weights(
    clip: Int[Array, "slots *b"], phase: Float[Array, "slots *b"], weight: Float[Array, "slots *b"], samples: int
) -> tuple[Int[Array, "2 slots *b"], Float[Array, "2 slots *b"]]:
    """The two table columns on either side of each phase, and their share of the blend.

    Clip c holds columns [c * samples, (c + 1) * samples) at phases 0, 1/samples, ...; the clip is cyclic.
    """
    at = phase * samples
    first = jnp.clip(jnp.floor(at).astype(jnp.int32), 0, samples - 1)
    second = jnp.where(first + 1 >= samples, 0, first + 1)
    share = jnp.clip(at - first, 0.0, 1.0)  # 1, not 0, at phase 1, which wrapping a tiny negative phase gives
    column = clip * samples
    return jnp.stack([column + first, column + second]), jnp.stack([(1.0 - share) * weight, share * weight])


def blend(
    table: Float[Array, "columns k rows"],
    column: Int[Array, "2 slots *b"],
    share: Float[Array, "2 slots *b"],
    wall: Wall = no_wall,
) -> Float[Array, "k rows *b"]:
    """Weighted sum of table columns. Quaternions of one row must lie on one hemisphere; the sum is not normalised.

    Each column lies in one piece, and so does the sum of a character's columns: picked number by number into
    [k, rows, *b] they take four times as long as summed as they lie and turned afterwards.
    """
    return wall(lambda mixed: jnp.moveaxis(mixed, (-2, -1), (0, 1)), wall(_mixed, table, column, share))


def _mixed(table: Array, column: Array, share: Array) -> Array:
    """[*b, k, rows]."""
    ends = [(end, slot) for end in range(2) for slot in range(column.shape[1])]
    return functools.reduce(jnp.add, (table[column[at]] * share[at][..., None, None] for at in ends))
