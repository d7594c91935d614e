"""Walls between stages: the same numbers through every transformation."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from kernels.wall import no_wall, through
from tests.kernels.checks import assert_close

X = jnp.linspace(-2.0, 2.0, 6).reshape(2, 3)
OPEN = jnp.array(True)


def stages(wall, x):
    """Two stages whose results are a tuple and an array."""
    sine, square = wall(lambda x: (jnp.sin(x), x * x), x)
    return wall(lambda a, b: (a * b).sum(0), sine, square)


WAYS = {
    "jit": lambda run: jax.jit(run)(OPEN, X),
    "vmap": lambda run: jax.vmap(run, in_axes=(None, 1))(OPEN, X),
    "map": lambda run: jax.jit(lambda flag: jax.lax.map(lambda x: run(flag, x), X.T))(OPEN),
    "scan": lambda run: jax.jit(lambda f: jax.lax.scan(lambda c, x: (c, run(f, x)), 0, X.T)[1])(OPEN),
    "reverse": lambda run: jax.jit(jax.grad(lambda x, flag: run(flag, x).sum()))(X, OPEN),
    "forward": lambda run: jax.jvp(lambda x: run(OPEN, x), (X,), (jnp.ones_like(X),))[1],
    "checkpoint": lambda run: jax.jit(jax.grad(lambda x, f: jax.checkpoint(run)(f, x).sum()))(X, OPEN),
}


@pytest.mark.parametrize("way", WAYS)
def test_same_numbers(way: str) -> None:
    walled = WAYS[way](lambda flag, x: stages(through(flag), x))
    plain = WAYS[way](lambda flag, x: stages(no_wall, x))
    assert np.abs(plain).max() > 0.1
    assert_close(walled, plain, 1e-6)


def test_result_keeps_structure_and_types() -> None:
    out = through(OPEN)(lambda x: {"whole": x.astype(jnp.int32), "sign": x > 0}, X)
    assert out["whole"].dtype == jnp.int32
    assert out["sign"].dtype == jnp.bool_
    assert (out["sign"] == (X > 0)).all()


def test_stays_in_the_program() -> None:
    """The compiler must not see through it: one conditional for each stage, in the compiled program too."""
    compiled = jax.jit(lambda flag, x: stages(through(flag), x)).lower(OPEN, X).compile().as_text() or ""
    plain = jax.jit(lambda x: stages(no_wall, x)).lower(X).compile().as_text() or ""
    assert compiled.count(" conditional(") == 2
    assert plain
    assert "conditional(" not in plain


def test_closed_wall_gives_zeros() -> None:
    assert (stages(through(jnp.array(False)), X) == 0).all()
