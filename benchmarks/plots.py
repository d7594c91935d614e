"""Results as pictures beside their file, one for each question; those that nothing was measured for are left out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.cases import CASES, GPU_CASES, RATE
from benchmarks.figures import comparable
from benchmarks.roofline import roofs
from benchmarks.stages import LOOPS, STAGES

Line = dict[str, Any]
MESHES = ("rigid", "skinned")
COLOURS = {"rigid": "#2a6f97", "skinned": "#d1603d"}
GREY, GRID = "#4a4a4a", "#d9d9d9"
# skin and drag warm, what poses the body blue, the rest grey to green
STAGE_COLOURS = {
    "sense": "#c7d9b7", "steer": "#a9c78f", "forces": "#87ad68", "body": "#648f47", "gait": "#3f6b2c",
    "pose": "#9ecae1", "feet": "#4f94c4", "arms": "#1f5f99", "skin": "#fdc086", "drag": "#d1603d",
    "record": "#bdbdbd", LOOPS: "#737373",
}  # fmt: skip


def drawn(lines: list[Line], out: Path) -> list[Path]:
    """Draws everything there is for, as OUT-count.png and so on. Returns the files."""
    cases = [line for line in lines if line["kind"] == "case" and "us" in line]
    made = []
    for name, draw in PLOTS.items():
        figure = draw(lines, cases)
        if figure is not None:
            path = out.with_name(f"{out.stem}-{name}.png")
            figure.savefig(path, dpi=120)
            made.append(path)
    return made


def _figure(width: float, height: float, title: str) -> tuple[Any, Any]:
    """A figure and its axes, in one look."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    axes = figure.add_subplot()
    axes.set_title(title, fontsize=11, loc="left")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    return figure, axes


def _noted(axes: Any, text: str, x: float, y: float) -> None:
    """A note above a point or a bar, in front of the grid."""
    back = dict(facecolor="white", edgecolor="none", pad=0.6, alpha=0.85)
    axes.annotate(text, (x, y), (0, 7), textcoords="offset points", ha="center", fontsize=8.5, color=GREY, bbox=back)


def count(_: list[Line], cases: list[Line]) -> Any:
    """µs of a character-frame against the number of people, one device."""
    names = {
        case.name: mesh for case in (*CASES, *GPU_CASES) for mesh in MESHES if case.name == f"human-{mesh}-{case.count}"
    }
    found = {mesh: [line for line in cases if names.get(line["case"]) == mesh] for mesh in MESHES}
    if max(len(each) for each in found.values()) < 2:
        return None
    figure, axes = _figure(7, 4.2, "Cost of a character, people in water, one device")
    for mesh, each in found.items():
        each.sort(key=lambda line: line["characters"])
        x, y = [line["characters"] for line in each], [line["us"] for line in each]
        spread = [[line["us"] - line["us_min"] for line in each], [line["us_max"] - line["us"] for line in each]]
        axes.errorbar(x, y, yerr=spread, fmt="o-", color=COLOURS[mesh], capsize=3, label=f"{mesh} drag")
        for at, us in zip(x, y, strict=True):
            _noted(axes, f"{us:.0f}" if us >= 100 else f"{us:.1f}", at, us)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(lambda x, _: f"{x:,.0f}".replace(",", " "))
    if max(line["us"] for each in found.values() for line in each) > 50:  # of one character, that pays for a tile
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
    else:
        axes.set_ylim(bottom=0)
    axes.margins(x=0.07, y=0.12)
    axes.set_xlabel("characters")
    axes.set_ylabel("µs per character and frame")
    axes.legend(frameon=False)
    return figure


def stages(_: list[Line], cases: list[Line]) -> Any:
    """µs of each stage, stacked, a bar for each case with 2048 characters on one device."""
    shown = [line for line in cases if line.get("stage_share") and line["characters"] >= 2048 and line["devices"] == 1]
    if not shown:
        return None
    figure, axes = _figure(10, 1.6 + 0.32 * len(shown), "Where the time of a frame goes, one device")
    rows = list(range(len(shown)))[::-1]
    left = [0.0] * len(shown)
    for name in (*STAGES, LOOPS):
        widths = [line["us"] * line["stage_share"].get(name, 0.0) for line in shown]
        axes.barh(rows, widths, left=left, color=STAGE_COLOURS[name], label=name, height=0.75)
        left = [a + b for a, b in zip(left, widths, strict=True)]
    for row, line in zip(rows, shown, strict=True):
        axes.annotate(
            f"{line['us']:#.3g}", (line["us"], row), (4, 0), textcoords="offset points", va="center", fontsize=8
        )
    axes.set_yticks(rows, [line["case"] for line in shown], fontsize=8)
    axes.set_xlabel("µs per character and frame")
    axes.grid(axis="y", visible=False)
    axes.margins(x=0.06, y=0.02)
    axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def devices(_: list[Line], cases: list[Line]) -> Any:
    """People at 60 Hz in real time on one device and on more."""
    by_name = {line["case"]: line for line in cases}
    several = [line for line in cases if line["devices"] > 1]
    pairs = [(by_name.get(line["case"].removesuffix(f"-{line['devices']}dev")), line) for line in several]
    bars = [(one, many) for one, many in pairs if one is not None]
    if not bars:
        return None
    figure, axes = _figure(6, 4, "Characters at 60 Hz in real time")
    for place, (one, many) in enumerate(bars):
        for k, line in enumerate((one, many)):
            rate = 1e6 / RATE / line["us"]
            axes.bar(place + 0.38 * k - 0.19, rate, 0.34, color=COLOURS[line["mesh"]], alpha=0.55 + 0.45 * k)
            gain = f"\n{(comparable(one) or 0.0) / (comparable(many) or 1.0):.2f} x" if k else ""
            text = f"{line['devices']} core{'s' if k else ''}\n{rate:.0f}{gain}"
            _noted(axes, text, place + 0.38 * k - 0.19, rate)
    axes.set_xticks(range(len(bars)), [one["case"] for one, _ in bars])
    axes.set_ylabel("characters")
    axes.grid(axis="x", visible=False)
    axes.margins(y=0.22)
    return figure


