"""Footsteps: which clips play, the clock, and the footstep controller that places the feet (section 4.1)."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from crowd.assets import HerdAssets, World
from crowd.components.pose import Poses
from crowd.layout import HerdLayout, Layout
from crowd.params import Character, Control, Params
from crowd.state import State
from kernels import clips, controllers, leg_clearance, stepping
from kernels.rows import picked
from kernels.trig import sin_cos
from kernels.vec import TINY, smoothstep
from kernels.wall import Wall

BAND = 0.12  # gaits change over this share above and below the speed half-way (geometric) between two clips


class Mix(NamedTuple):
    """The blend of locomotion clips, for characters of their scale."""

    share: Array  # [K, n]
    period: Array  # [n] s
    speed: Array  # [n] m/s
    lift: Array  # [L, n]
    duty: Array  # [L, n]
    rest: Array  # [2, L, n] m
    most_stride: Array  # [n] m


def mix(herd: HerdLayout, assets: HerdAssets, character: Character, state: State) -> Mix:
    """Clips by the low-passed desired speed; periods and speeds go with the root of the size (equal Froude number)."""
    root = jnp.sqrt(character.scale)
    place = jnp.zeros_like(root)
    for k in range(herd.gaits - 1):
        middle = jnp.sqrt(assets.speed[k] * assets.speed[k + 1]) * root
        place = place + smoothstep((state.gait.gait_speed / middle - (1 - BAND)) / (2 * BAND))
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
        blended(assets.most_stride) * character.scale,
    )


class _Pace(NamedTuple):
    """What the clock does in this frame."""

    advance: Array  # [n] cycles
    stride: Array  # [2, n] m per cycle, world (x, z)
    walking: Array  # [n] bool; otherwise the character stands, or takes closing steps
    idle: Array  # [n] weight of the idle clip
    idle_phase: Array  # [n] cycles


class _Swing(NamedTuple):
    """Every leg's swing in this frame."""

    before: Array  # [L, n] progress at its beginning, 0 when the leg lifts off in it
    after: Array  # [L, n] progress at its end
    aims: Array  # [L, n] bool: the target is (still) aimed


def gait(
    layout: Layout,
    which: int,
    assets: HerdAssets,
    world: World,
    params: Params,
    character: Character,
    state: State,
    climb: Array,
    depth: Array,
    wall: Wall,
) -> tuple[State, Mix, Poses]:
    """Clock, idle weight, every leg's swing, target and handle after the frame; the blend of clips and its poses."""
    del world, climb, depth
    dt, control, herd = layout.dt, params.control, layout.herds[which]
    if character.responses.reaction is not None:
        control = dataclasses.replace(control, filter_time=character.responses.reaction)
    state = _with(state, **wall(lambda s: _followed(dt, control, s), state))
    blend = wall(lambda c, s: mix(herd, assets, c, s), character, state)
    pace = wall(lambda c, s, b: _pace(layout, assets, control, c, s, b), character, state, blend)
    state = dataclasses.replace(_with(state, idle=pace.idle), idle_phase=pace.idle_phase)
    if layout.gait == "clip":
        phase = wall(lambda phase, pace: _wrap(phase + pace.advance), state.phase, pace)
        state = dataclasses.replace(state, phase=phase)
        return state, blend, wall(lambda s, b: _poses(herd, s, b), state, blend)
    rest = wall(lambda c, s, b: _turned(_standing_rest(assets, c, s, b), s.yaw), character, state, blend)
    pace = wall(lambda *now: _hastened(assets, *now), character, state, blend, pace, rest)
    phase = wall(lambda phase, pace: _wrap(phase + pace.advance), state.phase, pace)
    state = dataclasses.replace(state, phase=phase)
    swing = wall(lambda *now: _swing(dt, control, assets, *now), character, state, blend, pace, rest)
    other = picked(state.gait.handle, np.array(herd.partners), wall)
    target = wall(lambda *now: _aimed(herd, control, assets, *now), character, state, other, blend, pace, rest, swing)
    handle, foot_yaw = wall(_moved, state, target, swing)
    state = _with(state, progress=swing.after, target=target, handle=handle, foot_yaw=foot_yaw)
    return state, blend, wall(lambda s, b: _poses(herd, s, b), state, blend)


def _with(state: State, **changes: Array) -> State:
    """The state with fields of its gait replaced."""
    return dataclasses.replace(state, gait=dataclasses.replace(state.gait, **changes))


