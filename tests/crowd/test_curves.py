"""Curves to walk along: through their points, smooth, closed, measured by arc length; and where herds start on them."""

from __future__ import annotations

import numpy as np
import pytest

from crowd import courses, curves
from crowd.scenario_control import Route
from crowd.scenario_herd import Herd

SQUARE = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))
UNEVEN = ((0.0, 0.0), (0.3, 0.1), (6.0, 1.0), (6.2, 1.4), (1.0, 8.0))


def turns(points: np.ndarray, closed: bool) -> np.ndarray:
    """Angles between neighbouring spans, rad; of a closed curve over its seam too."""
    way = np.diff(points, axis=0)
    way = np.concatenate([way, way[:1]]) if closed else way
    angle = np.unwrap(np.arctan2(way[:, 0], way[:, 1]))
    return np.diff(angle)


@pytest.mark.parametrize("points", [SQUARE, UNEVEN])
@pytest.mark.parametrize("closed", [False, True])
def test_spline_passes_its_points_without_corners(
    points: tuple[tuple[float, float], ...], closed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    curve = curves.build(Route(points_m=points, closed=closed, speed_m_s=1.0))
    for point in points:
        assert np.hypot(*(curve.points - point).T).min() < curves.STEP
    monkeypatch.setattr(curves, "DENSE", 1024)
    fine = turns(curves.spline(np.array(points), closed), closed)
    assert np.abs(fine).max() < 0.05  # a corner keeps its angle, however finely it is sampled
    gap = np.linalg.norm(np.diff(curve.points, axis=0), axis=1)
    step = curve.length / (len(curve.points) - 1)
    assert gap.max() < 1.001 * step  # chords: a little shorter in tight turns
    assert gap.mean() > 0.99 * step
    assert curve.closed == closed
    ends = np.linalg.norm(curve.points[-1] - curve.points[0])
    assert (ends == 0.0) if closed else ends == pytest.approx(np.linalg.norm(np.subtract(points[-1], points[0])))


def test_spline_of_points_on_a_line_is_the_line() -> None:
    points = np.array([[0.0, 0.0], [1.0, 2.0], [4.0, 8.0]])
    found = curves.spline(points, False)
    np.testing.assert_allclose(found[:, 1], 2 * found[:, 0], atol=1e-12)
    assert curves.build(Route(points_m=((0, 0), (3, 4)), speed_m_s=1.0)).length == pytest.approx(5.0)


def test_closed_spline_does_not_depend_on_where_it_begins() -> None:
    first = curves.spline(np.array(SQUARE), True)[:-1]
    second = curves.spline(np.roll(SQUARE, -1, 0), True)[:-1]
    np.testing.assert_allclose(np.roll(first, -curves.DENSE, 0), second, atol=1e-12)


def test_circle_and_figure_of_eight() -> None:
    circle = curves.build(Route(curve="circle", center_m=(3.0, -1.0), radius_m=2.0, speed_m_s=1.0))
    assert circle.length == pytest.approx(4 * np.pi, rel=1e-5)
    np.testing.assert_allclose(np.hypot(*(circle.points - [3.0, -1.0]).T), 2.0, atol=1e-4)
    eight = curves.build(Route(curve="figure_eight", radius_m=5.0, speed_m_s=1.0))
    assert eight.length == pytest.approx(5.244115 * 5.0, rel=1e-4)  # of Bernoulli's lemniscate
    assert np.abs(eight.points).max(0) == pytest.approx([5.0, 5.0 / np.sqrt(8)], rel=1e-3)
    assert abs(turns(eight.points, True).sum()) < 0.1  # one half turns left, the other right
    assert circle.closed
    assert eight.closed


def test_rounded_corners_stay_near_and_touch_the_sides() -> None:
    curve = curves.build(Route(curve="polyline", points_m=SQUARE, closed=True, speed_m_s=1.0))
    r = curves.CORNER
    assert curve.length == pytest.approx(16.0 - 8 * r + 2 * np.pi * r, rel=1e-3)
    for corner in SQUARE:
        assert np.hypot(*(curve.points - corner).T).min() == pytest.approx(r * (np.sqrt(2) - 1), abs=0.01)
    assert np.abs(turns(curve.points, True)).max() < 1.5 * curves.STEP / r
    back = curves.build(Route(curve="polyline", points_m=((0, 0), (0, 3), (0, 1)), speed_m_s=1.0))
    assert back.length == pytest.approx(5.0, rel=0.02)  # straight back: no arc fits


def test_speed_falls_before_tight_turns_only() -> None:
    curve = curves.build(Route(curve="polyline", points_m=((0, 0), (0, 10), (10, 10)), speed_m_s=1.0))
    speed = curve.speed(2.0)
    along = np.linspace(0, curve.length, len(speed))
    assert speed.min() == pytest.approx(curves.AT_ONCE * 2.0 * curves.CORNER, rel=0.1)
    assert speed[0] > 3.0
    assert np.abs(along[np.argmin(speed)] - curve.length / 2) < 0.5
    change = np.abs(np.diff(speed**2)) / 2 / np.diff(along)
    assert change.max() < curves.BRAKES * 1.01
    circle = curves.build(Route(curve="circle", radius_m=1.0, speed_m_s=1.0))
    np.testing.assert_allclose(circle.speed(2.0), curves.AT_ONCE * 2.0, rtol=0.02)


@pytest.mark.parametrize("closed", [False, True])
def test_nearest_and_at_are_inverse(closed: bool) -> None:
    curve = curves.build(Route(points_m=UNEVEN, closed=closed, speed_m_s=1.0))
    along = np.linspace(0.01, curve.length - 0.01, 40)
    np.testing.assert_allclose(curve.nearest(curve.at(along)), along, atol=1e-3)
    beyond = curve.at(np.array([curve.length + 1.0]))
    np.testing.assert_allclose(beyond, curve.at(np.array([1.0])) if closed else curve.points[-1:], atol=1e-9)


def herd(route: Route, **more: object) -> Herd:
    return Herd.model_validate({"name": "h", "archetype": "human", "count": 4, "path": route.model_dump(), **more})


def test_spread_starts_evenly_along_the_curve() -> None:
    route = Route(curve="circle", radius_m=2.0, speed_m_s=1.0, along="spread", start_m=1.0)
    start = courses.start(herd(route), 0, courses.Path(), "")
    assert start.along is not None
    np.testing.assert_allclose(start.along, 1.0 + np.pi * np.arange(4), rtol=1e-5)
    np.testing.assert_allclose(np.hypot(*start.points.T), 2.0, atol=1e-3)
    # clockwise seen from above with z up the page and x to the right: first along +x, the heading of 90 degrees
    np.testing.assert_allclose(start.headings[0], np.pi / 2 + 0.5, atol=0.03)


def test_place_joins_where_the_curve_is_nearest() -> None:
    route = Route(points_m=((0, 0), (0, 10)), speed_m_s=1.0)
    place = {"kind": "list", "points_m": [[1.0, 2.0], [1.0, 4.0], [-1.0, 2.0], [-1.0, 4.0]]}
    kept = courses.start(herd(route, place=place), 0, courses.Path(), "")
    assert kept.along is not None
    np.testing.assert_allclose(kept.along, 3.0, atol=1e-6)  # the middle's
    np.testing.assert_allclose(kept.headings, 0.0, atol=1e-6)
    alone = route.model_copy(update={"keep_formation": False})
    own = courses.start(herd(alone, place=place), 0, courses.Path(), "")
    assert own.along is not None
    np.testing.assert_allclose(own.along, [2.0, 4.0, 2.0, 4.0], atol=1e-6)
    np.testing.assert_allclose(own.headings[0], -np.pi / 4, atol=1e-6)  # 1 m aside, 1 m on
    given = courses.start(herd(alone, place=place, heading_deg=30.0), 0, courses.Path(), "")
    np.testing.assert_allclose(given.headings, np.radians(30.0))
