"""Where the time of a frame goes: the whole program under JAX's profiler, summed by the stage of the step.

Every instruction of the compiled text carries the path of named scopes it came from, and the profiler times every
instruction as it runs. An instruction's own time is its duration less that of the instructions inside it (loops and
walls contain others), so own times add up to the whole. On a CPU all instructions of a step are one function, in which
the profiler sees nothing; the program is compiled anew for it, with a kernel for each. That, and the profiler itself,
slow the program down, most where instructions are many and short; so only shares are returned, and they are
approximate.
"""

from __future__ import annotations

import dataclasses
import re
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

STAGES = ("sense", "steer", "forces", "body", "gait", "pose", "feet", "arms", "skin", "drag", "record")
LOOPS = "loops"  # scanning over frames, mapping over tiles, moving states in and out of them

_INSTRUCTION = re.compile(r"^\s+(?:ROOT )?%?(?P<name>[\w.\-]+) = .*?op_name=\"(?P<path>[^\"]*)\"", re.MULTILINE)


class Event(NamedTuple):
    """One instruction as it ran."""

    name: str
    start: float  # ns
    duration: float  # ns


def stage_of(path: str) -> str:
    """Stage of an instruction from its path of scopes, e.g. "jit(rollout)/while/body/closed_call/skin/jit(wall)", or
    "jit(rollout)/while/body/eval_jaxpr/while/body/vmap(skin)/add" where all tiles are stepped at once.

    The innermost stage counts: skin/drag is drag.
    """
    parts = [part.removeprefix("vmap(").removesuffix(")") for part in path.split("/")]
    stages = [part for before, part in pairwise(("", *parts)) if part in STAGES and before != "while"]  # not while/body
    return stages[-1] if stages else LOOPS


def instruction_stages(text: str) -> dict[str, str]:
    """Stage of every instruction of a compiled program's text that says where it came from, by its name and by that of
    the kernel that a GPU makes of it. What lies in a called function does not say it, but its call does."""
    found = ((match["name"], match["path"]) for match in _INSTRUCTION.finditer(text))
    stages = {name: stage_of(path) for name, path in found if path.startswith("jit(")}
    return {re.sub(r"[.-]", "_", name): stage for name, stage in stages.items()} | stages


def own_times(events: Iterable[Event], stages: Mapping[str, str]) -> dict[str, float]:
    """ns by stage on one thread. Instructions of no known origin (copies), and the runtime's own events, count with
    the instruction around them; what has none around it is not the program's."""
    total: dict[str, float] = defaultdict(float)
    above: list[tuple[float, str | None]] = []  # (end, stage) of the events we are inside of
    for event in sorted(events, key=lambda event: (event.start, -event.duration)):
        while above and above[-1][0] <= event.start:
            above.pop()
        around = above[-1][1] if above else None
        stage = stages.get(event.name, around)
        if stage is not None:
            total[stage] += event.duration
        if around is not None:
            total[around] -= event.duration
        above.append((event.start + event.duration, stage))
    return total


def shares(layout: Any, assets: Any, params: Any, states: Any, frames: int) -> tuple[dict[str, float], float]:
    """Share of every stage in the time of `frames` frames, adding up to 1, and how many instructions of a stage (on a
    GPU: kernels) run in a frame; empty and 0 where the profiler shows nothing.

    All but the frames: of a `crowd.build.Program`. The states are donated.
    """
    import jax
    import jax.numpy as jnp

    from crowd.simulate import compiled

    count = jnp.asarray(frames, jnp.int32)
    run = compiled(dataclasses.replace(layout, as_functions=False), -(-frames // layout.record_every))
    executable = run.lower(assets, params, states, count).compile()
    stages = instruction_stages(executable.as_text())
    options = jax.profiler.ProfileOptions()
    options.python_tracer_level = 0
    with tempfile.TemporaryDirectory(prefix="crowd-profile-") as folder:
        with jax.profiler.trace(folder, profiler_options=options):
            jax.block_until_ready(executable(assets, params, states, count))
        file = next(Path(folder).rglob("*.xplane.pb"))
        total, count = sum_lines(jax.profiler.ProfileData.from_file(str(file)), stages)
    whole = sum(total.values())
    if not whole > 0:
        return {}, 0.0
    return {name: round(total[name] / whole, 4) for name in (*STAGES, LOOPS) if name in total}, count / frames


def sum_lines(profile: Any, stages: Mapping[str, str]) -> tuple[dict[str, float], int]:
    """(ns by stage, number of instructions), of all threads of a profile; of a GPU's streams where there is one."""
    total: dict[str, float] = defaultdict(float)
    count = 0
    planes = list(profile.planes)
    streams = [plane for plane in planes if "/device:GPU" in plane.name]
    for plane in streams or planes:
        for line in plane.lines:
            events = [Event(_instruction(event), event.start_ns, event.duration_ns) for event in line.events]
            count += sum(stages.get(event.name, LOOPS) != LOOPS for event in events)
            for stage, time in (_kernel_times if streams else own_times)(events, stages).items():
                total[stage] += time
    return total, count


def _kernel_times(events: Iterable[Event], stages: Mapping[str, str]) -> dict[str, float]:
    """ns by stage on a GPU's stream: kernels may overlap, none is inside another; copies belong to the loops."""
    total: dict[str, float] = defaultdict(float)
    for event in events:
        total[stages.get(event.name, LOOPS)] += event.duration
    return total


def _instruction(event: Any) -> str:
    """Name of the instruction that an event is. A GPU's kernel tells whose it is, unless it runs as part of a graph;
    then its own name is the instruction's, with other signs."""
    own = next((str(value) for key, value in event.stats if key == "hlo_op"), event.name)
    return event.name if own.startswith("command_buffer") else own
