"""Footprints: where and how a foot will stand, predicted in flight and frozen once it has landed.

A footprint is the heel end of the footbase, a yaw, and the normal of the ground under it: with the body's up axis
vertical, tilting by the shortest arc and turning upright again are exact inverses, so that yaw and normal say all that
a rotation would. (Specification of the semi-procedural locomotion system, sections 4.4, 4.5, 4.7.)
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from kernels import trig
from kernels.trig import sin_cos
from kernels.vec import TINY, axis, dot, unit, with_row
from kernels.wall import Wall, no_wall

LEDGE = 0.25  # of the foot's length: heel and toe further apart along the normal stand on different levels

ROOM = 0.06  # of the foot's length: how much of it rolls over its ends, and must not touch the next riser


class Footprint(NamedTuple):
    """Where a foot stands. The foot's own vector goes with it: a blend that changes does not turn a planted foot."""

    position: Array  # [3, *b] m, heel end
    yaw: Array  # [*b] rad
    normal: Array  # [3, *b] unit, of the ground
    foot: Array  # [2, *b] m, heel to toe end (x, z) before yaw and tilt

    @property
    def sole(self) -> Array:
        """[3, *b] m, heel end to toe end as it lies on the ground."""
        x, z = self.foot
        return tilted(about(jnp.stack([x, jnp.zeros_like(x), z]), self.yaw), self.normal)


class Hit(NamedTuple):
    """The ground under a point: height [*b] m and slope [2, *b], d(height)/d(x, z)."""

    height: Array
    slope: Array


def swept(velocity: Float[Array, "2 *#b"], angle: Float[Array, "*b"], time: Float[Array, "*b"]) -> Float[Array, "2 *b"]:
    """Way (x, z) in `time` seconds at a constant speed while turning evenly by `angle` rad: an arc or a straight line.

    The arc's chord is sin(a)/a along the mean direction; both turn directions are alike (mended defect 8.2 a).
    """
    half = 0.5 * angle
    small = jnp.abs(half) < 1e-3
    safe = jnp.where(small, 1.0, half)
    sin, cos = sin_cos(half)
    length = jnp.where(small, 1.0 - half * half / 6.0, trig.sin(safe) / safe) * time
    x, z = velocity
    return jnp.stack([(x * cos + z * sin) * length, (z * cos - x * sin) * length])


def swept_one_sided(
    velocity: Float[Array, "2 *#b"], turn: Float[Array, "*#b"], time: Float[Array, "*b"], cycle: Float[Array, "*#b"]
) -> Float[Array, "2 *b"]:
    """`swept` as the original has it (8.2 a): turns to the negative side, and below 5 degrees a cycle, go straight."""
    bends = turn * cycle >= jnp.pi / 36.0
    return jnp.where(bends, swept(velocity, turn * time, time), velocity * time)


def turned_towards(
    old: Float[Array, "*b"], wanted: Float[Array, "*b"], most: Float[Array, "*#b"] | float
) -> Float[Array, "*b"]:
    """Yaw that turns from old towards wanted the short way, by at most `most` rad."""
    full = 2.0 * jnp.pi
    error = wanted - old
    error = error - full * jnp.floor(error / full + 0.5)
    return old + jnp.clip(error, -most, most)


def about(place: Float[Array, "3 *#b"], yaw: Float[Array, "*#b"]) -> Float[Array, "3 *b"]:
    """A place of the character frame turned by a yaw."""
    sin, cos = sin_cos(yaw)
    x, y, z = place
    return jnp.stack([x * cos + z * sin, y + 0.0 * cos, z * cos - x * sin])


def smoothed(
    current: Float[Array, "3 *b"],
    goal: Float[Array, "3 *b"],
    predicted: Float[Array, "3 *b"],
    time: Float[Array, "*b"],
    strike: Float[Array, "*b"],
    flight: Float[Array, "*b"],
    begins: Bool[Array, "*b"],
    seek: Float[Array, "*#b"],
    cycle: Float[Array, "*#b"],
    designated: Float[Array, "*b"],
    dt: float | Array,
    wall: Wall = no_wall,
) -> tuple[Float[Array, "3 *b"], Float[Array, "3 *b"], Bool[Array, "*b"]]:
    """Footprint position, its goal, and whether that is the prediction, after the frame (4.5), while time < strike.

    A new step takes the prediction as it is. Later the goal follows it as long as the foot could still get there at the
    seek speed (m/s), and the print closes the gap in the time that is left. flight: share of the flight done.
    """

    def follows(current: Array, predicted: Array, time: Array, strike: Array, begins: Array, seek: Array) -> Array:
        gap = predicted - current
        reach = seek * (1.0 / jnp.maximum(time / strike, 1e-3) - 1.0)
        return begins | (dot(gap, gap) < reach * reach)

    def closing(
        current: Array, aim: Array, time: Array, strike: Array, flight: Array, seek: Array, left: Array
    ) -> Array:
        u = jnp.maximum(time / strike, 1e-3)
        error = aim - current
        size = jnp.sqrt(dot(error, error) + TINY)
        share = (1.0 + 2.0 * (u - 1.0) ** 2) * dt / jnp.maximum(left, dt)
        share = jnp.maximum(share, seek * dt / jnp.maximum(flight, 0.1) / size)
        return jnp.where(left > 0, jnp.minimum(share, 1.0), 0.0)

    def moved(current: Array, aim: Array, share: Array, begins: Array) -> Array:
        # the last bit of the way is taken whole, so that a print that has arrived stands still
        return jnp.where(begins | (share >= 1.0), aim, current + (aim - current) * share)

    fresh = wall(follows, current, predicted, time, strike, begins, seek)
    aim = wall(lambda fresh, predicted, goal: jnp.where(fresh, predicted, goal), fresh, predicted, goal)
    left = wall(lambda strike, designated, cycle: (strike - designated) * cycle, strike, designated, cycle)
    share = wall(closing, current, aim, time, strike, flight, seek, left)
    return wall(moved, current, aim, share, begins), aim, fresh


