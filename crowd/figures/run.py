"""`crowd figures`: one cached run per character, then every figure, table and check."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

from crowd import compile_cache
from crowd.figures.plots import PLOTS
from crowd.figures.pools import FLUIDS, Study, study
from crowd.figures.poses import figure_5
from crowd.figures.statements import PERSON, TABLE, Check, checks, force, medians, torque

TABLE_HEAD = [
    "fluid", "paper_median_c_d", "median_c_d", "aggregate_c_d", "skew", "paper_remaining", "remaining",
]  # fmt: skip
CHECKS, WALKS, CURVES = "checks.csv", "walks.csv", "speed.csv"


def run_figures(archetypes: tuple[str, ...], out: Path) -> bool:
    """Draw everything into `out/CHARACTER`; whether every check passes."""
    compile_cache.enable()
    good = True
    for name in archetypes:
        sys.stderr.write(f"{name}: walking through its pools (a minute or two, once)\n")
        found = study(name, Path.cwd(), out / "cache")
        folder = out / Path(name).stem
        results = write(found, folder)
        good &= all(check.passed for check in results)
        print(f"{found.archetype}: hips at {found.hip:.2f} m, {len(found.walks)} pools -> {folder}")
        _print(results)
        if found.archetype != PERSON:
            print(f"  {_belt(found.belt)}")
    return good


def write(found: Study, folder: Path) -> list[Check]:
    """Figures, tables and checks of one character."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, plot in PLOTS.items():
        if name != "figure_8_arms" or "arms down" in found.walks:
            plot(found, folder / f"{name}.png")
    figure_5(found, folder / "figure_5_poses.png")
    results = checks(found)
    _csv(
        folder / CHECKS,
        ["figure", "statement", "paper", "ours", "passed"],
        [list(vars(one).values()) for one in results],
    )
    _csv(
        folder / WALKS,
        ["pool", "fluid", "depth_m", "asked_m_s", "remaining", "force_n", "pitch_torque_n_m"],
        _walks(found),
    )
    _csv(folder / "table_1.csv", TABLE_HEAD, _table(found))
    if found.belt is not None:
        _csv(folder / "table_1_belt.csv", TABLE_HEAD, _table(found.belt))
    names = list(found.walks)
    curves = np.stack([found.walks[name].speed for name in names], 1)
    rows = [[f"{(t + 1) / 60:.4f}", *(f"{value:.5f}" for value in row)] for t, row in enumerate(curves)]
    _csv(folder / CURVES, ["time_s", *names], rows)
    return results


def _walks(found: Study) -> list[list[str]]:
    return [
        [
            name, walk.pool.fluid, f"{walk.depth:.3f}", f"{walk.asked:.3f}", f"{walk.remaining:.4f}",
            f"{force(walk).mean():.2f}", f"{torque(walk).mean():.2f}",
        ]
        for name, walk in found.walks.items()
    ]  # fmt: skip


def _table(found: Study) -> list[list[str]]:
    rows = []
    for fluid in FLUIDS:
        one = medians(found, fluid)
        remaining = found.walks[f"{fluid} waist"].remaining
        numbers = (TABLE[fluid][0], one.median, one.aggregate, one.skew, TABLE[fluid][1], remaining)
        rows.append([fluid, *(f"{number:.4g}" for number in numbers)])
    return rows


def _belt(found: Study | None) -> str:
    """Medians of a body that the constants were not fitted to: told, not held against the paper's."""
    if found is None:
        return "with a belt: no trunk under its hips to wear one on"
    told = ((found.walks[f"{fluid} waist"].remaining, medians(found, fluid)) for fluid in FLUIDS)
    each = (f"{100 * left:.0f} %, {one.median:.3g}, 1/{1 / one.skew:.0f}" for left, one in told)
    return f"with a belt and a person's B: remaining speed, median C_D and skew are {'; '.join(each)}"


def _csv(path: Path, head: list[str], rows: list[list[object]] | list[list[str]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(head)
        writer.writerows(rows)


def _print(results: list[Check]) -> None:
    for one in results:
        mark = "pass" if one.passed else "FAIL"
        print(f"  {mark}  {one.figure:<10} {one.statement:<58} wanted {one.paper:<22} {one.ours}")
