"""Statistics of triangles, from recorded poses in NumPy, against the step's own drag and closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from crowd import scene, simulate
from crowd import triangle_statistics as statistics
from tests.crowd.scenes import herd, scenario

BASE, OFFSET = 1.08, 20.0


@pytest.fixture(scope="module")
def waded() -> tuple[scene.Scene, dict[str, np.ndarray]]:
    model: dict[str, Any] = scenario([herd("p", "human", 1)], 0.85, drag={"mesh": "skinned"})
    model["record"] = {"rate_hz": 60, "pose": True}
    model["gait"] = "semi_procedural"
    loaded = scene.load(model)
    return loaded, simulate.simulate(loaded, frames=60, devices=1).herds["p"]


def test_the_sum_over_triangles_is_the_steps_drag(waded: tuple[scene.Scene, dict[str, np.ndarray]]) -> None:
    """F along the way: the same triangles, clipped and facing, as the kernel's."""
    loaded, arrays = waded
    table = loaded.scenario.fluid_table
    base, offset = table.base_drag.at(1000.0), table.offset_force_n.at(1000.0)
    found = [
        statistics.relevant(loaded.herds[0], {k: v[f - 1 : f + 1] for k, v in arrays.items()}, 0, 0.85, np.zeros(3), 60)
        for f in range(30, 60)
    ]
    drag = [(t.area * (base * 1000.0 * t.speed2 + offset / 0.2 * t.speed2 / (t.speed2 + 1e-4))).sum() for t in found]
    power = np.linalg.norm(arrays["drag_force"][30:60, 0], axis=-1)
    # sum of |F_i| is a little more than |sum of F_i|
    assert (drag >= power * 0.999).all()
    np.testing.assert_allclose(drag, power, rtol=0.15)


def test_statistics_of_few() -> None:
    found = statistics.Triangles(np.array([0.01, 0.02, 0.04]), np.array([1.0, 2.0, 0.5]))
    area = statistics.statistics(found, 1000.0, BASE, OFFSET)
    np.testing.assert_allclose(area.median, BASE + OFFSET / 0.2 / (1000.0 * 1.0))
    paper = statistics.statistics(found, 1000.0, BASE, OFFSET, "paper")
    flux = found.area * found.speed2
    np.testing.assert_allclose(paper.median, np.median(BASE + OFFSET / (1000.0 * flux)))
    np.testing.assert_allclose(paper.aggregate, (BASE * flux + OFFSET / 1000.0).sum() / flux.sum())
    np.testing.assert_allclose(paper.skew, np.median(flux) / flux.mean())
    for mode, one in (("area", area), ("paper", paper)):
        np.testing.assert_allclose(one.median, BASE + OFFSET * statistics.per_offset(found, 1000.0, mode), rtol=1e-6)


def test_wet_parts() -> None:
    """Shares and centroids of clipped triangles against a fine subdivision."""
    rng = np.random.default_rng(0)
    depth = rng.normal(size=(200, 3))
    share, weight = statistics.wet_parts(depth)
    n = 200
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    inside = i + j < n
    a, b = (i[inside] + 1 / 3) / n, (j[inside] + 1 / 3) / n
    corners = np.stack([a, b, 1 - a - b])
    wet = depth @ corners > 0
    np.testing.assert_allclose(share, wet.mean(1), atol=0.01)
    np.testing.assert_allclose(weight, (wet[:, None] * corners).mean(2), atol=0.01)
    np.testing.assert_allclose(weight.sum(1), share, atol=1e-12)
