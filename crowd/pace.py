"""Herds that are not stepped every frame: whose turn it is, steps of several frames, and what is shown between.

A tile whose turn it is goes ahead by as many frames as there are until its next turn, in one step of that length; the
others are not touched. Turns of neighbouring tiles follow each other, so that frames cost alike. What is shown of a
frame lies between the last two steps. A herd's tiles may also go frame by frame, as long as not all of their characters
are far or calm.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

from crowd.assets import HerdAssets, World
from crowd.layout import HerdLayout, Layout
from crowd.params import Character, Events, Pace, Params
from crowd.state import Frame, Paced, State, shown_state
from crowd.step import as_function, step
from kernels.vec import TINY
from kernels.wall import Wall

# What is recorded of a state goes "along" a line to the next step, or the shorter way round a "circle" (rad) or "cycle"
# (1); what is not named stays until then (footprints, phases, faults). Numbers of a frame go along lines.
SHOWN = dict(
    position="along", velocity="along", yaw="circle", pitch="along", phase="cycle",
    gait_time="cycle", gait_designated="cycle",
)  # fmt: skip
FRAME = (
    "drag_force", "drag_torque", "center_of_pressure", "depth", "ball", "ankle", "handle", "over_reach",
    "pose_position", "apparent_weight", "joint_translation",
)  # fmt: skip
ROTATIONS = ("pose_orientation", "joint_rotation")


def frame_on(
    layout: Layout, which: int, assets: HerdAssets, world: World, params: Params, state: State, wall: Wall
) -> State:
    """The tiles [tiles, ..., n] of herd number `which` one frame on."""
    characters = params.characters[which]
    assert state.paced is not None
    due = state.frame[:, 0] <= state.paced.frame[:, 0]
    once = jnp.minimum(due.sum(), 1)
    order = jnp.argsort(~due, stable=True)  # those whose turn it is first

    def one(number: Array, state: State) -> State:
        tile = order[number]
        mine = jax.tree.map(lambda leaf: jax.lax.dynamic_index_in_dim(leaf, tile, keepdims=False), (characters, state))
        # a loop of one turn, of which the compiler does not know: so everything of a tile is read before anything of it
        # is written, and tiles change in their place instead of in a copy of the whole herd
        ahead = functools.partial(_ahead, layout, which, wall=wall)
        given = assets, world, params, mine[0]
        gone = jax.lax.fori_loop(0, once, lambda _, own: as_function(layout, wall, ahead, *given, own), mine[1])
        return jax.tree.map(lambda leaf, new: jax.lax.dynamic_update_index_in_dim(leaf, new, tile, 0), state, gone)

    state = jax.lax.fori_loop(0, due.sum(), one, state)
    paced = state.paced
    assert paced is not None
    return dataclasses.replace(state, paced=dataclasses.replace(paced, frame=paced.frame + 1))


def _ahead(
    layout: Layout,
    which: int,
    assets: HerdAssets,
    world: World,
    params: Params,
    character: Character,
    state: State,
    wall: Wall,
) -> State:
    """A tile [..., n] at its next turn."""
    paced, now = state.paced, state.frame[0]
    assert paced is not None and character.pace is not None
    count = _frames(layout.herds[which], params, character, state, which, layout.dt)
    longer = dataclasses.replace(layout, dt=count * layout.dt, tick=layout.dt)
    moved = dataclasses.replace(
        params,
        events=_within(params.events, now, count),
        styles=tuple(dataclasses.replace(s, frame=_first(s.frame, now, count)) for s in params.styles),
    )
    plain = dataclasses.replace(state, paced=None)
    gone, frame = step(longer, which, assets, world, moved, character, plain, wall)
    gone = dataclasses.replace(gone, frame=state.frame + count)
    shown = Paced(paced.frame, state.frame, paced.after, (shown_state(gone), frame))
    return dataclasses.replace(gone, paced=shown)


def _frames(herd: HerdLayout, params: Params, character: Character, state: State, which: int, tick: float) -> Array:
    """[] int32: how many frames a tile goes on, up to its next turn; one where it is not slow, and at the start.

    After the very first frame there is something to show from. Then turns are taken one tile after the other.
    """
    pace, own, now = herd.pace, character.pace, state.frame[0]
    assert pace is not None and own is not None
    left = (own.turn[0] - now - 1) % pace.every + 1
    slow, aside = now > 0, own.padding | (state.fault > 0)
    if pace.far:
        x, z = state.position[0] - own.viewpoint[0], state.position[2] - own.viewpoint[1]
        slow = slow & jnp.all((x * x + z * z > own.far * own.far) | aside)
    if pace.calm:
        slow = slow & jnp.all(_calm(own, state, tick) | aside)
        slow = slow & ~_met(params, character, which, now, left)
    return jnp.where(slow, left, 1)


def _calm(own: Pace, state: State, tick: float) -> Array:
    """[n] whether the velocity changed slowly in the last step."""
    paced = state.paced
    assert paced is not None
    time = (state.frame - paced.since).astype(jnp.float32) * tick
    changes = state.velocity - paced.before[0]["velocity"]
    rate = jnp.sqrt(changes[0] ** 2 + changes[1] ** 2 + TINY) / jnp.maximum(time, tick)
    return rate < own.calm


def _met(params: Params, character: Character, which: int, now: Array, count: Array) -> Array:
    """[] whether an event meets a character of a tile within its next step."""
    events, styles, own = params.events, params.styles[which], character.pace
    assert own is not None
    found = jnp.zeros((), bool)
    for frames, chosen in (
        (events.impulse_frame, character.impulse),
        (events.turn_frame, character.turn),
        (styles.frame, character.style),
    ):
        if frames.shape[0]:
            soon = (frames >= now) & (frames < now + count)
            found = found | jnp.any(soon[:, None] & (chosen > 0) & ~own.padding)
    return found


def _within(events: Events, now: Array, count: Array) -> Events:
    """Events of the frames that a step takes, at its first one."""
    return dataclasses.replace(
        events,
        impulse_frame=_first(events.impulse_frame, now, count),
        turn_frame=_first(events.turn_frame, now, count),
    )


def _first(frames: Array, now: Array, count: Array) -> Array:
    return jnp.where((frames >= now) & (frames < now + count), now, frames)


def between(layout: Layout, state: State, wall: Wall) -> tuple[dict[str, Array], Frame]:
    """What is shown of the tiles [tiles, ..., n] now: of a state and of a frame, between the last two steps.

    A foot counts as planted where it is at both; a centre of pressure is there where there was one at both.
    """

    def tile(paced: Paced, ahead: Array) -> tuple[dict[str, Array], Frame]:
        share = (paced.frame - paced.since).astype(jnp.float32) / jnp.maximum(ahead - paced.since, 1)
        slim, frame = wall(_blended, paced.before, paced.after, share)
        turned = {
            name: _turned(getattr(paced.before[1], name), getattr(paced.after[1], name), share, wall)
            for name in ROTATIONS
        }
        return slim, dataclasses.replace(frame, **turned)

    assert state.paced is not None
    if wall.flag is None:
        return jax.vmap(tile)(state.paced, state.frame)
    return jax.lax.map(lambda given: as_function(layout, wall, tile, *given), (state.paced, state.frame))


def _blended(
    before: tuple[dict[str, Array], Frame], after: tuple[dict[str, Array], Frame], share: Array
) -> tuple[dict[str, Array], Frame]:
    """All but the rotations."""
    there = share >= 1.0

    def blend(kind: str | None, a: Any, b: Any) -> Any:
        if a is None:
            return None
        return jnp.where(there, b, a if kind is None else WAYS[kind](a, b, share))

    slim = {name: blend(SHOWN.get(name), before[0][name], after[0][name]) for name in after[0]}
    first, last = before[1], after[1]
    changed: dict[str, Any] = {name: blend("along", getattr(first, name), getattr(last, name)) for name in FRAME}
    changed["planted"] = jnp.where(there, last.planted, first.planted & last.planted)
    if last.strides is not None and first.strides is not None:
        names = [field.name for field in dataclasses.fields(last.strides)]
        own = {name: blend("along", getattr(first.strides, name), getattr(last.strides, name)) for name in names}
        changed["strides"] = dataclasses.replace(last.strides, **own)
    return slim, dataclasses.replace(last, **changed)


def _turned(a: Array, b: Array, share: Array, wall: Wall) -> Array:
    """Unit quaternions [4, ..., n] the shorter way from a to b, normalised linear (over a few frames, even).

    In stages: each of the four numbers would compute anew what all of them need.
    """
    same = wall(lambda a, b: jnp.where(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] < 0, -1.0, 1.0), a, b)
    mixed = wall(lambda a, b, same, share: a + (b * same - a) * share, a, b, same, share)
    size = wall(lambda m: 1.0 / jnp.sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2] + m[3] * m[3] + TINY), mixed)
    return wall(lambda m, size, b, share: jnp.where(share >= 1.0, b, m * size), mixed, size, b, share)


def _along(a: Array, b: Array, share: Array) -> Array:
    return a + (b - a) * share


def _round(whole: float) -> Callable[[Array, Array, Array], Array]:
    def way(a: Array, b: Array, share: Array) -> Array:
        turn = b - a
        return a + (turn - whole * jnp.round(turn * (1.0 / whole))) * share

    return way


WAYS: dict[str, Callable[[Array, Array, Array], Array]] = dict(
    along=_along, circle=_round(6.283185307179586), cycle=_round(1.0)
)
