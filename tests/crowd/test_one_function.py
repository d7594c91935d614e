"""Every loop of a compiled step is one function: nothing in it makes XLA run it kernel by kernel."""

from __future__ import annotations

import functools
import re
from typing import Any

import jax
import pytest

import crowd
from crowd.advance import rollout
from crowd.build import build
from crowd.compiler_options import options
from crowd.scene import load
from crowd.simulate import dealt, to_go
from tests.crowd.scenes import herd, scenario

QUICKLY: dict[str, Any] = {"xla_backend_optimization_level": 0}  # loops are put into functions before that counts
RUBBLE = {"ground": {"kind": "rubble", "amplitude_m": 0.1, "cell_m": 0.4}}
STEPS = {
    "people, footsteps": scenario([herd("a", "human", 3)], 0.8),
    "people of many tiles": scenario([herd("a", "human", 300)], 0.8, record={"rate_hz": 60, "pose": True}),
    "people, skinned": scenario([herd("a", "human", 3)], 0.8, drag={"mesh": "skinned"}),
    "people, strides": scenario([herd("a", "human", 3)], 0.8, gait="semi_procedural", **RUBBLE),
    "people, clip": scenario([herd("a", "human", 3)], 0.8, gait="clip"),
    "spiders, strides": scenario([herd("a", "spider", 3)], 0.3, gait="semi_procedural", **RUBBLE),
    "two herds, dry": scenario([herd("a", "dog", 3), herd("b", "hexapod", 3)]),
}
GRADIENTS = {name: STEPS[name] for name in ("people, footsteps", "people, skinned")}


def loops_outside(lowered: Any) -> list[str]:
    """Loops of a program, compiled quickly, that are called from no function, reading down from its entry."""
    text = lowered.compile(compiler_options={**options(), **QUICKLY}).as_text()
    bodies = dict(re.findall(r"^(?:ENTRY )?%?([\w.\-]+) \(.*?\) -> .*? \{\n(.*?)\n\}", text, re.M | re.S))
    entry = re.search(r"^ENTRY %?([\w.\-]+)", text, re.M)
    assert entry is not None
    assert "xla_cpu_small_call" in text
    found, to_read = [], [entry[1]]
    while to_read:
        for line in bodies[to_read.pop()].splitlines():
            if " while(" in line:
                found.append(line.strip())
            if "xla_cpu_small_call" not in line:
                to_read += re.findall(r"(?:to_apply|body|condition|\w+_computation)=%?([\w.\-]+)", line)
    return found


@pytest.mark.parametrize("name", STEPS)
def test_a_run(name: str) -> None:
    program = build(load(STEPS[name]))
    share = dealt(program, 1)[0]
    run = jax.jit(functools.partial(rollout, program[0], 4))
    assert loops_outside(run.lower(*share, to_go(share, 8))) == []


@pytest.mark.parametrize("name", GRADIENTS)
def test_a_gradient(name: str) -> None:
    roll = crowd.rollout(load(GRADIENTS[name]), 0.1)

    def loss(params: Any, start: Any) -> jax.Array:
        return (roll(params, start, lambda states, frames: states[0].velocity)[0] ** 2).mean()

    lowered = jax.jit(jax.grad(loss, allow_int=True)).lower(roll.params, roll.start)
    assert loops_outside(lowered) == []


def test_a_loop_by_itself_is_found() -> None:
    """The test can fail: a loop that stays one, beside one that is a function."""

    @jax.jit
    def both(x: jax.Array) -> jax.Array:
        x = jax.lax.fori_loop(0, x.astype(int)[0], lambda i, x: x + 1.0, x)
        return jax.lax.fori_loop(0, x.astype(int)[1], lambda i, x: jax.numpy.sort(x) + 1.0, x)

    assert len(loops_outside(both.lower(jax.numpy.arange(2000.0)))) == 1
