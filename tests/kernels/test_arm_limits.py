"""Limits of arms: play against a loop in Python, spans against bent arms, and random hands that end where they may."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from kernels import arm_limits
from tests.kernels.checks import assert_gradient_finite, assert_gradients_agree, assert_matches_in_batches, in_double

RNG = np.random.default_rng(8)
NEAREST, LONGEST, TAN_BACK = 0.17, 0.53, np.tan(np.radians(20.0))


def test_play_follows_late() -> None:
    """Up with the reading, down with the reading of a band more; still while it wavers by less than the band."""
    depth = np.concatenate([np.linspace(0, 1, 50), 0.7 + 0.09 * np.sin(np.arange(100)), np.linspace(0.7, 0, 50)])
    value, expected = 0.0, []
    for reading in depth:
        if value < reading:
            value = reading
        elif value > reading + 0.2:
            value = reading + 0.2
        expected.append(value)

    def frame(value: jax.Array, reading: jax.Array) -> tuple[jax.Array, jax.Array]:
        value = arm_limits.play(value, reading, reading + 0.2)
        return value, value

    found = np.asarray(jax.lax.scan(frame, jnp.float32(0), jnp.asarray(depth, jnp.float32))[1])
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert np.ptp(found[70:150]) == 0.0


def test_span_of_a_bent_arm() -> None:
    upper, lower, angle = RNG.uniform(0.2, 0.4, 6), RNG.uniform(0.2, 0.4, 6), np.radians([30, 60, 90, 120, 150, 180.0])
    hand = np.stack([lower * np.sin(angle), upper - lower * np.cos(angle)])
    assert_matches_in_batches(arm_limits.span, np.hypot(*hand), upper, lower, np.cos(angle), double=1e-6)


def limited(hand: np.ndarray) -> np.ndarray:
    full = np.ones(hand.shape[1])
    return in_double(arm_limits.limited, hand, NEAREST * full, LONGEST * full, TAN_BACK * full)


def test_hands_end_where_joints_let_them() -> None:
    hand = RNG.normal(size=(3, 2000)) * 0.5
    hand[:, 0] = 0.0
    out, up, ahead = found = limited(hand)
    distance = np.linalg.norm(found, axis=0)
    assert out.min() >= 0.0
    assert (ahead >= -TAN_BACK * np.hypot(out, up) - 1e-6).all()
    assert distance.min() >= NEAREST - 1e-6 and distance.max() <= LONGEST
    np.testing.assert_allclose(found[:, 0], [distance[0], 0, 0], atol=1e-9)


def test_allowed_hands_keep_their_direction_and_nearly_their_place() -> None:
    direction = np.abs(RNG.normal(size=(3, 200)))
    direction /= np.linalg.norm(direction, axis=0)
    size = RNG.uniform(0.25, 0.45, 200)
    found = limited(direction * size)
    np.testing.assert_allclose(found / np.linalg.norm(found, axis=0), direction, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(found, axis=0), size, atol=0.005)


def test_limits_set_in_without_a_jump() -> None:
    """Half a millimetre further asked for is no more than that further given, through every limit."""
    way = np.linspace(-1.0, 1.0, 4001)
    for line in (np.stack([way, 0 * way + 0.2, 0 * way]), np.stack([0 * way + 0.2, 0 * way, way])):
        step = np.linalg.norm(np.diff(limited(line), axis=1), axis=0)
        assert step.max() < 1.1 * 5e-4


def test_gradients() -> None:
    hand = np.abs(RNG.normal(size=(3, 6))) * 0.3 + 0.05
    full = np.ones(6)
    assert_gradients_agree(arm_limits.limited, hand, NEAREST * full, LONGEST * full, TAN_BACK * full)
    corner = np.array([[0.0, 0.0, -0.5, 0.0], [0.0, 0.3, 0.0, 2.0], [0.0, -0.5, -0.5, 0.0]])
    full = np.ones(4)
    assert_gradient_finite(arm_limits.limited, corner, NEAREST * full, LONGEST * full, TAN_BACK * full)
    assert_gradient_finite(arm_limits.span, full, full, full)
    assert_gradient_finite(arm_limits.play, full, full, full)
