"""The footbase in flight: from one footprint to the next along the clip's own curve, over the ground.

The footbase is a plate under the foot, at right angles to the ground's normal and as long as the foot; it is the only
thing the gait moves, the ankle follows from it. (Specification of the semi-procedural locomotion system, section 4.8,
4.10; trajectories 2.11, 2.12.)
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from kernels.footprint import Footprint, about, tilted, turned_towards
from kernels.leg_cycle import KeyTimes, ilerp
from kernels.vec import TINY, cross, dot, unit


class Footbase(NamedTuple):
    """The plate under each foot."""

    position: Array  # [3, legs, *b] m, heel end
    yaw: Array  # [legs, *b] rad
    normal: Array  # [3, legs, *b] unit
    sole: Array  # [3, legs, *b] m, heel end to toe end


class Support(NamedTuple):
    """What the footprints say of the ground under the body (4.8)."""

    height: Array  # [*b] m, of the ground that carries the body
    footing: Array  # [3, legs, *b] m, where each foot stands, followed through its flight
    travel: Array  # [3, *b] m, weighted way of the steps


def trajectory(
    table: Float[Array, "entries 3"], samples: int, weight: Float[Array, "motions *b"], flight: Float[Array, "legs *b"]
) -> Float[Array, "3 legs *b"]:
    """Blended normalised trajectory (sideways m, up m, share of the way) at each leg's share of its flight.

    table: [motions * legs * samples, 3], samples evenly from liftoff to strike of every motion: phase-warped already.
    """
    motions, legs = weight.shape[0], flight.shape[0]
    at = jnp.clip(flight, 0.0, 1.0) * (samples - 1)
    first = jnp.clip(jnp.floor(at).astype(jnp.int32), 0, samples - 2)
    share = at - first
    leg = jnp.arange(legs).reshape(-1, *(1,) * (flight.ndim - 1)) * samples
    total = [jnp.zeros_like(at)] * 3
    for motion in range(motions):
        index = motion * legs * samples + leg + first
        low, high = weight[motion] * (1.0 - share), weight[motion] * share
        total = [sum_ + table[index, k] * low + table[index + 1, k] * high for k, sum_ in enumerate(total)]
    return jnp.stack(total)


def support(
    stance: Float[Array, "3 legs *b"],
    before: Footprint,
    after: Footprint,
    time: Float[Array, "legs *b"],
    keys: KeyTimes,
    direction: Float[Array, "2 *b"],
    way: Float[Array, "*b"],
) -> Support:
    """Supporting height (4.8). stance: stance places turned to the body's yaw, relative to the root; direction: unit
    (x, z) of travel in the world; way: m travelled in a cycle. Feet in mid-flight hardly count.

    The footprints' own yaw turns the travel in the original; the body's is used here: the same while it goes straight.
    """
    weight = 0.5 + 0.5 * jnp.cos(2.0 * jnp.pi * time) + 1e-3
    share = 0.5 - 0.5 * jnp.cos(jnp.pi * ilerp(keys.lift, keys.land, time))
    ahead = jnp.stack([direction[0], jnp.zeros_like(way), direction[1]]) * way
    here = before.position + tilted(ahead[:, None], before.normal) * time
    there = after.position + tilted(ahead[:, None], after.normal) * (time - 1.0)
    footing = here + (there - here) * share
    total = weight.sum(0)
    height = ((footing[1] - stance[1]) * weight).sum(0) / total
    travel = ((after.position - before.position) * (1.0 - weight + 2e-3)).sum(1)
    return Support(height, footing, travel)


def footbase(
    root: Float[Array, "3 *b"],
    yaw: Float[Array, "*b"],
    stance: Float[Array, "3 legs *b"],
    before: Footprint,
    after: Footprint,
    time: Float[Array, "legs *b"],
    keys: KeyTimes,
    curve: Float[Array, "3 legs *b"],
    up: Float[Array, "3 *b"],
    base_height: Float[Array, "*b"],
    most_turn: Float[Array, "*#b"],
) -> Footbase:
    """The plate of every leg (4.10). curve: `trajectory` times the character's scale in its first two rows.

    root: the body's place; up: the legs' up axis; base_height: `Support.height` on the ground's level; most_turn: rad
    that a foot may turn against the body.
    """
    flight = ilerp(keys.liftoff, keys.strike, time)
    side, lift, along = curve
    arch = jnp.sin(jnp.pi * along)
    axis = up[:, None]
    start, end = before.position, after.position
    chord = start + (end - start) * along
    stray = root[:, None] + stance - (start + (end - start) * jnp.clip(time, 0.0, 1.0))
    stray = stray - axis * dot(stray, axis)
    raised = jnp.maximum(lift, _arc(before, after, axis) * arch)
    way = cross(axis, end - start)
    place = chord + stray * arch + axis * raised + unit(way) * side
    # the foot swings no lower than the ground that carries the body: over the edge of the step, not along its face
    held = place + axis * ((base_height - place[1]) / axis[1])
    wanted = place + (held - place) * jnp.sin(jnp.pi * flight)
    place = jnp.where(dot(wanted - place, axis) > 0, wanted, place)
    turned, normal = _attitude(yaw, before, after, flight, most_turn)
    foot = before.foot + (after.foot - before.foot) * flight
    level = about(jnp.stack([foot[0], jnp.zeros_like(flight), foot[1]]), turned)
    return Footbase(place, turned, normal, tilted(level, normal))


def _arc(before: Footprint, after: Footprint, axis: Array) -> Array:
    """[legs, *b] m, height of the tangents to the steeper footprint at mid-way, over the chord; 0 on any plane."""
    half = 0.5 * (after.position - before.position)
    own = -dot(before.normal, half) / jnp.maximum(dot(before.normal, axis), 0.1)
    other = dot(after.normal, half) / jnp.maximum(dot(after.normal, axis), 0.1)
    return jnp.maximum(jnp.maximum(own, other) * (2.0 / jnp.pi), 0.0)


def _attitude(
    yaw: Array,
    before: Footprint,
    after: Footprint,
    flight: Array,
    most_turn: Array,
) -> tuple[Array, Array]:
    """Yaw (print, body, print) and normal (print to print) of the plate.

    The original turns it between lift and land, while it still or already touches the ground with an end; here it turns
    in flight alone.
    """
    share = 2.0 * flight
    body = jnp.broadcast_to(yaw, flight.shape)
    away = turned_towards(before.yaw, body, jnp.inf) - before.yaw
    back = turned_towards(body, after.yaw, jnp.inf) - body
    turned = jnp.where(share < 1.0, before.yaw + away * share, body + back * (share - 1.0))
    # a foot that stands is not turned by the body, however far that has gone; in flight it comes back within bounds
    bounded = turned_towards(body, turned, most_turn)
    turned = turned + (bounded - turned) * (4.0 * flight * (1.0 - flight))
    normal = before.normal + (after.normal - before.normal) * flight
    return turned, normal / jnp.sqrt(dot(normal, normal) + TINY)
