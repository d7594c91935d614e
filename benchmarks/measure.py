"""One case in a process of its own, which `run.py` starts: `python -m benchmarks.measure JOB`, JOB as JSON.

The last line it prints is the measurement, as JSON. A process of its own because devices and cores can only be chosen
before JAX starts, because peak memory is the process's, and because a second process is what tells how fast a start
from the compile cache is (`JAX_COMPILATION_CACHE_DIR`: empty for the first, filled for the second).

On processors a case is confined to as many cores as it has devices before JAX starts, compiler included, so "one core"
is true. On a GPU it has all cores, for the compiler.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any, Literal

from benchmarks.cases import RATE, Case, scenario
from benchmarks.machine import peak_memory, pin


@dataclass(frozen=True)
class Job:
    """What to do with a case."""

    case: Case
    frames: int | None = None  # per timed run; None: enough for a run to last
    runs: int = 7  # 0: compile only
    profile: bool = True  # also time the stages
    platform: Literal["cpu", "gpu"] = "cpu"
    warm: bool = True  # also compiled again from the cache, by `run.py`
    reference: str | None = None  # address of what it is timed in turns with, see `reference.py`

    def text(self) -> str:
        """As JSON, for the command line."""
        return json.dumps(asdict(self))

    @staticmethod
    def read(text: str) -> Job:
        """The inverse of `text`."""
        fields = json.loads(text)
        case = fields.pop("case")
        case["herds"] = tuple((str(name), int(count)) for name, count in case["herds"])
        return Job(Case(**case), **fields)


def frames_for(count: int) -> int:
    """Frames of a timed run: 60, more for few characters so that starting a run does not weigh, fewer for very many."""
    if count > 16384:
        return max(10, RATE * 16384 // count)
    return RATE * max(1, min(8, 2048 // max(count, 1)))


def _begun(job: Job) -> list[int]:
    """Chooses cores and devices, before JAX starts; returns the cores."""
    pinned = pin(job.case.devices) if job.platform == "cpu" else []
    import jax

    from crowd import compile_cache, kept_memory

    kept_memory.keep()
    if job.platform == "cpu":
        jax.config.update("jax_platforms", "cpu")
        jax.config.update("jax_num_cpu_devices", job.case.devices)
    elif jax.default_backend() == "cpu":
        raise SystemExit("JAX finds no GPU here: it needs a plug-in of its own (jax[cuda13]) and a driver")
    compile_cache.enable()
    return pinned


def prepared(job: Job) -> Callable[[], float]:
    """Runs the case once whenever called, and returns microseconds per character-frame. Needs a fresh process, too."""
    _begun(job)
    frames = job.frames or frames_for(job.case.count)
    program, *_ = _compiled(job, frames)

    def once() -> float:
        nonlocal program
        program, wall, _ = _advanced(program, frames)
        return 1e6 * wall / (frames * job.case.count)

    return once


def measure(job: Job) -> dict[str, Any]:
    """Compiles the case, times it and returns the measurement. Chooses cores and devices: needs a fresh process."""
    pinned = _begun(job)
    import jax

    if job.case.gradient:
        from benchmarks.gradient import measured

        line = measured(job.case, job.runs)
        return line | {"pinned_cores": pinned, "peak_rss_bytes": peak_memory()}
    frames = job.frames or frames_for(job.case.count)
    program, line, layout = _compiled(job, frames)
    line |= {"pinned_cores": pinned, "device": jax.devices()[0].device_kind}
    if not job.runs:
        return line
    arguments, samples = _timed(program, job, frames)
    line |= samples | {"peak_rss_bytes": peak_memory()}
    if job.platform == "cpu":
        from benchmarks.sizes import sizes_of

        sizes = sizes_of((layout, *arguments[:3]), job.case.herds, job.case.depth)
        line["sizes"] = [asdict(each) for each in sizes]  # wet triangles: in the tiles of the first device
    if (held := jax.devices()[0].memory_stats()) is not None:  # processors do not say
        line["peak_device_bytes"] = held["peak_bytes_in_use"]
    if job.profile:
        from benchmarks.stages import shares

        profiled = max(1, min(RATE, 8192 // job.case.count)) if job.platform == "cpu" else 20
        line["stage_share"], line["instructions_per_frame"] = shares(layout, *arguments, frames=profiled)
    return line


def _compiled(job: Job, frames: int) -> tuple[Any, dict[str, Any], Any]:
    """([(executable, assets, params, states) of each device], seconds and bytes of the compiled program, layout)."""
    from crowd.build import build
    from crowd.one_compile import compiled_once
    from crowd.scene import load
    from crowd.simulate import compiled, dealt, to_go

    started = time.perf_counter()
    scene = load(scenario(job.case))
    program = build(scene, job.case.devices)
    shares = dealt(program, job.case.devices)
    built = time.perf_counter()
    run = compiled(program[0], -(-frames // RATE))
    lowered = [run.lower(*share, to_go(share, frames)) for share in shares]
    traced, processor = time.perf_counter(), time.process_time()
    executables = compiled_once(lowered)
    line = {
        "build_s": round(built - started, 3),
        "trace_s": round(traced - built, 3),
        "compile_s": round(time.perf_counter() - traced, 3),
        "compile_cpu_s": round(time.process_time() - processor, 3),
    }
    memory = executables[0].memory_analysis()
    if memory is not None:
        per = job.case.devices / job.case.count  # the program of one device
        line["temp_bytes_per_character"] = round(memory.temp_size_in_bytes * per, 1)
        line["argument_bytes_per_character"] = round(memory.argument_size_in_bytes * per, 1)
    return [(one, *share) for one, share in zip(executables, shares, strict=True)], line, program[0]


def _advanced(program: Any, frames: int) -> tuple[Any, float, float]:
    """(the program with the states after so many frames, seconds of wall time, and of processor time).

    Every device runs its share in a thread of its own, as `crowd.simulate.stream` does.
    """
    import jax

    from crowd.simulate import to_go

    def advance(one: Any) -> Any:
        executable, assets, params, states = one
        states, _ = jax.block_until_ready(executable(assets, params, states, to_go(one[1:], frames)))
        return executable, assets, params, states

    with ThreadPoolExecutor(len(program)) as pool:
        at, used = time.perf_counter(), time.process_time()
        program = list(pool.map(advance, program))
        return program, time.perf_counter() - at, time.process_time() - used


def _timed(program: Any, job: Job, frames: int) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """Runs the program once untimed, then `job.runs` times. Returns (what it can be called with next, samples)."""
    import numpy as np

    from benchmarks.reference import asked

    per = 1e6 / (frames * job.case.count)
    samples, references = [], []
    program, *_ = _advanced(program, frames)  # the first one fetches pages and walks the crowd in
    with asked(job.reference) as reference:
        for _ in range(job.runs):
            if reference is not None:
                references.append(reference())
            program, *seconds = _advanced(program, frames)
            samples.append(seconds)
    wall, processor = (per * np.array(samples)).T
    faults = sum(int(np.count_nonzero(np.asarray(state.fault))) for one in program for state in one[3])
    line = {
        "frames": frames,
        "runs": job.runs,
        "us": round(float(np.median(wall)), 4),
        "us_min": round(float(wall.min()), 4),
        "us_max": round(float(wall.max()), 4),
        "us_cpu": round(float(np.median(processor)), 4),  # of all cores together
        "frozen_by_a_fault": faults,
    }
    if references:
        line["over_reference"] = round(float(np.median(wall / np.array(references))), 4)
        line["reference_us"] = round(float(np.median(references)), 4)
    return program[0][1:], line


if __name__ == "__main__":
    print(json.dumps(measure(Job.read(sys.argv[1]))))
