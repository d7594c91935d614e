"""Quaternions against the host's (NumPy) and against rotation matrices."""

from __future__ import annotations

import numpy as np
import pytest

from crowd import posing
from kernels import quat
from tests.kernels.checks import (
    BATCHES,
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    assert_matches,
    first,
    in_double,
    in_single,
    last,
    unit_vectors,
)


@pytest.mark.parametrize("batch", BATCHES)
def test_multiply_and_rotate(batch: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    a, b = unit_vectors(rng, 4, *batch), unit_vectors(rng, 4, *batch)
    v = rng.normal(size=(3, *batch))
    assert_matches(quat.multiply, first(posing.multiply(last(a), last(b))), a, b)
    assert_matches(quat.rotate, first(posing.rotate(last(a), last(v))), a, v)
    assert_matches(quat.conjugate, first(posing.conjugate(last(a))), a)
    if batch == BATCHES[-1]:
        assert_gradients_agree(quat.multiply, a, b)
        assert_gradients_agree(quat.rotate, a, v)


def test_matrix_columns_are_the_turned_axes() -> None:
    batch = (3, 2)
    q = unit_vectors(np.random.default_rng(2), 4, *batch)
    columns = np.moveaxis(posing.matrix(last(q)), (-1, -2), (0, 1))
    assert_matches(quat.matrix, columns, q)
    axes = np.eye(3).reshape(3, 3, *(1,) * len(batch))
    turned = [in_double(quat.rotate, q, np.broadcast_to(axis, (3, *batch))) for axis in axes]
    assert_close(in_double(quat.matrix, q), np.stack(turned), 1e-12)
    assert_gradients_agree(quat.matrix, q)


def test_broadcast_over_joints() -> None:
    rng = np.random.default_rng(3)
    q, v = unit_vectors(rng, 4, 1, 5), rng.normal(size=(3, 7, 5))
    expected = first(posing.rotate(last(np.broadcast_to(q, (4, 7, 5))), last(v)))
    assert_matches(quat.rotate, expected, q, v)


def test_normalize() -> None:
    batch = (3, 2)
    q = 3.0 * np.random.default_rng(4).normal(size=(4, *batch))
    assert_matches(quat.normalize, q / np.linalg.norm(q, axis=0), q)
    assert_gradients_agree(quat.normalize, q)
    assert_gradient_finite(quat.normalize, np.zeros((4, *batch)))


@pytest.mark.parametrize(
    ("kernel", "axis", "before", "after"),
    [(quat.about_y, 1, (0, 0, 1), (1, 0, 0)), (quat.about_x, 0, (0, 1, 0), (0, 0, 1))],
    ids=["yaw turns +z to +x", "pitch turns +y to +z"],
)
def test_about_axis(kernel, axis: int, before: tuple, after: tuple) -> None:
    quarter = in_double(kernel, np.array(np.pi / 2))
    assert_close(in_double(quat.rotate, quarter, np.array(before, float)), np.array(after, float), 1e-12)
    angle = np.linspace(-7, 7, 9)
    expected = np.zeros((4, 9))
    expected[0], expected[1 + axis] = np.cos(angle / 2), np.sin(angle / 2)
    assert_matches(kernel, expected, angle)
    assert_gradients_agree(kernel, angle)


@pytest.mark.parametrize("batch", [(), (400,)])
def test_between_is_the_smallest_rotation(batch: tuple[int, ...]) -> None:
    rng = np.random.default_rng(5)
    a, b = unit_vectors(rng, 3, *batch), unit_vectors(rng, 3, *batch)
    q = in_double(quat.between, a, b)
    assert_close(np.linalg.norm(q, axis=0), np.ones(batch), 1e-9)
    assert_close(in_double(quat.rotate, q, a), b, 1e-3 if batch == (400,) else 1e-6)
    cosine = (a * b).sum(0)
    assert_close(2 * q[0] ** 2 - 1, cosine, 1e-6)
    assert np.abs((q[1:] * a).sum(0)).max() < 1e-9  # the axis is normal to both
    assert_close(in_single(quat.between, a, b)[0], q[0], 1e-4)
    if batch:
        assert_gradients_agree(quat.between, a[:, :6], b[:, :6])


def test_between_equal_vectors() -> None:
    a = unit_vectors(np.random.default_rng(6), 3, 50)
    expected = np.repeat([[1.0], [0], [0], [0]], 50, 1)
    assert_matches(quat.between, expected, a, a, single=1e-6)
    assert_gradient_finite(quat.between, a, a)


def test_between_opposite_vectors_is_a_rotation() -> None:
    """Unit and finite however near to opposite; exactly opposite: the identity."""
    off = np.array([0.0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2])
    a = np.concatenate([np.eye(3), unit_vectors(np.random.default_rng(7), 3, 50)], 1)[:, :, None]
    side = np.cross(a, np.array([0.3, -0.5, 0.8])[:, None, None], axis=0)
    b = -a * np.cos(off) + side / np.linalg.norm(side, axis=0) * np.sin(off)
    a = np.broadcast_to(a, b.shape)
    for run in (in_single, in_double):
        q = run(quat.between, a, b)
        assert_close(np.linalg.norm(q, axis=0), np.ones(q.shape[1:]), 1e-5)
        identity = np.array([[1.0], [0], [0], [0]]).repeat(3, 1)
        assert_close(q[:, :3, 0], identity, 1e-6)
    assert_gradient_finite(quat.between, a, b)


def test_upright_yaws_and_then_tilts() -> None:
    rng = np.random.default_rng(8)
    up, yaw = unit_vectors(rng, 3, 300), rng.uniform(-7, 7, 300)
    up = np.concatenate([up, np.array([[0.0, 0], [1, -1], [0, 0]])], 1)
    yaw = np.append(yaw, [0.4, -2.0])
    vertical = np.zeros_like(up)
    vertical[1] = 1.0
    tilt = in_double(quat.between, vertical, up)
    expected = in_double(quat.multiply, tilt, in_double(quat.about_y, yaw))
    near = up[1] > -0.99
    assert_close(in_double(quat.upright, up, yaw), expected, 1e-12)
    assert_close(in_single(quat.upright, up, yaw)[:, near], expected[:, near], 2e-5)
    assert_gradients_agree(quat.upright, up[:, near][:, :8], yaw[near][:8])
    assert_gradient_finite(quat.upright, up, yaw)
