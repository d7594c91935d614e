"""Walls between stages: the same numbers through every transformation."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from kernels.wall import apart, no_wall
from tests.kernels.checks import assert_close

X = jnp.linspace(-2.0, 2.0, 6).reshape(2, 3)
OPEN = jnp.array(True)


def stages(wall, x):
    """Two stages whose results are a tuple and an array."""
    sine, square = wall(lambda x: (jnp.sin(x), x * x), x)
    return wall(lambda a, b: (a * b).sum(0), sine, square)


def enclosing(wall, x):
    """A stage that gets part of what it is differentiated by from its surroundings, with results of other types."""
    scale = jnp.exp(x[0])
    value, sign, count = wall(lambda x: (x * scale, x > 0, (x * scale).astype(jnp.int32)), x)
    return wall(lambda value, sign, count: jnp.where(sign, value, count * value).sum(0), value, sign, count)


WEIGHTS = jnp.linspace(0.5, 1.5, 8).reshape(4, 2)


def linear(wall, x):
    """A product with constants, whose transpose is told, of what two stages make."""
    sine = wall(jnp.sin, x)
    return wall.linear(lambda w, x: w @ x, lambda w, y: w.T @ y, WEIGHTS, sine)[1:3] ** 2


STAGES = {"stages": stages, "enclosing": enclosing, "linear": linear}

WAYS = {
    "jit": lambda run: jax.jit(run)(OPEN, X),
    "vmap": lambda run: jax.vmap(run, in_axes=(None, 1))(OPEN, X),
    "map": lambda run: jax.jit(lambda flag: jax.lax.map(lambda x: run(flag, x), X.T))(OPEN),
    "scan": lambda run: jax.jit(lambda f: jax.lax.scan(lambda c, x: (c, run(f, x)), 0, X.T)[1])(OPEN),
    "vmap of reverse": lambda run: jax.vmap(jax.grad(lambda x: run(OPEN, x).sum()))(jnp.stack([X, 2 * X, X - 1])),
    "twice": lambda run: jax.jit(jax.hessian(lambda x: run(OPEN, x).sum()))(X),
    "reverse": lambda run: jax.jit(jax.grad(lambda x, flag: run(flag, x).sum()))(X, OPEN),
    "forward": lambda run: jax.jvp(lambda x: run(OPEN, x), (X,), (jnp.ones_like(X),))[1],
    "checkpoint": lambda run: jax.jit(jax.grad(lambda x, f: jax.checkpoint(run)(f, x).sum()))(X, OPEN),
}


WALLS = {"wall": lambda _: apart, "gate": apart.gate, "gate in a gate": lambda flag: apart.gate(flag).gate(flag)}


@pytest.mark.parametrize("kind", STAGES)
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("wall", WALLS)
def test_same_numbers(wall: str, way: str, kind: str) -> None:
    walled = WAYS[way](lambda flag, x: STAGES[kind](WALLS[wall](flag), x))
    plain = WAYS[way](lambda flag, x: STAGES[kind](no_wall, x))
    assert np.abs(plain).max() > 0.1
    assert_close(walled, plain, 1e-6)


def test_a_flag_for_each_of_a_batch() -> None:
    """Then nothing is left out, but closed walls still give zeros; backwards, too."""
    flags = jnp.array([True, False])
    both = jnp.stack([X, X])
    value, slope = jax.vmap(jax.value_and_grad(lambda x, flag: stages(apart.gate(flag), x).sum()))(both, flags)
    expected = jax.grad(lambda x: stages(no_wall, x).sum())(X)
    assert_close(value, jnp.array([stages(no_wall, X).sum(), 0.0]), 1e-6)
    assert_close(slope, jnp.stack([expected, jnp.zeros_like(X)]), 1e-6)


def test_a_told_transpose_is_used() -> None:
    def run(x):
        return apart.gate(OPEN).linear(lambda w, x: w @ x, lambda w, y: 2.0 * (w.T @ y), WEIGHTS, x).sum()

    assert_close(jax.grad(run)(X), 2.0 * jnp.broadcast_to(WEIGHTS.sum(0)[:, None], X.shape), 1e-6)


def looped(wall, scale, count, x):
    """Linear in two arrays, by a loop that JAX cannot go back through: its length is only known when it runs."""

    def forth(given, x):
        scale, count = given
        return jax.lax.fori_loop(0, count, lambda _, y: y * scale, x["one"] + 2.0 * x["other"].sum(0))

    def back(given, y):
        scale, count = given
        y = jax.lax.fori_loop(0, count, lambda _, y: y * scale, y)
        return {"one": y, "other": jnp.broadcast_to(2.0 * y, X.shape)}

    return wall.linear(forth, back, (scale, count), x)


@pytest.mark.parametrize("way", ["grad", "vmap of grad", "grad of vmap", "of one only"])
def test_a_told_transpose_of_a_loop(way: str) -> None:
    def run(x):
        return (looped(apart, jnp.float32(0.5), jnp.int32(3), {"one": jnp.sin(x[0]), "other": x}) ** 2).sum()

    def plain(x):
        return ((0.125 * (jnp.sin(x[0]) + 2.0 * x.sum(0))) ** 2).sum()

    def still(f, x):
        return f(jnp.concatenate([x[:1], jax.lax.stop_gradient(X[1:])]))

    several = jnp.stack([X, 2 * X, X - 1])
    ways = {
        "grad": lambda f: jax.grad(f)(X),
        "vmap of grad": lambda f: jax.vmap(jax.grad(f))(several),
        "grad of vmap": lambda f: jax.jit(jax.grad(lambda x: jax.vmap(f, in_axes=1)(x).sum()))(several.swapaxes(0, 1)),
        "of one only": lambda f: jax.grad(lambda x: still(f, x))(X),
    }
    assert_close(ways[way](run), ways[way](plain), 1e-5)


def test_backwards_it_keeps_its_arguments_only() -> None:
    """And its derivative is one more wall, not arrays that the first one returns."""

    def run(x):
        return apart.gate(OPEN)(lambda x: jnp.sin(jnp.cos(x) * jnp.exp(x)), x)

    known = jax.make_jaxpr(lambda x: jax.linearize(run, x)[0])(X)
    kept = jax.tree.leaves(jax.linearize(run, X)[1])
    assert len(known.jaxpr.eqns) == 1
    assert sum(leaf.size for leaf in kept if hasattr(leaf, "size")) <= X.size + 1


def test_results_that_do_not_change_cost_nothing_backwards() -> None:
    """No derivative is taken of what depends on no argument that varies."""

    def run(x, still):
        moved, other = apart.gate(OPEN)(lambda x, still: (jnp.sin(x), jnp.cos(still)), x, still)
        return moved.sum(), other

    text = str(jax.make_jaxpr(lambda x, still: jax.jvp(lambda x: run(x, still), (x,), (x,))[1])(X, X))
    assert text.count("wall[") == 2


def test_result_keeps_structure_and_types() -> None:
    out = apart.gate(OPEN)(lambda x: {"whole": x.astype(jnp.int32), "sign": x > 0}, X)
    assert out["whole"].dtype == jnp.int32
    assert out["sign"].dtype == jnp.bool_
    assert (out["sign"] == (X > 0)).all()


def test_stays_in_the_program() -> None:
    """The compiler must not see through it: one call or conditional for each stage, in the compiled program too."""

    def text(run) -> str:
        return jax.jit(run).lower(OPEN, X).compile().as_text() or ""

    plain = text(lambda _, x: stages(no_wall, x))
    for wall, kept in ((lambda _: apart, " call("), (apart.gate, " conditional(")):
        assert text(lambda flag, x, wall=wall: stages(wall(flag), x)).count(kept) == plain.count(kept) + 2


def test_what_a_stage_calls_is_part_of_it() -> None:
    """Only the wall stays a call, not the jitted functions inside it."""
    compiled = jax.jit(lambda x: apart(lambda x: jnp.clip(jnp.where(x > 0, x, 2 * x), -1, 1), x)).lower(X).compile()
    assert (compiled.as_text() or "").count('inlineable="false"') >= 1
    assert (compiled.as_text() or "").count(" call(") == 1


def test_closed_gate_gives_zeros() -> None:
    assert (stages(apart.gate(jnp.array(False)), X) == 0).all()
    assert stages(no_wall.gate(jnp.array(False)), X).any()


def test_what_passes_by_stays_outside() -> None:
    """Operands that no result needs do not go in, and what is handed through does not come out of it."""

    def stage(kept: jax.Array, read: jax.Array, other: jax.Array) -> tuple[jax.Array, jax.Array]:
        return kept, read * 2.0

    operands = X, X + 1.0, X + 2.0
    eqn = jax.make_jaxpr(lambda *each: apart(stage, *each))(*operands).eqns[0]
    assert len(eqn.outvars) == 1
    assert len(eqn.invars) == 2, "the flag and what is read"
    kept, doubled = apart(stage, *operands)
    np.testing.assert_array_equal(kept, X)
    np.testing.assert_array_equal(doubled, 2.0 * (X + 1.0))
    gradient = jax.grad(lambda *each: sum(part.sum() for part in apart(stage, *each)), (0, 1, 2))(*operands)
    np.testing.assert_array_equal(np.stack(gradient), np.stack([np.ones_like(X), np.full_like(X, 2), np.zeros_like(X)]))


def test_what_passes_a_closed_gate_is_zero() -> None:
    kept, doubled = apart.gate(~OPEN)(lambda kept, read: (kept, read * 2.0), X, X)
    np.testing.assert_array_equal(kept, np.zeros_like(X))
    np.testing.assert_array_equal(doubled, np.zeros_like(X))
