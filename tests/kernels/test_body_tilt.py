"""Up axes of body and legs against the specification's text (4.9)."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from kernels import body_tilt
from kernels.body_tilt import Tilt
from tests.kernels.checks import (
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    assert_matches,
    assert_matches_in_batches,
    in_double,
    in_single,
)

UP, LEFT, AHEAD = np.eye(3)[[1, 0, 2]]
TILTS = {
    "person": (0.0, 0.0, 0.2, 3.0, 0.02, 1.0),
    "quadruped": (0.0, 1.0, 0.0, 3.0, 0.0, 1.0),
    "spider": (1.0, 1.0, 0.6, 0.0, 0.0, 0.0),
    "all": (0.3, 0.6, 0.4, 2.0, 0.05, 1.5),
}


def tilt(name: str, like: Any) -> Tilt:
    return Tilt(*(jnp.asarray(value, like.dtype) for value in TILTS[name]))


def hat(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v)


def proj(v: np.ndarray, n: np.ndarray) -> np.ndarray:
    return n * (v @ n) / (n @ n)


def ground_up_by_text(footing: np.ndarray, before: np.ndarray, bias: float = 0.1) -> np.ndarray:
    u = bias * UP
    for e in (footing - footing.mean(1, keepdims=True)).T:
        u = u + before * (e @ e) - e * (e @ before)
    return u / u[1] if u[1] > 0 else before


def up_axes_by_text(
    name: str, ground: np.ndarray, lean: np.ndarray, travel: np.ndarray, speed: float
) -> tuple[np.ndarray, np.ndarray]:
    hug_x, hug_z, climb, climb_s, _, accelerate_s = TILTS[name]
    if hug_x >= 1 and hug_z >= 1:
        base = hat(ground)
    else:
        base = hat(UP + hug_x * proj(ground, LEFT) + hug_z * proj(ground, AHEAD))
    b = UP * (travel @ travel) - travel * (travel @ UP)
    velocity_up = b / (b @ UP) if b @ UP > 1e-8 else UP
    leaning = (lean[0] * LEFT + lean[1] * AHEAD) * (1 - 1 / (speed * accelerate_s + 1))
    slope = proj(velocity_up, LEFT) * (1 - hug_x) + proj(velocity_up, AHEAD) * (1 - hug_z)
    climbing = -climb * slope * (1 - 1 / (speed * climb_s + 1))
    return hat(base + leaning + climbing), hat(UP + leaning)


def test_ground_up() -> None:
    rng = np.random.default_rng(0)
    for count in (6, 300):
        footing = rng.normal(size=(3, 4, count)) * np.array([0.3, 0.15, 0.5])[:, None, None]
        before = np.stack([0.2 * rng.normal(size=count), np.ones(count), 0.2 * rng.normal(size=count)])
        expected = np.stack([ground_up_by_text(footing[..., i], before[:, i]) for i in range(count)], -1)
        check = assert_matches_in_batches if count == 6 else assert_matches
        check(body_tilt.ground_up, expected, footing, before, single=1e-5)
    assert_gradients_agree(body_tilt.ground_up, footing[..., :4], before[:, :4])
    for height in (0.0, 3.0):  # all feet at one place, feet one over the other
        places = np.zeros((3, 4, 2)) + np.array([0.0, height, 0.0])[:, None, None] * np.arange(4)[:, None]
        assert_gradient_finite(body_tilt.ground_up, places, before[:, :2])


def test_ground_up_settles_on_the_plane_of_the_feet() -> None:
    """However often it starts from the vertical: the axis becomes the normal of the plane (hexapods lie along it)."""
    x, z = np.array([0.4, -0.4, 0.4, -0.4]), np.array([0.5, 0.5, -0.5, -0.5])
    footing = np.stack([x, 0.3 * x - 0.2 * z, z])[..., None]
    up = UP[:, None]
    for _ in range(60):
        up = in_double(body_tilt.ground_up, footing, up)
    # a tenth of the vertical is always mixed in
    np.testing.assert_allclose(up[:, 0], [-0.3, 1.0, 0.2], atol=0.04)


@pytest.mark.parametrize("size", [0.1, 1.0, 3.0])
def test_characters_of_any_size_tilt_alike(size: float) -> None:
    """The bias goes with the square of the size: a spider's axis follows the ground as a horse's does."""
    rng = np.random.default_rng(3)
    footing, before = rng.normal(size=(3, 4, 6)), np.concatenate([0.2 * rng.normal(size=(1, 6)), np.ones((2, 6))])
    expected = np.stack([ground_up_by_text(footing[..., i], before[:, i], 0.05) for i in range(6)], -1)
    bias = np.full(6, 0.05 * size**2)
    assert_matches_in_batches(body_tilt.ground_up, expected, footing * size, before, bias, single=1e-5)


@pytest.mark.parametrize("name", TILTS)
def test_hugged(name: str) -> None:
    """A body along the ground is cos of the slope shorter from above, on each axis as much as it hugs; heights stay."""
    hug_x, hug_z = TILTS[name][:2]
    slopes = np.radians(np.array([[-25.0, -10, 0, 10, 25, 40], [30.0, 0, 0, -20, 25, 5]]))
    ground = np.stack([np.tan(slopes[0]), np.ones(6), np.tan(slopes[1])])
    stance = np.random.default_rng(4).normal(size=(3, 4, 6))
    shares = [np.cos(np.arctan(hug * np.tan(a))) for hug, a in zip((hug_x, hug_z), slopes, strict=True)]
    expected = stance * np.stack([shares[0], np.ones(6), shares[1]])[:, None]

    def kernel(ground: Any, stance: Any) -> Any:
        return body_tilt.hugged(tilt(name, ground), ground, stance)

    assert_matches_in_batches(kernel, expected, ground, stance)
    assert_gradients_agree(kernel, ground, stance)
    assert_gradient_finite(kernel, 0 * ground, 0 * stance)


@pytest.mark.parametrize("name", TILTS)
def test_up_axes(name: str) -> None:
    rng = np.random.default_rng(1)
    count = 200
    ground = np.stack([0.3 * rng.normal(size=count), np.ones(count), 0.3 * rng.normal(size=count)])
    lean, travel, speed = 0.1 * rng.normal(size=(2, count)), rng.normal(size=(3, count)), rng.uniform(0, 4, count)
    travel[:, ::9], travel[[0, 2], 1::9], speed[::7] = 0.0, 0.0, 0.0
    rows = [up_axes_by_text(name, ground[:, i], lean[:, i], travel[:, i], speed[i]) for i in range(count)]
    expected = tuple(np.stack(column, -1) for column in zip(*rows, strict=True))

    def kernel(ground: Any, *rest: Any) -> Any:
        return body_tilt.up_axes(tilt(name, ground), ground, *rest)

    assert_matches(kernel, expected, ground, lean, travel, speed)
    if name == "all":
        few = [ground[..., 2:8], lean[..., 2:8], travel[..., 2:8], speed[2:8]]
        assert_matches_in_batches(kernel, tuple(e[..., 2:8] for e in expected), *few)
        assert_gradients_agree(kernel, *few)
        assert_gradient_finite(kernel, ground, lean, travel, speed)


def test_a_person_on_level_ground_stands_upright() -> None:
    still = [np.array(v, float) for v in (UP, (0, 0), (0.0, 0.0, 1.2), 1.3)]
    for axis in in_single(lambda g, *rest: body_tilt.up_axes(tilt("person", g), g, *rest), *still):
        np.testing.assert_array_equal(axis, UP)


def test_a_person_leans_into_a_climb_and_back_going_down() -> None:
    def ahead(rise: float) -> float:
        now = [np.array(v, float) for v in (UP, (0, 0), (0.0, rise, 1.0), 1.0)]
        return float(in_double(lambda g, *rest: body_tilt.up_axes(tilt("person", g), g, *rest), *now)[0][2])

    assert ahead(0.5) > 0.05
    np.testing.assert_allclose(ahead(-0.5), -ahead(0.5), atol=1e-12)
    # 0.2 of the slope times 1 - 1 / (3 v + 1)
    np.testing.assert_allclose(ahead(0.5), np.sin(np.arctan(0.2 * 0.5 * 0.75)), atol=1e-9)


def test_lean() -> None:
    """Low-passed with 10 per second, never past what it follows."""
    rng = np.random.default_rng(2)
    current, acceleration = rng.normal(size=(2, 6)), 5 * rng.normal(size=(2, 6))
    hugs = np.array([[1 - 0.3], [1 - 0.6]])
    for dt in (1 / 240, 1 / 60, 0.5):

        def kernel(current: Any, acceleration: Any, dt: float = dt) -> Any:
            return body_tilt.lean(tilt("all", current), current, acceleration, dt)

        goal = acceleration * 0.05 * 1.5 * hugs
        expected = current + (goal - current) * min(1.0, 10 * dt)
        assert_matches_in_batches(kernel, expected, current, acceleration)
    assert_close(in_double(kernel, current, acceleration), goal, 1e-12)
