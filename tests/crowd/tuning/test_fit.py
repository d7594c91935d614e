"""The search on problems with known answers: bounds, priors, starts that fail."""

from __future__ import annotations

import numpy as np
import pytest

from crowd.tuning import fit


def decay(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals of a exp(-b t) against a = 2, b = 3 at five times; a, b from 0 to 10."""
    t = np.linspace(0.0, 1.0, 5)
    a, b = 10.0 * places[:, :1], 10.0 * places[:, 1:]
    fall = np.exp(-b * t)
    slope = np.stack([10.0 * fall, -10.0 * a * t * fall], -1)
    return (a * fall - 2.0 * np.exp(-3.0 * t)) / 0.01, slope / 0.01


def searched(places: np.ndarray, evaluate: fit.Evaluate = decay, weight: float = 0.0, count: int = 40) -> fit.Search:
    search = fit.begin(places, np.full(places.shape[1], 0.5), weight, evaluate)
    for _ in range(count):
        fit.levenberg_marquardt(search, evaluate)
    return search


def test_a_search_ends_when_nearly_all_starts_have_arrived() -> None:
    search = fit.begin(fit.random_places(np.array([0.5, 0.5]), 20, 0.5, 0), np.full(2, 0.5), 0.0, decay)
    count = 0
    while fit.levenberg_marquardt(search, decay):
        count += 1
    assert 2 < count < 30
    assert (np.abs(search.residual) <= 1.0).all(1).mean() >= fit.ENOUGH


def test_every_start_finds_the_answer() -> None:
    places = fit.random_places(np.array([0.5, 0.5]), 20, 1.0, 0)
    search = searched(places)
    near = np.abs(search.place - [0.2, 0.3]).max(1) < 1e-4
    assert near.sum() >= 18
    assert (np.diff(np.array(search.history), axis=0) <= 1e-12).all()


def test_bounds_hold() -> None:
    """The answer outside: the start ends on the bound, the other parameter at its best there."""

    def shifted(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        residual = np.stack([places[:, 0] - 1.7, places[:, 0] + places[:, 1] - 1.4], 1)
        return residual, np.tile([[1.0, 0.0], [1.0, 1.0]], (len(places), 1, 1))

    search = searched(np.array([[0.2, 0.9], [0.9, 0.1]]), shifted)
    np.testing.assert_allclose(search.place, [[1.0, 0.4]] * 2, atol=1e-4)


def test_the_prior_decides_what_targets_do_not() -> None:
    def total(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 100.0 * (places.sum(1, keepdims=True) - 0.6), np.full((len(places), 1, 2), 100.0)

    search = searched(np.array([[0.0, 0.9]]), total, weight=0.1)
    np.testing.assert_allclose(search.place, [[0.3, 0.3]], atol=1e-3)


def test_a_start_that_fails_harms_no_other() -> None:
    def holed(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        residual, slope = decay(places)
        bad = places[:, :1] > 0.9
        return np.where(bad, np.nan, residual), np.where(bad[..., None], np.nan, slope)

    search = searched(np.array([[0.95, 0.5], [0.5, 0.5]]), holed)
    assert search.best == 1
    np.testing.assert_allclose(search.place[1], [0.2, 0.3], atol=1e-4)
    np.testing.assert_array_equal(search.place[0], [0.95, 0.5])


def test_adam_comes_down_and_keeps_its_best() -> None:
    search = fit.begin(np.array([[0.5, 0.5]]), np.array([0.5, 0.5]), 0.0, decay)
    for _ in range(200):
        fit.adam(search, decay, 0.02)
    assert search.cost[0] < 1e-2 * search.history[0][0]
    np.testing.assert_allclose(search.place, [[0.2, 0.3]], atol=0.02)


@pytest.mark.parametrize("spread", [0.0, 0.3, 1.0])
def test_random_places(spread: float) -> None:
    start = np.array([0.1, 0.8])
    places = fit.random_places(start, 50, spread, 3)
    np.testing.assert_array_equal(places[0], start)
    assert (places >= start * (1 - spread) - 1e-12).all()
    assert (places <= start + (1 - start) * spread + 1e-12).all()
    np.testing.assert_array_equal(places, fit.random_places(start, 50, spread, 3))
