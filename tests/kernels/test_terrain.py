"""Ground profiles against formulas point by point, grids against SciPy's interpolation, slopes against differences."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from kernels import terrain
from kernels.wall import apart
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


def up_and_down(s: float) -> float:
    return steps(s) - steps(s - 6.0)


def stretches(s: float) -> float:
    """Up at 0.2 from 2 to 6, level, down at 0.5 from 7 to 14."""
    return 0.2 * min(max(s - 2, 0.0), 4.0) - 0.5 * min(max(s - 7, 0.0), 7.0)


PROFILES: dict[Any, tuple[list[float], Any]] = {
    "flat": ([0.4, 0, 0, 0], lambda s: 0.4),
    "slope": ([0.1, 0, 0, 0], lambda s: 0.1 * s),
    "ramp": ([2.0, 14.0, 1.1, 0], ramp),
    "steps": ([2.0, 0.29, 0.17, 10.0], steps),
    "steps and back": ([2.0, 0.29, 0.17, 10.0, 8.0], up_and_down),
    "stretches": ([2.0, 4.0, 0.2, 6.0, 1.0, 0.0, 7.0, 7.0, -0.5], stretches),
}


def named(case: str) -> Any:
    """The kernel's kind of a case."""
    return case.split()[0]


@pytest.mark.parametrize("batch", [*BATCHES, (400,)])
@pytest.mark.parametrize("kind", PROFILES)
def test_profile(kind, batch: tuple[int, ...]) -> None:
    parameters, formula = PROFILES[kind]
    s = np.random.default_rng(0).uniform(-3, 17, batch)
    expected = np.vectorize(formula, otypes=[float])(s)

    def run(parameters, s):
        return terrain.profile(named(kind), parameters, s)

    height, slope = in_double(run, np.array(parameters), s)
    assert_close(height, expected, 1e-9)
    assert_close(in_single(run, np.array(parameters), s)[0], expected, 1e-5)
    near = np.vectorize(formula, otypes=[float])(s + 1e-7) - np.vectorize(formula, otypes=[float])(s - 1e-7)
    assert_close(slope, near / 2e-7, 1e-6)


@pytest.mark.parametrize("kind", PROFILES)
def test_profile_at_its_corners(kind) -> None:
    """Finite, and of the heights on one side or the other, exactly where it bends or rises."""
    parameters, formula = PROFILES[kind]
    s = np.array([2.0, 14.0, 2.0 + 10 * 0.29, 6.0, 8.0, -1e6, 1e6])
    height, slope = in_single(lambda p, s: terrain.profile(named(kind), p, s), np.array(parameters), s)
    assert np.isfinite(slope).all()
    for h, at in zip(height, s, strict=True):
        assert min(abs(h - formula(at - 1e-5)), abs(h - formula(at + 1e-5))) < 1e-4 * max(1.0, abs(h))
    if named(kind) != "steps":
        assert_gradient_finite(lambda p, s: terrain.profile(named(kind), p, s), np.array(parameters), s)


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


@pytest.mark.parametrize("post", [(0, 0), (2, 3), (3, 5)])
def test_places_counted_from_a_post(post: tuple[int, int]) -> None:
    u, v = np.random.default_rng(5).uniform(-2, 8, (2, 300))

    def run(grid, u, v):
        cell = terrain.locate(GRID.shape, u - post[1], v - post[0], post)
        return terrain.grid_ground(terrain.posts(grid, 6, cell.corner), cell)

    assert_close(in_double(run, GRID.ravel(), u, v), in_double(bilinear, GRID.ravel(), u, v), 1e-12)


def test_height_alone_and_behind_walls_is_the_same() -> None:
    u, v = np.random.default_rng(6).uniform(-2, 8, (2, 300))

    def heights(grid, u, v):
        cell = terrain.locate(GRID.shape, u, v)
        walled = terrain.posts(grid, GRID.shape[1], cell.corner, apart)
        return terrain.grid_height(walled, cell), terrain.grid_ground(terrain.posts(grid, 6, cell.corner), cell)[0]

    walled, plain = in_double(heights, GRID.ravel(), u, v)
    assert_close(walled, plain, 1e-12)
    assert_close(plain, in_double(bilinear, GRID.ravel(), u, v)[0], 1e-12)


def test_whole_cells_have_near_posts_and_lie_inside() -> None:
    grid = np.array([[0.0, 0.1, 3.0], [0.0, 0.2, 3.1]])
    u, v = np.array([0.5, 1.5, 0.5, -0.1, 2.5]), np.array([0.5, 0.5, 1.0, 0.5, 0.5])

    def found(grid, u, v):
        cell = terrain.locate((2, 3), u, v)
        return terrain.whole(terrain.posts(grid, 3, cell.corner), cell, jnp.asarray(0.9))

    assert in_double(found, grid.ravel(), u, v).tolist() == [True, False, True, False, False]


def test_sine() -> None:
    cycles = np.concatenate([np.random.default_rng(7).uniform(-30, 30, 4000), np.arange(-4, 4) / 4, [0.2499999, 0.25]])
    assert_close(in_double(terrain.sine, cycles), np.sin(2 * np.pi * cycles), 5e-9)
    assert_close(in_single(terrain.sine, cycles / 30), np.sin(2 * np.pi * cycles / 30), 1e-6)
    with jax.enable_x64(True):
        slope = jax.vmap(jax.grad(terrain.sine))(jnp.asarray(cycles))
    assert_close(np.asarray(slope) / (2 * np.pi), np.cos(2 * np.pi * cycles), 1e-6)


WAVES = np.array([[0.3, 0.1], [0.2, -0.05], [0.1, 0.4], [0.1, 0.6]])


@pytest.mark.parametrize("batch", [*BATCHES, (50,)])
def test_sines(batch: tuple[int, ...]) -> None:
    x, z = np.random.default_rng(8).uniform(-9, 9, (2, *batch))
    angle = 2 * np.pi * (x[..., None] * WAVES[1] + z[..., None] * WAVES[2] + WAVES[3])
    rate = 2 * np.pi * WAVES[0] * np.cos(angle)
    expected = (WAVES[0] * np.sin(angle)).sum(-1), (rate * WAVES[1]).sum(-1), (rate * WAVES[2]).sum(-1)
    assert_close(in_double(terrain.sines, WAVES, x, z), expected, 1e-7)
    assert_close(in_single(terrain.sines, WAVES, x, z), expected, 1e-5)
    assert_close(in_single(terrain.sines_height, WAVES, x, z), expected[0], 1e-5)


def test_sines_gradients() -> None:
    assert_gradients_agree(terrain.sines_height, WAVES, np.array([0.3, 2.0]), np.array([-1.0, 4.1]))


def test_upper_level() -> None:
    """Against the rule in words, level by level: the highest up to reach; where none is, the lowest."""
    rng = np.random.default_rng(9)
    levels, there, reach = rng.normal(size=(4, 500)), rng.uniform(size=(4, 500)) < 0.7, rng.normal(size=500)
    there[0] = True

    def found(levels, there, reach):
        best = levels[0]
        for level, exists in zip(levels[1:], there[1:], strict=True):
            best = jnp.where(terrain.upper(reach, best, level, exists), level, best)
        return best

    here = np.where(there, levels, np.nan)
    within = np.where(here <= reach, here, -np.inf).max(0)
    expected = np.where(np.isfinite(within), within, np.nanmin(here, 0))
    assert_close(in_double(found, levels, there, reach), expected, 1e-12)
    assert_close(in_double(lambda a, b: found(a, b, None), levels, there), np.nanmax(here, 0), 1e-12)
