"""Rows of an array by fixed numbers: joints of a level, limbs of a body.

Indexing makes XLA's CPU backend loop over single numbers, and lays the result out for a loop that nobody asked for, so
that it is copied once more. Here rows that follow each other are copied together. Backwards, rows that were picked
twice add up.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from kernels.wall import Wall


def picked(x: Float[Array, "k rows *b"], numbers: np.ndarray, wall: Wall) -> Float[Array, "k picked *b"]:
    """x[:, numbers]."""
    if wall.flag is None:
        return x[:, numbers]

    def back(_: tuple[()], on: Array) -> Array:
        none = jnp.zeros_like(on[:, :1])
        of = ([on[:, i : i + 1] for i in np.flatnonzero(numbers == row)] for row in range(x.shape[1]))
        return jnp.concatenate([functools.reduce(jnp.add, each) if each else none for each in of], 1)

    return wall.linear(lambda _, x: _laid([x], np.zeros_like(numbers), numbers), back, (), x)


def merged(parts: Sequence[Array], numbers: Sequence[np.ndarray], wall: Wall) -> Float[Array, "k rows *b"]:
    """The array of which part i [k, some, *b] holds the rows numbers[i]: each row once."""
    back = np.argsort(np.concatenate(numbers))
    if wall.flag is None:
        return jnp.concatenate(parts, 1)[:, back]
    part = np.repeat(np.arange(len(parts)), [len(own) for own in numbers])[back]
    row = np.concatenate([np.arange(len(own)) for own in numbers])[back]

    def split(_: tuple[()], on: Array) -> list[Array]:
        return [_laid([on], np.zeros_like(own), own) for own in numbers]

    return wall.linear(lambda _, parts: _laid(parts, part, row), split, (), list(parts))


def _laid(parts: Sequence[Array], part: np.ndarray, row: np.ndarray) -> Array:
    """Rows row[i] of parts[part[i]], one after the other."""
    pieces = [jax.lax.slice_in_dim(parts[one], first, last, axis=1) for one, first, last in _runs(part, row)]
    return jnp.concatenate(pieces, 1)


def _runs(part: np.ndarray, row: np.ndarray) -> Iterator[tuple[int, int, int]]:
    """(part, first row, end) of stretches of rows that follow each other."""
    ends = np.flatnonzero((np.diff(part) != 0) | (np.diff(row) != 1)) + 1
    for stretch in np.split(np.arange(len(row)), ends):
        first, last = stretch[0], stretch[-1]
        yield int(part[first]), int(row[first]), int(row[last]) + 1
