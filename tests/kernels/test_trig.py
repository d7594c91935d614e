"""Sine, cosine and arc tangent against the library's in double precision."""

from __future__ import annotations

import numpy as np

from kernels import trig
from tests.kernels.checks import assert_gradient_finite, assert_gradients_agree, in_double, in_single


def angles() -> np.ndarray:
    small = np.geomspace(1e-20, 1.0, 300)
    return np.concatenate([np.linspace(-50, 50, 20001), np.arange(-40, 41) * np.pi / 4, small, -small])


def test_sin_cos() -> None:
    for angle, tolerance in ((angles(), 1.5e-7), (np.linspace(-6000, 6000, 10007), 3e-7)):
        angle = angle.astype(np.float32)
        exact = np.sin(angle.astype(float)), np.cos(angle.astype(float))
        for found, wanted in zip(in_single(trig.sin_cos, angle), exact, strict=True):
            np.testing.assert_allclose(found, wanted, atol=tolerance)
        for one, wanted in ((trig.sin, exact[0]), (trig.cos, exact[1])):
            np.testing.assert_allclose(in_single(one, angle), wanted, atol=tolerance)
            np.testing.assert_allclose(in_double(one, angle), wanted, atol=1e-15)


def test_sin_cos_slopes() -> None:
    for function in (trig.sin, trig.cos):
        assert_gradients_agree(function, np.linspace(-7, 7, 23))
        assert_gradient_finite(function, np.array([0.0, 1e6, -1e9, 1e30], np.float32))


def test_sin_cos_of_what_is_no_angle() -> None:
    """Finite for anything finite, and not a number for anything else, as the library's."""
    huge = in_single(trig.sin, np.array([1e9, -1e30, np.inf, np.nan], np.float32))
    np.testing.assert_array_equal(np.isfinite(huge), [True, True, False, False])


def test_arctan2() -> None:
    angle = angles()
    for size in (1e-15, 1e-3, 1.0, 1e12):
        y, x = (size * v for v in (np.sin(angle), np.cos(angle)))
        y, x = y.astype(np.float32), x.astype(np.float32)
        exact = np.arctan2(y.astype(float), x.astype(float))
        found = in_single(trig.arctan2, y, x)
        error = (found - exact + np.pi) % (2 * np.pi) - np.pi
        np.testing.assert_allclose(error, 0.0, atol=4e-7)
        np.testing.assert_allclose(in_double(trig.arctan2, y, x), exact, atol=1e-15)


def test_arctan2_on_the_axes() -> None:
    y = np.array([0.0, 0.0, 0.0, 1.0, -1.0, 1.0, -1.0])
    x = np.array([0.0, 1.0, -1.0, 0.0, 0.0, 1.0, -1.0])
    np.testing.assert_allclose(in_single(trig.arctan2, y, x), np.arctan2(y, x), atol=3e-7)


def test_arctan2_slopes() -> None:
    angle = np.linspace(-3, 3, 17)
    assert_gradients_agree(trig.arctan2, np.sin(angle), np.cos(angle))
    assert_gradient_finite(trig.arctan2, np.array([0.0, 1e-30, 1e-3]), np.array([0.0, 0.0, -1e-30]))
