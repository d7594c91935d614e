"""Inverse kinematics of legs of any number of bones (locomotion specification 5.3).

All joints bend by one relation, each about its own axis: straightening scales every bend by the same factor, folding
adds the same angle to every bend. The leg is then swung as a whole. So a leg keeps its plan: knees and hocks stay on
their sides, and no bone twists. A joint's bend is the angle between its bones, 0 when straight.

The one unknown is `y`: with it the reach falls nearly in a straight line, even from a stretched leg, so that Newton
steps kept in a bracket get there soon. Straightening multiplies bends by sqrt(y), y from 1 to 0; folding adds
sqrt(w^2 + y) - w to them, y from 0 up, w a typical bend. The search is not differentiated: the last step is, and gives
the derivative of the solution.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from kernels import quat
from kernels.trig import arctan2
from kernels.vec import TINY, cross, dot, norm, unit
from kernels.wall import Wall, no_wall

STRAIGHT = 1e-4  # sine of a bend; below, a joint has no axis and keeps its bend
FOLD = np.pi / 6  # step of the search for a bracket (specification 5.3)
FOLDS = 6  # up to half a turn
STEPS = 8  # of Newton, in the bracket
SHORT = 1e-5  # m; shorter bones have no direction
FOLDED = 1e-3  # of the length; hip to ankle below
LEAST = 0.02  # rad, of the typical bend
NOTHING = 1e-10  # m^2; a target or a leg end that near to the hip has no direction
_FLAT = 1e-8  # smallest y and smallest slope: roots and quotients stay finite
_SIN = (
    0.9999999999827677,
    -0.1666666661642123,
    0.008333330958758585,
    -1.984085912452894e-4,
    2.752516069376e-6,
    -2.38872e-8,
)
_COS = (0.9999999997772736, -0.499999993505528, 0.041666635966945, -1.388835770734148e-3, 2.47599723101e-5, -2.60481e-7)


_Components = tuple[jax.Array, jax.Array, jax.Array]


class _Leg(NamedTuple):
    """A leg's bones and joints."""

    bones: Float[Array, "3 bones *b"]
    axes: Float[Array, "3 joints *b"]  # unit; 0 without a bend
    bends: Float[Array, "joints *b"]  # rad; 0 without an axis
    typical: Float[Array, "*b"]  # rad
    length: Float[Array, "*b"]  # m


def chain(
    points: Float[Array, "3 joints *b"], target: Float[Array, "3 *b"], tolerance: float = 1e-3, wall: Wall = no_wall
) -> tuple[Float[Array, "3 joints *b"], Float[Array, "*b"]]:
    """The leg bent and swung so that its end meets the target, and how far it stays away from it (m).

    points: hip first, ankle last, at least two bones, world frame; bones of length 0 (padding: the hip repeated) stay
    so. tolerance: of the leg's length, for the reach. Out of reach the leg is straight within the tolerance and points
    at the target; nearer than it can fold it is as short as it gets; a target at the hip leaves its direction. Joints
    that are straight have no axis and stay straight.
    """
    leg = wall(_leg, points[:, 1:] - points[:, :-1])
    way = target - points[:, 0]
    distance = norm(way)
    reach = jnp.minimum(distance, (1.0 - 0.25 * tolerance) * leg.length)
    turned = _turned(leg, _bent(leg, reach, wall), way, None, wall)
    places = [points[:, 0]]
    for i, turn in enumerate(turned):
        places.append(
            wall(lambda above, turn, bone: above + quat.rotate(turn, bone), places[-1], turn, leg.bones[:, i])
        )
    return jnp.stack(places, 1), norm(places[-1] - target)


