"""The Python interface: `crowd.load`, `crowd.simulate`, results as named arrays."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import crowd

REPOSITORY = Path(__file__).resolve().parents[2]
SCENARIO = {
    "name": "two",
    "frames": 12,
    "herds": [
        {
            "name": "people",
            "archetype": "human",
            "count": 2,
            "place": {"kind": "grid", "spacing_m": 2.0},
            "speed_m_s": 1.3,
        }
    ],
    "record": {"rate_hz": 20},
}


def test_load_and_simulate_give_named_arrays() -> None:
    scene = crowd.load(SCENARIO, ["seed=3"])
    assert isinstance(scene, crowd.Scene)
    done: list[int] = []
    result = crowd.simulate(scene, progress=done.append)
    assert isinstance(result, crowd.Result)
    assert result.scene.scenario.seed == 3
    np.testing.assert_allclose(result.time, np.arange(1, 5) * 3 / 60, rtol=1e-6)
    people = result.herds["people"]
    assert people["position"].shape == (4, 2, 3)
    assert people["joint_rotation"].shape == (4, 2, scene.herds[0].archetype.skeleton.count, 4)
    assert np.isfinite(people["velocity"]).all()
    assert done[-1] == 12


def test_seconds_and_frames() -> None:
    scene = crowd.load(SCENARIO)
    assert len(crowd.simulate(scene, seconds=0.1).time) == 2
    assert len(crowd.simulate(scene, frames=3).time) == 1


def test_bad_input_is_an_input_error() -> None:
    with pytest.raises(crowd.InputError, match="did you mean 'seed'"):
        crowd.load(SCENARIO | {"sede": 1})


@pytest.mark.parametrize(
    "first",
    ["import crowd", "import crowd.simulate", "from crowd.simulate import stream", "from crowd import simulate"],
)
def test_simulate_is_a_function_in_any_order_of_imports(first: str) -> None:
    code = f"{first}\nimport crowd\nassert callable(crowd.simulate) and callable(crowd.simulate.stream)\nprint('ok')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=REPOSITORY, check=False)
    assert done.stdout == "ok\n", done.stderr


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'simluate'"):
        _ = crowd.simluate
