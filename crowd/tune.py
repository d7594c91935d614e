"""`crowd tune`: the command around `crowd.tuning`, from a tune file to a folder of fitted constants."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crowd import compile_cache
from crowd.errors import fail
from crowd.output_folder import refuse_foreign


@dataclass(frozen=True)
class Request:
    """What the command line asks for."""

    config: Path
    out: Path | None = None  # default: runs/NAME
    resume: bool = False
    overrides: tuple[str, ...] = ()


def run_tune(request: Request) -> Path:
    """Search into a folder, which is returned. The search is kept after every iteration, whatever comes after."""
    from crowd.tuning import config, outcome, run
    from crowd.tuning.evaluation import Evaluation
    from crowd.tuning.fit import Search

    problem = config.load(request.config, request.overrides)
    out = request.out or Path("runs") / problem.tune.name
    refuse_foreign(out, "search", outcome.FITTED, outcome.KEPT)
    kept = out / outcome.KEPT
    if request.resume and not kept.is_file():
        raise fail("--resume", f"{kept} is not there")
    compile_cache.enable()
    began = time.monotonic()
    ready: list[Evaluation] = []

    def on_ready(evaluation: Evaluation) -> None:
        ready.append(evaluation)
        names = ", ".join(one.name for one in evaluation.free)
        print(f"{problem.tune.name}: {problem.tune.starts.count} starts, {len(evaluation.targets)} targets")
        print(f"free: {names}")
        print("compiling the gradient, a minute or two", flush=True)

    def on_iteration(search: Search, number: int, of: int) -> None:
        out.mkdir(parents=True, exist_ok=True)
        run.save(kept, search, ready[0])
        good = int((np.abs(search.residual) <= 1.0).all(1).sum())
        worst = np.abs(search.residual[search.best]).max()
        sys.stderr.write(
            f"iteration {number}/{of}  best cost {search.cost[search.best]:.4g}, worst residual {worst:.2f}  "
            f"{good}/{len(search.cost)} starts good  {time.monotonic() - began:.0f} s\n"
        )
        sys.stderr.flush()

    found = run.tune(request.config, request.overrides, kept if request.resume else None, on_iteration, on_ready)
    files = outcome.write(out, found)
    print("\n".join(outcome.lines(found)))
    print(f"gradient memory {found.evaluation.memory / 1e6:.0f} MB, {found.seconds:.0f} s in all")
    for name, path in files.items():
        print(f"{name:<12} {path}")
    return out