def turns(
    before: Float[Array, "3 joints *b"], after: Float[Array, "3 joints *b"], wall: Wall = no_wall
) -> Float[Array, "4 bones *b"]:
    """World rotation of each bone from a leg's pose to the pose that `chain` made of it.

    Composed as `chain` does: the swing of the whole leg, then each joint's bend about its own axis, so bones do not
    twist about themselves. What is then left between a bone and its place (nothing, unless `after` is another leg's
    pose) is made up by the smallest rotation. Rotations of bones of length 0 are those of the joint above.
    """
    leg = wall(_leg, before[:, 1:] - before[:, :-1])
    bones = after[:, 1:] - after[:, :-1]
    bends = jnp.where(leg.bends > 0, wall(_angles, bones), leg.bends)
    turned = _turned(leg, bends, after[:, -1] - after[:, 0], bones[:, -1], wall)
    return jnp.stack([wall(_made_up, turn, leg.bones[:, i], bones[:, i]) for i, turn in enumerate(turned)], 1)


def _made_up(
    turn: Float[Array, "4 *b"], bone: Float[Array, "3 *b"], goal: Float[Array, "3 *b"]
) -> Float[Array, "4 *b"]:
    """The turn, and then the smallest one that brings the bone to its goal."""
    return quat.multiply(quat.between(unit(quat.rotate(turn, bone)), unit(goal)), turn)


def _leg(bones: Float[Array, "3 bones *b"]) -> _Leg:
    lengths = norm(bones)
    normal = cross(unit(bones[:, :-1]), unit(bones[:, 1:]))
    sine = norm(normal)
    there = (sine > STRAIGHT) & (jnp.minimum(lengths[:-1], lengths[1:]) > SHORT)
    axes = jnp.where(there, normal / jnp.where(there, sine, 1.0), 0.0)
    bends = jnp.where(there, _angles(bones), 0.0)
    count = jnp.maximum(_sum(there.astype(bends.dtype)), 1.0)
    typical = jnp.sqrt(_sum(bends * bends) / count + LEAST**2)
    return _Leg(bones, axes, bends, typical, _sum(lengths))


def _angles(bones: Float[Array, "3 bones *b"]) -> Float[Array, "joints *b"]:
    """Between neighbouring bones, 0 to pi; right angles with bones of length 0."""
    a, b = unit(bones[:, :-1]), unit(bones[:, 1:])
    return arctan2(norm(cross(a, b)), dot(a, b))


def _bends_at(
    leg: _Leg, folds: Bool[Array, "*b"], y: Float[Array, "*b"]
) -> tuple[Float[Array, "joints *b"], Float[Array, "joints *b"]]:
    """Every joint's bend at y, and its derivative. No bend passes half a turn."""
    root = jnp.sqrt(jnp.maximum(y, 0.0) + jnp.where(folds, leg.typical * leg.typical, _FLAT))
    more = leg.bends + (root - leg.typical)
    bends = jnp.where(folds, jnp.minimum(more, np.pi), leg.bends * root)
    slope = jnp.where(folds, jnp.where(more < np.pi, 1.0, 0.0), leg.bends) * (0.5 / root)
    there = leg.bends > 0
    return jnp.where(there, bends, 0.0), jnp.where(there, slope, 0.0)


def _sine_cosine(angle: Float[Array, "*b"]) -> tuple[Float[Array, "*b"], Float[Array, "*b"]]:
    """Of angles within half a turn either way, exact in float32: polynomials of the half angle, made one unit long."""
    half = 0.5 * angle
    square = half * half
    sine, cosine = jnp.zeros_like(angle), jnp.zeros_like(angle)
    for s, c in zip(reversed(_SIN), reversed(_COS), strict=True):
        sine, cosine = sine * square + s, cosine * square + c
    sine = sine * half
    return sine, cosine


def _end(
    leg: _Leg, bends: Float[Array, "joints *b"], slopes: Float[Array, "joints *b"]
) -> tuple[_Components, _Components]:
    """From hip to ankle before the swing, and its derivative for the given slopes of the bends.

    In components to the end: stacked between joints, XLA would compute each joint three times for the one below.
    """
    s, c = _sine_cosine(bends - leg.bends)
    x, y, z = leg.bones[:, -1]
    dx = dy = dz = jnp.zeros_like(x)
    for i in reversed(range(len(bends))):
        axis = leg.axes[:, i]
        u, v, w = axis
        q = c[i], s[i] * u, s[i] * v, s[i] * w
        x, y, z = _rotated(q, (x, y, z))
        dx, dy, dz = _rotated(q, (dx, dy, dz))
        dx, dy, dz = (
            dx + slopes[i] * (v * z - w * y),
            dy + slopes[i] * (w * x - u * z),
            dz + slopes[i] * (u * y - v * x),
        )
        bx, by, bz = leg.bones[:, i]
        x, y, z = x + bx, y + by, z + bz
    return (x, y, z), (dx, dy, dz)


