"""How long `crowd run` takes to its first frames, without and with compiled programs in the cache."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from benchmarks.machine import ROOT

SCENARIO = ROOT / "configs" / "wade.yaml"
PATIENCE = 300.0  # s


def start() -> dict[str, Any]:
    """Starts the shipped scenario twice with an empty cache, on all cores, as a user would."""
    with tempfile.TemporaryDirectory(prefix="crowd-start-") as folder:
        cold, warm = (_timed(Path(folder), f"out{run}") for run in range(2))
    line = {"cold_s": cold[0], "cold_cpu_s": cold[1], "warm_s": warm[0], "warm_cpu_s": warm[1]}
    return {"kind": "start", "scenario": SCENARIO.stem} | {name: round(value, 2) for name, value in line.items()}


def _timed(folder: Path, out: str) -> tuple[float, float]:
    """Seconds to the first frames, and of processor time until the command had been stopped."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = first_frames(SCENARIO, folder, folder / out)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return seconds, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def first_frames(scenario: Path, cache: Path, out: Path) -> float:
    """Seconds from starting the command to its first line of progress (the first chunk has been recorded).

    The command is then interrupted. Raises RuntimeError when it ends before.
    """
    command = [sys.executable, "-m", "crowd", "run", str(scenario), "--out", str(out)]
    environment = os.environ | {"JAX_COMPILATION_CACHE_DIR": str(cache / "cache")}
    began = time.perf_counter()
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=ROOT, env=environment
    )
    timer = threading.Timer(PATIENCE, process.kill)
    timer.start()
    told: list[str] = []
    try:
        for line in process.stderr or ():
            if line.startswith("frame "):
                return time.perf_counter() - began
            told.append(line)
        raise RuntimeError(f"crowd run ended before its first frame:\n{''.join(told[-20:])}")
    finally:
        timer.cancel()
        process.send_signal(signal.SIGINT)
        process.communicate()
