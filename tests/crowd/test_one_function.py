"""A step is compiled to one function: no stage of it stands outside, where XLA would run it kernel by kernel."""

from __future__ import annotations

import re
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import crowd
from crowd.build import build
from crowd.compiler_options import options
from crowd.scene import load
from crowd.simulate import compiled, dealt, to_go
from kernels.one_function import MARK
from kernels.wall import Wall, apart, no_wall
from tests.crowd.scenes import herd, scenario

QUICKLY: dict[str, Any] = {"xla_backend_optimization_level": 0}  # what is a function is known before that counts
RUBBLE = {"ground": {"kind": "rubble", "amplitude_m": 0.1, "cell_m": 0.4}}
CALM = {"every": 2, "calm_m_s2": 0.5}
STEPS = {
    "people, footsteps": scenario([herd("a", "human", 3)], 0.8),
    "people of many tiles": scenario([herd("a", "human", 300)], 0.8, record={"rate_hz": 60, "pose": True}),
    "people, skinned": scenario([herd("a", "human", 3)], 0.8, drag={"mesh": "skinned"}),
    "people, strides": scenario([herd("a", "human", 3)], 0.8, gait="semi_procedural", **RUBBLE),
    "people, clip": scenario([herd("a", "human", 3)], 0.8, gait="clip"),
    "people who take turns": scenario([herd("a", "human", 3, detail=CALM)], 0.8),
    "spiders, strides": scenario([herd("a", "spider", 3)], 0.3, gait="semi_procedural", **RUBBLE),
    "two herds, dry": scenario([herd("a", "dog", 3), herd("b", "hexapod", 3)]),
}
GRADIENTS = {name: STEPS[name] for name in ("people, footsteps", "people, skinned")}


def compiled_quickly(lowered: Any) -> str:
    """The text of a program all of whose loops are functions."""
    return lowered.compile(compiler_options={**options(), **QUICKLY}).as_text()


def outside(text: str) -> list[str]:
    """Walls and loops of a compiled program's text that are in no function, reading down from its entry."""
    bodies = dict(re.findall(r"^(?:ENTRY )?%?([\w.\-]+) \(.*?\) -> .*? \{\n(.*?)\n\}", text, re.M | re.S))
    entry = re.search(r"^ENTRY %?([\w.\-]+)", text, re.M)
    assert entry is not None
    assert MARK in text
    found, to_read = [], [entry[1]]
    while to_read:
        for line in bodies[to_read.pop()].splitlines():
            if MARK not in line:
                found += [line.strip()] if re.search(r" (while|call|conditional)\(", line) else []
                to_read += re.findall(r"(?:to_apply|body|condition|\w+_computation)=%?([\w.\-]+)", line)
    return found


@pytest.mark.parametrize("name", STEPS)
def test_a_run(name: str) -> None:
    """Only the loops over tiles, frames and steps of a frame are outside."""
    program = build(load(STEPS[name]))
    share = dealt(program, 1)[0]
    lowered = compiled(program[0], 4).lower(*share, to_go(share, 8))
    found = outside(lowered.compile(compiler_options=QUICKLY).as_text())
    assert [line for line in found if " while(" not in line] == []
    assert len(found) <= 4 * len(program[0].herds)


@pytest.mark.parametrize("name", GRADIENTS)
def test_a_gradient(name: str) -> None:
    """Its loops are functions whole."""
    roll = crowd.rollout(load(GRADIENTS[name]), 0.1)

    def loss(params: Any, start: Any) -> jax.Array:
        return (roll(params, start, lambda states, frames: states[0].velocity)[0] ** 2).mean()

    lowered = jax.jit(jax.grad(loss, allow_int=True)).lower(roll.params, roll.start)
    found = outside(compiled_quickly(lowered))
    assert [line for line in found if " while(" in line] == []


def test_a_loop_by_itself_is_found() -> None:
    """The test can fail: a loop that stays one, beside one that is a function."""

    @jax.jit
    def both(x: jax.Array) -> jax.Array:
        x = jax.lax.fori_loop(0, x.astype(int)[0], lambda i, x: x + 1.0, x)
        return jax.lax.fori_loop(0, x.astype(int)[1], lambda i, x: jnp.sort(x) + 1.0, x)

    found = outside(compiled_quickly(both.lower(jnp.arange(2000.0))))
    assert len([line for line in found if " while(" in line]) == 1


INDEX = np.array([2, 0, 1])


def picky(x: jax.Array, unused: jax.Array, wall: Wall) -> dict[str, jax.Array]:
    """Of `unused` XLA sees that nothing depends on it; the index is a constant."""
    both = wall(lambda x, y: jnp.stack([x, y]), x, unused)
    return {"a": wall(lambda both: 2.0 * both[0], both)[INDEX], "passed": unused}


def sorted_too(x: jax.Array, unused: jax.Array, wall: Wall) -> dict[str, jax.Array]:
    return {"a": jnp.sort(picky(x, unused, wall)["a"]), "passed": unused}


@pytest.mark.parametrize(("stage", "one"), [(picky, True), (sorted_too, False)], ids=["arguments unused", "sorts"])
def test_a_stage_as_a_function(stage: Any, one: bool) -> None:
    """It gives the same, whatever it does not need; what cannot be a function, here a sort, stays as it is."""

    def run(wall: Wall, x: jax.Array, unused: jax.Array) -> Any:
        def turn(_: Any, x: jax.Array) -> jax.Array:
            return wall.as_function(lambda x, y: stage(x, y, wall), x, unused)["a"]

        return jax.lax.fori_loop(0, 3, turn, x), wall.as_function(lambda x, y: stage(x, y, wall), x, unused)

    x, unused = jnp.array([3.0, 1.0, 2.0]), jnp.arange(3.0)
    walled = jax.jit(lambda *given: run(apart, *given), compiler_options=options(one_function=False))
    assert (MARK in walled.lower(x, unused).as_text(debug_info=False)) == one
    for found, right in zip(jax.tree.leaves(walled(x, unused)), jax.tree.leaves(run(no_wall, x, unused)), strict=True):
        np.testing.assert_array_equal(found, right)


def test_a_function_has_derivatives() -> None:
    """In both directions, and mapped."""

    def loss(wall: Wall, x: jax.Array) -> jax.Array:
        return (wall.as_function(lambda x: jnp.sin(wall(lambda x: x * x, x)), x) ** 2).sum()

    x = jnp.array([[0.3, 1.0], [-2.0, 0.1]])
    for way in (jax.grad, jax.jacfwd, lambda f: jax.vmap(jax.grad(f))):
        found, right = (jax.jit(way(lambda x, wall=wall: loss(wall, x)))(x) for wall in (apart, no_wall))
        np.testing.assert_allclose(found, right, rtol=1e-6)


def test_behind_a_closed_gate_it_is_left_out() -> None:
    closed = jax.jit(lambda x, flag: apart.gate(flag).as_function(lambda x: 2.0 * x, x))
    assert closed(jnp.ones(3), False).tolist() == [0, 0, 0]
    assert closed(jnp.ones(3), True).tolist() == [2, 2, 2]
