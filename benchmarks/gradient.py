"""A gradient against the run it is of: the derivative of a loss on a rollout by every number of `Params`."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from benchmarks.cases import RATE, Case, scenario


def measured(case: Case, runs: int) -> dict[str, Any]:
    """Compiles `case.gradient` frames forward and backward and times both, in turns. Needs devices chosen already.

    `us` is the gradient's time per character-frame (it contains a forward run), `over_forward` what it is times the
    run without derivatives. runs: 0 to compile only.
    """
    import jax
    import numpy as np

    import crowd
    from crowd.compiler_options import options

    started = time.perf_counter()
    roll = crowd.rollout(crowd.load(scenario(case)), case.gradient / RATE)

    def loss(params: Any, start: Any) -> jax.Array:
        shown, _ = roll(params, start, lambda states, frames: states[0].velocity)
        return (shown**2).mean()

    built = time.perf_counter()
    gradient = jax.jit(jax.value_and_grad(loss, allow_int=True), compiler_options=options()).lower(
        roll.params, roll.start
    )
    traced, processor = time.perf_counter(), time.process_time()
    backward = gradient.compile()
    line: dict[str, Any] = {
        "gradient_frames": case.gradient,
        "build_s": round(built - started, 3),
        "trace_s": round(traced - built, 3),
        "compile_s": round(time.perf_counter() - traced, 3),
        "compile_cpu_s": round(time.process_time() - processor, 3),
    }
    memory = backward.memory_analysis()
    if memory is not None:
        line["temp_bytes_per_character"] = round(memory.temp_size_in_bytes / case.count, 1)
    if not runs:
        return line
    forward = jax.jit(loss, compiler_options=options()).lower(roll.params, roll.start).compile()
    if not all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(backward(roll.params, roll.start)[1]) if leaf.size):
        raise SystemExit("the gradient is not finite")
    wall, used = in_turns([lambda: forward(roll.params, roll.start), lambda: backward(roll.params, roll.start)], runs)
    per = 1e6 / (case.gradient * case.count)
    median = np.median(np.array(wall), 0)
    return line | {
        "frames": case.gradient,
        "runs": runs,
        "us": round(float(median[1]) * per, 4),
        "us_min": round(min(both[1] for both in wall) * per, 4),
        "us_max": round(max(both[1] for both in wall) * per, 4),
        "us_cpu": round(float(np.median(np.array(used), 0)[1]) * per, 4),
        "forward_us": round(float(median[0]) * per, 4),
        "over_forward": round(float(np.median([back / ahead for ahead, back in wall])), 3),
    }


def in_turns(calls: list[Callable[[], Any]], runs: int) -> tuple[list[list[float]], list[list[float]]]:
    """Seconds of wall time and of processor of every call, `runs` times one after the other, the first time untimed."""
    import jax

    wall, used = [], []
    for run in range(runs + 1):
        seconds, processor = [], []
        for call in calls:
            at, before = time.perf_counter(), time.process_time()
            jax.block_until_ready(call())
            seconds.append(time.perf_counter() - at)
            processor.append(time.process_time() - before)
        if run:
            wall.append(seconds)
            used.append(processor)
    return wall, used