def _poses(herd: HerdLayout, state: State, blend: Mix) -> Poses:
    """Table columns and shares: the two nearest gaits (or the only one) and the idle clip."""
    moving = 1.0 - state.gait.idle
    phases, weights, which = [], [], []
    if herd.gaits == 1:
        which.append(jnp.zeros_like(state.fault))
        weights.append(moving)
        phases.append(state.phase)
    else:
        place = sum((k * blend.share[k] for k in range(1, herd.gaits)), jnp.zeros_like(state.phase))
        low = jnp.clip(jnp.floor(place).astype(jnp.int32), 0, herd.gaits - 2)
        upper = jnp.clip(place - low, 0.0, 1.0)
        which += [low, low + 1]
        weights += [moving * (1.0 - upper), moving * upper]
        phases += [state.phase, state.phase]
    which.append(jnp.full_like(state.fault, herd.gaits))
    weights.append(state.gait.idle)
    phases.append(state.idle_phase)
    column, share = clips.frame_weights(jnp.stack(which), jnp.stack(phases), jnp.stack(weights), herd.samples)
    return Poses(column, share, None)


def _followed(dt: float | Array, control: Control, state: State) -> dict[str, Array]:
    """The low-passed velocity, which steps follow, and the low-passed commanded speed, which picks the gait."""
    steps = state.gait
    desired = jnp.sqrt(state.command[0] ** 2 + state.command[1] ** 2 + TINY)
    share = controllers.low_pass(dt, control.filter_time)
    return dict(
        smoothed=steps.smoothed + (state.velocity - steps.smoothed) * share,
        gait_speed=steps.gait_speed + (desired - steps.gait_speed) * share,
    )


def _pace(
    layout: Layout, assets: HerdAssets, control: Control, character: Character, state: State, blend: Mix
) -> _Pace:
    """Cadence and stride by the schedule, from the low-passed velocity."""
    dt = layout.dt
    sin, cos = sin_cos(state.heading)
    ahead = state.gait.smoothed[0] * sin + state.gait.smoothed[1] * cos
    left = state.gait.smoothed[0] * cos - state.gait.smoothed[1] * sin
    ahead, left = stepping.step_velocity(ahead, left, control.side_ratio * blend.speed)
    pace = jnp.sqrt(ahead**2 + left**2 + TINY)
    desired = jnp.sqrt(state.command[0] ** 2 + state.command[1] ** 2 + TINY)
    speed = jnp.sqrt(state.gait.smoothed[0] ** 2 + state.gait.smoothed[1] ** 2 + TINY)
    walking = (speed > control.stand_ratio * blend.speed) & (state.fault == 0)
    cadence = stepping.cadence(layout.schedule, pace / blend.speed, desired / blend.speed) / blend.period
    cadence = jnp.maximum(cadence, pace / blend.most_stride)  # legs too short for the stride step quicker
    # gradients through the moments of steps mislead (events slide across frames): steps keep their times
    cadence = jax.lax.stop_gradient(cadence)
    printed = jnp.minimum(blend.speed * blend.period, blend.most_stride) / pace
    cycle = printed if layout.schedule == "paper" else 1.0 / cadence
    share = controllers.low_pass(dt, 0.5 * control.filter_time)
    return _Pace(
        advance=jnp.where(walking, cadence * dt, 0.0),
        stride=jnp.stack([ahead * sin + left * cos, ahead * cos - left * sin]) * cycle,
        walking=walking,
        idle=state.gait.idle + (jnp.where(walking, 0.0, 1.0) - state.gait.idle) * share,
        idle_phase=_wrap(state.idle_phase + dt * assets.idle_rate / jnp.sqrt(character.scale)),
    )


def _swing(
    dt: float | Array,
    control: Control,
    assets: HerdAssets,
    character: Character,
    state: State,
    blend: Mix,
    pace: _Pace,
    rest: Array,
) -> _Swing:
    """Lift-offs, and how far each swing gets; a leg that lifts off inside the frame has only the rest of it."""
    swing = 1.0 - blend.duty
    lifts = stepping.lift_off(state.phase, pace.advance, blend.lift, state.gait.progress, pace.walking)
    since = state.phase - blend.lift
    since = since - jnp.floor(since)
    close = _closing(control, assets, character, state, rest, pace.walking)
    before = jnp.where(lifts | close, 0.0, state.gait.progress)
    closing_step = dt / (control.close_time * jnp.sqrt(character.scale))
    step = jnp.where(pace.walking, pace.advance / swing, closing_step)
    after = jnp.where(lifts, since / swing, jnp.where(before < 1.0, before + step, 1.0))
    aims = lifts | close | (before < stepping.REAIM_UNTIL)
    return _Swing(before, jnp.clip(after, 0.0, 1.0), aims)


