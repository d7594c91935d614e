"""Totals of several arrays at once: against NumPy, both ways of summing, values and derivatives."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from kernels.totals import total_of
from kernels.wall import Wall, apart, no_wall


@pytest.fixture(params=["one reduction", "one each"])
def wall(request: pytest.FixtureRequest) -> Wall:
    return no_wall if request.param == "one reduction" else apart


@pytest.mark.parametrize("shape", [(7,), (5, 1), (4, 3, 2), (0, 3)])
def test_sums(wall: Wall, shape: tuple[int, ...]) -> None:
    terms = [np.random.default_rng(k).normal(size=shape) for k in range(3)]
    for axis in range(len(shape)):
        found = total_of(axis, [jnp.asarray(term) for term in terms], wall)
        np.testing.assert_allclose(found, np.stack([term.sum(axis) for term in terms]), atol=1e-6)


def test_derivatives(wall: Wall) -> None:
    x = jnp.asarray(np.random.default_rng(1).normal(size=(6, 2)))

    def f(x: jax.Array) -> jax.Array:
        x = jnp.asarray(x)
        return jnp.sin(total_of(0, [x, x * x, jnp.ones_like(x)], wall))

    check_grads(f, (x,), order=2, modes=("fwd", "rev"), atol=1e-2, rtol=1e-2)
