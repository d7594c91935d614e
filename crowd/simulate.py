"""Running a scene: the only jit, of `crowd.advance`, on one or several devices.

Characters do not meet yet, so devices never wait for each other within a chunk. Where they share a water surface, one
device steps them all, and the surface after them: it is the last of the states.
"""

from __future__ import annotations

import dataclasses
import functools
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from types import ModuleType
from typing import Any
from weakref import WeakKeyDictionary

import jax
import numpy as np
from jax import Array

from crowd.advance import rollout
from crowd.assets import Assets
from crowd.build import Program, build
from crowd.compiler_options import options
from crowd.errors import fail
from crowd.layout import Layout
from crowd.one_compile import compiled_once
from crowd.params import Params
from crowd.scenario_water import WATER_HZ
from crowd.scene import Scene
from crowd.types import WaterFrames
from crowd.unpack import unpacked

CHUNK = 32  # recorded frames that leave the device at once
Share = tuple[Assets, Params, tuple[Any, ...]]  # of a device: the arguments of `rollout`

_programs: WeakKeyDictionary[Any, dict[Any, list[Any]]] = WeakKeyDictionary()  # by what `compiled` gives


@dataclass(frozen=True, eq=False)
class Chunk:
    """Recorded frames of all herds, on the host: `herds[name][array]` is [time, character, ...].

    Joint rotations and translations are made each time they are asked for.
    """

    first_frame: int
    frames: int  # stepped in this chunk
    time: np.ndarray  # [t] s
    herds: dict[str, Mapping[str, np.ndarray]]
    water: WaterFrames | None = None  # at WATER_HZ at most


@dataclass(frozen=True, eq=False)
class Result:
    """A whole run in memory."""

    scene: Scene
    time: np.ndarray  # [t] s
    herds: dict[str, dict[str, np.ndarray]]
    state: tuple[Any, ...]  # a `State` per herd, then the `Water` where there is one
    water: WaterFrames | None = None


@functools.lru_cache(maxsize=32)
def compiled(layout: Layout, chunk: int) -> Any:
    """The jitted program for a layout: `rollout`, on whichever device its arguments lie."""
    return jax.jit(
        functools.partial(rollout, layout, chunk), donate_argnums=(2,), compiler_options=options(one_function=False)
    )


