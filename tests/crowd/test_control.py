"""Control of movement: limits per second, paths, facing, events, and a crowd steered call by call from Python."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import crowd
from crowd import scenario as scenarios
from crowd import scene
from crowd.errors import InputError
from tests.crowd.scenes import herd, run, scenario

Arrays = dict[str, dict[str, np.ndarray]]
EIGHT = {"curve": "figure_eight", "radius_m": 6.0, "speed_m_s": 1.3, "along": "spread"}
OPEN = {"curve": "spline", "points_m": [[0, 0], [0, 6], [4, 10], [10, 8]], "speed_m_s": 1.3, "keep_formation": False}
CORNERS = {"curve": "polyline", "points_m": [[0, 0], [0, 6], [6, 6], [6, 0]], "speed_m_s": 1.3, "closed": True}
RING = {"curve": "circle", "radius_m": 4.0, "center_m": [1.0, 2.0], "speed_m_s": 0.9, "along": "spread"}


def walker(name: str, count: int = 2, **more: Any) -> dict[str, Any]:
    return herd(name, "human", count, None, **more)


def angle(radians: np.ndarray) -> np.ndarray:
    """Degrees in [-180, 180)."""
    return (np.degrees(radians) + 180.0) % 360.0 - 180.0


# --- limits ----------------------------------------------------------------------------------------------------------

LIMITS = {"acceleration_m_s2": 1.0, "deceleration_m_s2": 2.0, "turn_rate_deg_s": 90.0}
ORDERS = [
    {"at_s": 1.0, "velocity_m_s": [0.0, 1.4]},
    {"at_s": 4.0, "velocity_m_s": [1.0, 0.0]},
    {"at_s": 7.0, "stop": True},
    {"at_s": 8.0, "stop": True, "facing_deg": -90.0},
]


@pytest.fixture(scope="module")
def rates() -> dict[int, dict[str, np.ndarray]]:
    """The same orders at three rates, recorded 30 times a second."""
    found = {}
    for rate in (30, 60, 240):
        model = scenario([walker("p", velocity_m_s=[0, 0], limits=LIMITS)], rate_hz=rate, events=ORDERS)
        found[rate] = run(model | {"record": {"rate_hz": 30, "pose": False}}, 11.0)["p"]
    return found


def test_limits_are_per_second(rates: dict[int, dict[str, np.ndarray]]) -> None:
    """Places within 1 cm of each other at all times, at 30, 60 and 240 Hz, and headings within half a frame's turn."""
    for rate in (30, 60):
        assert np.abs(rates[rate]["position"] - rates[240]["position"]).max() < 0.01
        assert np.abs(angle(rates[rate]["yaw"] - rates[240]["yaw"])).max() < 0.5 * 90.0 / rate


def test_limits_bound_what_the_body_does(rates: dict[int, dict[str, np.ndarray]]) -> None:
    arrays, dt = rates[240], 1 / 30
    speed = np.linalg.norm(arrays["velocity"][:, 0], axis=-1)
    change = np.diff(speed) / dt
    assert change.max() < 1.05
    assert change.min() > -2.1
    rising = (speed > 0.8) & (speed < 1.2) & (np.arange(len(speed)) < 90)
    np.testing.assert_allclose(np.gradient(speed, dt)[rising], 1.0, atol=0.03)
    turning = np.abs(np.diff(np.unwrap(arrays["yaw"][:, 0]))) / dt
    assert np.degrees(turning).max() < 95.0
    assert angle(arrays["yaw"][-1, 0]) == pytest.approx(-90.0, abs=1.0)
    assert speed[-1] < 1e-3
    # what was asked for stays what was asked for
    np.testing.assert_array_equal(arrays["desired_velocity"][35, 0], np.array([0.0, 0.0, 1.4], np.float32))


