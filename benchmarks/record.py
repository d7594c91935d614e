"""What recording costs: `python -m benchmarks.record`; cases that are `recorded` in `crowd bench`.

The same crowd is stepped without and with a recording, each in a process of its own, one after the other in several
rounds. What is compared is the time from the first chunk to the end of the last write; compiling and opening the
recording come before. Ratios are within a round, because machines get faster and slower.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from benchmarks.cases import RATE, Case, scenario
from benchmarks.machine import ROOT, cores, machine, peak_memory, pin

Line = dict[str, Any]
CROWD = Case("record", (("human", 2048),), gait="semi_procedural")
RECORDED = 30  # Hz


@dataclass(frozen=True)
class Place:
    """How many devices step the crowd, and how many cores everything has; 0: all, on the GPU where there is one."""

    name: str
    devices: int
    cores: int


PLACES = (
    Place("one-core", 1, 1),
    Place("one-of-two-cores", 1, 2),
    Place("two-devices", 2, 2),
    Place("gpu", 1, 0),
)


@dataclass(frozen=True)
class Mode:
    """What the scenario asks for, and whether it is written."""

    name: str
    pose: bool
    written: bool
    rate: int = RECORDED  # Hz of frames that leave the device, and are recorded


# of a case: full poses of every frame against a run like those of other cases
OFF, ON = Mode("off", False, False, 1), Mode("on", True, True, RATE)

MODES = (
    Mode("not recorded", False, False),
    Mode("poses stepped, not written", True, False),
    Mode("recorded without poses", False, True),
    Mode("recorded with poses", True, True),
)


def measure(place: Place, mode: Mode, frames: int, folder: Path, crowd: Case = CROWD) -> Line:
    """Steps the crowd in this process, which must be fresh, and returns what it took after the first chunk."""
    if place.cores:
        pin(place.cores)
    import jax

    if place.cores:
        jax.config.update("jax_platforms", "cpu")
        jax.config.update("jax_num_cpu_devices", place.devices)
    from crowd import compile_cache, kept_memory
    from crowd.build import build
    from crowd.recording import Recorder
    from crowd.recording_layout import HERD, ROOT
    from crowd.recording_thread import Writing
    from crowd.scene import load
    from crowd.simulate import CHUNK, stream

    kept_memory.keep()
    compile_cache.enable()
    scene = load(scenario(crowd) | {"record": {"rate_hz": mode.rate, "pose": mode.pose}})
    program = build(scene, place.devices)
    spent = _watched()
    size, recorded, stepped = 0, 0, 0
    path = folder / f"{os.getpid()}.zarr"
    chunks = stream(scene, frames, place.devices, max(1, min(CHUNK, mode.rate)), program)
    first = next(chunks)
    before = dict(spent)
    began, used = time.perf_counter(), time.process_time()
    if mode.written:
        with Recorder(path, scene) as recorder:
            began, used = time.perf_counter(), time.process_time()
            with Writing(recorder) as writing:
                writing.append(first)
                for chunk in chunks:
                    writing.append(chunk)
                    recorded, stepped = recorded + len(chunk.time), stepped + chunk.frames
            ended, processor = time.perf_counter(), time.process_time()
        size = _emptied(path)
    else:
        for chunk in chunks:
            recorded, stepped = recorded + len(chunk.time), stepped + chunk.frames
        ended, processor = time.perf_counter(), time.process_time()
    columns = ROOT | HERD
    raw = sum(a[name].nbytes for a in first.herds.values() for name in a if name in columns) / len(first.time)
    return {
        "wall_s": ended - began,
        "cpu_s": processor - used,
        "close_s": time.perf_counter() - ended,
        "recorded": recorded,
        "stepped": stepped,
        "raw_bytes": raw,
        "bytes": size / (recorded + len(first.time)),
        "spent": {name: spent[name] - before[name] for name in spent},
        "peak_rss": peak_memory(),
        "device": jax.devices()[0].device_kind,
    }


def _emptied(recording: Path) -> int:
    """Bytes of a recording, which are removed; its files stay until all runs are over.

    ext4 does not reuse a file's number for minutes and steps over each, so that files of the next run would take five
    times as long to make.
    """
    files = [file for file in recording.rglob("*") if file.is_file()]
    size = sum(file.stat().st_size for file in files)
    for file in files:
        os.truncate(file, 0)
    return size


def _watched() -> dict[str, float]:
    """Seconds of processor time of the stages on the host, which count from now on."""
    from crowd import recording_array, simulate, unpack

    spent = {"unpack": 0.0, "compress": 0.0, "files": 0.0}

    def watch(module: Any, function: str, name: str) -> None:
        inner = getattr(module, function)

        def timed(*arguments: Any) -> Any:
            began = time.thread_time()
            result = inner(*arguments)
            spent[name] += time.thread_time() - began
            return result

        setattr(module, function, timed)

    watch(simulate, "unpacked", "unpack")
    watch(unpack.Unpacked, "parts", "unpack")
    watch(recording_array, "encoded", "compress")
    watch(recording_array, "stored", "files")
    return spent


def compared(crowd: Case, rounds: int, frames: int = 640) -> Line:
    """`us` of a character-frame that is recorded, and `over_off`: times a run that records nothing, within a round.

    The crowd has the case's devices, and one core more for the threads of the recording where there is one.
    """
    place = Place(crowd.name, crowd.devices, min(crowd.devices + 1, len(cores())))
    orders = [(OFF, ON)[:: 1 if number % 2 else -1] for number in range(rounds)]
    with tempfile.TemporaryDirectory(prefix="crowd-record-") as folder:
        done = [{mode.name: _process(place, mode, frames, folder, crowd) for mode in order} for order in orders]
    us = [[1e6 * each[name]["wall_s"] / each[name]["stepped"] / crowd.count for each in done] for name in ("on", "off")]
    return {
        "frames": frames,
        "runs": rounds,
        "us": round(median(us[0]), 4),
        "us_min": round(min(us[0]), 4),
        "us_max": round(max(us[0]), 4),
        "us_off": round(median(us[1]), 4),
        "over_off": round(median(on / off for on, off in zip(*us, strict=True)), 3),
        "over_off_cpu": round(median(_cpu(each["on"]) / _cpu(each["off"]) for each in done), 3),
        "disk_bytes_per_character": round(median(each["on"]["bytes"] for each in done) / crowd.count, 1),
        "peak_rss_bytes": max(each["on"]["peak_rss"] for each in done),
        "recording_cores": place.cores,
    }


def _cpu(line: Line) -> float:
    """Seconds of processor of a step."""
    return line["cpu_s"] / line["stepped"]


def _process(place: Place, mode: Mode, frames: int, folder: str, crowd: Case = CROWD) -> Line:
    job = json.dumps({"place": asdict(place), "mode": asdict(mode), "frames": frames, "crowd": asdict(crowd)})
    command = [sys.executable, "-m", "benchmarks.record", "--folder", folder, "--job", job]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=os.environ, check=False)
    if done.returncode:
        raise subprocess.CalledProcessError(done.returncode, command, done.stdout, done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def show(place: Place, rounds: list[dict[str, Line]], console: Console) -> None:
    """A table of medians; ratios to the first mode, of wall and of processor time, with the extremes of the former."""
    table = Table(
        "2048 people, water, " + place.name, "ms a frame", "ratio", "processor", "on host", "MB a frame", "MB/s"
    )
    for mode in MODES:
        lines = [each[mode.name] for each in rounds]
        bases = [each[MODES[0].name] for each in rounds]
        ratios, processor = (
            [line[key] / base[key] for line, base in zip(lines, bases, strict=True)] for key in ("wall_s", "cpu_s")
        )
        recorded = lines[0]["recorded"]
        host = {name: 1e3 * median(line["spent"][name] for line in lines) / recorded for name in lines[0]["spent"]}
        table.add_row(
            mode.name,
            f"{1e3 * median(line['wall_s'] for line in lines) / recorded:.1f}",
            f"{median(ratios):.3f} ({min(ratios):.3f}-{max(ratios):.3f})",
            f"{median(processor):.3f}",
            " ".join(f"{name} {value:.2f}" for name, value in host.items()),
            f"{lines[0]['raw_bytes'] / 1e6:.2f} -> {lines[0]['bytes'] / 1e6:.2f}",
            f"{median(line['bytes'] * recorded / line['wall_s'] for line in lines) / 1e6:.1f}",
        )
    console.print(table)


def main(
    place: Annotated[
        list[str] | None, typer.Option(help="Only this place (repeatable) [default: on processors]")
    ] = None,
    rounds: Annotated[int, typer.Option(min=1, help="Rounds of all modes.")] = 4,
    frames: Annotated[int, typer.Option(min=192, help="Frames to step.")] = 640,
    folder: Annotated[Path | None, typer.Option(help="Recordings go here, and are removed.")] = None,
    job: Annotated[str, typer.Option(hidden=True)] = "",
) -> None:
    """Time a crowd with and without its recording."""
    if job:
        read = json.loads(job)
        place_, mode = Place(**read["place"]), Mode(**read["mode"])
        print(json.dumps(measure(place_, mode, read["frames"], folder or Path(), Case(**read["crowd"]))))
        return
    with tempfile.TemporaryDirectory(prefix="crowd-record-", dir=folder) as out:
        _table(place, rounds, frames, out)


def _table(place: list[str] | None, rounds: int, frames: int, folder: str) -> None:
    """All modes at the places asked for."""
    console = Console() if sys.stdout.isatty() else Console(width=160)
    here = machine()
    console.print(f"{here['cpu']}, {here['cores']} cores, load {here['load_1min']}, jax {here['jax']}")
    for one in PLACES:
        if one.name in place if place else 0 < one.cores <= len(cores()):
            # every other round backwards: a machine that slows down while it works favours who comes first
            orders = [MODES[:: 1 if number % 2 else -1] for number in range(rounds)]
            try:
                done = [{mode.name: _process(one, mode, frames, folder) for mode in order} for order in orders]
            except subprocess.CalledProcessError as error:
                raise SystemExit(error.stderr) from None
            show(one, done, console)
    console.print(
        f"Milliseconds of a recorded frame, {RECORDED} a second, of two steps. processor: ratio of the time of all "
        "cores. on host: processor time of what the recording does there."
    )


if __name__ == "__main__":
    typer.run(main)
