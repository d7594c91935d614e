"""Plots of the gait: what they show of a known walk, and files that are pictures."""

from __future__ import annotations

import dataclasses

import matplotlib.colors
import numpy as np
import pytest
from matplotlib.patches import Polygon, Rectangle
from PIL import Image

from crowd.recorded import open_recording
from crowd.recording import Recorder
from crowd.report import write_report
from crowd.report_gait import (
    Walker,
    blended_keys,
    draw_cycles,
    draw_footprints,
    draw_heights,
    draw_weights,
    gait,
)
from crowd.report_plots import figure
from crowd.view.footprints import plate_corners
from crowd.view.palette import leg_color
from tests.crowd.made_strides import KEYS, striding

FRAME = 40  # 2 s: left foot just planted, right foot in mid-stance


@pytest.fixture(scope="module")
def made(made_result):
    return striding(made_result)


@pytest.fixture
def axes():
    return figure(4.0, 4.0)[1][0, 0]


def walker(made, character: int = 0) -> Walker:
    return Walker(made, made.scene.herds[0], character)


def dots(axes, size: float) -> np.ndarray:
    """Places of the markers of a size."""
    lines = [line for line in axes.lines if line.get_markersize() == size and len(line.get_xdata()) == 1]
    return np.array([[line.get_xdata()[0], line.get_ydata()[0]] for line in lines])


def test_cycles_show_both_times(made, axes):
    who = walker(made)
    draw_cycles(axes, who, FRAME)
    shares = np.mod(np.arctan2(*dots(axes, 13).T) / (2 * np.pi), 1.0)
    assert shares == pytest.approx(who["cycle_time"][FRAME], abs=1e-6)
    clock = np.mod(np.arctan2(*dots(axes, 5).T) / (2 * np.pi), 1.0)
    assert clock == pytest.approx(who["cycle_designated"][FRAME], abs=1e-6)
    assert blended_keys(who, FRAME) == pytest.approx(np.tile(KEYS, (2, 1)))  # standing has no say


def test_squares_go_with_the_root_of_the_weight(made, axes):
    draw_weights(axes, walker(made), FRAME, "#000000")
    squares = {
        round(patch.get_y() + patch.get_height() / 2, 6): patch.get_width()
        for patch in axes.patches
        if isinstance(patch, Rectangle)
    }
    assert squares[1.2] / squares[0.0] == pytest.approx(np.sqrt(0.8 / 0.2))
    assert dots(axes, 11)[0] == pytest.approx([0.0, 1.2])


def test_velocity_is_the_characters_own(made):
    arrays = {name: value.copy() for name, value in made.herds["ones"].items()}
    arrays["yaw"] = np.full_like(arrays["yaw"], 0.5 * np.pi)  # looks along +x, walks along +z: to its right
    turned = dataclasses.replace(made, herds=made.herds | {"ones": arrays})
    assert walker(turned).local_velocity[FRAME] == pytest.approx([-1.2, 0.0], abs=1e-9)


def test_footprints_lie_where_they_are(made, axes):
    draw_footprints(axes, walker(made), FRAME)
    strong = [patch for patch in axes.patches if isinstance(patch, Polygon) and patch.get_alpha() == 0.85]
    arrays = made.herds["ones"]
    for leg, patch in enumerate(strong):
        corners = plate_corners(
            arrays["footprint_from"][FRAME, 0, leg], arrays["footprint_from_direction"][FRAME, 0, leg]
        )
        assert np.allclose(patch.get_xy()[:4], corners[:, [0, 2]])
        assert patch.get_facecolor()[:3] == pytest.approx(matplotlib.colors.to_rgb(leg_color(leg)))
    assert len(strong) == 2
    assert np.allclose(sorted(dots(axes, 10)[:, 1]), sorted(arrays["footprint_goal"][FRAME, 0, :, 2]))


def test_heights_and_rest(made, axes):
    draw_heights(axes, walker(made, 2), FRAME, made.scene)
    curves = [line for line in axes.lines if len(line.get_xdata()) == len(made.time)]
    assert len(curves) == 4
    heel = curves[0].get_ydata() - np.min(curves[0].get_ydata())
    assert np.max(heel) == pytest.approx(0.05 + 0.003)
    marks = [line for line in axes.lines if line.get_marker() in "^v" and len(line.get_xdata())]
    assert sum(len(line.get_xdata()) for line in marks) == 2 * 15  # as many as `foot_events` tells


def test_plate_corners():
    corners = plate_corners(np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.1, 0.2]), 0.5)
    assert np.allclose(corners, [[0.95, 2.0, 3.0], [0.95, 2.1, 3.2], [1.05, 2.1, 3.2], [1.05, 2.0, 3.0]])
    assert np.allclose(plate_corners(np.ones((2, 3)), np.zeros((2, 3))), 1.0)


def test_file_from_memory_disk_and_without_prints(made, tmp_path):
    with Recorder(tmp_path / "r.zarr", made.scene, pose=False) as recorder:
        for chunk in made.chunks(32):
            recorder.append(chunk)
    for number, run in enumerate((made, open_recording(tmp_path / "r.zarr"))):
        path = gait(run, run.scene, tmp_path / f"{number}.png", character=1, moment=1.0)
        assert path is not None
        with Image.open(path) as image:
            pixels = np.asarray(image.convert("RGB"))
        assert (pixels < 128).any(-1).mean() > 0.003
    assert gait(made, dataclasses.replace(made.scene, herds=made.scene.herds[1:]), tmp_path / "none.png") is None
    assert not (tmp_path / "none.png").exists()


def test_one_frame_and_a_frozen_character(made, tmp_path):
    arrays = {name: value[:1] for name, value in made.herds["ones"].items()}
    short = dataclasses.replace(made, time=made.time[:1], herds=made.herds | {"ones": arrays})
    assert gait(short, made.scene, tmp_path / "one.png") is not None
    frozen = {name: value.copy() for name, value in made.herds["ones"].items()}
    frozen["fault"][:] = 1
    frozen["footprint_goal"][:] = np.nan
    stuck = dataclasses.replace(made, herds=made.herds | {"ones": frozen})
    assert walker(stuck).busy_frame() == FRAME
    assert gait(stuck, made.scene, tmp_path / "frozen.png") is not None


def test_report_has_it(made, made_result, tmp_path):
    still = {name: {k: v for k, v in herd.items() if not k.startswith("joint")} for name, herd in made.herds.items()}
    assert "gait" in write_report(dataclasses.replace(made, herds=still), None, tmp_path / "new")
    old = {name: {k: v for k, v in made_result.herds[name].items() if not k.startswith("joint")} for name in still}
    assert "gait" not in write_report(dataclasses.replace(made_result, herds=old), None, tmp_path / "old")
