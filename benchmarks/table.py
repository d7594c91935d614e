"""Results as tables in the terminal."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.figures import Figure
from benchmarks.peers import show as show_peers
from benchmarks.roofline import Roof, roofs
from benchmarks.stages import LOOPS, STAGES

Line = dict[str, Any]
BUSY = 1.15  # wall time over processor time


def told(line: Line) -> str:
    """A line of progress."""
    name = line.get("case", {"start": "start of crowd run"}.get(line["kind"], line["kind"]))
    if "error" in line:
        return f"{name}: {line['error']}"
    if line["kind"] == "start":
        warm = f"{line['warm_s']:.1f} s ({line['warm_cpu_s']:.1f} s of processor)"
        return f"{name}: {line['cold_s']:.1f} s, with a warm cache {warm}"
    if line["kind"] == "peaks":
        return f"{name}: {line['gflops']:.0f} GFLOP/s, {line['gbytes']:.0f} GB/s, one core"
    if line["kind"] == "alone":
        return f"{name}: {sum(line['alone_us'].values()):.4g} µs, in a frame {line['us']:.4g} µs"
    if line["kind"] == "peers":
        return f"{name}: measured {', '.join(each['name'] for each in line['peers'] if 'us' in each)}"
    if "over_off" in line:
        return f"{name}: {line['us']:.4g} µs, {line['over_off']:.3f} times a run without"
    compiled = f"{line['compile_cold_s']:.1f} s ({line['compile_cpu_s']:.1f} s of processor)"
    return f"{name}: {line['us']:.4g} µs, compiled in {compiled}"


def show(lines: list[Line], figures: list[Figure], console: Console) -> None:
    """Prints cases, stages, limits, peers and figures."""
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
        console.print(_stages(timed, [line for line in lines if line["kind"] == "alone" and "error" not in line]))
    if found := roofs(lines):
        console.print(_roofs(found))
    for line in lines:
        if line["kind"] == "peers" and "error" not in line:
            show_peers(line, console)
    if figures:
        doubtful = any(busy(line) for line in timed)
        console.print(_figures(figures, "Figures (the machine was busy: not reliable)" if doubtful else "Figures"))


def busy(line: Line) -> bool:
    """Whether something else had the cores of a measurement."""
    return bool(line.get("pinned_cores")) and line["us"] * line["devices"] > BUSY * line["us_cpu"]


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
            _shown(line, "us_cpu", 2),
            _shown(line, "trace_s", 1),
            _shown(line, "compile_cold_s", 1),
            _shown(line, "compile_cpu_s", 1),
            _cached(line),
            _shown(line, "temp_bytes_per_character", 0),
            f"{line.get('peak_device_bytes', line['peak_rss_bytes']) / 1e6:.0f}",
        )
    return table


def _shown(line: Line, key: str, digits: int) -> str:
    """A number of a line; nothing where it has none (recordings are not compiled for themselves)."""
    return f"{line[key]:.{digits}f}" if key in line else ""


def _cached(line: Line) -> str:
    """Seconds of the second compile."""
    if "compile_warm_s" not in line:
        return ""
    return f"{line['compile_warm_s']:.1f}" if line["cache_used"] else "missed"


def _stages(lines: list[Line], alone: list[Line]) -> Table:
    """Share of each stage, and the µs that makes; then µs of the stages timed alone."""
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
    for line in alone:
        own = line["alone_us"]
        table.add_row(f"{line['case']}, alone", *(f"{own[name]:#.2g}" if name in own else "" for name in names))
    return table


def _roofs(found: list[Roof]) -> Table:
    """What cases compute and move against the machine's peaks."""
    peaks = f"of one core: {found[0].peak_gflops:.0f} GFLOP/s, {found[0].peak_gbytes:.0f} GB/s"
    table = Table(title="Least work of a character-frame, and its limit", caption=f"Peaks {peaks}")
    table.add_column("case", no_wrap=True)
    for name in ("kflop", "bytes", "GFLOP/s", "GB/s", "limit µs", "of limit"):
        table.add_column(name, justify="right", no_wrap=True)
    for roof in found:
        table.add_row(
            roof.case,
            f"{roof.flops / 1e3:.1f}",
            f"{roof.bytes:.0f}",
            f"{roof.gflops:.1f}",
            f"{roof.gbytes:.2f}",
            f"{roof.limit_us:.2f}",
            f"{100 * roof.share:.0f} %",
        )
    return table


def _figures(figures: list[Figure], title: str) -> Table:
    table = Table(title=title)
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
