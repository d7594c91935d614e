"""Any loss on a rollout: a pure function of `Params` that JAX differentiates, maps and compiles."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax

from crowd.advance import one_frame
from crowd.assets import Assets
from crowd.build import build
from crowd.errors import fail
from crowd.layout import Layout
from crowd.params import Params
from crowd.scene import Scene
from crowd.tree import pytree

Read = Callable[[tuple[Any, ...], tuple[Any, ...]], Any]


@pytree
class Start:
    """What a rollout begins from, beside the numbers: arrays of the scene, and the states."""

    assets: Assets
    states: tuple[Any, ...]  # a `State` per herd, then the `Water` where there is one; [tiles, ..., n]


@dataclass(frozen=True)
class Rollout:
    """Steps of a scene as a function; see `rollout`."""

    layout: Layout
    params: Params  # as the scene says
    start: Start
    frames: int
    settle: int
    block: int

    def __call__(self, params: Params, start: Start, read: Read) -> tuple[Any, Start]:
        """What `read` gives after each frame, stacked [frames, ...], and where the rollout ends.

        read(states, frames): a pytree of arrays out of a `crowd.state.State` and a `crowd.state.Frame` of each herd,
        [tiles, ..., n]; padding repeats the first character. Derivatives do not reach into the frames of settling.
        Pass `start` through `jax.jit` as an argument: arrays that it encloses become constants of the program. With
        `compiler_options=crowd.compiler_options.options()` frames have the bits, and the speed, of a plain run.
        """

        def settled(states: tuple[Any, ...], _: None) -> tuple[tuple[Any, ...], None]:
            return one_frame(self.layout, start.assets, params, states)[0], None

        def seen(states: tuple[Any, ...], _: None) -> tuple[tuple[Any, ...], Any]:
            states, frames = one_frame(self.layout, start.assets, params, states, remember=True)
            return states, jax.checkpoint(read)(states, frames)

        def blocks(states: tuple[Any, ...], _: None) -> tuple[tuple[Any, ...], Any]:
            return jax.checkpoint(lambda states: jax.lax.scan(seen, states, None, length=self.block))(states)

        states, _ = jax.lax.scan(settled, start.states, None, length=self.settle)
        states = jax.lax.stop_gradient(states) if self.settle else states
        if self.block == 1:
            states, shown = jax.lax.scan(seen, states, None, length=self.frames)
        else:
            states, shown = jax.lax.scan(blocks, states, None, length=self.frames // self.block)
            shown = jax.tree.map(lambda leaf: leaf.reshape(self.frames, *leaf.shape[2:]), shown)
        return shown, dataclasses.replace(start, states=states)


def rollout(scene: Scene, seconds: float, settle_s: float = 0.0, block: int = 1) -> Rollout:
    """A rollout of `seconds` after `settle_s` that are stepped without derivatives.

    Every frame is a checkpoint: a backward pass keeps the states (about 2 kB per character and frame) and steps each
    frame again. block: frames that form a checkpoint together; about the root of their number keeps least, at the price
    of stepping once more. Raises `InputError` for lengths that do not fit.
    """
    rate = scene.scenario.rate_hz
    frames, settle = round(seconds * rate), round(settle_s * rate)
    if frames < 1 or settle < 0:
        raise fail("seconds", f"{seconds:g} after {settle_s:g}: at least a frame of 1/{rate} s must be left")
    if block < 1 or frames % block:
        near = min((n for n in range(1, frames + 1) if frames % n == 0), key=lambda n: abs(n - block))
        raise fail("block", f"{block}: must divide the {frames} frames, e.g. {near}")
    if scene.water is not None:
        raise fail("world.water", "a water surface that the crowd moves has no rollout with derivatives")
    for index, herd in enumerate(scene.herds):
        if herd.model.detail is not None and herd.model.detail.every > 1:
            where = scene.scenario.where("herds", index, "detail", "every")
            raise fail(where, "a herd that is not stepped every frame has no rollout with derivatives; leave it out")
    layout, assets, params, states = build(scene)
    return Rollout(layout, params, Start(assets, states), frames, settle, block)
