"""Sums written out for a processor's small kernels; where kernels are large, one that sums several arrays."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

from kernels.wall import Wall

PIECES = 8  # that an axis is added up in behind walls: so many arrays to one, then what is left of the axis


def total_of(terms: Callable[..., Sequence[Array]], wall: Wall, *arguments: Any) -> Array:
    """[terms, ...]: each of the arrays that `terms` makes of the arguments, alike in shape, summed over its first axis.

    Behind walls its length must be a multiple of `PIECES`, and sums are written out (see `added`).
    Without walls they are one reduction with several outputs: otherwise XLA makes several kernels on a GPU, and each
    reads what leads to its terms again (102 400 people with skinned drag on an H200: 3.7 ms a frame instead of 4.6).
    """
    if wall.flag is None:
        return jnp.stack(_together(*jnp.broadcast_arrays(*terms(*arguments))))

    def pieces(*given: Any) -> Array:
        return jnp.stack([added(0, term.reshape(PIECES, -1, *term.shape[1:])) for term in terms(*given)])

    return wall(functools.partial(added, 1), wall(pieces, *arguments))


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def added(axis: int, terms: Array) -> Array:
    """The sum over a short axis, written out: a loop over what is left.

    XLA hands reductions and products of matrices to a library whose threads take longer to wake than so short a sum.
    """
    return functools.reduce(jnp.add, jnp.unstack(terms, axis=axis))


@added.defjvp
def _added_jvp(axis: int, terms: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    """Backwards, one broadcast."""
    return added(axis, *terms), tangents[0].sum(axis)


def spread(size: int, x: Array, wall: Wall) -> Array:
    """[size, ...]: x over and over. Backwards the sum stands alone: in one loop with what it is of, it is slow."""

    def over(_: tuple[()], x: Array) -> Array:
        return jnp.broadcast_to(x, (size, *x.shape))

    return wall.linear(over, lambda _, on: added(0, on), (), jnp.asarray(x))


@jax.custom_jvp
def _together(*terms: Array) -> tuple[Array, ...]:
    zeros = tuple(jnp.zeros((), term.dtype) for term in terms)
    return tuple(jax.lax.reduce(terms, zeros, lambda a, b: tuple(x + y for x, y in zip(a, b, strict=True)), (0,)))


@_together.defjvp
def _together_jvp(terms: tuple[Array, ...], tangents: tuple[Array, ...]) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """JAX knows no transpose of a reduction with several outputs; a sum is linear in its terms."""
    return _together(*terms), tuple(tangent.sum(0) for tangent in tangents)
