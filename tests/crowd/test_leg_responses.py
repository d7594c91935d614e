"""Responses of the legs: feet that stay out of each other's way, and steps over shallow water."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.crowd.scenes import herd, run, scenario

ASIDE = [
    {"at_s": 1.0, "velocity_m_s": [0.7, 0.0], "facing_deg": 0},
    {"at_s": 2.5, "velocity_m_s": [-0.7, 0.0], "facing_deg": 0},
    {"at_s": 4.0, "velocity_m_s": [0.0, -0.9]},
]


def distance(p: np.ndarray, q: np.ndarray, r: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Least distance of segments pq and rs [..., 2] by a search over both."""
    t = np.linspace(0, 1, 21)[:, None]
    one, other = (a[..., None, :] + (b - a)[..., None, :] * t for a, b in ((p, q), (r, s)))
    return np.linalg.norm(one[..., :, None, :] - other[..., None, :, :], axis=-1).min((-1, -2))


def gaps(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """[time, character] m, between the soles of the first two legs, seen from above."""
    heel, toe = arrays["heel"][..., [0, 2]], arrays["toe"][..., [0, 2]]
    return distance(heel[:, :, 0], toe[:, :, 0], heel[:, :, 1], toe[:, :, 1])


def people(**responses: Any) -> dict[str, Any]:
    return herd("p", "human", 6, variation={"speed": {"kind": "uniform", "min": 0.7, "max": 1.1}}, responses=responses)


def test_feet_keep_apart_in_side_steps_and_turns() -> None:
    """Without clearance they pass through each other time and again; with it they keep most of the gap (but for a frame
    of a turn of 130 degrees out of a side step), slide no more and reach as far."""
    plain = run(scenario([people()], events=ASIDE, gait="semi_procedural"), 6.0)["p"]
    apart = run(scenario([people(leg_clearance={})], events=ASIDE, gait="semi_procedural"), 6.0)["p"]
    close = {name: gaps(each) < 0.05 for name, each in (("plain", plain), ("apart", apart))}
    assert close["plain"].mean() > 0.05 and close["apart"].mean() < 0.005
    assert not (close["apart"] & apart["contact"].all(2)).any(), "nobody stands on his own foot"
    assert np.quantile(gaps(apart), 0.01) > 0.07
    assert apart["over_reach"].max() < 1e-3
    np.testing.assert_allclose(apart["velocity"], plain["velocity"], atol=1e-5, err_msg="dry: feet carry nothing")
    planted = apart["contact"][1:] & apart["contact"][:-1]
    slid = np.linalg.norm(np.diff(apart["handle"], axis=0), axis=-1)[planted]
    assert slid.max() < 1e-5


@pytest.mark.parametrize("gait", ["semi_procedural", "footsteps"])
def test_high_steps_leave_shallow_water_and_cost_less(gait: str) -> None:
    arrays = {
        name: run(scenario([people(**own)], surface=0.2, gait=gait), 4.0)["p"]
        for name, own in {"plain": {}, "high": {"high_step": {}}}.items()
    }
    sole = {name: each["ball"][120:, ..., 1].max(0) for name, each in arrays.items()}
    assert sole["plain"].max() < 0.2 < sole["high"].min()
    force = {name: np.abs(each["drag_force"][120:, :, 2]).mean() for name, each in arrays.items()}
    assert force["high"] < 0.6 * force["plain"]
    assert arrays["high"]["velocity"][120:, :, 2].mean() > 1.03 * arrays["plain"]["velocity"][120:, :, 2].mean()
    assert arrays["high"]["over_reach"].max() < 0.02


def test_deep_water_keeps_its_steps() -> None:
    plain, high = (
        run(scenario([people(**own)], surface=0.9), 2.0)["p"] for own in ({}, {"high_step": {"to_depth_m": 0.3}})
    )
    np.testing.assert_allclose(high["ball"], plain["ball"], atol=2e-5)


def test_any_number_of_legs() -> None:
    """Eight legs with eight neighbours to look out for, in shallow water: finite, planted, nobody faults."""
    own = {"leg_clearance": {"gap_share": 0.8}, "high_step": {"to_depth_m": 0.3}}
    model = scenario([herd("s", "spider", 3, 0.3, responses=own)], surface=0.03, gait="semi_procedural")
    arrays = run(model | {"events": [{"at_s": 1.0, "velocity_m_s": [0.0, -0.2]}]}, 3.0)["s"]
    assert not arrays["fault"].any() and np.isfinite(arrays["heel"]).all()
    planted = arrays["contact"][1:] & arrays["contact"][:-1]
    assert np.linalg.norm(np.diff(arrays["handle"], axis=0), axis=-1)[planted].max() < 1e-5


def test_feet_of_the_footstep_controller_keep_apart_too() -> None:
    """It aims aside of the other foot by itself, but swings through it in a turn."""
    turn = [{"at_s": 1.0, "velocity_m_s": [0.0, -0.9]}]
    close = {}
    for name, own in {"plain": {}, "apart": {"leg_clearance": {}}}.items():
        arrays = run(scenario([people(**own)], events=turn), 4.0)["p"]
        ankle, ball = arrays["ankle"][..., [0, 2]], arrays["ball"][..., [0, 2]]
        close[name] = (distance(ankle[:, :, 0], ball[:, :, 0], ankle[:, :, 1], ball[:, :, 1]) < 0.06).mean()
    assert close["apart"] < 0.6 * close["plain"]


def test_pushed_walkers_never_cross_their_feet() -> None:
    push = [
        {"at_s": at, "characters": [n], "impulse_n_s": [150.0, 0.0, 0.0]} for n, at in enumerate((1.0, 1.2, 1.4, 1.6))
    ]
    one = herd("p", "human", 4, responses={"leg_clearance": {}})
    arrays = run(scenario([one], events=push, gait="semi_procedural"), 5.0)["p"]
    assert np.ptp(arrays["position"][..., 0], axis=0).min() > 0.5
    left, right = arrays["handle"][..., 0, 0], arrays["handle"][..., 1, 0]
    assert (left - right).min() > 0.0
    assert not (gaps(arrays) < 0.03).any()


def test_side_steps_against_a_stream_from_the_side() -> None:
    """The stream carries walkers aside by its force over the lateral gain; feet step with them and stay on their sides,
    and the body keeps facing where it goes."""
    stream = {"fluid": "water", "surface_m": 0.5, "flow_m_s": [0.9, 0.0, 0.0]}
    model = scenario([herd("p", "human", 4, 1.2, responses={"leg_clearance": {}})], gait="semi_procedural")
    arrays = run(model | {"world": {"ground": {"kind": "flat"}, "fluids": [stream]}}, 8.0)["p"]
    late = slice(240, None)
    drift = arrays["velocity"][late, :, 0].mean(0)
    assert np.all(drift > 0.1)
    np.testing.assert_allclose(drift, arrays["drag_force"][late, :, 0].mean(0) / 250.0, rtol=0.05)
    across = arrays["handle"][late, :, 0, 0] - arrays["handle"][late, :, 1, 0]
    assert across.min() > 0.05
    assert np.abs(arrays["yaw"][late]).max() < np.radians(12)
    planted = arrays["contact"][1:] & arrays["contact"][:-1]
    assert np.linalg.norm(np.diff(arrays["handle"], axis=0), axis=-1)[planted].max() < 1e-5
