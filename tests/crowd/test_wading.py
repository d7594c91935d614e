"""Wading at every frame rate and in fluids ten times as dense as water: one mean speed, never thrown back."""

from __future__ import annotations

import numpy as np
import pytest

from tests.crowd.scenes import herd, run, scenario

SPEED, SECONDS, SETTLED = 1.3, 10.0, 3.0
# kg/m3: who walks; after them who stands in a flow, in the first and in the last
DENSITIES = (1000.0, 1840.0, 2750.0, 5000.0, 10_000.0)
FLOW = 1.0  # m/s, along +z
RATES = (15, 60, 240)
# of the mean speed in water against 240 Hz; the difference of footsteps goes with the time step
CLOSE = {
    ("semi_procedural", 15): 0.005,
    ("semi_procedural", 60): 0.0025,
    ("footsteps", 15): 0.015,
    ("footsteps", 60): 0.005,
}

Arrays = dict[str, np.ndarray]


def waders(gait: str, rate: int) -> Arrays:
    """Waist-deep, a region of its own density for each; the last two stand, and the fluid flows past them."""
    regions, points = [], []
    for number, density in enumerate((*DENSITIES, DENSITIES[0], DENSITIES[-1])):
        x = 20.0 * number
        area = {"x": [x - 10.0, x + 10.0], "z": [-50.0, 50.0]}
        flow = [0.0, 0.0, 0.0] if number < len(DENSITIES) else [0.0, 0.0, FLOW]
        regions.append({"density_kg_m3": density, "surface_m": 0.9, "area_m": area, "flow_m_s": flow})
        points.append([x, 0.0])
    walkers = {**herd("p", "human", len(points), SPEED), "place": {"kind": "list", "points_m": points}}
    stop = {"at_s": 0.0, "characters": [len(DENSITIES), len(DENSITIES) + 1], "velocity_m_s": [0.0, 0.0]}
    model = scenario([walkers], rate_hz=rate, gait=gait, events=[stop])
    model["world"]["fluids"] = regions
    return run(model, SECONDS)["p"]


@pytest.fixture(scope="module", params=["footsteps", "semi_procedural"])
def rates(request: pytest.FixtureRequest) -> tuple[str, dict[int, Arrays]]:
    return request.param, {rate: waders(request.param, rate) for rate in RATES}


def over_cycles(arrays: Arrays, rate: int, who: int) -> float:
    """m/s, mean over whole gait cycles after the first seconds."""
    first = round(SETTLED * rate)
    phase, way = arrays["phase"][first:, who], arrays["position"][first:, who, 2]
    last = np.flatnonzero(np.diff(phase) < -0.5)
    begins = last + (1.0 - phase[last]) / (phase[last + 1] + 1.0 - phase[last])
    ends = np.interp(begins[[0, -1]], np.arange(len(way)), way)
    return float((ends[1] - ends[0]) / (begins[-1] - begins[0]) * rate)


def test_mean_speed_at_every_frame_rate(rates: tuple[str, dict[int, Arrays]]) -> None:
    """The default gait within 0.5 % from 15 to 240 Hz; footsteps from 60 Hz, at 15 Hz within 1.5 %."""
    gait, runs = rates
    best = over_cycles(runs[240], 240, 0)
    assert 0.66 < best / SPEED < 0.77
    for rate in (15, 60):
        assert over_cycles(runs[rate], rate, 0) == pytest.approx(best, rel=CLOSE[gait, rate])


def test_any_density_at_any_frame_rate(rates: tuple[str, dict[int, Arrays]]) -> None:
    """No fault, nothing beyond what a walker can do; in the steady state forward, slower the denser."""
    _, runs = rates
    for rate, arrays in runs.items():
        assert not arrays["fault"].any()
        walking = arrays["velocity"][:, : len(DENSITIES), 2]
        assert walking.max() < 1.01 * SPEED
        assert walking.min() > -SPEED  # a leg that is driven into the thickest may push back for an instant
        steady = walking[round(SETTLED * rate) :]
        assert steady.min() > 0.0
        assert (np.diff(steady.mean(0)) < 0).all()
        assert np.abs(arrays["yaw"]).max() < 0.8
        assert np.abs(arrays["velocity"][:, : len(DENSITIES), 0]).max() < 0.5


def test_a_flow_never_carries_past_itself(rates: tuple[str, dict[int, Arrays]]) -> None:
    """Who stands in it drifts more slowly than it flows. Not at every instant: a foot that stands still while the body
    drifts is pushed on by the whole flow, and passes that on to the body."""
    _, runs = rates
    for rate, arrays in runs.items():
        drift = arrays["velocity"][round(SETTLED * rate) :, len(DENSITIES) :, 2]
        assert drift.max() < 1.15 * FLOW
        assert 0.05 < drift[:, 0].mean() < drift[:, 1].mean() < FLOW
