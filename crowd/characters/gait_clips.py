"""Clips from foot paths: the contact point of every foot is prescribed, the legs follow by inverse kinematics.

A foot on the ground moves backwards at exactly the clip's speed in a straight line at y = 0, so a clip built here has
ideal stances; the swing and the joints above are smooth curves chosen to give published joint angles.
Phase runs from 0 to 1 over a cycle and, for a foot, starts at its own touchdown.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from crowd import posing
from crowd.types import Clip, ClipRole, Skeleton

Curve = Callable[[np.ndarray], np.ndarray]
_X, _Y, _Z = np.eye(3)


def spline(
    knots: Sequence[float] | np.ndarray, values: Sequence[float] | np.ndarray, slopes: tuple[float, float] = (0.0, 0.0)
) -> Curve:
    """Cubic spline through the knots with the given end slopes, twice continuously differentiable, constant outside."""
    x, y = np.asarray(knots, float), np.asarray(values, float)
    h, count = np.diff(x), len(x)
    system, right = np.eye(count), np.zeros(count)
    right[0], right[-1] = slopes
    for i in range(1, count - 1):
        system[i, i - 1 : i + 2] = 1.0 / h[i - 1], 2.0 / h[i - 1] + 2.0 / h[i], 1.0 / h[i]
        right[i] = 3.0 * ((y[i] - y[i - 1]) / h[i - 1] ** 2 + (y[i + 1] - y[i]) / h[i] ** 2)
    return _hermite(x, y, np.linalg.solve(system, right))


def periodic(knots: Sequence[float], values: Sequence[float]) -> Curve:
    """Cubic spline of period 1 through knots in [0, 1)."""
    count = len(knots)
    x = np.concatenate([np.asarray(knots, float) - 1.0, knots, np.asarray(knots, float) + 1.0])
    inner = spline(x, np.tile(np.asarray(values, float), 3))
    low = x[count]
    return lambda phase: inner((np.asarray(phase) - low) % 1.0 + low)


def _hermite(x: np.ndarray, y: np.ndarray, slope: np.ndarray) -> Curve:
    def evaluate(at: np.ndarray) -> np.ndarray:
        at = np.clip(at, x[0], x[-1])
        i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
        h = x[i + 1] - x[i]
        s = (at - x[i]) / h
        return (
            (1 + 2 * s) * (1 - s) ** 2 * y[i]
            + s * (1 - s) ** 2 * h * slope[i]
            + s * s * (3 - 2 * s) * y[i + 1]
            + s * s * (s - 1) * h * slope[i + 1]
        )

    return evaluate


def smoothstep(s: np.ndarray) -> np.ndarray:
    """0 below 0, 1 above 1, C2 between."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s)


def _end_slopes(s: np.ndarray) -> np.ndarray:
    """0 at 0 and 1 with slope 1 at both: the quintic with no curvature at the ends."""
    r = 1.0 - s
    return s * r**3 * (1.0 + 3.0 * s) - r * s**3 * (1.0 + 3.0 * r)


def turn(axis: np.ndarray, degrees: np.ndarray | float) -> np.ndarray:
    """Quaternions [..., 4] turning by degrees [...] about a unit axis [3]."""
    half = np.radians(np.asarray(degrees, float)) / 2.0
    return np.concatenate([np.cos(half)[..., None], np.sin(half)[..., None] * axis], -1)


def pitch(degrees: np.ndarray | float) -> np.ndarray:
    """Leaning forward is positive (about +x); a hanging limb swings back."""
    return turn(_X, degrees)


def yaw(degrees: np.ndarray | float) -> np.ndarray:
    """Turning left is positive (about +y)."""
    return turn(_Y, degrees)


def roll(degrees: np.ndarray | float) -> np.ndarray:
    """Left side up is positive (about +z)."""
    return turn(_Z, degrees)


def compose(*rotations: np.ndarray) -> np.ndarray:
    """Product of quaternions; the last one acts first."""
    out = rotations[0]
    for rotation in rotations[1:]:
        out = posing.multiply(*np.broadcast_arrays(out, rotation))
    return out