def gradients(_: list[Line], cases: list[Line]) -> Any:
    """A gradient over the run it is of."""
    shown = [line for line in cases if "over_forward" in line]
    if not shown:
        return None
    figure, axes = _figure(6.5, 4, "Gradient of a run by every parameter, over the run")
    for place, line in enumerate(shown):
        axes.bar(place, line["over_forward"], 0.5, color=COLOURS[line["mesh"]])
        kilobytes = line["temp_bytes_per_character"] / line["gradient_frames"] / 1e3
        text = f"{line['over_forward']:.1f} x\n{kilobytes:.1f} kB a character-frame"
        _noted(axes, text, place, line["over_forward"])
    names = [f"{line['case'].removesuffix('-gradient')}\n{line['gradient_frames']} frames" for line in shown]
    axes.set_xticks(range(len(shown)), names)
    axes.set_ylabel("times the run without derivatives")
    axes.grid(axis="x", visible=False)
    axes.set_xlim(-0.7, len(shown) - 0.3)
    axes.margins(y=0.15)
    return figure


def roofline(lines: list[Line], _: list[Line]) -> Any:
    """Attained GFLOP/s over intensity, under the peaks of one core."""
    found = [roof for roof in roofs(lines) if not roof.case.endswith("-1")]  # one character pays for a tile
    if not found:
        return None
    peak, stream = found[0].peak_gflops, found[0].peak_gbytes
    figure, axes = _figure(9.5, 5.2, "Roofline, one core: least work of a frame over its time")
    x = [roof.flops / roof.bytes for roof in found]
    low, high = min(0.6 * min(x), 0.3 * peak / stream), max(2.0 * max(x), 4 * peak / stream)
    axes.plot([low, peak / stream, high], [low * stream, peak, peak], color=GREY, linewidth=1.5)
    text = dict(textcoords="offset points", fontsize=9, color=GREY)
    axes.annotate(f"{peak:.0f} GFLOP/s, matrix products", (high, peak), (0, 4), ha="right", **text)
    at = low**0.6 * (peak / stream) ** 0.4
    axes.annotate(f"{stream:.0f} GB/s, streaming", (at, at * stream), (10, -4), ha="left", va="top", **text)
    order = sorted(range(len(found)), key=lambda i: -found[i].gflops)
    colours = [f"C{k % 10}" for k in range(len(found))]
    markers = "osD^vP"
    for k, i in enumerate(order):
        roof = found[i]
        label = f"{roof.case}: {100 * roof.share:.0f} %"
        axes.plot(x[i], roof.gflops, markers[k // 10 % 6], color=colours[k], markersize=7, label=label)
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(lambda x, _: f"{x:g}" if f"{x:g}"[0] in "25" else "")
        axis.set_tick_params(which="minor", labelsize=8)
    axes.set_xlabel("flops per byte that must cross to memory")
    axes.set_ylabel("GFLOP/s")
    axes.legend(frameon=False, fontsize=7.5, loc="center left", bbox_to_anchor=(1.0, 0.5), title="case: of its limit")
    return figure


def peers(lines: list[Line], _: list[Line]) -> Any:
    """µs of a character and simulated second, here and elsewhere."""
    line = next((line for line in lines if line["kind"] == "peers" and line.get("own_us")), None)
    if line is None:
        return None
    bars = [("this simulator,\nrigid drag", line["own_us"], 1.0)]
    bars += [
        (each["name"].replace(", ", ",\n"), each["us"], each["over_own"]) for each in line["peers"] if "us" in each
    ]
    figure, axes = _figure(8.5, 4.4, "A character in fluid for a simulated second, one core, one run")
    for place, (_name, us, over) in enumerate(bars):
        axes.bar(place, us, 0.55, color=COLOURS["rigid"] if place == 0 else "#9a9a9a")
        text = f"{us:.0f} µs" + (f"\n{over:.0f} x" if place else "")
        _noted(axes, text, place, us)
    axes.set_yscale("log")
    axes.set_ylim(0.5 * bars[0][1], 4 * max(us for _, us, _ in bars))
    axes.set_xticks(range(len(bars)), [name for name, _, _ in bars])
    axes.set_ylabel("µs per character and simulated second")
    axes.set_xlabel("MuJoCo and MJX do other work: generalized dynamics, contacts, fluid on boxes", fontsize=8.5)
    axes.grid(axis="x", visible=False)
    return figure


PLOTS: dict[str, Callable[[list[Line], list[Line]], Any]] = {
    "count": count,
    "stages": stages,
    "devices": devices,
    "gradients": gradients,
    "roofline": roofline,
    "peers": peers,
}
