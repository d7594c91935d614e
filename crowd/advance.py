"""The program: all herds through the frames of a chunk, as one function of arrays. What `crowd.simulate` compiles.

On a CPU a herd is stepped tile by tile, each through all frames while what it needs is in the cache; on a GPU all tiles
at once. Characters that meet (in a water surface) are stepped frame by frame.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

from crowd import pace
from crowd.assets import Assets
from crowd.components import water_surface
from crowd.layout import Layout
from crowd.params import Params
from crowd.state import Frame, State, blank_frame, shown_state
from crowd.step import as_function, remembered, step
from kernels.wall import apart, no_wall
from kernels.water import Waves


def one_frame(
    layout: Layout,
    assets: Assets,
    params: Params,
    states: tuple[Any, ...],
    waves: Waves | None = None,
    remember: bool = False,
    last: tuple[Frame, ...] | None = None,
) -> Any:
    """All herds one frame on: a map over each herd's tiles, then their water surface. Returns (states, frames).

    Of herds that are stepped every frame. remember: a backward pass keeps little of each tile, see `step.remembered`;
    of all tiles together it would first put every array of a frame into memory. last: frames of which nothing is asked
    any more; the new ones take their place, which has no derivative.
    """
    wall = apart if layout.walls else no_wall
    felt = None if waves is None else water_surface.felt(layout, assets, params, states[-1], waves, wall)

    def herd(which: int) -> Any:
        def tile(pair: tuple[Any, State]) -> tuple[State, Frame]:
            def stage(herd: Any, world: Any, params: Params, character: Any, state: State, felt: Any) -> Any:
                return step(layout, which, herd, world, params, character, state, wall, felt)

            given = assets.herds[which], assets.world, params, *pair, felt
            # a derivative of a function would step everything again, the drag, too
            return stage(*given) if last is None else as_function(layout, wall, stage, *given)

        pairs = (params.characters[which], states[which])
        one = remembered(tile) if remember else tile
        if not layout.walls:
            return jax.vmap(one)(pairs)
        if last is None:
            return jax.lax.map(one, pairs)

        def turn(number: Array | int, now: tuple[State, Frame]) -> tuple[State, Frame]:
            return _put(now, number, tile((_at(params.characters[which], number), _at(now[0], number))))

        return jax.lax.fori_loop(0, len(states[which].phase), turn, (states[which], last[which]))

    results = [herd(which) for which in range(len(layout.herds))]
    stepped, frames = tuple(state for state, _ in results), tuple(frame for _, frame in results)
    if waves is None:
        return stepped, frames
    with jax.named_scope("water"):
        surface = water_surface.moved(layout, assets, params, stepped, frames, states[-1], waves, wall)
    return (*stepped, surface), frames


def rollout(
    layout: Layout,
    chunk: int,
    assets: Assets,
    params: Params,
    states: tuple[Any, ...],
    frames: Array,
) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Up to `chunk` recorded frames (of `record_every` steps each), and no step beyond the `frames` still to go.

    Returns the states and, of each herd, what `unpacked` reads, [tiles, recorded frames, ...], then the height of a
    water surface, [recorded frames, ...]. The program is the same for every chunk: the number of steps is an argument.
    """
    if layout.water is not None:
        return _together_on(layout, chunk, assets, params, states, frames)
    results = [_herd_on(layout, chunk, which, assets, params, states[which], frames) for which in range(len(states))]
    return tuple(state for state, _ in results), tuple(shown for _, shown in results)


def _recorded(
    layout: Layout, chunk: int, frames: Array, start: Any, advance: Callable[[Any], Any], show: Callable[[Any], Any]
) -> tuple[Any, Any]:
    """The end of `chunk` recorded frames from `start`, and what `show` gives after each, stacked."""

    def recorded(carry: tuple[Any, Array], _: Any) -> tuple[Any, Any]:
        now, left = _to_recorded(layout, advance, *carry)
        return (now, left), show(now)

    (end, _), shown = jax.lax.scan(recorded, (start, frames), None, length=chunk)
    return end, shown


def _to_recorded(layout: Layout, advance: Callable[[Any], Any], now: Any, left: Array) -> tuple[Any, Array]:
    """The next frame that is recorded, or the last, and how many are left after it."""
    count = jnp.clip(left, 0, layout.record_every)
    return jax.lax.fori_loop(0, count, lambda _, now: advance(now), now), left - count


