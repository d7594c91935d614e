"""Coefficients against scipy's logistic function."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import expit

from kernels import fluid
from tests.kernels.checks import BATCHES, assert_gradient_finite, assert_gradients_agree, assert_matches, in_single


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("slope", [0.004, -0.004], ids=["rising", "falling"])
def test_sigmoid(slope: float, batch: tuple[int, ...]) -> None:
    density = np.random.default_rng(0).uniform(900, 2800, batch)
    constants = (np.array(3.0), np.array(slope), np.array(1700.0))
    assert_matches(fluid.sigmoid, 3.0 * expit(slope * (density - 1700.0)), density, *constants)
    if batch == BATCHES[-1]:
        assert_gradients_agree(fluid.sigmoid, density, *constants)


@pytest.mark.parametrize("slope", [5.0, -5.0])
def test_does_not_overflow(slope: float) -> None:
    density = np.array([0.0, 1000.0, 1e9])
    at = density, np.array(2.0), np.array(slope), np.array(1000.0)
    expected = [0.0, 1.0, 2.0] if slope > 0 else [2.0, 1.0, 0.0]
    assert in_single(fluid.sigmoid, *at).tolist() == expected
    assert_gradient_finite(fluid.sigmoid, *at)
