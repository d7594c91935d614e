"""Leg cycles of the semi-procedural system: how long a cycle lasts, where each leg is in it, and when it rests.

A leg's cycle runs from stance to stance. Its *designated* time is what the common clock says; its *cycle time* is what
the leg does, which lags while it catches up after resting. Key times are in cycle time: lift <= liftoff <= postlift,
preland <= strike <= land. (Semi-procedural locomotion system, sections 3.5 to 3.7, 4.3, 4.6, 4.15.)
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from kernels.trig import arctan2
from kernels.vec import TINY, smoothstep

STANCE, LIFT, FLIGHT, LAND = 0, 1, 2, 3  # phases of a foot; the steps between them are the foot events
UNPARK_UNTIL = 0.67  # of the designated cycle: later a resting leg waits for the next one
CATCH_UP = 0.08  # cycles: the least time that a late step is given until its strike


class KeyTimes(NamedTuple):
    """In cycles after stance; every field `[legs, *b]`."""

    lift: Array
    liftoff: Array
    postlift: Array
    preland: Array
    strike: Array
    land: Array


class Cycle(NamedTuple):
    """Where each leg is; every field `[legs, *b]`."""

    designated: Array  # cycles since stance by the clock, in [0, 1)
    time: Array  # the leg's own, <= designated
    parked: Array  # bool
    begins: Array  # bool: the clock passed this leg's stance in this frame


def ilerp(a: Float[Array, "*#b"], b: Float[Array, "*#b"], v: Float[Array, "*#b"]) -> Float[Array, "*#b"]:
    """Where v lies between a and b, in [0, 1]; 0 when a equals b."""
    width = b - a
    safe = jnp.where(jnp.abs(width) > 1e-9, width, 1.0)
    return jnp.where(jnp.abs(width) > 1e-9, jnp.clip((v - a) / safe, 0.0, 1.0), 0.0)


def duration(
    frequency: Float[Array, "*b"],
    clip_speed: Float[Array, "*b"],
    speed: Float[Array, "*b"],
    turn: Float[Array, "*b"],
    acceleration: Float[Array, "*b"],
    longest: Float[Array, "*#b"],
    most_turn: Float[Array, "*#b"],
    most_acceleration: Float[Array, "*#b"],
) -> Float[Array, "*b"]:
    """Duration of a cycle, s (3.6). With one walk it is the clip's stride over the speed: cadence follows the speed.

    frequency: mean of 1/T over walk cycles (0: none has weight); clip_speed: mean speed of the blend at this size, m/s;
    speed, turn (rad/s, >= 0) and acceleration (m/s2, >= 0) of the character. longest s; most_turn rad per cycle.
    """
    walks = frequency > TINY
    base = jnp.where(walks, 1.0 / jnp.where(walks, frequency, 1.0), longest)
    fits = (speed > 1e-5) & (clip_speed > 1e-6)
    base = jnp.where(fits, base * clip_speed / jnp.where(fits, speed, 1.0), base)
    base = jnp.minimum(base, most_turn / jnp.maximum(turn, 1e-6))
    rush = most_acceleration / jnp.maximum(acceleration, 1e-6)
    return jnp.minimum(jnp.clip(rush, 0.5 * base, base), longest)


def hurry(twist: Float[Array, "legs *b"], most: Float[Array, "*#b"]) -> Float[Array, "*b"]:
    """How much faster the cycle goes when a standing foot lags behind the body's yaw: 1 up to half of `most`, then 2.

    twist, most: rad. Sudden turns outrun the smoothed yaw rate by which prints are predicted (4.1).
    """
    return 1.0 + smoothstep((jnp.abs(twist) / most - 0.5) * 1.25).max(0)


def advance(
    clock: Float[Array, "*#b"],
    stance: Float[Array, "legs *b"],
    designated: Float[Array, "legs *b"],
    time: Float[Array, "legs *b"],
    parked: Bool[Array, "legs *b"],
    strike: Float[Array, "legs *b"],
) -> Cycle:
    """Leg cycles after the frame (4.3), as if no leg rested; `parking` decides that. clock, stance: in cycles.

    designated, time, parked: of the frame before. A leg on schedule has its own time equal to the designated one, to
    the last bit. One that left its rest at designated time d0 catches up on the straight line
    time = strike (d - d0) / (strike - d0), whatever the frame rate, and is on schedule from its strike on.
    """
    now = clock - stance
    now = now - jnp.floor(now)
    begins = now < designated - 0.5
    left = strike - designated
    behind = left > 1e-6
    caught = strike - (strike - time) * (strike - now) / jnp.where(behind, left, 1.0)
    own = jnp.where(behind & (time < designated), jnp.minimum(caught, now), now)
    own = jnp.where(now >= strike, now, own)
    own = jnp.where(begins, jnp.where(parked, 0.0, now), own)
    return Cycle(now, own, parked, begins)


def parking(
    cycle: Cycle,
    was_parked: Bool[Array, "legs *b"],
    distance: Float[Array, "legs *b"],
    turn: Float[Array, "legs *b"],
    least_distance: Float[Array, "*#b"],
    least_turn: Float[Array, "*#b"],
    strike: Float[Array, "legs *b"],
) -> tuple[Bool[Array, "legs *b"], Float[Array, "legs *b"]]:
    """Which legs rest, and their own time (4.6). distance m and turn rad: of the step that would be taken.

    A leg rests when its new step is too small to be worth it. It sets out, and catches up, as soon as the step that it
    would take has grown, unless the cycle is too far gone. In the original that is at 0.67 even where the foot strikes
    earlier (long stances, backwards clips), and the foot then jumps to its print. Never before 0.5: of two legs in
    turn one can always set out.
    """
    worth = (distance > least_distance) | (turn > least_turn)
    until = jnp.clip(strike - CATCH_UP, 0.5, UNPARK_UNTIL)
    parked = jnp.where(cycle.begins, ~worth, was_parked & ~(worth & (cycle.designated < until)))
    return parked, jnp.where(parked, 0.0, cycle.time)


def foot_phase(phase: Int[Array, "legs *b"], time: Float[Array, "legs *b"], keys: KeyTimes) -> Int[Array, "legs *b"]:
    """The foot's phase after a frame (4.15): one transition a frame, in this order."""
    lifts = (time >= keys.lift) & (time < keys.land)
    flies = (time >= keys.liftoff) | (time < keys.lift)
    strikes = (time >= keys.strike) | (time < keys.liftoff)
    lands = (time >= keys.land) | (time < keys.strike)
    moves = jnp.where(
        phase == STANCE, lifts, jnp.where(phase == LIFT, flies, jnp.where(phase == FLIGHT, strikes, lands))
    )
    return jnp.where(moves, (phase + 1) % 4, phase)


def lifted(time: Float[Array, "legs *b"], keys: KeyTimes) -> Float[Array, "legs *b"]:
    """0 while the foot keeps to the ground's attitude, 1 while it keeps to the leg's (4.13): ramps of the key times."""
    up = ilerp(keys.lift, keys.postlift, time)
    down = 1.0 - ilerp(keys.preland, keys.land, time)
    return jnp.minimum(jnp.where(time >= keys.postlift, 1.0, up), jnp.where(time <= keys.preland, 1.0, down))


def circular_mean(
    cosine: Float[Array, "motions legs *#b"], sine: Float[Array, "motions legs *#b"], weight: Float[Array, "motions *b"]
) -> Float[Array, "legs *b"]:
    """Weighted mean of phases on the circle, cycles in [0, 1) (3.5); cosine, sine: of 2 pi phase. 0 when all cancel."""
    c = sum(cosine[m] * weight[m] for m in range(cosine.shape[0]))
    s = sum(sine[m] * weight[m] for m in range(sine.shape[0]))
    turns = arctan2(s, c) / (2.0 * jnp.pi)
    return turns - jnp.floor(turns)
