"""The search: many starts at once, Levenberg-Marquardt on residuals or Adam on their squares, within bounds.

Everything is in places between the bounds (0 low, 1 high) and residuals in tolerances; a prior pulls weakly towards the
given start. On the host: the expensive part, quantities and their derivatives, is one call for all starts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Evaluate = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Places [s, p] to residuals [s, t] and their derivatives [s, t, p]."""

LEAST_DAMPING, MOST_DAMPING = 1e-8, 1e6
STEADY = 1e-2  # relative fall of the cost below which a try brought nothing
ARRIVED = 0.25  # tolerances: a start whose every residual is smaller is done
CALM = 0.05  # relative fall of the cost below which a start within every tolerance is done
ENOUGH = 0.9  # of the starts: the search ends when so many are done


@dataclass
class Search:
    """Where every start is; s starts, p parameters, t targets."""

    place: np.ndarray  # [s, p] best so far
    prior: np.ndarray  # [p] places that the prior pulls to
    weight: float
    residual: np.ndarray  # [s, t] at `place`
    slope: np.ndarray  # [s, t, p]
    cost: np.ndarray  # [s] half the sum of squares, with the prior
    damping: np.ndarray  # [s]
    still: np.ndarray  # [s] tries in a row that brought nothing
    history: list[np.ndarray] = field(default_factory=list)  # [s] cost after each iteration
    moments: Any = None  # Adam's

    @property
    def best(self) -> int:
        """The start with the lowest cost."""
        return int(np.argmin(np.where(np.isfinite(self.cost), self.cost, np.inf)))


def begin(place: np.ndarray, prior: np.ndarray, weight: float, evaluate: Evaluate) -> Search:
    """The search at its starts."""
    residual, slope = evaluate(place)
    cost = _cost(place, prior, weight, residual)
    count = len(place)
    return Search(
        place, prior, weight, residual, slope, cost, np.full(count, 1e-2), np.zeros(count, int), [cost.copy()]
    )


def levenberg_marquardt(search: Search, evaluate: Evaluate) -> bool:
    """One iteration of every start; whether some start still moves."""
    trial = np.clip(search.place + _steps(search), 0.0, 1.0)
    residual, slope = evaluate(trial)
    cost = _cost(trial, search.prior, search.weight, residual)
    better = cost < search.cost  # false for NaN
    falls = better & (cost > search.cost * (1.0 - STEADY))
    search.still = np.where(better & ~falls, 0, search.still + 1)
    for name, new in (("place", trial), ("residual", residual), ("slope", slope)):
        old = getattr(search, name)
        setattr(search, name, np.where(better.reshape(-1, *(1,) * (old.ndim - 1)), new, old))
    calm = ~better | (cost > search.cost * (1.0 - CALM))
    search.cost = np.where(better, cost, search.cost)
    factor = np.where(better, 1.0 / 3.0, 5.0)
    search.damping = np.clip(search.damping * factor, LEAST_DAMPING, MOST_DAMPING)
    search.history.append(search.cost.copy())
    size = np.abs(search.residual).max(1)
    done = (size <= ARRIVED) | (calm & (size <= 1.0))
    return bool(done.mean() < ENOUGH and ((search.still < 3) & ~done).any())


def _steps(search: Search) -> np.ndarray:
    """[s, p] damped Gauss-Newton steps; parameters that press against a bound stay out of it."""
    count, parameters = search.place.shape
    square = search.weight**2
    steps = np.zeros((count, parameters))
    for s in range(count):
        slope, residual = search.slope[s], search.residual[s]
        if not (np.isfinite(slope).all() and np.isfinite(residual).all()):
            continue
        gradient = slope.T @ residual + square * (search.place[s] - search.prior)
        pressed = ((search.place[s] <= 0) & (gradient > 0)) | ((search.place[s] >= 1) & (gradient < 0))
        free = ~pressed
        if not free.any():
            continue
        part = slope[:, free]
        normal = part.T @ part + square * np.eye(free.sum())
        normal += search.damping[s] * np.diag(np.maximum(np.diag(normal), 1e-6 * normal.max() + 1e-12))
        steps[s, free] = np.linalg.solve(normal, -gradient[free])
    return np.clip(steps, -0.5, 0.5)


def adam(search: Search, evaluate: Evaluate, rate: float) -> bool:
    """One step of optax's Adam on half the sum of squares; the best place of every start is kept."""
    import jax.numpy as jnp
    import optax

    optimiser = optax.adam(rate)
    if search.moments is None:
        search.moments = (
            search.place.copy(),
            search.residual,
            search.slope,
            optimiser.init(jnp.zeros(search.place.shape)),
        )
    place, residual, slope, moments = search.moments
    gradient = np.einsum("st,stp->sp", residual, slope) + search.weight**2 * (place - search.prior)
    update, moments = optimiser.update(jnp.asarray(np.nan_to_num(gradient)), moments)
    place = np.clip(place + np.asarray(update, float), 0.0, 1.0)
    residual, slope = evaluate(place)
    cost = _cost(place, search.prior, search.weight, residual)
    better = cost < search.cost
    for name, new in (("place", place), ("residual", residual), ("slope", slope)):
        old = getattr(search, name)
        setattr(search, name, np.where(better.reshape(-1, *(1,) * (old.ndim - 1)), new, old))
    search.cost = np.where(better, cost, search.cost)
    search.moments = (place, residual, slope, moments)
    search.history.append(search.cost.copy())
    return True


def _cost(place: np.ndarray, prior: np.ndarray, weight: float, residual: np.ndarray) -> np.ndarray:
    return 0.5 * (residual**2).sum(1) + 0.5 * weight**2 * ((place - prior) ** 2).sum(1)


def random_places(start: np.ndarray, count: int, spread: float, seed: int) -> np.ndarray:
    """[count, p] the given start, then even draws from the part of the bounds that `spread` covers about it."""
    rng = np.random.default_rng(seed)
    drawn = rng.uniform(size=(count, len(start)))
    low, high = start * (1.0 - spread), start + (1.0 - start) * spread
    places = low + (high - low) * drawn
    places[0] = start
    return places
