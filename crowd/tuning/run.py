"""`crowd tune`: from a tune file to fitted constants, every start's way there, and what the data leave open."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from crowd.errors import InputError, Problem, fail
from crowd.tuning import fit
from crowd.tuning.config import Problemset, load
from crowd.tuning.evaluation import Evaluation
from crowd.tuning.fit import Search

INFLUENCE = 1e-4  # tolerances over the whole width of the bounds: a parameter that does less does nothing
DETERMINED = 1e-2  # singular values below this share of the largest, or of 1: that direction is left to the prior


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a search came to."""

    problem: Problemset
    evaluation: Evaluation
    search: Search
    values: np.ndarray  # [t] quantities at the best place, from the rollouts of the search
    verified: np.ndarray  # [t] the same from a plain run of the scenario
    seconds: float

    @property
    def numbers(self) -> dict[str, float]:
        """The fitted constants by name."""
        place = self.search.place[self.search.best]
        return {one.name: float(one.value(place[p])) for p, one in enumerate(self.evaluation.free)}

    @property
    def reached(self) -> np.ndarray:
        """[s] starts with every target within its tolerance."""
        return np.all(np.abs(self.search.residual) <= 1.0, axis=1)


def tune(
    source: str | Path | Mapping[str, Any],
    overrides: Sequence[str] = (),
    resume: Path | None = None,
    on_iteration: Callable[[Search, int, int], None] | None = None,
    on_ready: Callable[[Evaluation], None] | None = None,
) -> Outcome:
    """Search the constants of a tune file.

    resume: file of a search that was kept (`save`) to go on from. on_iteration: called with the search, the iteration
    and their number, after the first evaluation and every iteration. Raises `InputError` for what is wrong with the
    file, for targets that no parameter influences and for an objective that is not finite at any start.
    """
    began = time.monotonic()
    problem = load(source, overrides)
    evaluation = Evaluation(problem)
    if on_ready is not None:
        on_ready(evaluation)
    start = np.array([one.place(one.start) for one in evaluation.free])
    settings = problem.tune.starts
    places = fit.random_places(start, settings.count, settings.spread, settings.seed)
    if resume is not None:
        places = _kept(resume, evaluation, places)
    tell = on_iteration or (lambda search, number, of: None)
    search = _rounds(problem, evaluation, start, places, tell)
    best = search.place[search.best]
    values = evaluation.quantities(best[None])[0][0]
    return Outcome(problem, evaluation, search, values, evaluation.verified(best), time.monotonic() - began)


def _rounds(
    problem: Problemset,
    evaluation: Evaluation,
    start: np.ndarray,
    places: np.ndarray,
    tell: Callable[[Search, int, int], None],
) -> Search:
    """Iterations between measurements of what triangles see."""
    solver, done = problem.tune.solver, 0
    rounds = problem.tune.rounds if evaluation.has_statistics else 1
    total = solver.iterations * rounds
    search, history = None, []
    for number in range(rounds):
        evaluation.settle_statistics(start if search is None else search.place[search.best])
        before = places if search is None else search.place
        search = fit.begin(before, start, problem.tune.prior, evaluation.residuals)
        search.history = [*history, *search.history]
        if number == 0:
            _refuse(problem, evaluation, search)
        tell(search, done, total)
        for _ in range(solver.iterations):
            moves = (
                fit.levenberg_marquardt(search, evaluation.residuals)
                if solver.kind == "levenberg_marquardt"
                else fit.adam(search, evaluation.residuals, solver.learning_rate)
            )
            done += 1
            tell(search, done, total)
            if not moves:
                break
        history = search.history
    assert search is not None
    return search


def _refuse(problem: Problemset, evaluation: Evaluation, search: Search) -> None:
    """`InputError` for an objective that cannot be searched."""
    if not np.isfinite(search.cost).any():
        raise fail("targets", "the objective is not finite at any start: nothing to begin from; narrow the bounds")
    usable = np.isfinite(search.cost)
    influence = np.abs(search.slope[usable]).max(0)  # [t, p]
    problems = []
    for k, target in enumerate(evaluation.targets):
        if influence[k].max() < INFLUENCE:
            message = f"no free parameter influences {target.quantity} of '{target.herd}' {target.character}"
            problems.append(Problem(problem.where("targets", k), message))
    for p, one in enumerate(evaluation.free):
        if influence[:, p].max() < INFLUENCE:
            problems.append(Problem(problem.where("free", one.name), f"'{one.name}' influences no target"))
    if problems:
        raise InputError(problems)


def save(path: Path, search: Search, evaluation: Evaluation) -> None:
    """Keep where a search is."""
    names = np.array([one.name for one in evaluation.free])
    part = path.with_suffix(".part.npz")
    np.savez(part, names=names, place=search.place, cost=search.cost, history=np.array(search.history))
    part.replace(path)


def _kept(path: Path, evaluation: Evaluation, places: np.ndarray) -> np.ndarray:
    """Places of a search that was kept; it must have had the same parameters and number of starts."""
    try:
        kept = np.load(path, allow_pickle=False)
        names, place = kept["names"].tolist(), kept["place"]
    except (OSError, ValueError, KeyError) as error:
        raise fail(str(path), f"is no kept search: {error}") from None
    if names != [one.name for one in evaluation.free] or place.shape != places.shape:
        raise fail(str(path), f"is of another search: {len(place)} starts of {', '.join(names)}")
    return place


@dataclass(frozen=True)
class Identifiability:
    """What the targets determine, at the best place."""

    singular: np.ndarray  # [d] of the residuals' derivative by places, largest first
    directions: np.ndarray  # [d, p] unit vectors in places
    determined: np.ndarray  # [d] bool


def identifiability(search: Search) -> Identifiability:
    """Singular values of the Jacobian: tolerances moved by crossing the bounds along each direction."""
    slope = search.slope[search.best]
    _, singular, directions = np.linalg.svd(slope, full_matrices=True)
    singular = np.concatenate([singular, np.zeros(len(directions) - len(singular))])
    return Identifiability(singular, directions, singular > DETERMINED * max(1.0, float(singular[0])))
