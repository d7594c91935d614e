"""A water surface that is not level, as pictures and plots see it: heights and slopes between samples and frames."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from crowd.report_water import liveliest
from crowd.types import WaterFrames
from crowd.view.relief import Relief, relief_at

X, Z = np.arange(12) * 0.5 - 2.0, np.arange(9) * 0.5 + 1.0


def plane(a: float, b: float) -> np.ndarray:
    """[rows, columns] m, a x + b z."""
    return a * X[None, :] + b * Z[:, None]


def test_a_plane_is_itself_between_the_samples_and_nothing_off_the_grid() -> None:
    relief = Relief.of(X, Z, plane(0.3, -0.2))
    rng = np.random.default_rng(0)
    x, z = rng.uniform(X[0], X[-1], 50), rng.uniform(Z[0], Z[-1], 50)
    height, by_x, by_z = relief.at(x.astype(np.float32), z.astype(np.float32))
    np.testing.assert_allclose(height, 0.3 * x - 0.2 * z, atol=1e-5)
    np.testing.assert_allclose(by_x, 0.3, atol=1e-5)
    np.testing.assert_allclose(by_z, -0.2, atol=1e-5)
    off = relief.at(np.array([X[0] - 0.1, X[-1] + 0.1, 0.0, np.nan]), np.array([2.0, 2.0, Z[-1] + 0.1, 2.0]))
    np.testing.assert_array_equal(off, 0.0)
    assert relief.highest == pytest.approx(np.abs(plane(0.3, -0.2)).max(), rel=1e-6)


def frames() -> WaterFrames:
    height = np.stack([plane(0.0, 0.0), plane(0.1, 0.0), plane(0.3, 0.0)])
    return WaterFrames(np.array([0.1, 0.2, 0.4]), height, X, Z, 0.0)


@pytest.mark.parametrize(("time", "slope"), [(0.0, 0.0), (0.1, 0.0), (0.15, 0.05), (0.3, 0.2), (0.4, 0.3), (9.0, 0.3)])
def test_between_frames_it_is_their_mixture(time: float, slope: float) -> None:
    relief = relief_at(frames(), time)
    assert relief.at(np.array([1.0]), np.array([2.0]))[1, 0] == pytest.approx(slope, abs=1e-6)


def test_the_liveliest_frame_has_the_highest_waves() -> None:
    water = frames()
    assert liveliest(water) == 2
    assert liveliest(WaterFrames(water.time, water.height[::-1], X, Z, 0.0)) == 0
    assert liveliest(WaterFrames(water.time, np.full_like(water.height, np.nan), X, Z, 0.0)) == 0


def test_the_plot_shows_tracks_on_the_surface(tmp_path: Path) -> None:
    from crowd import scene, simulate
    from crowd.report_water import water
    from tests.crowd.test_water_surface import model

    run = simulate(scene.load(model(water={})), seconds=0.5)
    path = water(run, run.scene, tmp_path / "water.png")
    assert path is not None and path.stat().st_size > 10_000
    level = dataclasses.replace(run, water=None)
    assert water(level, run.scene, tmp_path / "none.png") is None
