"""What `crowd tune` leaves: constants, residuals and identifiability as YAML, the way there as CSV and PNG."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from crowd.report_plots import figure, finish
from crowd.tuning.evaluation import Evaluation
from crowd.tuning.fit import Search
from crowd.tuning.run import Identifiability, Outcome, identifiability
from crowd.view.palette import INK, LEFT, QUIET

FITTED, TABLE, HISTORY, PLOT, KEPT = "fitted.yaml", "fluids.yaml", "history.csv", "convergence.png", "search.npz"
SIGMOIDS = ("base_drag", "offset_force")


def write(out: Path, outcome: Outcome) -> dict[str, Path]:
    """Write all files into a folder; returns them by name."""
    out.mkdir(parents=True, exist_ok=True)
    files = {"fitted": out / FITTED, "history": out / HISTORY, "convergence": out / PLOT}
    dump(files["fitted"], summary(outcome), f"Constants fitted by crowd tune {outcome.problem.tune.name}.")
    _write_history(files["history"], outcome.search)
    _plot(files["convergence"], outcome)
    if any(name.startswith("fluids.") for name in outcome.numbers):
        files["fluids"] = out / TABLE
        note = "A table of fluids with the fitted constants: a scenario uses it with `fluids: fluids.yaml`."
        dump(files["fluids"], fluid_table(outcome), note)
    return files


def summary(outcome: Outcome) -> dict[str, Any]:
    """Fitted constants, targets with residuals, and what the data do not determine, as plain data."""
    search, evaluation = outcome.search, outcome.evaluation
    found = identifiability(search)
    rows = zip(evaluation.targets, outcome.values, outcome.verified, strict=True)
    return {
        "constants": {name: _short(value) for name, value in outcome.numbers.items()},
        "targets": [
            {
                "herd": target.herd, "character": target.character, "quantity": target.quantity,
                "wanted": target.value, "tolerance": target.tolerance,
                "fitted": _short(value), "plain_run": _short(seen),
                "within": bool(abs(value - target.value) <= target.tolerance),
            }
            for target, value, seen in rows
        ],
        "starts": {"count": len(search.cost), "reached_all_targets": int(outcome.reached.sum())},
        "identifiability": {
            "singular_values": [_short(value) for value in found.singular],
            "determined_directions": int(found.determined.sum()),
            "left_to_the_prior": undetermined(found, evaluation),
        },
        "gradient_memory_mb": round(evaluation.memory / 1e6, 1),
        "seconds": round(outcome.seconds, 1),
    }  # fmt: skip


def undetermined(found: Identifiability, evaluation: Evaluation) -> list[dict[str, float]]:
    """Directions that the targets leave open: shares of the bounds' widths, of the parameters that matter in each."""
    rows = []
    for direction, known in zip(found.directions, found.determined, strict=True):
        if not known:
            shares = zip(evaluation.free, direction, strict=True)
            rows.append({one.name: round(float(share), 2) for one, share in shares if abs(share) >= 0.1})
    return rows


def lines(outcome: Outcome) -> list[str]:
    """The same for the terminal."""
    told = [f"{name:<34} {value:.6g}" for name, value in outcome.numbers.items()]
    told.append("")
    told.append(f"{'target':<44} {'wanted':>9} {'fitted':>9} {'plain run':>9}")
    for target, value, seen in zip(outcome.evaluation.targets, outcome.values, outcome.verified, strict=True):
        good = "ok" if abs(value - target.value) <= target.tolerance else f"off by more than {target.tolerance:g}"
        label = f"{target.herd} {target.character} {target.quantity}"
        told.append(f"{label:<44} {target.value:9.4g} {value:9.4g} {seen:9.4g}  {good}")
    found = identifiability(outcome.search)
    told.append("")
    told.append(f"{int(outcome.reached.sum())} of {len(outcome.search.cost)} starts reach every target")
    told.append(f"the targets determine {int(found.determined.sum())} of {len(found.directions)} directions")
    return told


def fluid_table(outcome: Outcome) -> dict[str, Any]:
    """The scenario's table of fluids with the fitted constants in it."""
    scenario = outcome.problem.scenario
    table = scenario.fluid_table.model_dump(exclude_none=True)
    for name, value in outcome.numbers.items():
        parts = name.split(".")
        if parts[0] == "fluids" and parts[1] in SIGMOIDS:
            key = "base_drag" if parts[1] == "base_drag" else "offset_force_n"
            table[key][parts[2]] = _short(value)
    return table


def dump(path: Path, data: dict[str, Any], note: str) -> None:
    """Write plain data as YAML under a comment."""
    from ruamel.yaml import YAML

    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None
    yaml.width = 160
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    with path.open("w", encoding="utf-8") as stream:
        stream.write(f"# {note}\n")
        yaml.dump(data, stream)


def _short(value: float) -> float:
    return float(f"{value:.6g}")


def _write_history(path: Path, search: Search) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["iteration", *(f"start_{s}" for s in range(len(search.cost)))])
        for number, row in enumerate(search.history):
            writer.writerow([number, *(f"{cost:.6g}" for cost in row)])


def _plot(path: Path, outcome: Outcome) -> Path:
    """Cost of every start over iterations; residuals of the best one."""
    search, evaluation = outcome.search, outcome.evaluation
    made, axes = figure(11.0, 4.6, 1, 2)
    left, right = axes[0]
    history = np.array(search.history)
    left.plot(history, color=QUIET, linewidth=0.9, alpha=0.7)
    left.plot(history[:, search.best], color=INK, linewidth=2.0, label="best start")
    left.axhline(
        0.5 * len(evaluation.targets), color=LEFT, linestyle="--", linewidth=1.0, label="all at their tolerance"
    )
    left.set_yscale("log")
    left.set_xlabel("iteration")
    left.set_ylabel("half the sum of squared residuals, with the prior")
    left.legend(frameon=False, fontsize=9)
    labels = [f"{t.herd} {t.character}\n{t.quantity}" for t in evaluation.targets]
    position = np.arange(len(labels))
    right.axvspan(-1, 1, color=LEFT, alpha=0.12, linewidth=0)
    shown = ((outcome.values, 0.1, "o", INK, "fitted"), (outcome.verified, -0.1, "s", LEFT, "plain run"))
    for values, shift, marker, color, label in shown:
        residual = (values - evaluation.values) / evaluation.tolerances
        right.plot(residual, position + shift, marker, color=color, markersize=7, label=label)
    right.set_yticks(position, labels, fontsize=8)
    right.invert_yaxis()
    right.set_xlim(-max(1.25, right.get_xlim()[1]), max(1.25, right.get_xlim()[1]))
    right.set_xlabel("residual, tolerances")
    right.legend(frameon=False, fontsize=9)
    return finish(
        made, path, f"{outcome.problem.tune.name}: starts {len(search.cost)}, reached {int(outcome.reached.sum())}"
    )
