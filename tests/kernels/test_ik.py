"""Two-bone inverse kinematics against trigonometry, and at every degenerate place."""

from __future__ import annotations

import numpy as np
import pytest

from kernels import ik
from tests.kernels.checks import (
    BATCHES,
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    assert_matches,
    in_double,
    in_single,
    unit_vectors,
)


def legs(batch: tuple[int, ...], seed: int = 0) -> tuple[np.ndarray, ...]:
    """hip, target (within reach), pole, upper, lower."""
    rng = np.random.default_rng(seed)
    upper, lower = rng.uniform(0.3, 0.5, (2, *batch))
    hip = rng.normal(size=(3, *batch))
    share = rng.uniform(0.1, 0.9, batch)
    low, high = np.abs(upper - lower), upper + lower
    target = hip + unit_vectors(rng, 3, *batch) * (low + share * (high - low))
    return hip, target, unit_vectors(rng, 3, *batch), upper, lower


def by_angles(hip, target, pole, upper, lower) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The knee by turning the direction to the target through the hip's angle, towards the pole (Rodrigues)."""
    along = target - hip
    distance = np.linalg.norm(along, axis=0)
    x = along / distance
    angle = np.arccos((upper**2 + distance**2 - lower**2) / (2 * upper * distance))
    axis = np.cross(x, pole, axis=0)
    axis = axis / np.linalg.norm(axis, axis=0)
    knee = hip + upper * (x * np.cos(angle) + np.cross(axis, x, axis=0) * np.sin(angle))
    return knee, target, np.zeros_like(distance)


@pytest.mark.parametrize("batch", [*BATCHES, (200,)])
def test_within_reach(batch: tuple[int, ...]) -> None:
    leg = legs(batch)
    assert_matches(ik.two_bone, by_angles(*leg), *leg, double=1e-6, single=2e-4)


def test_gradients() -> None:
    assert_gradients_agree(ik.two_bone, *legs((3, 2)))


def test_one_length_for_all() -> None:
    hip, target, pole, _, _ = legs((4,))
    shared = np.full(1, 0.5)
    wide = np.full(4, 0.5)
    narrow = in_double(ik.two_bone, hip, target, pole, shared, shared)
    assert_close(narrow, in_double(ik.two_bone, hip, target, pole, wide, wide), 0)


DEGENERATE = {
    # target and pole relative to the hip; upper, lower; expected reach
    "too far": ((0.0, -3.0, 0.0), (0.0, 0.0, 1.0), 0.5, 0.4, 0.9 * (1 - ik.MARGIN)),
    "full stretch": ((0.0, -0.9, 0.0), (0.0, 0.0, 1.0), 0.5, 0.4, 0.9 * (1 - ik.MARGIN)),
    "too near": ((0.0, -0.05, 0.0), (0.0, 0.0, 1.0), 0.5, 0.4, 0.1 + 0.9 * ik.MARGIN),
    "fully folded": ((0.0, -0.1, 0.0), (0.0, 0.0, 1.0), 0.5, 0.4, 0.1 + 0.9 * ik.MARGIN),
    "pole along the leg": ((0.0, -0.7, 0.0), (0.0, -1.0, 0.0), 0.5, 0.4, 0.7),
    "pole against the leg": ((0.0, -0.7, 0.0), (0.0, 1.0, 0.0), 0.5, 0.4, 0.7),
    "no pole": ((0.0, -0.7, 0.0), (0.0, 0.0, 0.0), 0.5, 0.4, 0.7),
    "target at the hip": ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5, 0.4, 0.0),
    "at the hip, equal bones": ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.4, 0.4, 0.0),
}


@pytest.mark.parametrize("case", DEGENERATE)
def test_degenerate(case: str) -> None:
    target, pole, upper, lower, reach = DEGENERATE[case]
    hip = np.array([0.2, 1.0, -0.3])
    target = np.array(target)
    at = hip, hip + target, np.array(pole), np.array(upper), np.array(lower)
    _, reached, over = in_single(ik.two_bone, *at)
    distance = np.linalg.norm(target)
    assert_close(np.linalg.norm(reached - hip), reach, 1e-5)
    if distance > 0:
        assert_close(reached, hip + target / distance * reach, 1e-5)
        assert_close(over, abs(distance - reach), 1e-5)
    else:
        assert over > 0
    assert_gradient_finite(ik.two_bone, *at)


def test_bone_lengths_are_kept_out_of_reach() -> None:
    hip, target, pole, upper, lower = legs((100,), seed=3)
    stretch = np.random.default_rng(4).choice([0.05, 0.5, 1.0, 2.0, 10.0], 100)
    knee, reached, over = in_double(ik.two_bone, hip, hip + (target - hip) * stretch, pole, upper, lower)
    assert_close(np.linalg.norm(knee - hip, axis=0), upper, 1e-6)
    assert_close(np.linalg.norm(reached - knee, axis=0), lower, 1e-6)
    asked = np.linalg.norm(target - hip, axis=0) * stretch
    assert_close(over, np.abs(asked - np.linalg.norm(reached - hip, axis=0)), 1e-6)
    assert (over > 0.1).any()
    assert (over < 1e-9).any()


def test_knee_lies_on_the_side_of_the_pole() -> None:
    hip, target, pole, upper, lower = legs((100,), seed=5)
    knee, reached, _ = in_double(ik.two_bone, hip, target, pole, upper, lower)
    x = (reached - hip) / np.linalg.norm(reached - hip, axis=0)
    off = (knee - hip) - x * ((knee - hip) * x).sum(0)
    assert ((off * pole).sum(0) > 0).all()
    normal = np.cross(x, pole, axis=0)
    assert np.abs((normal * (knee - hip)).sum(0)).max() < 1e-6


def test_hardly_out_of_reach_is_continuous() -> None:
    """Sweeping the target through full stretch moves the knee without a jump."""
    distance = np.linspace(0.85, 0.95, 401)
    ones = np.ones_like(distance)
    hip, target = np.zeros((3, 401)), np.stack([0 * ones, -distance, 0 * ones])
    pole = np.stack([0 * ones, 0 * ones, ones])
    knee, reached, _ = in_double(ik.two_bone, hip, target, pole, 0.5 * ones, 0.4 * ones)
    assert np.abs(np.diff(knee)).max() < 2e-2
    assert np.abs(np.diff(reached)).max() < 5e-4
