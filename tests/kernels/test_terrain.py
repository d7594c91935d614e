"""Ground profiles against formulas point by point, grids against SciPy's interpolation, slopes against differences."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from kernels import terrain
from tests.kernels.checks import (
    BATCHES,
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    in_double,
    in_single,
)


def ramp(s: float) -> float:
    if s < 2:
        return 0.0
    return -1.1 * (s - 2) / 12 if s < 14 else -1.1


def steps(s: float) -> float:
    return 0.17 * min(max(int(np.floor((s - 2) / 0.29)) + 1, 0), 10)


PROFILES: dict[Any, tuple[list[float], Any]] = {
    "flat": ([0.4, 0, 0, 0], lambda s: 0.4),
    "slope": ([0.1, 0, 0, 0], lambda s: 0.1 * s),
    "ramp": ([2.0, 14.0, 1.1, 0], ramp),
    "steps": ([2.0, 0.29, 0.17, 10.0], steps),
}


@pytest.mark.parametrize("batch", [*BATCHES, (400,)])
@pytest.mark.parametrize("kind", PROFILES)
def test_profile(kind, batch: tuple[int, ...]) -> None:
    parameters, formula = PROFILES[kind]
    s = np.random.default_rng(0).uniform(-3, 17, batch)
    expected = np.vectorize(formula, otypes=[float])(s)
    run = lambda parameters, s: terrain.profile(kind, parameters, s)  # noqa: E731
    height, slope = in_double(run, np.array(parameters), s)
    assert_close(height, expected, 1e-9)
    assert_close(in_single(run, np.array(parameters), s)[0], expected, 1e-5)
    near = np.vectorize(formula, otypes=[float])(s + 1e-7) - np.vectorize(formula, otypes=[float])(s - 1e-7)
    assert_close(slope, near / 2e-7, 1e-6)


@pytest.mark.parametrize("kind", PROFILES)
def test_profile_at_its_corners(kind) -> None:
    """Finite, and of the heights on one side or the other, exactly where it bends or rises."""
    parameters, formula = PROFILES[kind]
    s = np.array([2.0, 14.0, 2.0 + 10 * 0.29, -1e6, 1e6])
    height, slope = in_single(lambda p, s: terrain.profile(kind, p, s), np.array(parameters), s)
    assert np.isfinite(slope).all()
    for h, at in zip(height, s, strict=True):
        assert min(abs(h - formula(at - 1e-5)), abs(h - formula(at + 1e-5))) < 1e-4 * max(1.0, abs(h))
    if kind != "steps":
        assert_gradient_finite(lambda p, s: terrain.profile(kind, p, s), np.array(parameters), s)


GRID = np.random.default_rng(1).normal(size=(4, 6))


def bilinear(grid, u, v):
    return terrain.bilinear(grid, GRID.shape, u, v)


@pytest.mark.parametrize("batch", [*BATCHES, (500,)])
def test_grid(batch: tuple[int, ...]) -> None:
    rng = np.random.default_rng(2)
    u, v = rng.uniform(-2, 8, batch), rng.uniform(-2, 6, batch)
    expected = map_coordinates(GRID, [v, u], order=1, mode="nearest") if batch else None
    if not batch:
        expected = map_coordinates(GRID, [[v], [u]], order=1, mode="nearest")[0]
    height, along_u, along_v = in_double(bilinear, GRID.ravel(), u, v)
    assert_close(height, np.asarray(expected), 1e-9)
    assert_close(in_single(bilinear, GRID.ravel(), u, v)[0], np.asarray(expected), 1e-5)
    with jax.enable_x64(True):
        slope = jax.jit(jax.grad(lambda u, v: bilinear(jnp.asarray(GRID.ravel()), u, v)[0].sum(), argnums=(0, 1)))(u, v)
    assert_close((along_u, along_v), slope, 1e-9)


def test_grid_at_posts_and_borders() -> None:
    """Every post's own height, the last row and column too; level ground and no slope outside."""
    v, u = (x.ravel().astype(float) for x in np.indices(GRID.shape))
    assert_close(in_single(bilinear, GRID.ravel(), u, v)[0], GRID.ravel(), 1e-6)
    u, v = np.array([-5.0, 50.0, 2.5, 2.5]), np.array([1.5, 1.5, -5.0, 50.0])
    height, along_u, along_v = in_single(bilinear, GRID.ravel(), u, v)
    inside = np.clip(u, 0, 5), np.clip(v, 0, 3)
    assert_close(height, map_coordinates(GRID, [inside[1], inside[0]], order=1), 1e-5)
    assert along_u[:2].tolist() == [0.0, 0.0]
    assert along_v[2:].tolist() == [0.0, 0.0]
    assert (along_u[2:] != 0).all()
    assert (along_v[:2] != 0).all()


def test_grid_of_a_plane_is_the_plane() -> None:
    rows, columns = np.indices(GRID.shape)
    u, v = np.random.default_rng(3).uniform(0, 3, (2, 50))
    at = np.ravel(0.5 + 0.2 * columns - 0.3 * rows), u, v
    expected = 0.5 + 0.2 * u - 0.3 * v, np.full(50, 0.2), np.full(50, -0.3)
    assert_close(in_double(bilinear, *at), expected, 1e-12)


def test_grid_gradients() -> None:
    u, v = np.random.default_rng(4).uniform(0.1, 2.9, (2, 4))
    assert_gradients_agree(bilinear, GRID.ravel(), u, v)
