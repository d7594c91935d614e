"""What a character senses of the ground about it: its slope over the stance, whatever its yaw."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest

from crowd.components import sense
from crowd.ground import Ground
from tests.crowd.grounds import made
from tests.crowd.test_ground_kernels import program

REACH = 0.3  # m


def slope(ground: Ground, x: Any, z: Any, yaw: Any) -> np.ndarray:
    """[2, n] slope sensed at places of the highest ground with yaws, rad."""
    layout, world = program(ground)
    x, z, yaw = (np.asarray(v, np.float32) for v in np.broadcast_arrays(x, z, yaw))
    position = np.stack([x, 0 * x + 5.0, z])

    def run(world: Any, position: Any, yaw: Any) -> Any:
        level = sense.height(layout, world, position[::2], position[1])
        return sense.slope_about(layout, world, position[::2], level, position[1], yaw, REACH + 0.0 * yaw)

    return np.asarray(jax.jit(run)(world, position, yaw))


@pytest.mark.parametrize("angle", [-25.0, 10.0, 25.0])
def test_of_a_plane_it_is_the_planes(angle: float, tmp_path: Path) -> None:
    """At any place and yaw."""
    rng = np.random.default_rng(0)
    x, z = rng.uniform(-5, 5, (2, 60))
    plane = made({"kind": "slope", "angle_deg": angle, "toward_deg": 30.0}, tmp_path)
    found = slope(plane, x, z, rng.uniform(-9, 9, 60))
    rise = np.tan(np.radians(angle)) * np.array([np.sin(np.pi / 6), np.cos(np.pi / 6)])
    np.testing.assert_allclose(found, np.broadcast_to(rise[:, None], found.shape), atol=1e-5)


def test_of_what_is_smaller_than_the_stance_it_takes_the_mean(tmp_path: Path) -> None:
    """A pebble under the middle of the body: its sides are steep, the stance is level."""
    heights = np.zeros((41, 41))
    heights[20, 20] = 0.1
    np.save(tmp_path / "pebble.npy", heights)
    pebble = made({"kind": "heightmap", "file": "pebble.npy", "cell_m": 0.1}, tmp_path)
    found = slope(pebble, 0.03, 0.05, np.linspace(-3, 3, 30))
    np.testing.assert_allclose(found, 0.0, atol=1e-6)


def test_a_wall_counts_as_its_stance_is_wide(tmp_path: Path) -> None:
    """Three metres up within the stance are no more than one reach up: half the slope of 45 degrees."""
    heights = np.zeros((41, 41))
    heights[:, 22:] = 3.0
    np.save(tmp_path / "wall.npy", heights)
    wall = made({"kind": "heightmap", "file": "wall.npy", "cell_m": 0.1}, tmp_path)
    found = slope(wall, 0.0, 0.0, np.array([0.0, np.pi / 2, np.pi]))
    assert np.abs(found).max() <= 0.5 + 1e-5
    np.testing.assert_allclose(np.abs(found[0]), 0.5, atol=1e-4)
    np.testing.assert_allclose(found[1], 0.0, atol=1e-4)
