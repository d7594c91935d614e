"""Running a scene: the only jit, a scan over frames around a map over tiles, on one or several devices."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.sharding import Mesh, NamedSharding
from jax.sharding import PartitionSpec as P

from crowd.assets import Assets
from crowd.build import Program, build
from crowd.layout import Layout
from crowd.params import Params
from crowd.scene import HerdScene, Scene
from crowd.state import Frame, State
from crowd.step import step
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
        slim = tuple(_slim(state) for state in states)
        return (states, shown, left - count), tuple(zip(slim, shown, strict=True))

    blank = jax.tree.map(
        lambda leaf: jnp.zeros(leaf.shape, leaf.dtype),
        jax.eval_shape(lambda states: one_frame(layout, assets, params, states, flag)[1], states),
    )
    (states, _, _), shown = jax.lax.scan(recorded, (states, blank, frames), None, length=chunk)
    return states, shown


def _slim(state: State) -> dict[str, Array]:
    names = ("position", "velocity", "yaw", "pitch", "desired", "phase", "fault")
    return {name: getattr(state, name) for name in names}


@functools.lru_cache(maxsize=32)
def compiled(layout: Layout, chunk: int, devices: int) -> Callable[..., Any]:
    """The jitted program for a layout: `rollout` on one device, or with tiles sharded over several."""
    run = functools.partial(rollout, layout, chunk)
    if devices > 1:
        mesh = Mesh(np.array(jax.devices()[:devices]), ("tiles",))
        tiles, recorded = P("tiles"), P(None, "tiles")
        herds = P()
        params = Params(fluids=herds, control=herds, events=herds, characters=tiles)  # pyright: ignore
        run = jax.shard_map(
            run,
            mesh=mesh,
            in_specs=(herds, params, tiles, herds, herds),
            out_specs=(tiles, recorded),
            check_vma=False,
        )
    return jax.jit(run, donate_argnums=(2,))


def shard(program: Program, devices: int) -> Program:
    """The program's arrays placed on their devices."""
    layout, assets, params, states = program
    if devices == 1:
        return program
    mesh = Mesh(np.array(jax.devices()[:devices]), ("tiles",))
    states = jax.device_put(states, NamedSharding(mesh, P("tiles")))
    return layout, assets, params, states


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
    count = len(jax.devices()) if devices is None else devices
    total = scene.scenario.frame_count if frames is None else frames
    layout, assets, params, states = shard(program or build(scene, count), count)
    every = layout.record_every
    chunk = max(1, min(chunk, -(-total // every)))
    run = compiled(layout, chunk, count)
    flag = jnp.asarray(True)
    done = 0
    # donated buffers must not be the caller's own
    states = jax.tree.map(jnp.copy, states) if program is not None else states
    while done < total:
        left = total - done
        states, shown = run(assets, params, states, jnp.asarray(left, jnp.int32), flag)
        stepped = min(left, chunk * every)
        if on_state is not None:
            on_state(states)
        recorded = stepped // every
        time = (done + (1 + np.arange(recorded)) * every) * layout.dt
        herds = {
            herd.name: unpacked(herd, layout, which, shown[which], recorded) for which, herd in enumerate(scene.herds)
        }
        yield Chunk(done, stepped, time, herds)
        done += stepped


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


def unpacked(herd: HerdScene, layout: Layout, which: int, shown: Any, recorded: int) -> dict[str, np.ndarray]:
    """Users' arrays [time, character, ..., component] of one herd, padding removed."""
    slim, frame = jax.tree.map(lambda leaf: _untiled(np.asarray(leaf)[:recorded], herd.count), shown)
    velocity = slim["velocity"]
    flat = np.stack([velocity[..., 0], np.zeros_like(velocity[..., 0]), velocity[..., 1]], -1)
    desired = slim["desired"]
    out = dict(
        position=slim["position"],
        velocity=flat,
        yaw=slim["yaw"],
        pitch=slim["pitch"],
        desired_velocity=np.stack([desired[..., 0], np.zeros_like(desired[..., 0]), desired[..., 1]], -1),
        phase=slim["phase"],
        drag_force=frame.drag_force,
        drag_torque=frame.drag_torque,
        center_of_pressure=frame.center_of_pressure,
        drag_power=-np.sum(frame.drag_force * flat, -1),
        depth=frame.depth,
        fault=slim["fault"],
        contact=frame.planted,
        handle=frame.handle,
        ball=frame.ball,
        ankle=frame.ankle,
        over_reach=frame.over_reach,
        pose_position=frame.pose_position,
        pose_orientation=frame.pose_orientation,
    )
    if layout.record_pose:
        out["joint_rotation"] = frame.joint_rotation
        rest = herd.archetype.skeleton.rest_translation.astype(np.float32)
        translation = np.broadcast_to(rest, (*frame.joint_translation.shape[:2], *rest.shape)).copy()
        translation[:, :, list(layout.herds[which].moving)] = frame.joint_translation
        out["joint_translation"] = translation
    return out


def _untiled(values: np.ndarray, count: int) -> np.ndarray:
    """[t, tiles, *components first*, 128] to [t, n, *components last*]."""
    moved = np.moveaxis(values, -1, 2)
    flat = moved.reshape(values.shape[0], moved.shape[1] * moved.shape[2], *moved.shape[3:])[:, :count]
    # components first (3, joints) to last (joints, 3)
    return flat if flat.ndim < 4 else np.moveaxis(flat, 2, -1)


class _CallableModule(ModuleType):
    """Importing this module gives its name in the package to it; `crowd.simulate(scene)` means the function still."""

    def __call__(self, *args: Any, **kwargs: Any) -> Result:
        return simulate(*args, **kwargs)


sys.modules[__name__].__class__ = _CallableModule
