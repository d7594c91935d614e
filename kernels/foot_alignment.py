"""From the footbase to the ankle: where the ankle must be, how the foot turns, how high the hips can be.

(Specification of the semi-procedural locomotion system, sections 4.11, 4.13, 4.14.)
"""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Float

from kernels import quat
from kernels.trig import arctan2
from kernels.vec import TINY, cross, dot, unit

STRAIGHT = 0.999  # of a leg's length: the most that hips may be away from the ankle
MOST_DRAWN = 0.25  # of the legs' length: how far the hips follow legs that do not reach, or make way


def balance(rise: Float[Array, "*b"], length: Float[Array, "*#b"]) -> Float[Array, "*b"]:
    """0 when only the heel touches, 1 when only the toe does (2.1). rise: heel over toe along the normal, m."""
    return arctan2(20.0 * rise, length + 0.0 * rise) * (1.0 / jnp.pi) + 0.5


def plate_offset(
    heel: Float[Array, "3 *b"],
    toe: Float[Array, "3 *b"],
    plate: Float[Array, "3 *b"],
    normal: Float[Array, "3 *b"],
    length: Float[Array, "*#b"],
) -> Float[Array, "3 *b"]:
    """Heel less the plate's heel end, for a posed foot (4.11): the plate touches heel, toe or both.

    heel, toe: points of the posed foot; plate: from its heel end to its toe end.
    """
    share = balance(dot(heel - toe, normal), length)
    return (plate + heel - toe) * share


def foot_orientation(
    carried: Float[Array, "4 *b"], grounded: Float[Array, "4 *b"], lifted: Float[Array, "*b"]
) -> Float[Array, "4 *b"]:
    """The ankle's rotation (4.13): as the leg carries it in mid-flight, as the ground has it while planted."""
    w = dot(carried[1:], grounded[1:]) + carried[0] * grounded[0]
    near = jnp.where(w < 0, -carried, carried)
    return quat.normalize(grounded + (near - grounded) * lifted)


def leg_yaw(
    axis: Float[Array, "3 *b"], ahead: Float[Array, "3 *b"], foot: Float[Array, "3 *b"]
) -> Float[Array, "4 *b"]:
    """Turn of a leg about its own axis (hip to ankle) by half of the foot's yaw against the body (4.13, second pass).

    ahead, foot: unit directions of the body and of the footbase.
    """
    along = unit(axis)
    cosine = dot(ahead, foot) - dot(along, ahead) * dot(along, foot)
    sine = dot(along, cross(ahead, foot))
    # (both times the size of the projections); twice halved without trigonometry
    w = jnp.sqrt(cosine * cosine + sine * sine + TINY) + cosine
    size = jnp.sqrt(w * w + sine * sine + TINY)
    w, share = w / size + 1.0, sine / size
    size = jnp.sqrt(w * w + share * share)
    x, y, z = along * (share / size)
    return jnp.stack([w / size, x, y, z])


def within_reach(
    hip: Float[Array, "3 *b"],
    target: Float[Array, "3 *b"],
    up: Float[Array, "3 *#b"],
    pose_reach: Float[Array, "*b"],
    longest: Float[Array, "*#b"],
    softness: Float[Array, "*b"] | float,
) -> Float[Array, "3 *b"]:
    """The target with its horizontal distance from the hip limited softly (4.14). pose_reach: that of the clip, m.

    softness 0 leaves it: the original pulls planted feet inward with this (8.2 i); here they stay, the hips come down.
    """
    k = target - hip
    flat = k - up * dot(k, up)
    far = jnp.sqrt(dot(flat, flat) + TINY)
    excess = jnp.maximum(far - pose_reach, 0.0)
    room = jnp.maximum(longest - pose_reach, 1e-4)
    limited = pose_reach + excess * room / (excess + room)
    share = jnp.where(excess > 0, limited / far - 1.0, 0.0) * softness
    return target + flat * share


