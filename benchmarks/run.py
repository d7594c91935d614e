"""Runs the benchmarks: `make bench`, `crowd bench`, `python -m benchmarks.run`.

Every case is compiled and timed in a process of its own with an empty compile cache, then compiled again in a second
process from the cache the first one filled. Results are written as JSON lines while they come, and shown as tables.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from rich.console import Console

from benchmarks.cases import CASES, GPU_CASES, QUICK, Case
from benchmarks.figures import figures
from benchmarks.machine import ROOT, cores, machine
from benchmarks.measure import Job
from benchmarks.start import start as measure_start
from benchmarks.table import show
from crowd.errors import nearest

Line = dict[str, Any]
RESULTS = ROOT / "benchmarks" / "results"
Platform = Literal["cpu", "gpu"]


def run_case(job: Job) -> Line:
    """The line of one case, timed in one process and compiled from the cache in another.

    A case that fails, or needs more cores than there are, has an "error" instead of measurements. "cache_used" is false
    where the second process compiled anew: the program is not the same in every process, or the code was changed.
    """
    case = job.case
    line: Line = {"kind": "case", "case": case.name, "devices": case.devices, "characters": case.count}
    line |= {"mesh": case.mesh, "water": case.water, "herds": dict(case.herds)}
    if job.platform == "cpu" and case.devices > len(cores()):
        return line | {"error": f"needs {case.devices} cores, there are {len(cores())}"}
    try:
        with tempfile.TemporaryDirectory(prefix="crowd-bench-") as cache:
            line |= _process(job, cache)
            line["compile_cold_s"] = line.pop("compile_s")
            programs = len(os.listdir(cache))
            if job.warm:
                warm = _process(replace(job, runs=0), cache)
                line |= {"compile_warm_s": warm["compile_s"], "cache_used": len(os.listdir(cache)) == programs}
    except subprocess.CalledProcessError as error:
        return line | {"error": "\n".join(error.stderr.splitlines()[-20:])}
    return line


def _process(job: Job, cache: str) -> Line:
    """What `benchmarks.measure` prints for a job."""
    environment = os.environ | {"JAX_COMPILATION_CACHE_DIR": cache}
    command = [sys.executable, "-m", "benchmarks.measure", job.text()]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=environment, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def chosen(names: list[str], quick: bool, platform: Platform = "cpu") -> list[Case]:
    """The cases asked for; all when none are. Raises typer.BadParameter for an unknown name."""
    cases = CASES if platform == "cpu" else GPU_CASES
    known = [case.name for case in cases]
    for name in names:
        if name not in known:
            raise typer.BadParameter(f"there is no case '{name}'{nearest(name, known)}; --list names them")
    wanted = set(names) | (set(QUICK) if quick else set())
    return [case for case in cases if not wanted or case.name in wanted]


def main(
    case: Annotated[list[str] | None, typer.Option(help="Only this case (repeatable).")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Only the cases of the promised figures.")] = False,
    names: Annotated[bool, typer.Option("--list", help="Print the cases and stop.")] = False,
    platform: Annotated[Platform, typer.Option(help="gpu: cases of its own, on the first one.")] = "cpu",
    out: Annotated[
        Path | None, typer.Option(help="JSON lines go here; replaces a file [default: one in benchmarks/results]")
    ] = None,
    runs: Annotated[int, typer.Option(min=1, help="Timed runs of each case.")] = 7,
    frames: Annotated[int | None, typer.Option(min=1, help="Frames of each run [default: 60 or more].")] = None,
    stages: Annotated[bool, typer.Option(help="Also time the stages of the step.")] = True,
    warm: Annotated[bool, typer.Option(help="Also compile every case again, from the cache.")] = True,
    start: Annotated[bool, typer.Option(help="Also time the start of `crowd run`.")] = True,
) -> None:
    """Time the simulation, its compilation and its start, and compare with what is promised."""
    console = Console() if sys.stdout.isatty() else Console(width=160)
    cases = chosen(case or [], quick, platform)
    out = out or RESULTS / ("latest.jsonl" if platform == "cpu" else "gpu.jsonl")
    if names:
        for one in cases:
            print(one.name)
        return
    lines: list[Line] = []
    here = machine()
    console.print(f"{here['cpu']}, {here['cores']} cores, load {here['load_1min']}, jax {here['jax']}")
    out.parent.mkdir(parents=True, exist_ok=True)
    with out.open("w", encoding="utf-8") as file:
        jobs = [lambda one=one: run_case(Job(one, frames, runs, stages, platform, warm)) for one in cases]
        for job in (*jobs, *([_start] if start and platform == "cpu" else [])):
            line = job() | {"machine": machine()}
            lines.append(line)
            file.write(json.dumps(line) + "\n")
            file.flush()
            console.print(_told(line))
    show(lines, figures(lines) if platform == "cpu" else [], console)
    print(f"results  {out}")
    if any("error" in line for line in lines):
        raise typer.Exit(1)


def _start() -> Line:
    try:
        return measure_start()
    except RuntimeError as error:
        return {"kind": "start", "error": str(error)}


def _told(line: Line) -> str:
    """A line of progress."""
    name = line.get("case", "start of crowd run")
    if "error" in line:
        return f"{name}: {line['error']}"
    if line["kind"] == "start":
        warm = f"{line['warm_s']:.1f} s ({line['warm_cpu_s']:.1f} s of processor)"
        return f"{name}: {line['cold_s']:.1f} s, with a warm cache {warm}"
    compiled = f"{line['compile_cold_s']:.1f} s ({line['compile_cpu_s']:.1f} s of processor)"
    return f"{name}: {line['us']:.4g} µs, compiled in {compiled}"


if __name__ == "__main__":
    typer.run(main)
