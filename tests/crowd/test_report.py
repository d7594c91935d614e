"""The report: files that are pictures, of the right moments, from memory and from disk."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from PIL import Image

from crowd.recorded import open_recording
from crowd.recorded_scene import RecordedScene
from crowd.recording import Recorder
from crowd.report import PLOTS, moments_of, write_report
from crowd.report_plots import Sampled, mean_over
from crowd.scenario import Pictures
from crowd.view.camera import framing
from crowd.view.crowd_picture import (
    bodies_at,
    clear_view,
    close_group,
    geometry_at,
    has_poses,
    surfaces,
    travel_azimuth,
)


@pytest.fixture(scope="module")
def report(made_result, tmp_path_factory):
    return write_report(made_result, None, tmp_path_factory.mktemp("report") / "plots")


def test_files_are_pictures_with_something_in_them(report):
    assert set(PLOTS) <= set(report)
    names = [name for name in report if name not in PLOTS]
    assert names == ["crowd_001.00s", "near_001.00s", "crowd_003.00s", "near_003.00s", "pictures"]
    for path in report.values():
        with Image.open(path) as image:
            assert image.format == "PNG"
            pixels = np.asarray(image.convert("RGB"))
        assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 50, path
        assert pixels.std() > 5, path
    with Image.open(report["pictures"]) as image:
        assert image.size == (320 + 6 + 192, 2 * 160 + 6)


def test_report_from_disk_is_the_same(made_result, report, tmp_path):
    with Recorder(tmp_path / "r.zarr", made_result.scene) as recorder:
        for chunk in made_result.chunks(32):
            recorder.append(chunk)
    again = write_report(open_recording(tmp_path / "r.zarr"), None, tmp_path / "plots")
    assert list(again) == list(report)
    for name in ("speed", "crowd_003.00s"):
        pair = [np.asarray(Image.open(files[name]).convert("RGB")).astype(int) for files in (report, again)]
        assert pair[0].shape == pair[1].shape
        # The ground is sampled in a recording; everything else is the same.
        assert np.mean(np.abs(pair[0] - pair[1]).max(-1) > 24) < 0.02, name


def test_runs_without_poses_water_or_frames(made_result, tmp_path):
    herds = {
        name: {key: value for key, value in herd.items() if not key.startswith(("joint", "pose"))}
        for name, herd in made_result.herds.items()
    }
    for herd in herds.values():
        herd["center_of_pressure"] = np.full_like(herd["center_of_pressure"], np.nan)
        herd["depth"] = np.zeros_like(herd["depth"])
        herd["fault"] = np.ones_like(herd["fault"])
    broken = dataclasses.replace(made_result, herds=herds)
    assert not has_poses(broken)
    files = write_report(broken, None, tmp_path / "dry")
    assert set(files) == {"speed", "footprints"}
    frozen = {name: herd | {"depth": herd["depth"] + 0.1} for name, herd in herds.items()}
    assert set(write_report(dataclasses.replace(made_result, herds=frozen), None, tmp_path / "frozen")) == set(PLOTS)
    with Recorder(tmp_path / "none.zarr", made_result.scene):
        pass
    assert write_report(open_recording(tmp_path / "none.zarr"), None, tmp_path / "none") == {}


def test_moments():
    time = np.arange(1, 61) / 20
    assert moments_of(Pictures(at_s=(0.5, 2.0, 9.0)), time) == [0.5, 2.0]
    assert moments_of(Pictures(), time) == pytest.approx([0.05, 1.0333333, 2.0166667, 3.0])
    assert moments_of(Pictures(at_s=(9.0,)), time)[-1] == 3.0


def test_bodies_stand_where_the_characters_are(made_result):
    bodies = bodies_at(made_result, made_result.scene, 40)
    assert [len(body.vertices) for body in bodies] == [3, 2]
    middle = 0.5 * (bodies[1].vertices.min(1) + bodies[1].vertices.max(1))
    assert np.allclose(middle[:, [0, 2]], made_result.herds["twos"]["position"][40][:, [0, 2]], atol=0.15)
    thinned = bodies_at(made_result, made_result.scene, 40, most=400)
    assert sum(len(body.vertices) * len(body.triangles) for body in thinned) <= 400
    assert np.allclose(thinned[0].vertices[0], bodies[0].vertices[0])


def test_group_stands_towards_the_camera(made_result):
    assert travel_azimuth(made_result, made_result.scene, [0, 40]) == pytest.approx(0.0)
    herd = made_result.scene.herds[0]
    assert list(close_group(made_result, made_result.scene, herd, [20, 40])) == [0, 1, 2]


def test_surfaces_respect_priority(made_result):
    assert [level.height for level in surfaces(made_result.scene)] == [-0.05]
    everywhere = {"surface_m": 0.0, "density_kg_m3": 1000.0, "x": None, "z": None, "priority": 0}
    pool = {"surface_m": 0.5, "density_kg_m3": 1840.0, "x": [0.0, 1.0], "z": [0.0, 1.0], "priority": 1}

    mud, water = surfaces(RecordedScene((), lambda x, z: 0 * x, [everywhere, pool]))
    assert mud.height == 0.5
    inside, outside = (np.array([0.5]), np.array([0.5])), (np.array([2.0]), np.array([0.5]))
    assert (mud.covers(*inside), mud.covers(*outside)) == ([True], [False])
    assert (water.covers(*inside), water.covers(*outside)) == ([False], [True])


def test_sampled_hides_frozen_characters(made_result):
    herds = {name: dict(herd) for name, herd in made_result.herds.items()}
    herds["ones"]["fault"] = herds["ones"]["fault"].copy()
    herds["ones"]["fault"][10:, 0] = 2
    data = Sampled(dataclasses.replace(made_result, herds=herds), made_result.scene.herds[0])
    assert np.isnan(data["velocity"][10:, 0]).all()
    assert np.isfinite(data["velocity"][:, 1:]).all()
    assert np.allclose(mean_over(np.array([[1.0, np.nan], [np.nan, np.nan]])), [1.0, np.nan], equal_nan=True)


def test_close_up_is_not_blocked(made_result):
    geometry = geometry_at(made_result, made_result.scene, 40)
    front = geometry.bodies[0].vertices[2]
    camera = framing(front, (100, 60), 90.0, 5.0)
    points = geometry.bodies[0].vertices[:1].mean(1)
    clear = clear_view(geometry, camera, points)
    kept = [camera.view(body.vertices.mean(1))[:, 2] for body in clear.bodies if len(body.vertices)]
    assert np.concatenate(kept).min() >= camera.view(points)[0, 2] - 0.2
    assert sum(len(body.vertices) for body in clear.bodies) < 5
