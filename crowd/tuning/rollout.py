"""Rollouts of which the gradient is taken: every start of the search and every character is one lane of a tile.

Lanes are characters, start after start; a free number is an array over lanes. One pull-back per quantity gives the
derivative of every lane's quantity by every free number of that lane, since lanes do not meet.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from crowd.assets import Assets
from crowd.build import Program
from crowd.compiler_options import options
from crowd.layout import TILE, Layout
from crowd.params import Params
from crowd.state import State
from crowd.step import remembered, step
from crowd.tuning import parameters, quantities
from crowd.tuning.parameters import Free
from kernels.wall import apart, no_wall


class Plan(NamedTuple):
    """What is stepped and measured. Hashable: the program is compiled once for it."""

    layout: Layout
    which: int  # herd
    free: tuple[tuple[str | int, ...], ...]  # ways to the free numbers
    quantities: tuple[str, ...]
    settle: int  # frames without gradient
    lead: int  # frames with gradient, not measured
    window: int  # measured frames


class Lanes(NamedTuple):
    """A herd's characters, `starts` times over."""

    assets: Assets
    params: Params  # of which `characters` are the lanes'
    state: State


def lanes(program: Program, which: int, starts: int) -> Lanes:
    """Lanes of a herd of a program that was built with one tile as wide as the herd's count."""
    _, assets, params, states = program
    count = states[which].phase.shape[-1]
    index = np.tile(np.arange(count), starts)

    def spread(tree: Any) -> Any:
        return jax.tree.map(lambda leaf: leaf[0][..., index], tree)

    characters = tuple(spread(c) if herd == which else c for herd, c in enumerate(params.characters))
    return Lanes(assets, dataclasses.replace(params, characters=characters), spread(states[which]))


def starts_at_once(count: int) -> int:
    """How many starts share a tile with so many characters each."""
    return max(1, TILE // count)


def measured(plan: Plan, given: Lanes, free: Sequence[Array]) -> Array:
    """[quantities, n] of a rollout with the free numbers [n]; derivatives reach back to the end of the settling."""
    params = wide(parameters.put(given.params, dict(zip(plan.free, free, strict=True))))
    wall = apart if plan.layout.walls else no_wall
    herd, world = given.assets.herds[plan.which], given.assets.world

    def frame(state: State) -> State:
        return step(plan.layout, plan.which, herd, world, params, params.characters[plan.which], state, wall)[0]

    def settled(state: State, _: None) -> tuple[State, None]:
        return frame(state), None

    def seen(state: State, _: None) -> tuple[State, dict[str, Array]]:
        state = remembered(frame)(state)
        return state, quantities.signals(state)

    state, _ = jax.lax.scan(settled, given.state, None, length=plan.settle)
    state, signal = jax.lax.scan(seen, jax.lax.stop_gradient(state), None, length=plan.lead + plan.window)
    signal = {name: values[plan.lead :] for name, values in signal.items()}
    hann = np.hanning(plan.window + 2)[1:-1]
    window, time = jnp.asarray(hann / hann.sum(), np.float32), jnp.arange(plan.window) * plan.layout.dt
    return jnp.stack([quantities.over_window(name, signal, window, time) for name in plan.quantities])


def wide(params: Params) -> Params:
    """Numbers of regions with an axis for the characters: some of them may differ from character to character."""
    names = ("density", "drag_override", "offset_override", "surface")
    leaves = {name: getattr(params.fluids, name) for name in names}
    changed = {name: leaf[:, None] if leaf.ndim == 1 else leaf for name, leaf in leaves.items()}
    return dataclasses.replace(params, fluids=dataclasses.replace(params.fluids, **changed))


def _with_slopes(plan: Plan, given: Lanes, free: tuple[Array, ...]) -> tuple[Array, Array]:
    """Quantities [q, n] and their derivatives [q, parameters, n]."""
    found, pull = jax.vjp(lambda free: measured(plan, given, free), free)
    rows = []
    for number in range(len(plan.quantities)):
        (slopes,) = pull(jnp.zeros_like(found).at[number].set(1.0))
        rows.append(jnp.stack(slopes))
    return found, jnp.stack(rows)


@functools.lru_cache(maxsize=8)
def _jitted(plan: Plan) -> Any:
    return jax.jit(functools.partial(_with_slopes, plan), compiler_options=options(one_function=False))


_programs: dict[tuple[Any, ...], tuple[Any, int]] = {}


def compiled(plan: Plan, given: Lanes, free: tuple[np.ndarray, ...]) -> tuple[Any, int]:
    """The program (lanes, free) -> (quantities, derivatives), and the bytes it needs beside those."""
    key = (plan, free[0].shape)
    if key not in _programs:
        program = _jitted(plan).lower(given, free).compile()
        memory = program.memory_analysis()
        _programs[key] = program, int(memory.temp_size_in_bytes) if memory is not None else 0
    return _programs[key]


def plan_of(
    layout: Layout, which: int, free: Sequence[Free], quantities: Sequence[str], seconds: tuple[float, float, float]
) -> Plan:
    """The plan of a layout; seconds: settling, lead and window."""
    frames = [round(length / layout.dt) for length in seconds]
    ways = tuple(one.steps for one in free)
    return Plan(layout, which, ways, tuple(quantities), frames[0], frames[1], max(frames[2], 1))
