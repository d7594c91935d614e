"""Rows by fixed numbers against indexing, values and derivatives."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from kernels.rows import merged, parted, picked, summed
from kernels.wall import Wall, apart, no_wall


@pytest.fixture(params=["indexed", "walls"])
def wall(request: pytest.FixtureRequest) -> Wall:
    return no_wall if request.param == "indexed" else apart


def array(rows: int, batch: tuple[int, ...] = (5,)) -> jax.Array:
    return jnp.asarray(np.random.default_rng(rows).normal(size=(3, rows, *batch)).astype(np.float32))


@pytest.mark.parametrize("batch", [(), (5,), (2, 3)])
@pytest.mark.parametrize("numbers", [[], [0], [3], [0, 1, 2, 3, 4, 5], [5, 4, 3], [1, 2, 4, 4, 4, 0, 1], [2, 2]])
def test_picked(numbers: list[int], batch: tuple[int, ...], wall: Wall) -> None:
    x, rows = array(6, batch), np.array(numbers, int)
    np.testing.assert_array_equal(picked(x, rows, wall), np.asarray(x)[:, rows])
    check_grads(
        lambda x: jnp.sin(picked(jnp.asarray(x), rows, wall)), (x,), order=2, modes=("fwd", "rev"), atol=1e-2, rtol=1e-2
    )


@pytest.mark.parametrize("parts", [[[0, 1, 2]], [[], [1, 0]], [[2, 0], [1]], [[4, 1], [0, 3, 5], [2]]])
def test_merged(parts: list[list[int]], wall: Wall) -> None:
    numbers = [np.array(part, int) for part in parts]
    whole = array(sum(map(len, parts)))
    split = [whole[:, part] for part in numbers]
    np.testing.assert_array_equal(merged(split, numbers, wall), whole)

    def f(*split: jax.Array) -> jax.Array:
        return jnp.sin(merged([jnp.asarray(x) for x in split], numbers, wall))

    check_grads(f, tuple(split), order=2, modes=("fwd", "rev"), atol=1e-2, rtol=1e-2)


def test_under_a_map(wall: Wall) -> None:
    x, rows = array(6, (4, 5)), np.array([1, 1, 5])
    mapped = jax.vmap(lambda x: picked(x, rows, wall), 2, 2)(x)
    np.testing.assert_array_equal(mapped, np.asarray(x)[:, rows])


def test_parted(wall: Wall) -> None:
    x = array(6)
    parts = parted(x, 3, wall)
    np.testing.assert_array_equal(jnp.stack(parts), np.split(np.asarray(x), 3, 1))

    def f(x: jax.Array) -> list[jax.Array]:
        return [jnp.sin((k + 1.0) * part) for k, part in enumerate(parted(jnp.asarray(x), 3, wall))]

    check_grads(f, (x,), order=2, modes=("fwd", "rev"), atol=1e-2, rtol=1e-2)


@pytest.mark.parametrize("index", [[], [0], [3, 3, 3], [2, 0, 5, 0, 2, 2, 1]])
def test_summed(index: list[int], wall: Wall) -> None:
    values = np.random.default_rng(0).normal(size=(len(index), 2, 5)).astype(np.float32)
    expected = np.zeros((6, 2, 5), np.float32)
    np.add.at(expected, np.array(index, int), values)
    found = jax.jit(lambda values: summed(np.array(index, int), values, 6, wall))(values)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)
