"""`crowd run`: from a scenario file to a folder with recording, metrics, plots and pictures."""

from __future__ import annotations

import itertools
import math
import os
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from crowd import check, compile_cache, kept_memory
from crowd.drag_error import detail_rows
from crowd.errors import fail
from crowd.layout import TILE
from crowd.output_folder import existing, refuse_foreign
from crowd.progress import Progress
from crowd.recording import Recorder
from crowd.recording_thread import Writing
from crowd.scenario import Scenario
from crowd.scenario import load as load_scenario
from crowd.scene import Scene
from crowd.scene import load as load_scene
from crowd.simulate import Chunk, stream
from crowd.state import FAULT_NAMES

RECORDING, METRICS, REPORT = "recording.zarr", "metrics.csv", "report"


class Faults(NamedTuple):
    """Of a herd's n characters: fault bits, and the recorded time of the first (inf: none)."""

    code: np.ndarray  # [n]
    since: np.ndarray  # [n] s


@dataclass(frozen=True)
class Request:
    """What the command line asks for."""

    scenario: Path
    out: Path | None = None  # default: runs/NAME
    frames: int | None = None
    seconds: float | None = None
    devices: int | None = None  # default: as many cores as there are tiles for
    overrides: tuple[str, ...] = ()


def run_scenario(request: Request) -> Path:
    """Run a scenario into its folder, which is returned. Bad input raises `InputError` before anything is written."""
    scenario = load_scenario(request.scenario, request.overrides)
    frames = _frames(request, scenario)
    out = request.out or Path("runs") / scenario.name
    refuse_foreign(out, "run", RECORDING)
    kept_memory.keep()
    compile_cache.enable()
    devices = use_devices(request.devices, scenario)
    scene = load_scene(scenario)
    found = check.needs(scene, frames)
    _refuse_too_large(found, out)
    _announce(scene, found, frames, devices)
    fault = _step(scene, frames, devices, out)
    _report_faults(fault)
    _evaluate(scene, out)
    return out


def use_devices(asked: int | None, scenario: Scenario) -> int:
    """Makes JAX show that many devices and returns the number. Call before JAX has made any array.

    On a processor a device is a core; more than there are, or more than the machine's accelerators, is refused.
    """
    import jax

    if scenario.world.water is not None:
        if asked is not None and asked > 1:
            raise fail("--devices", f"{asked}; a scenario with world.water runs on one")
        return 1
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    tiles = max(math.ceil(herd.count / TILE) for herd in scenario.herds)
    if asked is not None and asked > 1:
        jax.config.update("jax_num_cpu_devices", min(asked, cores))
    elif asked is None and tiles > 1 and cores > 1:
        jax.config.update("jax_num_cpu_devices", min(cores, tiles))
    there = len(jax.devices())
    if asked is not None and asked > there:
        raise fail("--devices", f"{asked}; this machine has {there}")
    return asked if asked is not None else min(there, tiles)


def _frames(request: Request, scenario: Scenario) -> int:
    """Frames to step."""
    if request.frames is not None and request.seconds is not None:
        raise fail("--frames, --seconds", "only one of them can be given")
    if request.seconds is not None:
        if not (math.isfinite(request.seconds) and request.seconds > 0):
            raise fail("--seconds", f"{request.seconds}: must be a positive number")
        return max(1, round(request.seconds * scenario.rate_hz))
    return scenario.frame_count if request.frames is None else request.frames


def _refuse_too_large(found: check.Needs, out: Path) -> None:
    """`InputError` for a run that cannot fit into the machine's memory or onto the disk, before compiling."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if found.memory > memory:
        raise fail(
            "memory", f"about {check.readable(found.memory)} are needed; this machine has {check.readable(memory)}"
        )
    free = shutil.disk_usage(existing(out)).free
    packed = found.recording * 3 // 4  # about what compression leaves
    if packed > free:
        message = f"the recording needs about {check.readable(packed)}; {check.readable(free)} are free"
        raise fail(str(out), f"{message}; record.rate_hz, record.pose or --seconds make it smaller")


def _announce(scene: Scene, found: check.Needs, frames: int, devices: int) -> None:
    scenario = scene.scenario
    for herd in found.herds:
        print(herd)
    for note in found.notes:
        print(f"note: {note}")
    for warning in found.warnings:
        print(f"warning: {warning}")
    print(
        f"{scenario.name}: {scene.count:,} characters, {frames:,} frames at {scenario.rate_hz} Hz on "
        f"{devices} device{'s' if devices > 1 else ''}, recording about {check.readable(found.recording)} "
        "before compression",
        flush=True,
    )


def _step(scene: Scene, frames: int, devices: int, out: Path) -> dict[str, Faults]:
    """Steps and records; returns each herd's faults. The folder is made when the first frames are there."""
    fault: dict[str, Faults] = {}
    with Progress(frames, scene.scenario.rate_hz, scene.count) as progress:
        chunks = stream(scene, frames, devices)
        first = next(chunks)
        with Recorder(out / RECORDING, scene) as recorder, Writing(recorder) as writing:
            for chunk in itertools.chain([first], chunks):
                _record(writing, chunk, progress, fault)
    return fault


def _record(writing: Writing, chunk: Chunk, progress: Progress, fault: dict[str, Faults]) -> None:
    writing.append(chunk)
    for name, arrays in chunk.herds.items():
        if len(chunk.time):
            codes = arrays["fault"]
            here = np.where(codes.any(0), chunk.time[np.argmax(codes != 0, axis=0)], np.inf)
            before = fault[name].since if name in fault else np.inf
            fault[name] = Faults(codes[-1], np.minimum(before, here))
    progress.advance(chunk.first_frame + chunk.frames)


def _report_faults(fault: dict[str, Faults]) -> None:
    """A line for each herd with frozen characters: which, from when, and what stopped being finite."""
    for name, faults in fault.items():
        bad = np.flatnonzero(faults.code)
        shown = ", ".join(
            f"{number} (from {faults.since[number]:.2f} s: "
            + " and ".join(what for bit, what in FAULT_NAMES.items() if faults.code[number] & bit)
            + ")"
            for number in bad[:10]
        )
        if len(bad):
            more = ", ..." if len(bad) > 10 else ""
            print(f"warning: {len(bad)} of {len(faults.code)} characters of '{name}' were frozen: {shown}{more}")


def _evaluate(scene: Scene, out: Path) -> None:
    """Metrics, plots and pictures of the recording; the files of an earlier run are replaced."""
    from rich.console import Console

    from crowd.metrics import measure, print_metrics, write_metrics
    from crowd.recorded import open_recording
    from crowd.report import write_report

    recording = open_recording(out / RECORDING)
    rows = measure(recording, ground=scene.ground) + detail_rows(scene)
    metrics = write_metrics(rows, out / METRICS)
    for stale in (out / REPORT).glob("*.png"):
        stale.unlink()
    files = write_report(recording, scene, out / REPORT)
    print_metrics(rows, Console() if sys.stdout.isatty() else Console(width=110))
    print(f"recording  {out / RECORDING}")
    print(f"metrics    {metrics}")
    print(f"plots      {out / REPORT}")
    if "pictures" in files:
        print(f"pictures   {files['pictures']}")
