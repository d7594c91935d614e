"""The same ground on the host and in the program: heights of every kind agree, slopes are those of the heights."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

from crowd.build import ground_layout, ground_world
from crowd.components import sense
from crowd.ground import Ground, height
from crowd.layout import Layout
from tests.crowd.grounds import EDGES, KINDS, made


def program(ground: Ground) -> tuple[Any, Any]:
    """Layout (only its ground counts) and world."""
    layout = Layout(
        herds=(), dt=0.0, ground=ground_layout(ground), regions=0, turns=0, gait="clip", bands="polar", compat=False,
        schedule="paper", mesh="rigid", submersion="clipped", offset_mode="area", arms_up=(), forces=(),
        record_pose=False, record_every=1, walls=True,
    )  # fmt: skip
    return layout, ground_world(ground)


def kernel(ground: Ground, place: np.ndarray, altitude: np.ndarray | None = None) -> tuple[np.ndarray, ...]:
    """Height and slope, and height alone, of `sense` in single precision."""
    layout, world = program(ground)
    both = jax.jit(lambda w, p, y: (*sense.ground(layout, w, p, y), sense.height(layout, w, p, y)))
    return tuple(np.asarray(part) for part in both(world, place, altitude))


def points(ground: Ground, name: str, count: int = 600) -> np.ndarray:
    """[2, n] random places on and around the ground, and places on its edges."""
    random = np.random.default_rng(3).uniform(-9, 9, (2, count))
    return np.concatenate([random, np.array(EDGES[name], float).reshape(-1, 2).T], 1).astype(np.float32)


@pytest.mark.parametrize("name", KINDS)
def test_heights_agree(name: str, tmp_path: Path) -> None:
    ground = made(name, tmp_path)
    place = points(ground, name)
    for altitude in (None, -20.0, 0.0, 0.7, 1.7, 50.0):
        many = None if altitude is None else np.full(place.shape[1], altitude, np.float32)
        found, _, alone = kernel(ground, place, many)
        np.testing.assert_allclose(found, height(ground, place[0], place[1], many), atol=1e-5)
        np.testing.assert_allclose(alone, found, atol=2e-6)


@pytest.mark.parametrize("name", KINDS)
def test_slopes_are_those_of_the_heights(name: str, tmp_path: Path) -> None:
    """Central differences over 1 mm, where both sides lie on the same piece of ground."""
    ground = made(name, tmp_path)
    place = points(ground, name, 2000)[:, :2000].astype(float)
    _, slope, _ = kernel(ground, place.astype(np.float32))
    step = 5e-4
    centre = height(ground, *place)
    for axis in (0, 1):
        way = step * np.eye(2)[:, axis, None]
        up, down = height(ground, *(place + way)), height(ground, *(place - way))
        smooth = np.abs((up - centre) - (centre - down)) < 1e-5
        assert smooth.mean() > 0.9
        np.testing.assert_allclose(slope[axis][smooth], ((up - down) / (2 * step))[smooth], atol=4e-3)


@pytest.mark.parametrize("name", KINDS)
def test_places_that_are_not_finite_do_no_harm(name: str, tmp_path: Path) -> None:
    place = np.array([[np.nan, 0.3, np.inf, 1e30], [0.2, np.nan, -np.inf, -1e30]], np.float32)
    place = np.concatenate([place, [[0.5], [0.5]]], 1).astype(np.float32)
    ground = made(name, tmp_path)
    found, _, _ = kernel(ground, place, np.zeros(5, np.float32))
    assert found[4] == pytest.approx(height(ground, 0.5, 0.5, 0.0), abs=1e-5)


@pytest.mark.parametrize("name", KINDS)
def test_gradients_are_finite(name: str, tmp_path: Path) -> None:
    ground = made(name, tmp_path)
    layout, world = program(ground)
    place = points(ground, name, 50)

    def total(world: Any, place: Any) -> Any:
        found, slope = sense.ground(layout, world, place, place[0])
        return found.sum() + slope.sum() + sense.height(layout, world, place, place[0]).sum()

    gradient = jax.jit(jax.grad(total, argnums=(0, 1), allow_int=True))(world, place)
    for leaf in jax.tree.leaves(gradient):
        if leaf.dtype == np.float32:
            assert np.isfinite(leaf).all()


def test_digits_of_a_large_map(tmp_path: Path) -> None:
    """Near the world's origin a map of 40 km is as exact as a small one: steps of 1 mm change heights evenly."""
    rows, columns = np.indices((401, 401))
    np.save(tmp_path / "large.npy", 0.3 * 100.0 * (rows - 200.0) + 0.1 * 100.0 * (columns - 200.0))
    ground = made({"kind": "heightmap", "file": "large.npy", "cell_m": 100.0}, tmp_path)
    x = np.arange(1.0, 1.5, 1e-3, dtype=np.float32)
    found, _, _ = kernel(ground, np.stack([x, 0 * x + 2]))
    np.testing.assert_allclose(np.diff(found), -1e-4, atol=3e-6)
    np.testing.assert_allclose(found, height(ground, x, 2.0), atol=1e-5)


def test_one_flat_ground_costs_no_more_than_its_height(tmp_path: Path) -> None:
    layout, world = program(made("flat", tmp_path))
    run = jax.jit(lambda w, p: sense.height(layout, w, p, p[0]))
    text = run.lower(world, np.zeros((2, 8), np.float32)).compile().as_text()
    assert text is not None
    assert not {"gather", "floor", "multiply", "select", "clamp"} & set(re.findall(r"[a-z]+", text.split("ENTRY")[1]))
