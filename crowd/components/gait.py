"""Gait: which clips play, the clock, and the footstep controller that places the feet (section 4.1)."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from crowd.assets import HerdAssets
from crowd.layout import HerdLayout, Layout
from crowd.params import Character, Control, Params
from crowd.state import State
from kernels import stepping
from kernels.vec import TINY, smoothstep

BAND = 0.12  # gaits change over this share above and below the speed half-way (geometric) between two clips


class Mix(NamedTuple):
    """The blend of locomotion clips, for characters of their scale."""

    share: Array  # [K, n]
    period: Array  # [n] s
    speed: Array  # [n] m/s
    lift: Array  # [L, n]
    duty: Array  # [L, n]
    rest: Array  # [2, L, n] m


def mix(herd: HerdLayout, assets: HerdAssets, character: Character, state: State) -> Mix:
    """Clips by the low-passed desired speed; periods and speeds go with the root of the size (equal Froude number)."""
    root = jnp.sqrt(character.scale)
    place = jnp.zeros_like(root)
    for k in range(herd.gaits - 1):
        middle = jnp.sqrt(assets.speed[k] * assets.speed[k + 1]) * root
        place = place + smoothstep((state.gait_speed / middle - (1 - BAND)) / (2 * BAND))
    share = jnp.stack([jnp.clip(1 - jnp.abs(place - k), 0.0, 1.0) for k in range(herd.gaits)])

    def blended(table: Array) -> Array:
        return sum((share[k] * table[k] for k in range(1, herd.gaits)), share[0] * table[0])

    return Mix(
        share,
        blended(assets.period) * root,
        blended(assets.speed) * root,
        blended(assets.lift),
        blended(assets.duty),
        blended(assets.rest) * character.scale,
    )


def gait(
    layout: Layout, herd: HerdLayout, assets: HerdAssets, params: Params, character: Character, state: State
) -> State:
    """Clock, idle weight, and every leg's swing, target and handle after the frame."""
    dt, control = layout.dt, params.control
    desired = jnp.sqrt(state.desired[0] ** 2 + state.desired[1] ** 2 + TINY)
    lag = dt / (dt + control.filter_time)
    state = dataclasses.replace(state, gait_speed=state.gait_speed + (desired - state.gait_speed) * lag)
    blend = mix(herd, assets, character, state)
    sin, cos = jnp.sin(state.heading), jnp.cos(state.heading)
    ahead = state.smoothed[0] * sin + state.smoothed[1] * cos
    left = state.smoothed[0] * cos - state.smoothed[1] * sin
    ahead, left = stepping.step_velocity(ahead, left, control.side_ratio * blend.speed)
    pace = jnp.sqrt(ahead**2 + left**2 + TINY)
    speed = jnp.sqrt(state.smoothed[0] ** 2 + state.smoothed[1] ** 2 + TINY)
    walking = (speed > control.stand_ratio * blend.speed) & (state.fault == 0)
    cadence = stepping.cadence(layout.schedule, pace / blend.speed, desired / blend.speed) / blend.period
    # gradients through the moments of steps mislead (events slide across frames): steps keep their times
    cadence = jax.lax.stop_gradient(cadence)
    cycle = blend.speed * blend.period / pace if layout.schedule == "paper" else 1.0 / cadence
    stride = jnp.stack([ahead * sin + left * cos, ahead * cos - left * sin]) * cycle
    idle = state.idle + (jnp.where(walking, 0.0, 1.0) - state.idle) * (dt / (dt + 0.5 * control.filter_time))
    state = dataclasses.replace(
        state, idle=idle, idle_phase=_wrap(state.idle_phase + dt * assets.idle_rate / jnp.sqrt(character.scale))
    )
    advance = jnp.where(walking, cadence * dt, 0.0)
    phase = _wrap(state.phase + advance)
    if not layout.footsteps:
        return dataclasses.replace(state, phase=phase)
    return _steps(herd, assets, params, character, state, blend, stride, cadence, advance, phase, walking, dt)


