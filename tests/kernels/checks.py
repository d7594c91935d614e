"""What every kernel is held to: a reference in x64, the same numbers in float32, three kinds of gradient that agree."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

BATCHES = ((), (1,), (3, 2))


def arrays(tree: Any, dtype: Any) -> Any:
    """Leaves as device arrays; floating ones of the given type."""

    def leaf(x: Any) -> jax.Array:
        x = np.asarray(x)
        return jnp.asarray(x, dtype if np.issubdtype(x.dtype, np.floating) else None)

    return jax.tree.map(leaf, tree)


def in_double(function: Callable[..., Any], *arguments: Any) -> Any:
    """The function's result in x64, as NumPy arrays."""
    with jax.enable_x64(True):
        return jax.tree.map(np.asarray, jax.jit(function)(*arrays(arguments, np.float64)))


def in_single(function: Callable[..., Any], *arguments: Any) -> Any:
    """The function's result in float32, as NumPy arrays."""
    result = jax.tree.map(np.asarray, jax.jit(function)(*arrays(arguments, np.float32)))
    assert all(leaf.dtype != np.float64 for leaf in jax.tree.leaves(result))
    return result


def assert_close(actual: Any, expected: Any, tolerance: float) -> None:
    """Leaf by leaf the same shape, and the same values up to a tolerance relative to the largest (at least 1)."""
    actual, expected = jax.tree.leaves(actual), jax.tree.leaves(expected)
    assert len(actual) == len(expected)
    for a, e in zip(actual, expected, strict=True):
        assert np.shape(a) == np.shape(e)
        largest = float(np.max(np.abs(e), initial=1.0))
        np.testing.assert_allclose(np.asarray(a, float), np.asarray(e, float), rtol=0, atol=tolerance * largest)


def assert_matches(
    function: Callable[..., Any], expected: Any, *arguments: Any, double: float = 1e-9, single: float = 2e-6
) -> None:
    """The kernel gives the reference's numbers, in x64 and in float32."""
    assert_close(in_double(function, *arguments), expected, double)
    assert_close(in_single(function, *arguments), expected, single)


def assert_matches_in_batches(
    function: Callable[..., Any], expected: Any, *arguments: Any, double: float = 1e-9, single: float = 2e-6
) -> None:
    """The same at every batch shape; leaves of expected and arguments are [..., 6]. One program for all shapes."""

    def shaped(tree: Any) -> list[Any]:
        def cut(batch: tuple[int, ...]) -> Any:
            count = int(np.prod(batch))
            return jax.tree.map(lambda x: x[..., :count].reshape((*x.shape[:-1], *batch)), tree)

        return [cut(batch) for batch in BATCHES]

    def everywhere(*arguments: Any) -> list[Any]:
        return [function(*each) for each in shaped(arguments)]

    assert_matches(everywhere, shaped(expected), *arguments, double=double, single=single)


def assert_gradients_agree(
    function: Callable[..., Any], *arguments: Any, seed: int = 0, step: float = 1e-6, tolerance: float = 1e-5
) -> None:
    """Forward mode, reverse mode and central differences along a random direction, for random cotangents, in x64."""
    rng = np.random.default_rng(seed)
    direction = jax.tree.map(lambda x: rng.normal(size=np.shape(x)), arguments)
    with jax.enable_x64(True):
        at, along = arrays(arguments, np.float64), arrays(direction, np.float64)
        shapes = jax.eval_shape(function, *at)
        weight = jax.tree.map(lambda s: jnp.asarray(rng.normal(size=s.shape)), shapes)

        def scalar(*arguments: Any) -> jax.Array:
            products = jax.tree.map(lambda w, y: (w * y).sum(), weight, function(*arguments))
            return jnp.stack(jax.tree.leaves(products)).sum()

        def derivatives(at: Any, along: Any) -> tuple[jax.Array, jax.Array, jax.Array]:
            forward = jax.jvp(scalar, at, along)[1]
            gradient = jax.grad(scalar, argnums=tuple(range(len(at))))(*at)
            reverse = jax.tree.leaves(jax.tree.map(lambda g, t: (g * t).sum(), gradient, along))
            ends = [scalar(*jax.tree.map(lambda a, t, h=h: a + h * t, at, along)) for h in (-step, step)]
            return forward, jnp.stack(reverse).sum(), (ends[1] - ends[0]) / (2 * step)

        forward, reverse, numeric = map(float, jax.jit(derivatives)(at, along))
    assert abs(numeric) > 1e-3, "this direction shows nothing"
    np.testing.assert_allclose(forward, reverse, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(forward, numeric, rtol=tolerance, atol=tolerance)


def assert_gradient_finite(function: Callable[..., Any], *arguments: Any) -> None:
    """Values and reverse-mode gradients without NaN or infinity, in float32 (where squares of small numbers vanish)."""
    at = arrays(arguments, np.float32)

    def scalar(*arguments: Any) -> jax.Array:
        return jnp.stack([leaf.sum() for leaf in jax.tree.leaves(function(*arguments))]).sum()

    value, gradient = jax.jit(jax.value_and_grad(scalar, argnums=tuple(range(len(at)))))(*at)
    assert np.isfinite(value)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gradient)), gradient


def unit_vectors(rng: np.random.Generator, components: int, *shape: int) -> np.ndarray:
    """Random directions or unit quaternions [components, *shape]."""
    v = rng.normal(size=(components, *shape))
    return v / np.linalg.norm(v, axis=0)


def last(x: np.ndarray) -> np.ndarray:
    """Components moved from the first axis (kernels) to the last (host)."""
    return np.moveaxis(x, 0, -1)


def first(x: np.ndarray) -> np.ndarray:
    """Components moved from the last axis (host) to the first (kernels)."""
    return np.moveaxis(x, -1, 0)