def _aimed(
    herd: HerdLayout,
    control: Control,
    assets: HerdAssets,
    character: Character,
    state: State,
    other: Array,
    blend: Mix,
    pace: _Pace,
    rest: Array,
    swing: _Swing,
) -> Array:
    """[2, L, n] targets: aimed at where the foot will be wanted, without crossing the other foot, at `other`."""
    root = state.position[::2]
    stride = pace.stride * jnp.where(pace.walking, 1.0, 0.0)
    aim = stepping.landing(root[:, None], rest, stride[:, None], swing.after, blend.duty)
    return jnp.where(swing.aims, _uncrossed(herd, control, assets, character, state, other, aim), state.gait.target)


def _moved(state: State, target: Array, swing: _Swing) -> tuple[Array, Array]:
    """Handles [2, L, n] and yaws of the feet [L, n], fixed while planted."""
    yaw = jnp.broadcast_to(state.yaw, swing.before.shape)
    foot_yaw = stepping.move_handle(state.gait.foot_yaw[None], yaw[None], swing.before, swing.after)[0]
    return stepping.move_handle(state.gait.handle, target, swing.before, swing.after), foot_yaw


def _standing_rest(assets: HerdAssets, character: Character, state: State, blend: Mix) -> Array:
    """[2, L, n] m, rest place of each foot in the character frame: the gait's, or the idle clip's when standing."""
    return blend.rest + (assets.idle_rest * character.scale - blend.rest) * state.gait.idle


def _off(state: State, rest: Array) -> Array:
    """[L, n] m, how far each handle is from its rest place."""
    off = state.gait.handle - state.position[::2][:, None] - rest
    return jnp.sqrt(off[0] ** 2 + off[1] ** 2 + TINY)


def _hastened(assets: HerdAssets, character: Character, state: State, blend: Mix, pace: _Pace, rest: Array) -> _Pace:
    """A planted foot left far behind (a push) hastens the clock, up to twice."""
    half = 0.5 * blend.duty * jnp.sqrt(pace.stride[0] ** 2 + pace.stride[1] ** 2 + TINY)
    excess = jnp.where(state.gait.progress >= 1.0, _off(state, rest) - half, 0.0).max(0)
    reach = 0.25 * assets.pivot_height * character.scale
    haste = jax.lax.stop_gradient(1.0 + smoothstep((excess - 0.5 * reach) / reach))
    return pace._replace(advance=pace.advance * haste)


def _closing(
    control: Control, assets: HerdAssets, character: Character, state: State, rest: Array, walking: Array
) -> Array:
    """[L, n] legs that take a closing step: standing, too far from rest, the farthest first, one at a time."""
    far = _off(state, rest) - control.close_distance * assets.pivot_height * character.scale
    farthest = far >= far.max(0) - 1e-6
    first = jnp.stack([farthest[leg] & ~farthest[:leg].any(0) for leg in range(len(farthest))])
    still = (state.gait.progress >= 1.0).all(0)
    return first & (far > 0) & ~walking & still & (state.fault == 0)


def _uncrossed(
    herd: HerdLayout,
    control: Control,
    assets: HerdAssets,
    character: Character,
    state: State,
    other: Array,
    aim: Array,
) -> Array:
    """Targets that do not pass the partner's foot: a lateral gap in the character's own axes is kept."""
    partner = np.array(herd.partners)
    side = jnp.array([s if p != i else 0 for i, (s, p) in enumerate(zip(herd.sides, herd.partners, strict=True))])
    side = side.reshape(-1, 1).astype(aim.dtype)
    sin, cos = sin_cos(state.yaw)
    left = jnp.stack([cos, -sin])
    gap = control.foot_gap * jnp.abs(assets.idle_rest[0] - assets.idle_rest[0, partner]) * character.scale
    return leg_clearance.beside(aim, other, left[:, None], side, gap)


def _turned(place: Array, yaw: Array) -> Array:
    """[2, L, n] (x, z) of the character frame turned to the world's axes."""
    sin, cos = sin_cos(yaw)
    return jnp.stack([place[0] * cos + place[1] * sin, place[1] * cos - place[0] * sin])


def _wrap(phase: Array) -> Array:
    return phase - jnp.floor(phase)
