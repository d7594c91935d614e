"""Vectors against NumPy, and at zero."""

from __future__ import annotations

import numpy as np
import pytest

from kernels import vec
from tests.kernels.checks import (
    BATCHES,
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    assert_matches,
    in_double,
    in_single,
)

PRODUCTS = {
    "dot": (vec.dot, lambda a, b: (a * b).sum(0)),
    "cross": (vec.cross, lambda a, b: np.cross(a, b, axis=0)),
}
LENGTHS = {
    "norm": (vec.norm, lambda a: np.linalg.norm(a, axis=0)),
    "unit": (vec.unit, lambda a: a / np.linalg.norm(a, axis=0)),
}


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("name", PRODUCTS)
def test_product(name: str, batch: tuple[int, ...]) -> None:
    kernel, reference = PRODUCTS[name]
    a, b = np.random.default_rng(1).normal(size=(2, 3, *batch))
    assert_matches(kernel, reference(a, b), a, b)
    if batch == BATCHES[-1]:
        assert_gradients_agree(kernel, a, b)


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("name", LENGTHS)
def test_length(name: str, batch: tuple[int, ...]) -> None:
    kernel, reference = LENGTHS[name]
    a = np.random.default_rng(2).normal(size=(3, *batch))
    assert_matches(kernel, reference(a), a)
    if batch == BATCHES[-1]:
        assert_gradients_agree(kernel, a)


def test_products_broadcast() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(3, 4, 1)), rng.normal(size=(3, 1, 5))
    assert_matches(vec.dot, np.einsum("kab,kbc->ac", a, b), a, b)
    assert_matches(vec.cross, np.cross(np.broadcast_to(a, (3, 4, 5)), b, axis=0), a, b)


def test_zero_vector() -> None:
    zero = np.zeros((3, 2))
    assert_close(in_single(vec.norm, zero), np.full(2, 1e-6), 1e-12)
    assert_close(in_single(vec.unit, zero), zero, 0)
    assert_gradient_finite(vec.norm, zero)
    assert_gradient_finite(vec.unit, zero)


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("row", [0, 2])
def test_rows_by_number(row: int, batch: tuple[int, ...]) -> None:
    rng = np.random.default_rng(4)
    v, value = rng.normal(size=(3, *batch)), rng.normal(size=batch)
    replaced, unit = v.copy(), np.zeros_like(v)
    replaced[row], unit[row] = value, 1.0
    assert_matches(lambda v, value: vec.with_row(v, row, value), replaced, v, value)
    assert_matches(lambda v: vec.axis(v, row), unit, v)
    if batch == BATCHES[-1]:
        assert_gradients_agree(lambda v, value: vec.with_row(v, row, value), v, value)


def test_not_a_number_stays_in_its_row() -> None:
    v, value = np.ones((3, 2)), np.array([np.nan, 2.0])
    assert np.isnan(in_single(lambda v, value: vec.with_row(v, 1, value), v, value)).sum() == 1
    assert in_single(lambda v: vec.axis(v, 1), v * np.nan).tolist() == [[0, 0], [1, 1], [0, 0]]


def test_smoothstep() -> None:
    inside = np.linspace(0.01, 0.99, 12)
    assert_matches(vec.smoothstep, inside**2 * (3 - 2 * inside), inside)
    assert_gradients_agree(vec.smoothstep, inside)
    outside = in_double(vec.smoothstep, np.array([-3.0, 0.0, 0.5, 1.0, 7.0]))
    assert outside.tolist() == [0.0, 0.0, 0.5, 1.0, 1.0]
    assert_gradient_finite(vec.smoothstep, np.array([-1.0, 0.0, 1.0, 2.0]))