def test_without_limits_the_command_is_what_is_asked_for() -> None:
    stepper = crowd.stepper(scene.load(scenario([walker("p", velocity_m_s=[0, 0])])))
    stepper.step(velocity={"p": [[0.5, 1.0]] * 2})
    state = stepper.state[0]
    np.testing.assert_array_equal(state.command, state.desired)
    assert state.desired[0, 1, 0] == 1.0


# --- paths and facing ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def paths() -> Arrays:
    """30 s along curves on flat dry ground."""
    start = {"kind": "list", "points_m": [[0.5, -0.5], [-0.4, 0.0]]}
    herds = [
        walker("eight", path=EIGHT),
        walker("open", path=OPEN, place=start),
        walker("corners", path=CORNERS, place=start),
        walker("ring", path=RING, facing={"point_m": [1.0, 2.0]}),
    ]
    return run(scenario(herds), 30.0)


def off_curve(arrays: dict[str, np.ndarray], path: dict[str, Any]) -> np.ndarray:
    """[t, n] m, distance of every tenth frame's place from the curve, a formation's offsets taken off."""
    curve = scene.load(scenario([walker("p", path=path)])).herds[0].curve
    assert curve is not None
    place = arrays["position"][::10, :, [0, 2]]
    return np.stack([np.linalg.norm(p - curve.at(curve.nearest(p)), axis=1) for p in place])


def test_smooth_curve_is_kept_within_centimetres(paths: Arrays) -> None:
    """2 m is the tightest turn of the figure of eight."""
    off = off_curve(paths["eight"], EIGHT)
    assert off.mean() < 0.02
    assert off[6:].max() < 0.04
    assert off[:6].max() < 0.08  # at first they walk straight on, in the tightest turn
    speed = np.linalg.norm(paths["eight"]["velocity"][120:], axis=-1)
    np.testing.assert_allclose(speed.mean(), 1.3, rtol=0.03)
    way = np.linalg.norm(np.diff(paths["eight"]["position"][:, 0], axis=0), axis=-1).sum()
    assert way > 31.46  # once round and on


def test_open_path_ends_in_standing(paths: Arrays) -> None:
    arrays = paths["open"]
    assert off_curve(arrays, OPEN)[30:].max() < 0.05  # they join from half a metre beside it
    np.testing.assert_allclose(arrays["position"][-1][:, [0, 2]], [[10.0, 8.0]] * 2, atol=0.04)
    assert np.ptp(arrays["position"][-300:], axis=0).max() < 0.01
    assert arrays["contact"][-60:].all()
    # never back: they do not swing about the end
    last = arrays["position"][-600:, 0, 0]
    assert last.max() - last[-1] < 0.005


def test_corners_are_walked_round_in_formation(paths: Arrays) -> None:
    arrays = paths["corners"]
    middle = {**arrays, "position": arrays["position"].mean(1, keepdims=True)}
    assert off_curve(middle, CORNERS)[60:].max() < 0.12
    apart = arrays["position"][:, 0] - arrays["position"][:, 1]
    np.testing.assert_allclose(apart, np.broadcast_to(apart[0], apart.shape), atol=0.05)
    speed = np.linalg.norm(arrays["velocity"][120:, 0], axis=-1)
    assert 0.5 < speed.min() < 1.0  # slower round the corners, as the turn rate asks
    assert speed.max() > 1.25


def test_facing_a_point_while_walking_round_it(paths: Arrays) -> None:
    arrays = paths["ring"]
    x, z = 1.0 - arrays["position"][..., 0], 2.0 - arrays["position"][..., 2]
    assert np.abs(angle(arrays["yaw"] - np.arctan2(x, z)))[60:].max() < 5.0
    assert off_curve(arrays, RING)[12:].max() < 0.06
    np.testing.assert_allclose(np.linalg.norm(arrays["velocity"][120:], axis=-1).mean(), 0.9, rtol=0.03)
    assert not arrays["fault"].any()