@dataclass(frozen=True)
class FootPath:
    """Where the contact point is and how the foot is pitched over a cycle; phase 0 is the foot's touchdown.

    stride: speed × cycle, m; negative: backwards. front: of the contact point at touchdown, m along the way from the
    origin of the clip (z, where the way is forward). side: its x.
    duty: fraction of the cycle on the ground. lift: height of the contact point over the swing (0 to 1), zero at
    both ends. pitch: of the foot against its flat pose over the cycle, degrees, toes up positive. bend: of the
    toes against the foot at toe-off, straightened over `relax` of the swing; on the ground the toes lie flat. late:
    above 1 the foot comes forward later in the swing. follow: share of the ground's speed the foot has as it leaves
    the ground and as it lands. toward: the way, degrees to the left of forward. ahead: z added to every place, m.
    """

    stride: float
    front: float
    side: float
    duty: float
    lift: Curve
    pitch: Curve
    relax: float = 0.4
    late: float = 1.0
    follow: float = 1.0
    toward: float = 0.0
    ahead: float = 0.0

    def contact(self, phase: np.ndarray) -> np.ndarray:
        """Contact point [F, 3]."""
        phase = np.asarray(phase) % 1.0
        swing = np.clip((phase - self.duty) / max(1.0 - self.duty, 1e-9), 0.0, 1.0)
        on_ground = self.front - self.stride * phase
        # Carried with the ground, plus a whole stride forward, at rest at both ends (C2): no jerk at touchdown.
        forward = self.stride * smoothstep(swing**self.late)
        # A foot that keeps less of the ground's speed leaves and lands with a jerk but swings out less far.
        lag = self.stride * (1.0 - self.duty) * (1.0 - self.follow) * _end_slopes(swing)
        along = on_ground + forward + np.where(phase < self.duty, 0.0, lag)
        height = np.where(phase < self.duty, 0.0, self.lift(swing))
        way = np.radians(self.toward)
        return np.stack([self.side + along * np.sin(way), height, self.ahead + along * np.cos(way)], -1)

    def toe_bend(self, phase: np.ndarray) -> np.ndarray:
        """Angle of the toes against the foot, degrees, toes up positive."""
        phase = np.asarray(phase) % 1.0
        swing = (phase - self.duty) / max(1.0 - self.duty, 1e-9)
        at_toe_off = -self.pitch(np.array(self.duty))
        fading = at_toe_off * (1.0 - smoothstep(swing / self.relax))
        landing = -self.pitch(np.array(1.0)) * smoothstep((swing - 1.0 + self.relax) / self.relax)
        return np.where(phase < self.duty, -self.pitch(phase), fading + landing)