def _herd_on(
    layout: Layout, chunk: int, which: int, assets: Assets, params: Params, states: State, frames: Array
) -> tuple[State, Any]:
    """`rollout` of a herd whose tiles do not meet: each goes through all frames while what it needs is in the cache."""
    if layout.herds[which].pace is not None:
        return _turns_on(layout, chunk, which, assets, params, states, frames)
    wall = apart if layout.walls else no_wall

    def advance(character: Any, now: tuple[State, Frame]) -> tuple[State, Frame]:
        stage = functools.partial(step, layout, which, wall=wall)
        return as_function(layout, wall, stage, assets.herds[which], assets.world, params, character, now[0])

    def started(state: State) -> tuple[State, Frame]:
        return state, blank_frame(layout, layout.herds[which], state)

    def show(now: tuple[State, Frame]) -> tuple[dict[str, Array], Frame]:
        return shown_state(now[0]), now[1]

    characters = params.characters[which]
    if not layout.walls:

        def tile(character: Any, state: State) -> tuple[State, Any]:
            now = functools.partial(advance, character)
            (state, _), shown = _recorded(layout, chunk, frames, started(state), now, show)
            return state, shown

        return jax.vmap(tile)(characters, states)

    def turn(number: Array | int, carry: tuple[State, Any]) -> tuple[State, Any]:
        """In place: what a map returns is filled with zeros first, and put together from copies."""
        character, state = _at((characters, carry[0]), number)

        def recorded(frame: Array | int, carry: tuple[Any, Array, Any]) -> tuple[Any, Array, Any]:
            now, left, shown = carry
            now, left = _to_recorded(layout, functools.partial(advance, character), now, left)
            return now, left, _put(shown, (number, frame), show(now))

        (state, _), _, shown = jax.lax.fori_loop(0, chunk, recorded, (started(state), frames, carry[1]))
        return _put(carry[0], number, state), shown

    one = jax.eval_shape(lambda states: show(started(_at(states, 0))), states)
    empty = jax.tree.map(lambda leaf: jnp.zeros((len(states.phase), chunk, *leaf.shape), leaf.dtype), one)
    return jax.lax.fori_loop(0, len(states.phase), turn, (states, empty))


def _at(tiles: Any, number: Array | int) -> Any:
    """What belongs to one tile."""
    return jax.tree.map(lambda x: jax.lax.dynamic_index_in_dim(x, number, keepdims=False), tiles)


def _put(every: Any, number: Array | int | tuple[Array | int, ...], one: Any) -> Any:
    """All, with number such and such along the first axes replaced, in place where nothing else asks for them."""
    at = number if isinstance(number, tuple) else (number,)

    def put(leaf: Array, own: Array) -> Array:
        return jax.lax.dynamic_update_slice(leaf, own[(None,) * len(at)], (*at, *(0,) * own.ndim))

    return jax.tree.map(put, every, one)


def _turns_on(
    layout: Layout, chunk: int, which: int, assets: Assets, params: Params, states: State, frames: Array
) -> tuple[State, Any]:
    """`rollout` of a herd whose tiles take turns."""
    wall = apart if layout.walls else no_wall

    def advance(state: State) -> State:
        return pace.frame_on(layout, which, assets.herds[which], assets.world, params, state, wall)

    states, shown = _recorded(layout, chunk, frames, states, advance, lambda state: pace.between(layout, state, wall))
    return states, jax.tree.map(lambda x: jnp.swapaxes(x, 0, 1), shown)


def _together_on(
    layout: Layout, chunk: int, assets: Assets, params: Params, states: tuple[Any, ...], frames: Array
) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """`rollout` of characters that meet in a water surface: all of them frame by frame."""
    herds = len(layout.herds)
    waves = water_surface.prepared(layout, assets, params)

    def advance(now: Any) -> Any:
        return one_frame(layout, assets, params, now[0], waves, last=now[1])

    def show(now: Any) -> Any:
        states, frames = now
        slim = tuple(shown_state(state) for state in states[:herds])
        return tuple(zip(slim, frames, strict=True)), tuple(water.height for water in states[herds:])

    blank = tuple(blank_frame(layout, herd, state) for herd, state in zip(layout.herds, states[:herds], strict=True))
    (states, _), (shown, surface) = _recorded(layout, chunk, frames, (states, blank), advance, show)
    return states, (*jax.tree.map(lambda x: jnp.swapaxes(x, 0, 1), shown), *surface)
