"""Results as tables in the terminal."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.figures import Figure
from benchmarks.stages import LOOPS, STAGES

Line = dict[str, Any]
BUSY = 1.15  # wall time over processor time


def show(lines: list[Line], figures: list[Figure], console: Console) -> None:
    """Prints cases, stages and figures."""
    timed = [line for line in lines if line["kind"] == "case" and "us" in line]
    if timed:
        console.print(_cases(timed))
        console.print(
            "µs: wall time per character-frame, median (least to most). Cases on one processor are confined to one "
            "core, compiler included. Compile: with an empty cache (wall, processor), then with it in the cache."
        )
        if any(busy(line) for line in timed):
            console.print(
                "[yellow]* the machine was busy (wall time well above processor time): nothing here is reliable[/]"
            )
    if any(line.get("stage_share") for line in timed):
        console.print(_stages(timed))
    if figures:
        console.print(_figures(figures))


def busy(line: Line) -> bool:
    """Whether something else had the cores of a measurement."""
    return bool(line["pinned_cores"]) and line["us"] * line["devices"] > BUSY * line["us_cpu"]


def _cases(lines: list[Line]) -> Table:
    table = Table(title="Cases")
    table.add_column("case", no_wrap=True)
    for name in (
        "µs",
        "least to most",
        "cpu µs",
        "trace s",
        "compile s",
        "cpu s",
        "cached s",
        "temp B/char",
        "peak MB",
    ):
        table.add_column(name, justify="right", no_wrap=True)
    for line in lines:
        table.add_row(
            line["case"] + (" *" if busy(line) else ""),
            f"{line['us']:#.3g}",
            f"{line['us_min']:#.3g} to {line['us_max']:#.3g}",
            f"{line['us_cpu']:.2f}",
            f"{line['trace_s']:.1f}",
            f"{line['compile_cold_s']:.1f}",
            f"{line['compile_cpu_s']:.1f}",
            _cached(line),
            f"{line['temp_bytes_per_character']:.0f}" if "temp_bytes_per_character" in line else "",
            f"{line.get('peak_device_bytes', line['peak_rss_bytes']) / 1e6:.0f}",
        )
    return table


def _cached(line: Line) -> str:
    """Seconds of the second compile."""
    if "compile_warm_s" not in line:
        return ""
    return f"{line['compile_warm_s']:.1f}" if line["cache_used"] else "missed"


def _stages(lines: list[Line]) -> Table:
    """Share of each stage, and the µs that makes."""
    lines = [line for line in lines if line.get("stage_share")]
    table = Table(title="Stages: µs per character-frame, share of the whole")
    table.add_column("case", no_wrap=True)
    names = [name for name in (*STAGES, LOOPS) if any(name in line["stage_share"] for line in lines)]
    for name in names:
        table.add_column(name, justify="right", no_wrap=True)
    for line in lines:
        share = line["stage_share"]
        table.add_row(
            line["case"],
            *(f"{share[name] * line['us']:#.2g} {100 * share[name]:2.0f}%" if name in share else "" for name in names),
        )
    return table


def _figures(figures: list[Figure]) -> Table:
    table = Table(title="Figures")
    table.add_column("figure")
    table.add_column("measured", justify="right", no_wrap=True)
    table.add_column("promised", justify="right", no_wrap=True)
    table.add_column("", no_wrap=True)
    colour = {True: "green", False: "red", None: "dim"}
    for figure in figures:
        measured = "" if figure.value is None else f"{figure.value:.2f} {figure.unit}"
        promised = "" if figure.limit is None else f"{figure.sense} {figure.limit:g} {figure.unit}"
        table.add_row(figure.name, measured, promised, f"[{colour[figure.reached]}]{figure.verdict}[/]")
    return table
