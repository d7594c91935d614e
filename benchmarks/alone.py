"""The stages of a frame timed alone, against the frame: `python -m benchmarks.alone` prints it as JSON.

The step of a tile is traced, and what each stage does is cut out of the trace as a program of its own: it gets what the
stages before it gave to tiles of a walking crowd, and goes over these tiles as the frame does. A frame that takes much
longer than its stages together loses the rest between them: loops, copies, caches.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.cases import CASES, RATE, Case, scenario
from benchmarks.gradient import in_turns
from benchmarks.machine import pin
from benchmarks.stages import LOOPS, stage_of

CASE = "human-rigid-2048"
RUNS = 7


@dataclass(frozen=True)
class Part:
    """What one stage does to a tile."""

    stage: str
    jaxpr: Any  # from what all tiles share, then what is each tile's own
    shared: Sequence[Any]  # variables of the trace
    own: Sequence[Any]


def parts(jaxpr: Any, shared: int) -> list[Part]:
    """The stages of a traced step, in order; the first `shared` of its inputs are the same for all tiles.

    Equations outside any stage belong to none of them.
    """
    from jax.extend.core import Literal

    differs = set(jaxpr.invars[shared:])
    stages: dict[str, list[Any]] = {}
    for eqn in jaxpr.eqns:
        stages.setdefault(stage_of(str(eqn.source_info.name_stack)), []).append(eqn)
        if any(not isinstance(v, Literal) and v in differs for v in eqn.invars):
            differs.update(eqn.outvars)

    def used(eqns: Sequence[Any]) -> dict[Any, None]:
        return dict.fromkeys(v for eqn in eqns for v in eqn.invars if not isinstance(v, Literal))

    def part(stage: str, eqns: Sequence[Any]) -> Part:
        made = {v for eqn in eqns for v in eqn.outvars}
        others = [eqn for name, each in stages.items() if name != stage for eqn in each]
        wanted = used(others) | dict.fromkeys(v for v in jaxpr.outvars if not isinstance(v, Literal))
        given = [v for v in used(eqns) if v not in made]
        same, own = [v for v in given if v not in differs], [v for v in given if v in differs]
        out = [v for v in wanted if v in made]
        whole = dict(constvars=[], invars=[*same, *own], outvars=out, eqns=list(eqns))
        return Part(stage, jaxpr.replace(**whole, debug_info=jaxpr.debug_info.with_unknown_names()), same, own)

    return [part(stage, eqns) for stage, eqns in stages.items() if stage != LOOPS]


def measure(case: Case, frames: int = RATE, runs: int = RUNS) -> dict[str, Any]:
    """µs per character-frame of the frame and of every stage alone, in turns, for the first herd of a case."""
    import jax
    import numpy as np

    from crowd.build import build
    from crowd.scene import load
    from crowd.simulate import compiled, dealt
    from crowd.step import step
    from kernels.wall import apart

    program = build(load(scenario(case)), 1)
    layout = program[0]
    assets, params, states = dealt(program, 1)[0]
    run, left = compiled(layout, -(-frames // RATE)), np.int32(frames)
    states = run(assets, params, states, left)[0]
    pairs = jax.tree.map(jax.numpy.copy, (params.characters[0], states[0]))  # the frame overwrites its own

    def tile(shared: Any, pair: Any) -> Any:
        (assets, params), (character, state) = shared, pair
        return step(layout, 0, assets.herds[0], assets.world, params, character, state, apart)

    traced = jax.make_jaxpr(tile)((assets, params), jax.tree.map(lambda x: x[0], pairs))
    same, own = jax.tree.leaves((assets, params)), jax.tree.leaves(pairs)
    stages = parts(traced.jaxpr, len(same))
    calls = [_call(part, *_given(traced, part, same, own), frames) for part in stages]

    def frame() -> Any:
        nonlocal states
        states, shown = run(assets, params, states, left)
        return shown

    wall = 1e6 * np.array(in_turns([frame, *calls], runs)[0]) / (frames * case.count)
    return {
        "kind": "alone",
        "case": case.name,
        "us": round(float(np.median(wall[:, 0])), 4),
        "alone_us": dict(
            zip((part.stage for part in stages), np.median(wall[:, 1:], 0).round(4).tolist(), strict=True)
        ),
        "frame_over_alone": round(float(np.median(wall[:, 0] / wall[:, 1:].sum(1))), 3),
    }


def _given(traced: Any, part: Part, same: list[Any], own: list[Any]) -> tuple[list[Any], list[Any]]:
    """Values of what a part gets: shared, and of all tiles."""
    import jax
    from jax import core

    def values(wanted: Sequence[Any], own: Sequence[Any]) -> list[Any]:
        asked = traced.jaxpr.replace(outvars=list(wanted), debug_info=traced.jaxpr.debug_info.with_unknown_names())
        return core.eval_jaxpr(asked, traced.consts, *same, *own)

    shared = jax.jit(lambda own: values(part.shared, own))([x[0] for x in own])
    return shared, jax.jit(lambda own: jax.lax.map(lambda own: values(part.own, own), own))(own)


def _call(part: Part, shared: list[Any], own: list[Any], times: int) -> Callable[[], Any]:
    """All tiles through a part, `times` over."""
    import jax
    import jax.numpy as jnp
    from jax import core

    from crowd.compiler_options import options

    def tiles(shared: Any, own: Any) -> Any:
        def one(_: Any, own: Any) -> Any:
            return tuple(core.eval_jaxpr(part.jaxpr, (), *shared, *own)), None

        start = tuple(jnp.zeros(v.aval.shape, v.aval.dtype) for v in part.jaxpr.outvars)
        return jax.lax.fori_loop(0, times, lambda _, last: jax.lax.scan(one, last, own)[0], start)

    compiled = jax.jit(tiles, compiler_options=options()).lower(shared, own).compile()
    return lambda: compiled(shared, own)


def main() -> None:
    """Measures on one core, in this process."""
    pinned = pin(1)
    import jax

    from crowd import compile_cache

    jax.config.update("jax_platforms", "cpu")
    compile_cache.enable()
    case = next(case for case in CASES if case.name == CASE)
    print(json.dumps(measure(case) | {"pinned_cores": pinned}))


if __name__ == "__main__":
    main()