def _rotated(q: tuple[jax.Array, ...], v: _Components) -> _Components:
    """`quat.rotate`, not stacked."""
    w, x, y, z = q
    vx, vy, vz = v
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx


def _reach(leg: _Leg, folds: Bool[Array, "*b"], y: Float[Array, "*b"]) -> Float[Array, "2 *b"]:
    """Distance from hip to ankle at y (m), and its derivative."""
    bends, slopes = _bends_at(leg, folds, y)
    (x, y, z), (dx, dy, dz) = _end(leg, bends, slopes)
    far = jnp.sqrt(x * x + y * y + z * z + TINY)
    return jnp.stack([far, (x * dx + y * dy + z * dz) / far])


def _now(leg: _Leg) -> Float[Array, "*b"]:
    """Distance from hip to ankle as it is, m."""
    end = leg.bones[:, 0]
    for i in range(1, leg.bones.shape[1]):
        end = end + leg.bones[:, i]
    return norm(end)


def _bent(leg: _Leg, reach: Float[Array, "*b"], wall: Wall) -> Float[Array, "joints *b"]:
    """Bends that give the leg this reach."""
    fixed, asked = jax.lax.stop_gradient(leg), jax.lax.stop_gradient(reach)
    now = wall(_now, fixed)
    folds = asked < now
    y = _search(fixed, folds, asked, now, wall)
    now, slope = wall(_reach, leg, folds, y)
    slope = jax.lax.stop_gradient(slope)
    falls = slope < -_FLAT
    step = jnp.where(falls, (now - reach) / jnp.where(falls, slope, -1.0), 0.0)
    # the derivative of the solution; the step itself is used where it is small, near a minimum it is not
    step = jnp.where(jnp.abs(step) <= 0.1 * y + 1e-3, step, step - jax.lax.stop_gradient(step))
    return wall(lambda *at: _bends_at(*at)[0], leg, folds, y - step)