def placed(
    heel: Float[Array, "3 *b"],
    yaw: Float[Array, "*b"],
    foot: Float[Array, "2 *b"],
    at_heel: Hit,
    at_toe: Hit,
    least_normal_y: Float[Array, "*#b"],
    window: Float[Array, "*#b"],
) -> Footprint:
    """The print on the ground under a heel at `heel` with the foot vector `foot` (heel to toe, x and z, m).

    The two rays of 4.7 are look-ups here: a hit further than `window` above or below the heel counts as missed, a
    normal less upright than `least_normal_y` is not accepted. Where heel and toe stand on different levels, or the
    plane along both would be that steep, the higher one carries the foot, on its own ground and centred on its edge;
    elsewhere the foot lies along both (the original lays it on one of them, and its other end then cuts into hollows).
    Nothing hit: where it was, level.
    """
    sole = about(jnp.stack([foot[0], jnp.zeros_like(foot[0]), foot[1]]), yaw)
    hit_a, hit_b = (jnp.abs(hit.height - heel[1]) <= window for hit in (at_heel, at_toe))
    normal_a, normal_b = normal_of(at_heel.slope), normal_of(at_toe.slope)
    good_a, good_b = hit_a & (normal_a[1] > least_normal_y), hit_b & (normal_b[1] > least_normal_y)
    a = jnp.stack([heel[0], at_heel.height, heel[2]])
    b = jnp.stack([heel[0] + sole[0], at_toe.height, heel[2] + sole[2]])
    both, one = good_a & good_b, good_a ^ good_b
    mean = unit(normal_a + normal_b)
    rise = dot(b - a, mean)
    along = _along_both(sole, b - a, mean)
    apart = (jnp.abs(rise) > LEDGE * jnp.sqrt(dot(sole, sole) + TINY)) | (along[1] <= least_normal_y)
    ledge = both & apart
    by_toe = jnp.where(both, ledge & (rise > 0), good_b & ~good_a)
    by_toe = jnp.where(both | one, by_toe, ~hit_a & hit_b)
    up = axis(mean, 1)
    single = jnp.where(both | one, jnp.where(by_toe, normal_b, normal_a), up)
    normal = jnp.where(both & ~ledge, along, single)
    ahead = tilted(sole, normal)
    shift = jnp.where(ledge | one, jnp.where(by_toe, 0.5, -0.5), 0.0)
    position = jnp.where(by_toe, b - ahead, a) + ahead * shift
    missed = ~(hit_a | hit_b)
    return Footprint(jnp.where(missed, heel, position), yaw, jnp.where(missed, up, normal), foot)


def _along_both(h: Array, way: Array, mean: Array) -> Array:
    """Unit normal at right angles to the line from heel to toe, rolled as the mean normal is."""
    length = jnp.sqrt(h[0] * h[0] + h[2] * h[2] + TINY)
    x, z, rise = h[0] / length, h[2] / length, way[1] / length
    side = -(mean[0] * z - mean[2] * x) / jnp.maximum(mean[1], 0.1)  # slope across the foot
    return unit(jnp.stack([-(rise * x + side * z), jnp.ones_like(rise), -(rise * z - side * x)]))


def sole_points(print_: Footprint) -> Float[Array, "3 5 *b"]:
    """Five points along the print, from just behind its heel end to just ahead of its toe end."""
    ahead = print_.sole
    shares = jnp.arange(5, dtype=ahead.dtype).reshape(5, *(1,) * (ahead.ndim - 1)) / 4.0
    shares = shares * (1.0 + 2.0 * ROOM) - ROOM
    return print_.position[:, None] + ahead[:, None] * shares


def settled(print_: Footprint, points: Float[Array, "3 5 *b"], ground: Float[Array, "5 *b"]) -> Footprint:
    """The print where nothing sticks through its sole. points: `sole_points`; ground: heights there, m.

    Bumps up to a quarter of the foot's length lift it. A higher edge before or behind its middle (the next riser of a
    stair) is stepped back from, along the foot, to the nearest sample that was clear.
    """
    ahead = print_.sole
    length = jnp.sqrt(dot(ahead, ahead) + TINY)
    inside = (ground - points[1]) / length
    wall = inside > LEDGE
    front = jnp.where(wall[3], 0.5, jnp.where(wall[4], 0.25, 0.0))
    back = jnp.where(wall[1], 0.5, jnp.where(wall[0], 0.25, 0.0))
    squeezed = wall[2] | ((front > 0) & (back > 0))
    shift = jnp.where(squeezed, 0.0, back - front)
    bump = jnp.where(wall & ~squeezed, 0.0, inside).max(0)
    lift = jnp.maximum(bump, 0.0) * length
    position = print_.position + ahead * shift
    return print_._replace(position=with_row(position, 1, position[1] + lift))


def tilted(h: Float[Array, "3 *#b"], normal: Float[Array, "3 *b"]) -> Float[Array, "3 *b"]:
    """A level vector after the shortest arc from vertical to the normal."""
    nx, ny, nz = normal
    hx, _, hz = h
    flat = (nx * hx + nz * hz) / (1.0 + ny)
    return jnp.stack([hx - nx * flat, -(nx * hx + nz * hz), hz - nz * flat])


def normal_of(slope: Float[Array, "2 *b"]) -> Float[Array, "3 *b"]:
    """Unit normal of a ground with the slope d(height)/d(x, z)."""
    return unit(jnp.stack([-slope[0], jnp.ones_like(slope[0]), -slope[1]]))
