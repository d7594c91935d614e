"""Running a scene: the only jit, a scan over frames around a map over tiles, on one or several devices.

Characters do not meet yet, so devices never wait for each other within a chunk.
"""

from __future__ import annotations

import dataclasses
import functools
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from crowd.assets import Assets
from crowd.build import Program, build
from crowd.errors import fail
from crowd.layout import Layout
from crowd.params import Params
from crowd.scene import Scene
from crowd.state import Frame, State, blank_frame
from crowd.step import step
from crowd.unpack import shown_state, unpacked
from kernels.wall import no_wall, through

CHUNK = 32  # recorded frames that leave the device at once


@dataclass(frozen=True, eq=False)
class Chunk:
    """Recorded frames of all herds, on the host: `herds[name][array]` is [time, character, ...]."""

    first_frame: int
    frames: int  # stepped in this chunk
    time: np.ndarray  # [t] s
    herds: dict[str, dict[str, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Result:
    """A whole run in memory."""

    scene: Scene
    time: np.ndarray  # [t] s
    herds: dict[str, dict[str, np.ndarray]]
    state: tuple[State, ...]


def one_frame(layout: Layout, assets: Assets, params: Params, states: tuple[State, ...], flag: Array) -> Any:
    """All herds one frame on: a map over each herd's tiles. Returns (states, frames)."""
    wall = through(flag) if layout.walls else no_wall

    def herd(which: int) -> Any:
        def tile(pair: tuple[Any, State]) -> tuple[State, Frame]:
            character, state = pair
            return step(layout, which, assets.herds[which], assets.world, params, character, state, wall)

        pairs = (params.characters[which], states[which])
        return jax.lax.map(tile, pairs) if layout.walls else jax.vmap(tile)(pairs)

    results = [herd(which) for which in range(len(layout.herds))]
    return tuple(state for state, _ in results), tuple(frame for _, frame in results)


def rollout(
    layout: Layout,
    chunk: int,
    assets: Assets,
    params: Params,
    states: tuple[State, ...],
    frames: Array,
    flag: Array,
) -> tuple[tuple[State, ...], tuple[tuple[dict[str, Array], Frame], ...]]:
    """Up to `chunk` recorded frames (of `record_every` steps each), and no step beyond the `frames` still to go.

    Returns the states and, stacked over recorded frames, what `unpacked` reads. The program is the same for every
    chunk of a run: the number of steps is an argument.
    """

    def advance(_: Any, carry: Any) -> Any:
        return one_frame(layout, assets, params, carry[0], flag)

    def recorded(carry: Any, _: Any) -> tuple[Any, Any]:
        states, shown, left = carry
        count = jnp.clip(left, 0, layout.record_every)
        states, shown = jax.lax.fori_loop(0, count, advance, (states, shown))
        slim = tuple(shown_state(state) for state in states)
        return (states, shown, left - count), tuple(zip(slim, shown, strict=True))

    blank = tuple(blank_frame(layout, herd, state) for herd, state in zip(layout.herds, states, strict=True))
    (states, _, _), shown = jax.lax.scan(recorded, (states, blank, frames), None, length=chunk)
    return states, shown


@functools.lru_cache(maxsize=32)
def compiled(layout: Layout, chunk: int) -> Any:
    """The jitted program for a layout: `rollout`, on whichever device its arguments lie."""
    return jax.jit(functools.partial(rollout, layout, chunk), donate_argnums=(2,))


def dealt(program: Program, devices: int) -> list[tuple[Assets, Params, tuple[State, ...]]]:
    """Arrays for each device: its share of every herd's tiles, and copies of what all characters share.

    Every device runs the same program by itself. Sharding one program over them compiles differently, and a character's
    bits would then depend on the number of devices.
    """
    _, assets, params, states = program
    if any(state.phase.shape[0] % devices for state in states):
        raise fail("devices", f"the program's tiles do not divide by {devices}; build it for as many devices")

    def share(tree: Any, device: int) -> Any:
        def cut(leaf: Array) -> np.ndarray:
            size = leaf.shape[0] // devices
            # a copy: the program overwrites its states, the caller's stay
            return np.array(np.asarray(leaf)[device * size : (device + 1) * size])

        return jax.tree.map(cut, tree)

    shares = []
    for number, device in enumerate(jax.devices()[:devices]):
        mine = dataclasses.replace(params, characters=share(params.characters, number))
        shares.append(jax.device_put((assets, mine, share(states, number)), device))
    return shares


def stream(
    scene: Scene,
    frames: int | None = None,
    devices: int | None = None,
    chunk: int = CHUNK,
    program: Program | None = None,
    on_state: Callable[[tuple[State, ...]], None] | None = None,
) -> Iterator[Chunk]:
    """Step the scene and yield recorded chunks; `frames` (default: the scenario's) are stepped in all.

    devices: as many as the machine shows JAX when left out. program: reuse or change what `build` gives.
    on_state: called with the states after each chunk, on the device (resuming, checks).
    """
    count = _devices(devices)
    total = scene.scenario.frame_count if frames is None else frames
    program = program or build(scene, count)
    layout, shares = program[0], dealt(program, count)
    every = layout.record_every
    chunk = max(1, min(chunk, -(-total // every)))
    run = compiled(layout, chunk)
    run.trace(*shares[0], np.int32(total), np.True_)  # once: the devices' threads would each do it
    done = 0
    while done < total:
        left = total - done
        with ThreadPoolExecutor(count) as pool:  # compiling, the first time, goes on at once too
            results = list(pool.map(functools.partial(_advanced, run, left), shares))
        shares = [(*share[:2], states) for share, (states, _) in zip(shares, results, strict=True)]
        stepped = min(left, chunk * every)
        if on_state is not None:
            on_state(_joined([states for states, _ in results], 0))
        shown = _joined([shown for _, shown in results], 1)
        recorded = stepped // every
        time = (done + (1 + np.arange(recorded)) * every) * layout.dt
        herds = {
            herd.name: unpacked(herd, layout, which, shown[which], recorded) for which, herd in enumerate(scene.herds)
        }
        yield Chunk(done, stepped, time, herds)
        done += stepped


def _advanced(run: Callable[..., Any], left: int, share: tuple[Assets, Params, tuple[State, ...]]) -> Any:
    """One chunk on the device that holds the share."""
    device = share[2][0].frame.device
    return jax.block_until_ready(run(*share, *jax.device_put((np.int32(left), np.True_), device)))


def _joined(parts: list[Any], axis: int) -> Any:
    """The devices' arrays on the host, tiles one after the other."""
    return jax.tree.map(lambda *leaves: np.concatenate([np.asarray(leaf) for leaf in leaves], axis), *parts)


def _devices(wanted: int | None) -> int:
    """How many devices to use; refuses more than there are."""
    there = len(jax.devices())
    if wanted is not None and not 1 <= wanted <= there:
        raise fail("devices", f"{wanted} asked for, this process has {there} (jax_num_cpu_devices sets host devices)")
    return there if wanted is None else wanted


def simulate(
    scene: Scene,
    frames: int | None = None,
    seconds: float | None = None,
    devices: int | None = None,
    progress: Callable[[int], None] | None = None,
    program: Program | None = None,
) -> Result:
    """Run a scene and keep every recorded frame in memory; `progress` is called with the frames done."""
    if frames is None and seconds is not None:
        frames = max(1, round(seconds * scene.scenario.rate_hz))
    last: list[tuple[State, ...]] = []

    def keep(states: tuple[State, ...]) -> None:
        last[:] = [states]

    chunks: list[Chunk] = []
    for chunk in stream(scene, frames, devices, program=program, on_state=keep):
        chunks.append(chunk)
        if progress is not None:
            progress(chunk.first_frame + chunk.frames)
    state = jax.tree.map(np.asarray, last[0])
    herds = {
        name: {key: np.concatenate([chunk.herds[name][key] for chunk in chunks]) for key in arrays}
        for name, arrays in chunks[0].herds.items()
    }
    return Result(scene, np.concatenate([chunk.time for chunk in chunks]), herds, state)


class _CallableModule(ModuleType):
    """Importing this module gives its name in the package to it; `crowd.simulate(scene)` means the function still."""

    def __call__(self, *args: Any, **kwargs: Any) -> Result:
        return simulate(*args, **kwargs)


sys.modules[__name__].__class__ = _CallableModule
