"""Rows of an array by fixed numbers: joints of a level, limbs of a body.

Indexing makes XLA's CPU backend loop over single numbers, and lays the result out for a loop that nobody asked for, so
that it is copied once more. Here rows that follow each other are copied together. Backwards, rows that were picked
twice add up.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from kernels.wall import Wall, apart

MOST = 8  # pieces that XLA puts together in one loop; of more, it copies each by itself first


def picked(x: Float[Array, "k rows *b"], numbers: np.ndarray, wall: Wall) -> Float[Array, "k picked *b"]:
    """x[:, numbers]."""
    if wall.flag is None:
        return x[:, numbers]

    rows, one = x.shape[1], (x.shape[0], 1, *x.shape[2:])

    def back(_: tuple[()], on: Array) -> Array:
        none = jnp.zeros(one, on.dtype)
        of = ([on[:, i : i + 1] for i in np.flatnonzero(numbers == row)] for row in range(rows))
        return jnp.concatenate([functools.reduce(jnp.add, each) if each else none for each in of], 1)

    return wall.linear(lambda _, x: _laid([x], np.zeros_like(numbers), numbers), back, (), x)


def parted(x: Float[Array, "k rows *b"], parts: int, wall: Wall) -> list[Float[Array, "k some *b"]]:
    """Equal parts of the rows, which backwards are put together, not added up in arrays of zeros."""
    return wall.linear(lambda _, x: jnp.split(x, parts, 1), lambda _, on: jnp.concatenate(on, 1), (), x)


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


def summed(index: np.ndarray | Array, values: Float[Array, "n *b"], rows: int, wall: Wall) -> Float[Array, "rows *b"]:
    """The sum of all values of each row: value i belongs to row index[i].

    Value after value: XLA has no scatter within a loop that is one function (see `crowd.compiler_options`).
    """
    none = jnp.zeros((rows, *values.shape[1:]), values.dtype)
    if wall.flag is None or not len(index):
        return none.at[index].add(values)
    row = jnp.asarray(index)

    def added(i: Array | int, total: Array) -> Array:
        at = row[i]
        own = jax.lax.dynamic_slice_in_dim(total, at, 1) + jax.lax.dynamic_slice_in_dim(values, i, 1)
        return jax.lax.dynamic_update_slice_in_dim(total, own, at, 0)

    return jax.lax.fori_loop(0, len(row), added, none)


def _laid(parts: Sequence[Array], part: np.ndarray, row: np.ndarray) -> Array:
    """Rows row[i] of parts[part[i]], one after the other; none of none."""
    if not len(row):
        return parts[0][:, :0]
    runs = list(_runs(part, row))
    groups = [runs[first : first + MOST] for first in range(0, len(runs), MOST)]
    if len(groups) == 1:
        return _together(runs, *parts)
    return jnp.concatenate([apart(functools.partial(_together, group), *parts) for group in groups], 1)


def _together(runs: Sequence[_Run], *parts: Array) -> Array:
    return jnp.concatenate([run.of(parts[run.part]) for run in runs], 1)


class _Run(NamedTuple):
    """Rows of a part at a constant distance: neighbours (1), the same joint of every leg, or one row again (0)."""

    part: int
    first: int
    step: int
    count: int

    def of(self, x: Array) -> Array:
        if self.step:
            last = self.first + self.step * (self.count - 1)
            return jax.lax.slice_in_dim(x, self.first, last + 1, self.step, axis=1)
        return jnp.broadcast_to(x[:, self.first : self.first + 1], (x.shape[0], self.count, *x.shape[2:]))


def _runs(part: np.ndarray, row: np.ndarray) -> Iterator[_Run]:
    at = 0
    while at < len(row):
        elsewhere = np.flatnonzero(part[at:] != part[at])
        ahead = row[at : at + elsewhere[0]] if len(elsewhere) else row[at:]
        steps = np.diff(ahead)
        step = int(steps[0]) if len(steps) and (steps[0] in (0, 1) or (steps[:2] == steps[0]).sum() == 2) else 1
        other = np.flatnonzero(steps != step)
        count = (int(other[0]) if len(other) else len(steps)) + 1 if step >= 0 else 1
        yield _Run(int(part[at]), int(row[at]), max(step, 0), count)
        at += count
