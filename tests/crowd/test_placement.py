"""Where characters start and how they differ: shapes, distances, distributions, and what a draw may depend on."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from crowd.errors import InputError
from crowd.placement import place, uniforms, variation
from crowd.scenario_herd import Herd


def herd(count: int, place: dict[str, Any], name: str = "people", **more: Any) -> Herd:
    moving = {} if {"velocity_m_s", "waypoints"} & more.keys() else {"speed_m_s": 1.0}
    return Herd.model_validate({"name": name, "archetype": "human", "count": count, "place": place} | moving | more)


def distances(points: np.ndarray) -> np.ndarray:
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    return apart[~np.eye(len(points), dtype=bool)]


DISC = {"kind": "poisson_disc", "radius_m": 10.0, "min_distance_m": 1.0, "center_m": [3.0, -4.0]}
GRID = {"kind": "grid", "spacing_m": 1.5}


def test_grid_is_centred_with_its_spacing() -> None:
    points, headings = place(herd(12, {"kind": "grid", "spacing_m": 2.0, "columns": 4, "center_m": [1.0, -2.0]}), 0)
    assert points.shape == (12, 2)
    assert headings.shape == (12,)
    np.testing.assert_allclose(points.mean(0), [1.0, -2.0])
    np.testing.assert_allclose(np.unique(points[:, 0]), [-2.0, 0.0, 2.0, 4.0])
    np.testing.assert_allclose(np.unique(points[:, 1]), [-4.0, -2.0, 0.0])
    np.testing.assert_allclose(points[0], [4.0, 0.0])  # in front on the left


@pytest.mark.parametrize("count", [1, 2, 3, 5, 17, 100])
def test_square_grid_of_any_count(count: int) -> None:
    points, _ = place(herd(count, GRID), 0)
    assert len(points) == count
    assert count == 1 or distances(points).min() == pytest.approx(1.5)
    assert np.ptp(points, axis=0).max() <= 1.5 * np.ceil(np.sqrt(count))


def test_disc_is_evenly_full() -> None:
    points, _ = place(herd(500, {"kind": "disc", "radius_m": 4.0, "center_m": [10.0, 0.0]}), 0)
    radius = np.linalg.norm(points - [10.0, 0.0], axis=1)
    assert radius.max() <= 4.0
    np.testing.assert_allclose(np.mean(radius < 2.0), 0.25, atol=0.01)  # as area
    assert distances(points).min() > 0.8 * np.sqrt(np.pi * 16.0 / 500) / 1.5


def test_poisson_disc_keeps_the_distance_and_fills_the_disc() -> None:
    points, _ = place(herd(120, DISC), 1)
    assert distances(points).min() >= 1.0
    radius = np.linalg.norm(points - [3.0, -4.0], axis=1)
    assert 8.0 < radius.max() <= 10.0
    assert 0.1 < np.mean(radius < 5.0) < 0.45


def test_poisson_disc_that_is_full_says_so() -> None:
    tight = {"kind": "poisson_disc", "radius_m": 3.0, "min_distance_m": 1.0}
    with pytest.raises(InputError, match=r"herds.people.place: only \d+ of 40 characters fit in a disc of 3 m"):
        place(herd(40, tight), 0)


def test_list_is_taken_as_it_is() -> None:
    points, _ = place(herd(2, {"kind": "list", "points_m": [[1.0, 2.0], [3.0, 4.0]]}), 0)
    np.testing.assert_array_equal(points, [[1.0, 2.0], [3.0, 4.0]])


@pytest.mark.parametrize(
    ("more", "degrees"),
    [
        ({}, 0.0),
        ({"heading_deg": 30.0}, 30.0),
        ({"velocity_m_s": [1.0, 0.0]}, 90.0),  # toward +x is left
        ({"velocity_m_s": [1.0, 0.0], "heading_deg": 0.0}, 0.0),  # walks sideways
        ({"velocity_m_s": [0.0, 0.0]}, 0.0),
        ({"waypoints": {"points_m": [[-5.0, 5.0], [9.0, 9.0]], "speed_m_s": 1.0}}, -45.0),
    ],
)
def test_heading(more: dict[str, Any], degrees: float) -> None:
    _, headings = place(herd(4, GRID, **more), 0)
    np.testing.assert_allclose(np.degrees(headings), degrees)


def test_draws_depend_on_seed_name_and_number_only() -> None:
    vary = {"height": {"kind": "normal", "sd": 0.1}, "speed": {"kind": "uniform", "min": 0.8, "max": 1.2}}
    few, many = (variation(herd(count, GRID, variation=vary), 3) for count in (10, 1000))
    for key in few:
        np.testing.assert_array_equal(few[key], many[key][:10])
    other_name = variation(herd(10, GRID, name="others", variation=vary), 3)
    other_seed = variation(herd(10, GRID, variation=vary), 4)
    assert np.abs(few["height"] - other_name["height"]).min() > 0
    assert np.abs(few["height"] - other_seed["height"]).min() > 0
    assert np.abs(np.corrcoef(many["height"], many["speed"])[0, 1]) < 0.1


def test_poisson_places_do_not_depend_on_the_count() -> None:
    few, many = (place(herd(count, DISC), 5)[0] for count in (10, 100))
    np.testing.assert_array_equal(few, many[:10])


def test_uniforms_are_uniform_and_inside() -> None:
    drawn = uniforms(1, "people", "test", 20_000, 3)
    assert drawn.min() > 0.0
    assert drawn.max() < 1.0
    for column in drawn.T:
        assert stats.kstest(column, "uniform").pvalue > 1e-3


def test_normal_variation_is_a_truncated_normal() -> None:
    vary = {"height": {"kind": "normal", "mean": 1.0, "sd": 0.1, "min": 0.95, "max": 1.3}}
    drawn = variation(herd(20_000, GRID, variation=vary), 0)["height"]
    assert drawn.min() >= 0.95
    assert drawn.max() <= 1.3
    truncated = stats.truncnorm(-0.5, 3.0, loc=1.0, scale=0.1)
    assert stats.kstest(drawn, truncated.cdf).pvalue > 1e-3


def test_uniform_constant_and_absent_variation() -> None:
    vary = {"mass": {"kind": "uniform", "min": 0.5, "max": 1.5}, "speed": {"kind": "constant", "value": 1.1}}
    drawn = variation(herd(5000, GRID, variation=vary), 0)
    assert stats.kstest(drawn["mass"], stats.uniform(0.5, 1.0).cdf).pvalue > 1e-3
    np.testing.assert_array_equal(drawn["speed"], 1.1)
    np.testing.assert_array_equal(drawn["height"], 1.0)


def test_normal_without_spread_is_its_mean() -> None:
    drawn = variation(herd(5, GRID, variation={"height": {"kind": "normal", "mean": 1.2, "sd": 0.0}}), 0)
    np.testing.assert_array_equal(drawn["height"], 1.2)
