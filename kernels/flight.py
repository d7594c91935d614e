"""The footbase in flight: from one footprint to the next along the clip's own curve, over the ground.

The footbase is a plate under the foot, at right angles to the ground's normal and as long as the foot; it is the only
thing the gait moves, the ankle follows from it. (Specification of the semi-procedural locomotion system, section 4.8,
4.10; trajectories 2.11, 2.12.)
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from kernels import trig
from kernels.footprint import Footprint, about, tilted, turned_towards
from kernels.leg_cycle import KeyTimes, ilerp
from kernels.vec import TINY, cross, dot, unit
from kernels.wall import Wall, no_wall


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
    wall: Wall = no_wall,
) -> Support:
    """Supporting height (4.8). stance: stance places turned to the body's yaw, relative to the root; direction: unit
    (x, z) of travel in the world; way: m travelled in a cycle. Feet in mid-flight hardly count.

    The footprints' own yaw turns the travel in the original; the body's is used here: the same while it goes straight.
    """

    def followed(before: Footprint, after: Footprint, time: Array, share: Array, direction: Array, way: Array) -> Array:
        ahead = (jnp.stack([direction[0], jnp.zeros_like(way), direction[1]]) * way)[:, None]
        here = before.position + tilted(ahead, before.normal) * time
        there = after.position + tilted(ahead, after.normal) * (time - 1.0)
        return here + (there - here) * share

    def mean(footing: Array, stance: Array, weight: Array) -> Array:
        return ((footing[1] - stance[1]) * weight).sum(0) / weight.sum(0)

    def travelled(before: Footprint, after: Footprint, weight: Array) -> Array:
        return ((after.position - before.position) * (1.0 - weight + 2e-3)).sum(1)

    weight = wall(lambda time: 0.5 + 0.5 * trig.cos(2.0 * jnp.pi * time) + 1e-3, time)
    share = wall(
        lambda lift, land, time: 0.5 - 0.5 * trig.cos(jnp.pi * ilerp(lift, land, time)), keys.lift, keys.land, time
    )
    footing = wall(followed, before, after, time, share, direction, way)
    return Support(wall(mean, footing, stance, weight), footing, wall(travelled, before, after, weight))


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
    wall: Wall = no_wall,
) -> Footbase:
    """The plate of every leg (4.10). curve: `trajectory` times the character's scale in its first two rows.

    root: the body's place; up: the legs' up axis; base_height: `Support.height` on the ground's level; most_turn: rad
    that a foot may turn against the body.
    """
    flight = wall(ilerp, keys.liftoff, keys.strike, time)
    arc = wall(_arc, before, after, up)
    arches = wall(lambda along, flight: (trig.sin(jnp.pi * along), trig.sin(jnp.pi * flight)), curve[2], flight)
    place = wall(_place, root, stance, before, after, time, curve, arc, arches, up, base_height)
    turned = wall(_turned, yaw, before, after, flight, most_turn)
    normal = wall(_normal, before, after, flight)
    return Footbase(place, turned, normal, wall(_sole, before, after, flight, turned, normal))


def _place(
    root: Array,
    stance: Array,
    before: Footprint,
    after: Footprint,
    time: Array,
    curve: Array,
    arc: Array,
    arches: tuple[Array, Array],
    up: Array,
    base_height: Array,
) -> Array:
    """[3, legs, *b] heel ends: chord, sway, terrain arc or the clip's lift, and the ground that carries the body."""
    side, lift, along = curve
    axis = up[:, None]
    arch, swell = arches
    start, end = before.position, after.position
    stray = root[:, None] + stance - (start + (end - start) * jnp.clip(time, 0.0, 1.0))
    stray = stray - axis * dot(stray, axis)
    raised = jnp.maximum(lift, arc * arch)
    place = start + (end - start) * along + stray * arch + axis * raised + unit(cross(axis, end - start)) * side
    # the foot swings no lower than the ground that carries the body: over the edge of the step, not along its face
    higher = jnp.maximum((base_height - place[1]) * swell, 0.0)
    return place + axis * (higher / axis[1])


def _sole(before: Footprint, after: Footprint, flight: Array, turned: Array, normal: Array) -> Array:
    foot = before.foot + (after.foot - before.foot) * flight
    return tilted(about(jnp.stack([foot[0], jnp.zeros_like(flight), foot[1]]), turned), normal)


def _arc(before: Footprint, after: Footprint, up: Array) -> Array:
    """[legs, *b] m, height of the tangents to the steeper footprint at mid-way, over the chord; 0 on any plane."""
    axis, half = up[:, None], 0.5 * (after.position - before.position)
    own = -dot(before.normal, half) / jnp.maximum(dot(before.normal, axis), 0.1)
    other = dot(after.normal, half) / jnp.maximum(dot(after.normal, axis), 0.1)
    return jnp.maximum(jnp.maximum(own, other) * (2.0 / jnp.pi), 0.0)


def _turned(yaw: Array, before: Footprint, after: Footprint, flight: Array, most_turn: Array) -> Array:
    """Yaw of the plate: print, body, print.

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
    return turned + (bounded - turned) * (4.0 * flight * (1.0 - flight))


def _normal(before: Footprint, after: Footprint, flight: Array) -> Array:
    normal = before.normal + (after.normal - before.normal) * flight
    return normal / jnp.sqrt(dot(normal, normal) + TINY)
