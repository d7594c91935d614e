"""The paper's figures: every statement holds for the built-in person, files are written, the run is kept."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crowd import simulate
from crowd.figures import pools, run, statements
from crowd.figures.pools import Study


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def person(cache: Path) -> Study:
    return pools.study("human", Path.cwd(), cache)


def test_every_statement_of_the_paper_holds(person: Study) -> None:
    found = statements.checks(person)
    assert len(found) >= 25
    assert sum(one.figure == "Belt" for one in found) == 6
    assert [f"{one.figure} {one.statement}: {one.ours}" for one in found if not one.passed] == []


def test_the_printed_medians_are_those_of_a_small_detail(person: Study) -> None:
    """Skew about 1/190 in every fluid with a belt; 1/3, and medians of a few, without."""
    assert person.belt is not None
    for fluid in ("mud", "goo"):
        worn, plain = statements.medians(person.belt, fluid), statements.medians(person, fluid)
        assert 1 / 220 < worn.skew < 1 / 140
        assert 1 / 5 < plain.skew < 1 / 2
        assert worn.median > 20 * plain.median
        # the force is the same whichever way it is shared
        assert worn.aggregate == pytest.approx(plain.aggregate, rel=0.15)


def test_files(person: Study, tmp_path: Path) -> None:
    results = run.write(person, tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    for number in (4, 5, 6, 7, 8):
        assert any(name.startswith(f"figure_{number}") and name.endswith(".png") for name in names)
    with (tmp_path / run.CHECKS).open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(results)
    with (tmp_path / "table_1.csv").open() as stream:
        table = {row["fluid"]: row for row in csv.DictReader(stream)}
    assert float(table["goo"]["remaining"]) < float(table["mud"]["remaining"]) < float(table["water"]["remaining"])


def test_a_second_time_nothing_is_stepped(person: Study, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise AssertionError("stepped again")

    monkeypatch.setattr(simulate, "simulate", refuse)
    again = pools.study("human", Path.cwd(), cache)
    for name, walk in person.walks.items():
        np.testing.assert_array_equal(again.walks[name].speed, walk.speed)


def test_checks_can_fail() -> None:
    """Waves of known amplitudes; falling and rising rows."""
    phase = np.linspace(0, 1, 200, endpoint=False)
    values = 3.0 + 0.5 * np.sin(2 * np.pi * phase) + 0.2 * np.cos(4 * np.pi * phase)
    np.testing.assert_allclose([statements.wave(phase, values, k) for k in (1, 2, 3)], [0.5, 0.2, 0.0], atol=1e-12)
    assert statements._rises([1.0, 2.0, 2.5])
    assert not statements._rises([1.0, 2.0, 2.0])