def two_bone(
    start: np.ndarray, end: np.ndarray, upper: float, lower: float, pole: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Middle joint [F, 3] of two bones from start towards end, bent towards pole, and the end reached.

    Beyond 99.95 % of the full length the end is drawn back, so the bend never vanishes.
    """
    span = end - start
    length = np.linalg.norm(span, axis=-1, keepdims=True)
    along = span / length
    length = np.clip(length, abs(upper - lower) + 1e-6, 0.9995 * (upper + lower))
    near = (length**2 + upper**2 - lower**2) / (2.0 * length)
    across = pole - np.sum(pole * along, -1, keepdims=True) * along
    across = across / np.linalg.norm(across, axis=-1, keepdims=True)
    return start + near * along + np.sqrt(np.maximum(upper**2 - near**2, 0.0)) * across, start + length * along


def aim(direction: np.ndarray, side: np.ndarray, rest_direction: np.ndarray, rest_side: np.ndarray) -> np.ndarray:
    """Rotations [F, 4] that take rest_direction to direction [F, 3] and rest_side as near as possible to side."""

    def frame(forward: np.ndarray, beside: np.ndarray) -> np.ndarray:
        forward = forward / np.linalg.norm(forward, axis=-1, keepdims=True)
        beside = beside - np.sum(beside * forward, -1, keepdims=True) * forward
        beside = beside / np.linalg.norm(beside, axis=-1, keepdims=True)
        return np.stack([forward, beside, np.cross(forward, beside)], -1)

    return posing.quaternion(
        frame(direction, np.broadcast_to(side, direction.shape)) @ frame(rest_direction, rest_side).T
    )


class Poser:
    """A clip being made: local rotations [F, J, 4] and root translation [F, 3], with access to world poses."""

    def __init__(self, skeleton: Skeleton, samples: int):
        self.skeleton = skeleton
        self.index = {name: joint for joint, name in enumerate(skeleton.names)}
        self.rotation = np.tile(skeleton.rest_rotation, (samples, 1, 1))
        self.translation = np.tile(skeleton.rest_translation, (samples, 1, 1))
        self.samples = samples

    def world(self) -> tuple[np.ndarray, np.ndarray]:
        """Rotations [F, J, 4] and positions [F, J, 3] in the character frame."""
        return posing.world_transforms(
            self.skeleton, posing.clip_motion(Clip("", "other", 1.0, self.rotation, self.translation))
        )

    def move(self, name: str, offset: np.ndarray) -> None:
        """Shift a joint from its rest place by offset [F, 3] in its parent's frame."""
        self.translation[:, self.index[name]] += offset

    def turn(self, name: str, rotation: np.ndarray) -> None:
        """Set a joint's rotation to its parent [F, 4] or [4]."""
        self.rotation[:, self.index[name]] = rotation

    def turn_world(self, name: str, rotation: np.ndarray) -> None:
        """Set a joint's rotation in the character frame [F, 4] or [4]."""
        joint = self.index[name]
        above = self.skeleton.parents[joint]
        rotation = np.broadcast_to(rotation, (self.samples, 4))
        if above >= 0:
            rotation = posing.multiply(posing.conjugate(self.world()[0][:, above]), rotation)
        self.rotation[:, joint] = rotation

    def reach(self, upper: str, lower: str, end: str, target: np.ndarray, pole: np.ndarray) -> None:
        """Bend upper and lower so that joint `end` comes to target [F, 3], the middle pointing to pole [3] or [F, 3].

        The joints' frames at zero rotation must be parallel to the character's, as in the built-in skeletons.
        """
        a, b, c = (self.index[name] for name in (upper, lower, end))
        offset_b, offset_c = self.skeleton.rest_translation[b], self.skeleton.rest_translation[c]
        start = self.world()[1][:, a]
        middle, reached = two_bone(
            start, target, float(np.linalg.norm(offset_b)), float(np.linalg.norm(offset_c)), pole
        )
        hinge = np.cross(reached - start, np.broadcast_to(pole, start.shape))
        rest_hinge = np.cross(offset_b + offset_c, np.mean(np.broadcast_to(pole, start.shape), 0))
        self.turn_world(upper, aim(middle - start, hinge, offset_b, rest_hinge))
        self.turn_world(lower, aim(reached - middle, hinge, offset_c, rest_hinge))

    def clip(self, name: str, role: ClipRole, duration: float, speed: float | None) -> Clip:
        """The finished clip; quaternions keep to one hemisphere over time."""
        rotation = self.rotation / np.linalg.norm(self.rotation, axis=-1, keepdims=True)
        for sample in range(1, self.samples):
            flip = np.sum(rotation[sample] * rotation[sample - 1], -1, keepdims=True) < 0.0
            rotation[sample] = np.where(flip, -rotation[sample], rotation[sample])
        return Clip(name, role, duration, rotation, self.translation.copy(), speed=speed)


@dataclass(frozen=True)
class LegJoints:
    """Names of a leg's joints and which way its middle joint points; contact: m, in the frame of `ball`.

    A foot of one joint has it as ankle and as ball.
    """

    hip: str
    knee: str
    ankle: str
    ball: str
    contact: np.ndarray
    pole: np.ndarray


def step_leg(poser: Poser, leg: LegJoints, path: FootPath, phase: np.ndarray, outward: float = 0.0) -> None:
    """Put one leg of a poser on its foot path at phases [F]; outward: yaw of the foot, degrees."""
    one = leg.ankle == leg.ball
    ankle_to_ball = np.zeros(3) if one else poser.skeleton.rest_translation[poser.index[leg.ball]]
    heading = yaw(outward)
    foot = compose(heading, pitch(-path.pitch(phase % 1.0)))
    toes = foot if one else compose(foot, pitch(-path.toe_bend(phase)))
    ball = path.contact(phase) - posing.rotate(toes, np.broadcast_to(leg.contact, (len(phase), 3)))
    ankle = ball - posing.rotate(foot, np.broadcast_to(ankle_to_ball, ball.shape))
    poser.reach(leg.hip, leg.knee, leg.ankle, ankle, leg.pole)
    poser.turn_world(leg.ankle, foot)
    poser.turn_world(leg.ball, toes)