def _search(
    leg: _Leg, folds: Bool[Array, "*b"], asked: Float[Array, "*b"], now: Float[Array, "*b"], wall: Wall
) -> Float[Array, "*b"]:
    """y of the reach asked for; of the shortest reach, nearly, where folding does not come to it."""
    known, low, high = _bracket(leg, folds, asked, now, wall)
    secant = (leg.length - asked) / jnp.maximum(leg.length - now, _FLAT)
    y = jnp.where(folds, 0.5 * (low + high), jnp.clip(secant, 0.0, 1.0))

    def step(_: jax.Array | int, at: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
        y, low, high, best, missed = at
        far, slope = wall(_reach, leg, folds, y)
        past = (far <= asked) | (~known & (slope >= 0))
        low, high = jnp.where(past, low, y), jnp.where(past, y, high)
        nearer = jnp.abs(far - asked) < missed
        best, missed = jnp.where(nearer, y, best), jnp.where(nearer, jnp.abs(far - asked), missed)
        falls = slope < -_FLAT
        newton = y - (far - asked) / jnp.where(falls, slope, -1.0)
        inside = falls & (newton >= low) & (newton <= high)
        return jnp.where(inside, newton, 0.5 * (low + high)), low, high, best, missed

    as_it_is = jnp.where(folds, 0.0, 1.0)
    return jax.lax.fori_loop(0, STEPS, step, (y, low, high, as_it_is, jnp.abs(now - asked)))[3]


def _bracket(
    leg: _Leg, folds: Bool[Array, "*b"], asked: Float[Array, "*b"], now: Float[Array, "*b"], wall: Wall
) -> tuple[Bool[Array, "*b"], Float[Array, "*b"], Float[Array, "*b"]]:
    """Bounds of y: of the first step of FOLD that passes the reach asked for, or on both sides of the shortest step.

    Straightening always passes it between 1 and 0.
    """

    def at(fold: Float[Array, ""]) -> Float[Array, "*b"]:
        angle = FOLD * jnp.clip(fold, 0.0, FOLDS)
        return jnp.where(folds, angle * (angle + 2.0 * leg.typical), 1.0)

    def widen(k: jax.Array | int, bounds: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
        passed, low, high, least = bounds
        fold = jnp.asarray(k, asked.dtype)
        far = wall(lambda *at: _reach(*at)[0], leg, folds, at(fold))
        shorter = ~passed & (far < least)
        passes = ~passed & (far <= asked)
        low = jnp.where(shorter, at(fold - 1), low)
        high = jnp.where(shorter, jnp.where(passes, at(fold), at(fold + 1)), high)
        return passed | passes, low, high, jnp.where(shorter, far, least)

    first = at(jnp.ones((), asked.dtype))
    return jax.lax.fori_loop(1, FOLDS + 1, widen, (~folds, jnp.zeros_like(asked), first, now))[:3]


def _turned(
    leg: _Leg,
    bends: Float[Array, "joints *b"],
    way: Float[Array, "3 *b"],
    last: Float[Array, "3 *b"] | None,
    wall: Wall,
) -> list[Float[Array, "4 *b"]]:
    """World rotation of each bone: bends about the axes, then the swing of hip to ankle onto `way`.

    A leg folded onto its hip has no such direction: its last bone is then swung onto `last` where that is given.
    """
    end = wall(lambda leg, bends: jnp.stack(_end(leg, bends, jnp.zeros_like(bends))[0]), leg, bends)
    if last is not None:
        foot = wall(_foot, leg, bends)
        folded = dot(way, way) < (FOLDED * leg.length) ** 2
        end, way = jnp.where(folded, foot, end), jnp.where(folded, last, way)
    turned = [wall(_swing, end, way)]
    for i in range(len(bends)):
        turned.append(wall(_multiplied, turned[-1], leg.axes[:, i], bends[i] - leg.bends[i]))
    return turned


def _multiplied(q: Float[Array, "4 *b"], axis: Float[Array, "3 *b"], angle: Float[Array, "*b"]) -> Float[Array, "4 *b"]:
    """First a turn about the axis (or none, if that is 0), then q."""
    s, c = _sine_cosine(angle)
    return quat.multiply(q, jnp.stack([c, s * axis[0], s * axis[1], s * axis[2]]))


def _foot(leg: _Leg, bends: Float[Array, "joints *b"]) -> Float[Array, "3 *b"]:
    """The last bone before the swing."""
    s, c = _sine_cosine(bends - leg.bends)
    foot = tuple(leg.bones[:, -1])
    for i in reversed(range(len(bends))):
        u, v, w = s[i] * leg.axes[:, i]
        foot = _rotated((c[i], u, v, w), foot)
    return jnp.stack(foot)


def _swing(a: Float[Array, "3 *b"], b: Float[Array, "3 *b"]) -> Float[Array, "4 *b"]:
    """Smallest rotation of direction a to b: none if either is 0, half a turn about some axis if they are opposite."""
    some = (dot(a, a) > NOTHING) & (dot(b, b) > NOTHING)
    a, b = (unit(jnp.where(some, v, jnp.ones_like(v))) for v in (a, b))
    zero = jnp.zeros_like(a[0])
    across = jnp.where(jnp.abs(a[0]) < 0.6, jnp.stack([zero, a[2], -a[1]]), jnp.stack([-a[2], zero, a[0]]))
    half_turn = jnp.concatenate([zero[None], unit(across)])
    return jnp.where(dot(a, b) < -1.0 + 1e-6, half_turn, quat.between(a, b))


def _sum(x: Float[Array, "n *b"]) -> Float[Array, "*b"]:
    total = x[0]
    for i in range(1, len(x)):
        total = total + x[i]
    return total