def test_facing_a_heading_and_orders() -> None:
    """Side-steps along way-points with the eyes on +z; orders keep the facing or give another."""
    events = [{"at_s": 3.0, "velocity_m_s": [0.0, -0.5]}, {"at_s": 6.0, "velocity_m_s": [0.0, 0.5], "facing_deg": 60.0}]
    events.append({"at_s": 8.0, "velocity_m_s": [0.0, 0.5], "facing_deg": 30.0, "frame": "character"})
    way = {"points_m": [[9.0, 0.0]], "speed_m_s": 0.6}
    fixed = walker("fixed", waypoints=way, facing={"heading_deg": 0.0})
    along = walker("along", waypoints=way)
    arrays = run(scenario([fixed, along], events=events), 10.0)
    found, free = arrays["fixed"], arrays["along"]
    np.testing.assert_allclose(angle(found["yaw"][:360]), 0.0, atol=2.0)
    assert found["velocity"][170, 0, 0] > 0.55
    assert found["velocity"][350, 0, 2] < -0.45
    np.testing.assert_allclose(angle(free["yaw"][170]), 90.0, atol=2.0)
    np.testing.assert_allclose(np.abs(angle(free["yaw"][350])), 180.0, atol=3.0)
    for each in (found, free):
        np.testing.assert_allclose(angle(each["yaw"][479]), 60.0, atol=2.0)
        np.testing.assert_allclose(each["velocity"][479, :, 2], 0.5, atol=0.02)
        np.testing.assert_allclose(angle(each["yaw"][-1]), 90.0, atol=2.0)  # 30 degrees on from where it looked
        np.testing.assert_allclose(each["velocity"][-1, :, 0], 0.433, atol=0.03)  # ahead of one who looked at 60


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"path": {"speed_m_s": 1.0}}, "herds[0].path: missing; 'points_m' is needed for curve: spline"),
        ({"path": {"curve": "circle", "speed_m_s": 1.0}}, "'radius_m' is needed for curve: circle"),
        ({"path": OPEN | {"radius_m": 2.0}}, "path.radius_m: is for circle and figure_eight; a spline has points_m"),
        ({"path": EIGHT | {"points_m": [[0, 0], [1, 1]]}}, "path.points_m: is for splines and polylines"),
        (
            {"path": OPEN | {"points_m": [[0, 0], [0, 0], [1, 1]]}},
            "points_m[0]: [0.0, 0.0]: the same place as the next",
        ),
        ({"path": OPEN | {"curve": "splin"}}, "must be one of spline, polyline, circle, figure_eight (did you mean"),
        ({"path": OPEN, "place": None}, "herds[0].place: missing; 'place' is needed"),
        ({"path": OPEN, "waypoints": {"points_m": [[0, 1]], "speed_m_s": 1}}, "both waypoints and path are given"),
        ({"velocity_m_s": [0, 0], "facing": {}}, "exactly one of heading_deg, point_m is needed"),
        ({"velocity_m_s": [0, 0], "facing": "ahead"}, "herds[0].facing: 'ahead': must be along"),
        ({"velocity_m_s": [0, 0], "limits": {"acceleration_m_s2": 0}}, "acceleration_m_s2: 0: must be greater than 0"),
        ({"velocity_m_s": [0, 0], "limits": {"turn_rate": 1}}, "did you mean 'turn_rate_deg_s'?"),
    ],
)
def test_bad_ways_are_told(more: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError) as caught:
        scenarios.load(scenario([walker("p", **more)]))
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("event", "says"),
    [
        ({"at_s": 1.0, "impulse_n_s": [1, 0, 0], "facing_deg": 3.0}, "facing_deg: goes with velocity_m_s or stop"),
        ({"at_s": 1.0, "stop": False}, "events[0].stop: false: must be true"),
        ({"at_s": 1.0, "stop": True, "velocity_m_s": [0, 1]}, "both velocity_m_s and stop are given"),
    ],
)
def test_bad_events_are_told(event: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError) as caught:
        scenarios.load(scenario([walker("p", velocity_m_s=[0, 0])], events=[event]))
    assert says in str(caught.value)
