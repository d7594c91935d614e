"""Sums written out and totals of several arrays at once: against NumPy, values and derivatives."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from kernels.drag_moments import summed, term_by_term
from kernels.totals import PIECES, added, spread, total_of
from kernels.wall import Wall, apart, no_wall
from tests.kernels.checks import assert_close, in_double


@pytest.fixture(params=["one reduction", "written out"])
def wall(request: pytest.FixtureRequest) -> Wall:
    return no_wall if request.param == "one reduction" else apart


@pytest.mark.parametrize("shape", [(PIECES,), (2 * PIECES, 1), (3 * PIECES, 3, 2)])
def test_sums(wall: Wall, shape: tuple[int, ...]) -> None:
    terms = [np.random.default_rng(k).normal(size=shape) for k in range(3)]
    found = in_double(lambda *terms: total_of(lambda *terms: terms, wall, *terms), *terms)
    assert_close(found, np.stack([term.sum(0) for term in terms]), 1e-12)


def test_sums_over_any_axis() -> None:
    x = np.random.default_rng(0).normal(size=(3, 1, 5))
    for axis in range(3):
        assert_close(in_double(functools.partial(added, axis), x), x.sum(axis), 1e-12)
        check_grads(lambda x, axis=axis: added(axis, jnp.asarray(x)), (jnp.asarray(x),), order=2, modes=("fwd", "rev"))


@pytest.mark.parametrize("batch", [(), (5,), (2, 3)])
def test_products_written_out(batch: tuple[int, ...]) -> None:
    """Rows and values of blocks: what `summed` makes of them, and its derivatives in both."""
    rng = np.random.default_rng(2)
    rows, values = rng.normal(size=(3, 4, 6)), rng.normal(size=(3, 6, *batch))
    expected = np.einsum("bkt,bt...->bk...", rows, values)
    assert_close(in_double(term_by_term, rows, values), expected, 1e-12)
    assert_close(in_double(summed, rows, values), expected, 1e-12)

    def f(rows: jax.Array, values: jax.Array) -> jax.Array:
        return term_by_term(jnp.asarray(rows), jnp.asarray(values))

    check_grads(f, (rows, values), order=2, modes=("fwd", "rev"), atol=1e-2, rtol=1e-2)


def test_derivatives(wall: Wall) -> None:
    x = jnp.asarray(np.random.default_rng(1).normal(size=(PIECES, 2)))

    def f(x: jax.Array) -> jax.Array:
        return jnp.sin(total_of(lambda x: [x, x * x, jnp.ones_like(x)], wall, jnp.asarray(x)))

    check_grads(f, (x,), order=2, modes=("fwd", "rev"), atol=1e-2, rtol=1e-2)


@pytest.mark.parametrize("shape", [(), (5,), (2, 3)])
def test_spread(wall: Wall, shape: tuple[int, ...]) -> None:
    x = np.random.default_rng(0).normal(size=shape).astype(np.float32)
    np.testing.assert_array_equal(spread(4, jnp.asarray(x), wall), np.stack([x] * 4))
    weights = jnp.arange(1.0, 5.0).reshape(4, *(1,) * len(shape))
    slope = jax.grad(lambda x: (weights * spread(4, x, wall)).sum())(jnp.asarray(x))
    np.testing.assert_allclose(slope, np.full(shape, 10.0), rtol=1e-6)