def _steps(
    herd: HerdLayout,
    assets: HerdAssets,
    params: Params,
    character: Character,
    state: State,
    blend: Mix,
    stride: Array,
    cadence: Array,
    advance: Array,
    phase: Array,
    walking: Array,
    dt: float,
) -> State:
    """Plan, swing and plant every leg (axis L)."""
    control = params.control
    root = state.position[jnp.array([0, 2])]
    rest = _turned(_standing_rest(herd, assets, character, state, blend), state.yaw)
    lag = _urgency(state, root, rest, stride, blend, assets, character)
    advance = advance * lag
    phase = _wrap(state.phase + advance)
    swing = 1.0 - blend.duty
    lifts = stepping.lift_off(phase, advance, blend.lift, state.progress, walking)
    since = phase - blend.lift
    since = since - jnp.floor(since)
    close = _closing(herd, control, assets, character, state, root, rest, walking)
    # a leg that lifts off inside the frame has only the remainder of it to swing
    before = jnp.where(lifts | close, 0.0, state.progress)
    closing_step = dt / (control.close_time * jnp.sqrt(character.scale))
    pace = jnp.where(walking, advance / swing, closing_step)
    after = jnp.where(lifts, since / swing, jnp.where(before < 1.0, before + pace, 1.0))
    after = jnp.clip(after, 0.0, 1.0)
    aim = stepping.landing(root[:, None], rest, stride[:, None] * jnp.where(walking, 1.0, 0.0), after, blend.duty)
    aim = _uncrossed(herd, params, assets, character, state, aim)
    fresh = lifts | close | ((before < stepping.REAIM_UNTIL) & (before < 1.0))
    target = jnp.where(fresh, aim, state.target)
    handle = stepping.move_handle(state.handle, target, before, after)
    yaw = jnp.broadcast_to(state.yaw, before.shape)
    foot_yaw = stepping.move_handle(state.foot_yaw[None], yaw[None], before, after)[0]
    return dataclasses.replace(state, phase=phase, progress=after, target=target, handle=handle, foot_yaw=foot_yaw)


def _standing_rest(herd: HerdLayout, assets: HerdAssets, character: Character, state: State, blend: Mix) -> Array:
    """[2, L, n] m, rest place of each foot in the character frame: the gait's, or the idle clip's when standing."""
    del herd
    return blend.rest + (assets.idle_rest * character.scale - blend.rest) * state.idle


def _urgency(
    state: State, root: Array, rest: Array, stride: Array, blend: Mix, assets: HerdAssets, character: Character
) -> Array:
    """[n] factor on the clock: a planted foot left far behind (a push) hastens the cycle, up to twice."""
    off = state.handle - root[:, None] - rest
    half = 0.5 * blend.duty * jnp.sqrt(stride[0] ** 2 + stride[1] ** 2 + TINY)
    distance = jnp.sqrt(off[0] ** 2 + off[1] ** 2 + TINY)
    excess = jnp.where(state.progress >= 1.0, distance - half, 0.0).max(0)
    reach = 0.25 * assets.pivot_height * character.scale
    return jax.lax.stop_gradient(1.0 + smoothstep((excess - 0.5 * reach) / reach))


def _closing(
    herd: HerdLayout,
    control: Control,
    assets: HerdAssets,
    character: Character,
    state: State,
    root: Array,
    rest: Array,
    walking: Array,
) -> Array:
    """[L, n] legs that take a closing step: standing, too far from rest, the farthest first, one at a time."""
    off = state.handle - root[:, None] - rest
    distance = jnp.sqrt(off[0] ** 2 + off[1] ** 2 + TINY)
    far = distance - control.close_distance * assets.pivot_height * character.scale
    farthest = far >= far.max(0) - 1e-6
    first = jnp.cumsum(farthest, 0) == 1
    still = (state.progress >= 1.0).all(0)
    return farthest & first & (far > 0) & ~walking & still & (state.fault == 0)


def _uncrossed(
    herd: HerdLayout, params: Params, assets: HerdAssets, character: Character, state: State, aim: Array
) -> Array:
    """Targets that do not pass the partner's foot: a lateral gap in the character's own axes is kept."""
    partner = jnp.array(herd.partners)
    side = jnp.array([s if p != i else 0 for i, (s, p) in enumerate(zip(herd.sides, herd.partners, strict=True))])
    side = side.reshape(-1, 1).astype(aim.dtype)
    left = jnp.stack([jnp.cos(state.yaw), -jnp.sin(state.yaw)])
    other = state.handle[:, partner]
    gap = params.control.foot_gap * jnp.abs(assets.idle_rest[0] - assets.idle_rest[0, partner]) * character.scale
    across = (aim[0] - other[0]) * left[0] + (aim[1] - other[1]) * left[1]
    short = jnp.maximum(gap - side * across, 0.0) * side
    return aim + left[:, None] * short


def _turned(place: Array, yaw: Array) -> Array:
    """[2, L, n] (x, z) of the character frame turned to the world's axes."""
    sin, cos = jnp.sin(yaw), jnp.cos(yaw)
    return jnp.stack([place[0] * cos + place[1] * sin, place[1] * cos - place[0] * sin])


def _wrap(phase: Array) -> Array:
    return phase - jnp.floor(phase)