def dealt(program: Program, devices: int) -> list[Share]:
    """Arrays for each device: its share of every herd's tiles, and copies of what all characters share.

    Every device runs the same program by itself. Sharding one program over them, `shard_map` included, compiles
    differently, and a character's bits would then depend on the number of devices.
    """
    layout, assets, params, states = program
    if layout.water is not None and devices > 1:
        raise fail("devices", f"{devices}: a crowd with `world.water` runs on one; its characters meet in the water")
    if any(state.phase.shape[0] % devices for state in states[: len(layout.herds)]):
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
    on_state: Callable[[tuple[Any, ...]], None] | None = None,
) -> Iterator[Chunk]:
    """Step the scene and yield recorded chunks; `frames` (default: the scenario's) are stepped in all.

    The next chunk is stepped while the caller has the last one.

    devices: as many as the machine shows JAX when left out, one where there is a water surface.
    program: reuse or change what `build` gives.
    on_state: called with the states after each chunk, on the device (resuming, checks).
    """
    count = _devices(1 if devices is None and scene.water is not None else devices)
    total = scene.scenario.frame_count if frames is None else frames
    program = program or build(scene, count)
    layout, shares = program[0], dealt(program, count)
    every = layout.record_every
    chunk = max(1, min(chunk, -(-total // every)))
    run = compiled(layout, chunk)
    with ThreadPoolExecutor(count) as pool:
        runs = pool.submit(_on_each, run, shares).result()  # in a thread: the caller may be interrupted meanwhile
        running = [pool.submit(_advanced, *one, total) for one in zip(runs, shares, strict=True)]
        for done in range(0, total, chunk * every):
            stepped = min(total - done, chunk * every)
            states, shown = zip(*(one.result() for one in running), strict=True)
            if on_state is not None:  # now: the next chunk overwrites them
                on_state(_joined(states))
            shares = [(*share[:2], state) for share, state in zip(shares, states, strict=True)]
            left = total - done - stepped
            running = [pool.submit(_advanced, *one, left) for one in zip(runs, shares, strict=True) if left]
            made = [_chunk(scene, layout, shown, done, stepped)]
            del shown  # two chunks on the device are enough
            yield made.pop()


def _chunk(scene: Scene, layout: Layout, shown: Sequence[Any], done: int, stepped: int) -> Chunk:
    """What the devices have recorded in `stepped` frames after the first `done`, on the host."""
    every = layout.record_every
    recorded = stepped // every
    time = (done + (1 + np.arange(recorded)) * every) * layout.dt
    herds: dict[str, Mapping[str, np.ndarray]] = {
        herd.name: unpacked(herd, layout, which, [each[which] for each in shown], recorded)
        for which, herd in enumerate(scene.herds)
    }
    return Chunk(done, stepped, time, herds, _water(scene, shown[0], time, done // every))


def _water(scene: Scene, shown: Any, time: np.ndarray, first: int) -> WaterFrames | None:
    """Of the recorded heights, the last of `shown`, those to keep; `first`: number in the run of the first one."""
    grid = scene.water
    if grid is None:
        return None
    every = -(-scene.scenario.record.rate_hz // WATER_HZ)
    kept = np.arange(len(time))[(first + np.arange(len(time))) % every == 0]
    return WaterFrames(time[kept], np.asarray(shown[-1])[kept], grid.x, grid.z, grid.surface)


def _on_each(run: Any, shares: Sequence[Share]) -> list[Callable[..., Any]]:
    """What steps the share of each device: `compiled` itself for one."""
    if len(shares) == 1:
        return [run]
    kind = len(shares), *((leaf.shape, leaf.dtype) for leaf in jax.tree.leaves(shares[0]))
    made = _programs.setdefault(run, {})
    if kind not in made:
        made[kind] = compiled_once([run.lower(*share, to_go(share, 0)) for share in shares])
    return made[kind]


def _advanced(run: Callable[..., Any], share: Share, left: int) -> Any:
    """One chunk on the device that holds the share."""
    return jax.block_until_ready(run(*share, to_go(share, left)))


def to_go(share: Share, frames: int) -> Array:
    """The last argument of `rollout`, on the device of a share."""
    return jax.device_put(np.int32(frames), share[2][0].frame.device)


def _joined(parts: Sequence[Any]) -> Any:
    """Copies of the devices' states on the host, tiles one after the other."""
    return jax.tree.map(lambda *leaves: np.concatenate([np.asarray(leaf) for leaf in leaves]), *parts)


def _whole(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Arrays of chunks one after the other, components last in memory too."""
    out = np.empty((sum(map(len, parts)), *parts[0].shape[1:]), parts[0].dtype)
    return np.concatenate(parts, out=out)


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
    last: list[tuple[Any, ...]] = []

    def keep(states: tuple[Any, ...]) -> None:
        last[:] = [states]

    chunks: list[Chunk] = []
    for chunk in stream(scene, frames, devices, program=program, on_state=keep):
        chunks.append(chunk)
        if progress is not None:
            progress(chunk.first_frame + chunk.frames)
    state = jax.tree.map(np.asarray, last[0])
    herds = {
        name: {key: _whole([chunk.herds[name][key] for chunk in chunks]) for key in arrays}
        for name, arrays in chunks[0].herds.items()
    }
    time = np.concatenate([chunk.time for chunk in chunks])
    return Result(scene, time, herds, state, _together([chunk.water for chunk in chunks if chunk.water is not None]))


def _together(parts: list[WaterFrames]) -> WaterFrames | None:
    if not parts:
        return None
    time, height = (np.concatenate([getattr(part, name) for part in parts]) for name in ("time", "height"))
    return dataclasses.replace(parts[0], time=time, height=height)


class _CallableModule(ModuleType):
    """Importing this module gives its name in the package to it; `crowd.simulate(scene)` means the function still."""

    def __call__(self, *args: Any, **kwargs: Any) -> Result:
        return simulate(*args, **kwargs)


sys.modules[__name__].__class__ = _CallableModule