def hip_lift(
    hip: Float[Array, "3 legs *b"],
    target: Float[Array, "3 legs *b"],
    up: Float[Array, "3 *b"],
    pose_length: Float[Array, "legs *b"],
    longest: Float[Array, "legs *#b"],
) -> Float[Array, "*b"]:
    """How far the hips move along `up`, m (4.14): between what the lowest leg wants and what every leg allows.

    pose_length: hip to ankle in the clip's pose; longest: `STRAIGHT` of the leg's length.
    """
    away = target - hip
    rise = dot(away, up[:, None])
    level2 = dot(away, away) - rise * rise
    wants, allows = (rise + _root(radius * radius - level2) for radius in (pose_length, longest))
    most = allows.min(0)
    low = jnp.minimum(wants.min(0), most)
    a, b = jnp.maximum(wants.mean(0) - low, 0.0), jnp.maximum(most - low, 0.0)
    total = a + b
    moves = total > 1e-6
    return low + jnp.where(moves, a * b / jnp.where(moves, total, 1.0), 0.0)


def folded(
    lift: Float[Array, "*b"],
    hip: Float[Array, "3 legs *b"],
    target: Float[Array, "3 legs *b"],
    up: Float[Array, "3 *b"],
    nearest: Float[Array, "legs *#b"],
    longest: Float[Array, "legs *#b"],
) -> Float[Array, "*b"]:
    """`hip_lift`, raised until no leg is folded further than it can: `nearest` m from hip to ankle.

    Legs that arch (a spider's) on a bump near the body need that; the original has nothing there. Never so high that
    another leg does not reach. A target above its hip asks for nothing.
    """
    away = target - hip
    rise = dot(away, up[:, None])
    level2 = dot(away, away) - rise * rise
    needs = rise + _root(nearest * nearest - level2)
    needs = jnp.where((level2 < nearest * nearest) & (rise <= lift), needs, lift).max(0)
    most = (rise + _root(longest * longest - level2)).min(0)
    return jnp.maximum(lift, jnp.minimum(needs, most))


def drawn(
    hip: Float[Array, "3 legs *b"],
    target: Float[Array, "3 legs *b"],
    shift: Float[Array, "3 *b"],
    nearest: Float[Array, "legs *#b"],
    longest: Float[Array, "legs *#b"],
) -> Float[Array, "3 *b"]:
    """The hips' shift, m, drawn on to legs that would not reach and away from those that cannot fold so far.

    Where their height alone (`hip_lift`) cannot help; the original has nothing there. The mean of what those legs miss,
    weighted by it: one leg gets all, legs on opposite sides get nothing. At most `MOST_DRAWN` of the legs' mean length.
    nearest, longest: m from hip to ankle, what a leg can do. A target on the hip itself draws nowhere.
    """
    way = target - hip - shift[:, None]
    far = jnp.sqrt(dot(way, way) + TINY)
    missing = far - jnp.clip(far, nearest, longest)
    size = jnp.abs(missing)
    missed = (way * (missing * size / far)).sum(1) / (size.sum(0) + 1e-6)
    most = MOST_DRAWN * longest.mean(0)
    return shift + missed * jnp.minimum(1.0, most / jnp.sqrt(dot(missed, missed) + TINY))


def _root(square: Array) -> Array:
    """Square root; 1e-6 for anything below, where a target is out of reach and the hip is best level with it."""
    return jnp.sqrt(jnp.maximum(square, 0.0) + TINY)


def limited(
    wanted: Float[Array, "3 *b"], reference: Float[Array, "3 *b"], most: Float[Array, "*#b"]
) -> Float[Array, "3 *b"]:
    """`wanted`, no further than `most` from `reference` (4.11)."""
    way = wanted - reference
    size = jnp.sqrt(dot(way, way) + TINY)
    return reference + way * jnp.minimum(1.0, most / size)
