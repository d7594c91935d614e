"""Loads in pictures: boxes where they are carried, as large as they are heavy, of those who carry one then."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from crowd import scene
from crowd.recorded_scene import RecordedScene
from crowd.view.loads import DENSITY, loads_at
from tests.crowd.scenes import herd, scenario

LOAD = {"mass_kg": 16.0, "behind_m": 0.25, "height_m": 1.2, "carried": False}


def standing(count: int, yaw: float) -> dict[str, np.ndarray]:
    """Arrays of two recorded frames of people at [i, 0, 5] who look along `yaw`."""
    position = np.stack([np.arange(count), np.zeros(count), np.full(count, 5.0)], -1)
    turn = np.array([np.cos(yaw / 2), 0.0, np.sin(yaw / 2), 0.0])
    return dict(pose_position=np.stack([position] * 2), pose_orientation=np.tile(turn, (2, count, 1)))


def test_boxes_are_where_and_when_they_are_carried() -> None:
    events: list[dict[str, Any]] = [
        {"at_s": 1.0, "load": "pick_up", "herds": ["p"], "characters": [0, 2]},
        {"at_s": 3.0, "load": "put_down", "herds": ["p"], "characters": [2]},
    ]
    loaded = scene.load(scenario([herd("free", "human", 2), herd("p", "human", 3, load=LOAD)], events=events))
    run = SimpleNamespace(time=np.array([0.5, 2.0]), herds={"p": standing(3, np.pi / 2)})
    assert loads_at(run, loaded, 0) == []
    (box,) = loads_at(run, loaded, 1)
    # they look along +x, so behind them is -x
    np.testing.assert_allclose(box.vertices.mean(1), [[-0.25, 1.2, 5.0], [1.75, 1.2, 5.0]], atol=1e-6)
    np.testing.assert_allclose(box.middle[:, [0, 2]], [[0.0, 5.0], [2.0, 5.0]], atol=1e-6)
    a, b, c = np.moveaxis(box.vertices[0][box.triangles], 1, 0)
    volume = np.sum(np.cross(a, b) * c) / 6.0  # positive where faces look outward
    np.testing.assert_allclose(volume, 16.0 / DENSITY, rtol=1e-6)
    run.time = np.array([0.5, 4.0])
    assert len(loads_at(run, loaded, 1)[0].vertices) == 1


def test_recordings_without_their_scenario_show_none() -> None:
    run = SimpleNamespace(time=np.zeros(1), herds={})
    assert loads_at(run, RecordedScene((), lambda x, z: 0 * x, []), 0) == []
