"""A crowd steered call by call: the same bits as a scripted run, one program, clear refusals, resumable."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest

import crowd
from crowd.errors import InputError
from tests.crowd.scenes import herd, scenario

WAY = {"points_m": [[1.0, 2.0], [4.0, 2.5], [4.0, -3.0]], "speed_m_s": 1.3}
FRAMES = 240


def model(**more: Any) -> dict[str, Any]:
    herds = [herd("people", "human", 3, None, **more), herd("dogs", "dog", 2, 1.0)]
    return scenario(herds) | {"record": {"rate_hz": 60, "pose": True}}


@pytest.fixture(scope="module")
def stepper() -> crowd.Stepper:
    """Standing people and a dog herd that walks by itself; nothing in this scene knows of way-points."""
    return crowd.stepper(crowd.load(model(velocity_m_s=[0.0, 1.3], heading_deg=0.0)))


def test_fed_the_same_velocities_it_walks_the_same_bits() -> None:
    """Scripted along way-points; the same scene steered from outside with the velocities that were asked for."""
    scene = crowd.load(model(waypoints=WAY))
    scripted = crowd.simulate(scene, frames=FRAMES, devices=1)
    stepper = crowd.stepper(scene)
    for frame in range(FRAMES):
        found = stepper.step(velocity={"people": scripted.herds["people"]["desired_velocity"][frame]})
    for name, arrays in scripted.herds.items():
        assert set(found[name]) == set(arrays)
        for key, values in arrays.items():
            np.testing.assert_array_equal(found[name][key], values[-1], err_msg=f"{name} {key}")
    assert stepper.time == pytest.approx(FRAMES / 60)
    np.testing.assert_array_equal(stepper.position["dogs"], scripted.herds["dogs"]["position"][-1])
    assert np.linalg.norm(scripted.herds["people"]["position"][-1, 0] - stepper.scene.herds[0].points[0, 0]) > 3.0


def test_shapes_of_commands_and_frames_do_not_retrace(stepper: crowd.Stepper) -> None:
    stepper.reset()
    stepper.step()
    before = stepper._run._cache_size()
    stepper.step(velocity={"people": np.zeros((3, 2))})
    stepper.step(velocity={"people": np.zeros((3, 3), np.float32), "dogs": [[0, 1]] * 2}, frames=7)
    stepper.step(facing={"people": [0.0, 1.0, np.nan]}, frames=2)
    assert stepper._run._cache_size() == before
    assert stepper.frame == 11
    assert jax.devices()[0] == stepper._device


def test_commands_last_until_the_next(stepper: crowd.Stepper) -> None:
    stepper.reset()
    stepper.step(
        velocity={"people": [[1.0, 0.0], [np.nan, np.nan], [0.0, -0.6]]}, facing={"people": [np.nan, np.nan, 0.0]}
    )
    found = stepper.step(frames=180)["people"]
    np.testing.assert_allclose(found["velocity"][:, 0], [1.0, 0.0, 0.0], atol=0.01)
    np.testing.assert_allclose(found["velocity"][:, 2], [0.0, 1.3, -0.6], atol=0.01)
    np.testing.assert_allclose(found["yaw"], [np.pi / 2, 0.0, 0.0], atol=0.02)  # the third walks backwards
    found = stepper.step(velocity={"people": [[0.0, 0.5, -0.6]] * 3}, frames=150)["people"]
    np.testing.assert_allclose(np.abs(found["yaw"]), [np.pi, np.pi, 0.0], atol=0.02)
    found = stepper.step(facing={"people": [0.5, np.nan, np.nan]}, frames=150)["people"]
    np.testing.assert_allclose(np.abs(found["yaw"]), [0.5, np.pi, np.pi], atol=0.02)
    np.testing.assert_allclose(found["velocity"][:, 2], -0.6, atol=0.01)


def test_reset_and_resume(stepper: crowd.Stepper) -> None:
    stepper.reset()
    stepper.step(velocity={"people": [[0.4, 0.9]] * 3}, frames=30)
    middle = stepper.state
    expected = stepper.step(frames=30)["people"]["ball"]
    stepper.reset(middle)
    assert stepper.frame == 30
    np.testing.assert_array_equal(stepper.step(frames=30)["people"]["ball"], expected)
    again = crowd.stepper(stepper.scene, middle)
    np.testing.assert_array_equal(again.step(frames=30)["people"]["ball"], expected)
    stepper.reset()
    assert stepper.time == 0.0
    np.testing.assert_array_equal(stepper.position["people"][:, [0, 2]], np.float32(stepper.scene.herds[0].points))


@pytest.mark.parametrize(
    ("call", "says"),
    [
        ({"velocity": {"peple": np.zeros((3, 2))}}, "no such herd (did you mean 'people'?); herds: people, dogs"),
        ({"velocity": {"people": np.zeros((2, 2))}}, "shape (2, 2): must be (3, 2) or (3, 3) for 3 characters"),
        ({"facing": {"dogs": np.zeros((2, 1))}}, "facing['dogs']: shape (2, 1): must be (2,)"),
        ({"velocity": {"people": [["a", "b"]] * 3}}, "must be an array of numbers"),
        ({"velocity": {"people": np.full((3, 2), np.inf)}}, "must be finite"),
        ({"velocity": {"people": np.full((3, 2), 99.0)}}, "at most 15 m/s"),
        ({"frames": 0}, "frames: 0: must be a whole number from 1"),
    ],
)
def test_bad_calls_are_told_and_change_nothing(stepper: crowd.Stepper, call: dict[str, Any], says: str) -> None:
    before = stepper.frame
    with pytest.raises(InputError) as caught:
        stepper.step(**call)
    assert says in str(caught.value)
    assert stepper.frame == before


def test_state_of_another_scene_is_refused(stepper: crowd.Stepper) -> None:
    with pytest.raises(InputError, match="of 1 herds; the scene has 2"):
        stepper.reset(stepper.state[:1])
    with pytest.raises(InputError, match="herd 'people' is of another scene"):
        stepper.reset(stepper.state[::-1])
