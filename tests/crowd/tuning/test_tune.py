"""`crowd tune` end to end, its errors, and whether the gradient says where to go."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from typer.testing import CliRunner

from crowd.cli import app
from crowd.errors import InputError
from crowd.scenario_yaml import read_file
from crowd.tuning import config, outcome, quantities, rollout, run
from crowd.tuning.evaluation import Evaluation
from tests.crowd.scenes import herd, scenario

WADING: dict[str, Any] = {
    "name": "t",
    "scenario": scenario([herd("p", "human", 2)], 0.8),
    "free": {
        "fluids.base_drag.a": {"low": 0.5, "high": 3.0, "scale": "log"},
        "characters.gain_forward": {"low": 0.5, "high": 2.0, "scale": "log", "relative": True},
    },
    "targets": [{"herd": "p", "character": 0, "quantity": "relative_speed", "value": 0.7, "tolerance": 0.01}],
    "horizon": {"settle_s": 1.5, "lead_s": 0.5, "window_s": 4.2},
}
PUSH: dict[str, Any] = {
    "name": "push",
    "scenario": scenario([herd("p", "human", 1)], events=[{"at_s": 1.0, "impulse_n_s": [100.0, 0.0, 0.0]}]),
    "free": {"characters.gain_side": {"low": 100.0, "high": 2000.0, "scale": "log"}},
    "targets": [{"herd": "p", "quantity": "settling_s", "value": 1.2, "tolerance": 0.02}],
    "horizon": {"settle_s": 0.8, "lead_s": 0.2, "window_s": 3.0},
    "starts": {"count": 3},
}


def changed(model: dict[str, Any], **keys: Any) -> dict[str, Any]:
    return copy.deepcopy(model) | keys


@pytest.fixture(scope="module")
def wading() -> Evaluation:
    return Evaluation(config.load(WADING))


def test_the_gradient_is_the_slope_over_five_and_ten_percent(wading: Evaluation) -> None:
    """Within 10 %: steps keep their times, and the window holds eight of them."""
    ratio = []
    for p, one in enumerate(wading.free):
        middle = np.array([each.place(each.start) for each in wading.free])
        _, slope = wading.quantities(middle[None])
        for change in (0.05, 0.1):
            ends = np.tile(middle, (2, 1))
            ends[:, p] = [one.place(one.start * (1 - change)), one.place(one.start * (1 + change))]
            values, _ = wading.quantities(ends)
            ratio.append(slope[0, 0, p] * (ends[1, p] - ends[0, p]) / (values[1, 0] - values[0, 0]))
    np.testing.assert_allclose(ratio, 1.0, atol=0.1)


def test_lanes_are_plain_runs(wading: Evaluation) -> None:
    """What a lane measures is what the scenario does with those constants, whatever the lanes beside it.

    The gradient of so many lanes, 64, needs less than 0.5 GB for 600 frames.
    """
    rng = np.random.default_rng(0)
    places = rng.uniform(0.2, 0.8, (32, 2))
    values, _ = wading.quantities(places)
    np.testing.assert_allclose(values[3, 0], wading.verified(places[3])[0], atol=2e-4)
    seconds = WADING["horizon"]["lead_s"] + WADING["horizon"]["window_s"]
    assert 1e6 < wading.memory / (60 * seconds) * 600 < 0.5e9
    np.testing.assert_allclose(wading.quantities(places[3:4])[0][0], values[3], atol=1e-5)


def test_a_fit_reaches_its_target_and_says_what_it_left_open(wading: Evaluation) -> None:
    found = run.tune(changed(WADING, starts={"count": 4}))
    assert found.reached.all()
    np.testing.assert_allclose(found.verified, 0.7, atol=0.01)
    known = run.identifiability(found.search)
    assert known.determined.tolist() == [True, False]  # only C_D / k counts
    # as places, the two bounds' widths differ: along the open direction both grow by the same factor
    widths = np.log([6.0, 4.0])
    np.testing.assert_allclose(*(known.directions[1] * widths), rtol=0.1)
    del wading


def test_the_command(tmp_path: Path) -> None:
    from ruamel.yaml import YAML

    path, out = tmp_path / "push.yaml", tmp_path / "out"
    with path.open("w") as stream:
        YAML(typ="safe").dump(PUSH, stream)
    found = CliRunner().invoke(app, ["tune", str(path), "--out", str(out)])
    assert found.exit_code == 0, found.output
    fitted = read_file(out / outcome.FITTED).data
    gain = fitted["constants"]["characters.gain_side"]
    # 2 % settling time of (m + b) / k; the walk adds a little to it
    np.testing.assert_allclose(4.0 * 140.0 / gain, 1.2, rtol=0.1)
    assert fitted["targets"][0]["within"]
    assert fitted["starts"]["reached_all_targets"] == 3
    for name in (outcome.HISTORY, outcome.PLOT, outcome.KEPT):
        assert (out / name).stat().st_size > 0
    again = CliRunner().invoke(app, ["tune", str(path), "--out", str(out), "--resume"])
    assert again.exit_code == 0, again.output
    assert "iteration 1/" in again.output
    refused = CliRunner().invoke(app, ["tune", str(path), "--out", str(tmp_path)])
    assert refused.exit_code == 2


BAD = {
    "unknown parameter": (
        {"free": {"characters.gain_foward": {"low": 1.0, "high": 2.0}}},
        "did you mean 'characters.gain_forward'?",
    ),
    "bounds": ({"free": {"fluids.base_drag.a": {"low": 2.0, "high": 1.0}}}, "low 2 is not below high 1"),
    "excluded": ({"free": {"fluids.base_drag.a": {"low": 2.0, "high": 3.0}}}, "exclude the start, 1.1"),
    "excluded start": (
        {"free": {"fluids.base_drag.a": {"low": 2.0, "high": 3.0, "start": 1.0}}},
        "exclude the start 1",
    ),
    "log": ({"free": {"fluids.base_drag.a": {"low": 0.0, "high": 3.0, "scale": "log"}}}, "positive"),
    "herd": ({"targets": [{"herd": "q", "quantity": "speed", "value": 1.0, "tolerance": 0.1}]}, "no herd 'q'"),
    "character": (
        {"targets": [{"herd": "p", "character": 2, "quantity": "speed", "value": 1.0, "tolerance": 0.1}]},
        "has 2, counted from 0",
    ),
    "quantity": (
        {"targets": [{"herd": "p", "quantity": "sped", "value": 1.0, "tolerance": 0.1}]},
        "did you mean 'speed'?",
    ),
    "scenario": ({"scenario": {"herds": []}}, "herds"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_files(case: str) -> None:
    keys, message = BAD[case]
    with pytest.raises(InputError) as found:
        Evaluation(config.load(changed(WADING, **keys)))
    assert message in str(found.value)


def test_a_parameter_without_influence_is_named() -> None:
    free = {
        "characters.gain_side": PUSH["free"]["characters.gain_side"],
        "control.arm_margin": {"low": 0.01, "high": 0.5},
    }
    with pytest.raises(InputError, match=r"'control\.arm_margin' influences no target"):
        run.tune(changed(PUSH, free=free))


def test_settled_is_exact_for_an_exponential() -> None:
    time = np.arange(0.0, 20.0, 1e-3)
    tau = np.array([0.2, 0.5, 1.0])
    error = (0.3 * np.exp(-time[:, None] / tau)) ** 2
    np.testing.assert_allclose(quantities.settled(jnp.asarray(error), jnp.asarray(time)), 4.0 * tau, rtol=5e-3)


def test_starts_share_a_tile() -> None:
    assert rollout.starts_at_once(3) == 42
    assert rollout.starts_at_once(500) == 1
