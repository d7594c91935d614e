"""Runs the benchmarks: `make bench`, `crowd bench`, `python -m benchmarks.run`.

Every case is compiled and timed in a process of its own with an empty compile cache, then compiled again in a second
process from the cache the first one filled. Results are written as JSON lines while they come, shown as tables, and
drawn beside the file. See docs/performance.md.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from rich.console import Console

from benchmarks.alone import CASE as ALONE
from benchmarks.cases import CASES, GPU_CASES, Case
from benchmarks.compare import read
from benchmarks.compare import show as show_differences
from benchmarks.figures import figures
from benchmarks.machine import ROOT, cores, machine
from benchmarks.measure import Job
from benchmarks.plots import drawn
from benchmarks.record import compared as recorded
from benchmarks.reference import standing
from benchmarks.start import start as measure_start
from benchmarks.table import show, told
from crowd.errors import nearest

Line = dict[str, Any]
RESULTS = ROOT / "benchmarks" / "results"
Platform = Literal["cpu", "gpu"]
ROUNDS = 4  # at most, of a recording and the same run without
RECORDED_FRAMES = 640


def run_case(job: Job) -> Line:
    """The line of one case, timed in one process and compiled from the cache in another.

    A case that fails, or needs more cores than there are, has an "error" instead of measurements. "cache_used" is false
    where the second process compiled anew: the program is not the same in every process, or the code was changed.
    """
    case = job.case
    line: Line = {"kind": "case", "case": case.name, "devices": case.devices, "characters": case.count}
    line |= {"mesh": case.mesh, "water": case.water, "depth_m": case.depth, "gait": case.gait, "rubble": case.rubble}
    line |= {"herds": dict(case.herds)}
    if job.platform == "cpu" and case.devices > len(cores()):
        return line | {"error": f"needs {case.devices} cores, there are {len(cores())}"}
    try:
        if case.recorded:
            return line | recorded(case, min(job.runs, ROUNDS), job.frames or RECORDED_FRAMES)
        with tempfile.TemporaryDirectory(prefix="crowd-bench-") as cache:
            line |= _process(job, cache)
            line["compile_cold_s"] = line.pop("compile_s")
            programs = len(os.listdir(cache))
            if job.warm:
                warm = _process(replace(job, runs=0), cache)
                line |= {"compile_warm_s": warm["compile_s"], "cache_used": len(os.listdir(cache)) == programs}
    except subprocess.CalledProcessError as error:
        return line | {"error": _last(error)}
    return line


def _process(job: Job, cache: str) -> Line:
    """What `benchmarks.measure` prints for a job."""
    return _module("benchmarks.measure", job.text(), environment={"JAX_COMPILATION_CACHE_DIR": cache})


def _module(name: str, *arguments: str, environment: dict[str, str] | None = None) -> Line:
    """The JSON that a module prints last, run in a process of its own."""
    command = [sys.executable, "-m", name, *arguments]
    inherited = os.environ | (environment or {})
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=inherited, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def _last(error: subprocess.CalledProcessError) -> str:
    return "\n".join((error.stderr or "").splitlines()[-20:]) or f"ended with exit status {error.returncode}"


def chosen(names: list[str], quick: bool, platform: Platform = "cpu", every: bool = False) -> list[Case]:
    """The cases asked for; the usual ones when none are. Raises typer.BadParameter for an unknown name."""
    cases = CASES if platform == "cpu" else GPU_CASES
    known = [case.name for case in cases]
    for name in names:
        if name not in known:
            raise typer.BadParameter(f"there is no case '{name}'{nearest(name, known)}; --list --all names them")
    sets = ("quick",) if quick else ("quick", "usual", "all") if every else () if names else ("quick", "usual")
    return [case for case in cases if case.name in names or case.asked in sets]


def main(
    case: Annotated[list[str] | None, typer.Option(help="Only this case (repeatable).")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="The promised figures that fit 20 minutes.")] = False,
    every: Annotated[bool, typer.Option("--all", help="Cases that take long or promise nothing, too.")] = False,
    names: Annotated[bool, typer.Option("--list", help="Print the cases and stop.")] = False,
    platform: Annotated[Platform, typer.Option(help="gpu: cases of its own, on the first one.")] = "cpu",
    out: Annotated[
        Path | None, typer.Option(help="JSON lines go here; replaces a file (default: one in benchmarks/results).")
    ] = None,
    compare: Annotated[Path | None, typer.Option(help="An earlier results file: then, now, ratio.")] = None,
    runs: Annotated[int, typer.Option(min=1, help="Timed runs of each case.")] = 7,
    frames: Annotated[int | None, typer.Option(min=1, help="Frames of each run (default: 60 or more).")] = None,
    stages: Annotated[bool, typer.Option(help="Also time the stages of the step, in it and alone.")] = True,
    warm: Annotated[bool, typer.Option(help="Also compile every case again, from the cache.")] = True,
    start: Annotated[bool, typer.Option(help="Also time the start of `crowd run`.")] = True,
    roofline: Annotated[
        bool, typer.Option(help="Also measure the machine's peaks, and hold cases against them.")
    ] = True,
    peers: Annotated[bool, typer.Option(help="Also measure what else is installed (docs/performance.md).")] = False,
    plots: Annotated[bool, typer.Option(help="Draw the results, beside the file.")] = True,
) -> None:
    """Time the simulation, its compilation and its start, and compare with what is promised."""
    console = Console() if sys.stdout.isatty() else Console(width=160)
    cases = chosen(case or [], quick, platform, every)
    if names:
        for one in cases:
            print(one.name)
        return
    out = out or RESULTS / ("latest.jsonl" if platform == "cpu" else "gpu.jsonl")
    earlier = None if compare is None else read(compare)  # now: a bad file need not cost the measurement
    here = machine()
    console.print(f"{here['cpu']}, {here['cores']} cores, load {here['load_1min']}, jax {here['jax']}")
    with standing() if platform == "cpu" and len(cases) > 1 else nullcontext() as reference:
        if platform == "cpu" and len(cases) > 1 and reference is None:
            console.print("the reference does not start: ratios are of cases minutes apart")
        jobs = [lambda one=one: run_case(Job(one, frames, runs, stages, platform, warm, reference)) for one in cases]
        lines = _measured(jobs, out, console)
    jobs = []
    if platform == "cpu":
        jobs += [lambda: _beside("alone", "benchmarks.alone")] * (stages and any(one.name == ALONE for one in cases))
        jobs += [lambda: _beside("peaks", "benchmarks.peaks")] * roofline
        jobs += [_start] * start
        jobs += [lambda: _beside("peers", "benchmarks.peers", "--json")] * peers
    lines += _measured(jobs, out, console, "a")
    show(lines, figures(lines) if platform == "cpu" else [], console)
    if earlier is not None:
        show_differences(earlier, lines, console)
    print(f"results  {out}")
    for path in drawn(lines, out) if plots else ():
        print(f"plot     {path}")
    if any("error" in line for line in lines):
        raise typer.Exit(1)


def _measured(
    jobs: Sequence[Callable[[], Line]], out: Path, console: Console, mode: Literal["w", "a"] = "w"
) -> list[Line]:
    """The lines of all jobs, written to a file while they come."""
    lines = []
    out.parent.mkdir(parents=True, exist_ok=True)
    with out.open(mode, encoding="utf-8") as file:
        for job in jobs:
            line = job() | {"machine": machine()}
            lines.append(line)
            file.write(json.dumps(line) + "\n")
            file.flush()
            console.print(told(line), highlight=False)
    return lines


def _beside(kind: str, module: str, *arguments: str) -> Line:
    """A line that is not a case's."""
    try:
        return _module(module, *arguments)
    except subprocess.CalledProcessError as error:
        return {"kind": kind, "error": _last(error)}


def _start() -> Line:
    try:
        return measure_start()
    except RuntimeError as error:
        return {"kind": "start", "error": str(error)}


if __name__ == "__main__":
    typer.run(main)
