"""A six-legged walker of 1 m and 27 kg, generated: an insect's plan at the size of a dog, so that it wades with others.

Each leg has coxa, femur and tibia and ends in a short tarsus. Gaits: alternating tripod (front and hind leg of one side
with the middle leg of the other), walking with a duty factor of 0.6 and running with 0.45.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from crowd import posing
from crowd.characters.body_mesh import skinned
from crowd.characters.gait_clips import FootPath, Poser, compose, pitch, roll, spline, step_leg, yaw
from crowd.characters.loft import Loft, hole_border, rings_along
from crowd.characters.surface import Part
from crowd.characters.two_sided import SIDES, leg, leg_joints, other_side, two_sided
from crowd.types import Archetype, Clip, ClipRole, Mesh, Skeleton

HEIGHT, MASS = 0.56, 27.0  # knees
_TARSUS = 0.03  # m, height of the last joint above the ground
_SAMPLES = 60
_CENTRE = {  # name: (parent, position standing, m)
    "thorax": ("", (0.0, 0.365, 0.0)),
    "head": ("thorax", (0.0, 0.385, 0.205)),
    "abdomen": ("thorax", (0.0, 0.375, -0.185)),
    "abdomen_end": ("abdomen", (0.0, 0.375, -0.340)),
}
_ANTENNA = {
    "antenna": ("head", (0.035, 0.435, 0.300)),
    "antenna_tip": ("antenna", (0.110, 0.520, 0.420)),
}
_ROWS = {  # row: (z of the coxa, azimuth of the leg from +x to +z in degrees, touchdown phases left and right)
    "front": (0.135, 46.0, (0.0, 0.5)),
    "middle": (0.0, -2.0, (0.5, 0.0)),
    "hind": (-0.130, -44.0, (0.0, 0.5)),
}
_LEG = {  # joint: (distance out along the azimuth, height), m
    "coxa": (0.062, 0.350),
    "femur": (0.135, 0.345),
    "tibia": (0.310, 0.530),
    "tarsus": (0.510, _TARSUS),
}


def _leg_places(row: str) -> dict[str, tuple[float, float, float]]:
    """Joints of a left leg, standing."""
    z, azimuth, _ = _ROWS[row]
    a = np.radians(azimuth)
    base = 0.062  # the coxae sit beside the body's axis, whatever way the leg points
    return {
        name: (base + (out - base) * np.cos(a), height, z + (out - base) * np.sin(a))
        for name, (out, height) in _LEG.items()
    }


def _skeleton() -> Skeleton:
    side: dict[str, tuple[str, tuple[float, float, float]]] = dict(_ANTENNA)
    for row in _ROWS:
        above = "thorax"
        for name, place in _leg_places(row).items():
            side[f"{row}_{name}"] = (above, place)
            above = f"{row}_{name}"
    return two_sided(_CENTRE, side)


def _names(row: str) -> tuple[str, ...]:
    """Hip, knee, ankle and ball; the tarsus is both of the last."""
    return tuple(f"{row}_{name}" for name in ("femur", "tibia", "tarsus", "tarsus"))


def _step(poser: Poser, side: str, sign: float, row: str, path: FootPath, phase: np.ndarray) -> None:
    """One leg on its path; the coxa turns most of the way with the foot."""
    places = _leg_places(row)
    coxa = f"{side}_{row}_coxa"
    base = poser.world()[1][:, poser.index[coxa]]
    rest = np.subtract(places["tarsus"], places["coxa"])
    to_foot = path.contact(phase) - base
    turned = np.degrees(np.arctan2(-to_foot[:, 2], to_foot[:, 0] * sign) - np.arctan2(-rest[2], rest[0]))
    poser.turn(coxa, yaw(0.75 * sign * turned))
    step_leg(poser, leg_joints(side, _names(row), _TARSUS, (0.0, 1.0, 0.0)), path, phase)


def _feel(poser: Poser, phase: np.ndarray, degrees: float) -> None:
    """Antennae waving, one after the other."""
    for side, sign, lag in (("left", 1.0, 0.0), ("right", -1.0, 0.35)):
        wave = 2 * np.pi * (phase + lag)
        poser.turn(f"{side}_antenna", compose(yaw(sign * degrees * np.sin(wave)), pitch(0.7 * degrees * np.cos(wave))))
        poser.turn(f"{side}_antenna_tip", pitch(0.8 * degrees * np.sin(wave - 0.8)))


def _idle(skeleton: Skeleton) -> Clip:
    poser = Poser(skeleton, 120)
    phase = np.arange(120) / 120
    wave = 2 * np.pi * phase
    poser.move("thorax", np.stack([0.003 * np.sin(wave), 0.004 * np.sin(2 * wave), 0.0 * wave], -1))
    poser.turn("abdomen", pitch(1.5 * np.sin(3 * wave)))
    poser.turn("abdomen_end", pitch(1.5 * np.sin(3 * wave - 0.6)))
    poser.turn("head", compose(yaw(7.0 * np.sin(wave)), roll(4.0 * np.sin(wave - 0.5))))
    _feel(poser, 2 * phase, 14.0)
    for row in _ROWS:
        x, _, z = _leg_places(row)["tarsus"]
        for side, sign in SIDES:
            path = FootPath(0.0, z, sign * x, 1.0, lambda s: 0.0 * s, lambda p: 0.0 * p)
            _step(poser, side, sign, row, path, np.zeros(120))
    return poser.clip("idle", "idle", 4.0, None)


def _tripod(
    skeleton: Skeleton, name: str, role: ClipRole, speed: float, cycle: float, duty: float, lift: float
) -> Clip:
    poser = Poser(skeleton, _SAMPLES)
    phase = np.arange(_SAMPLES) / _SAMPLES
    wave = 2 * np.pi * phase
    size = lift / 0.07
    height = -0.006 * size * np.cos(2 * (wave - np.pi * duty)) - 0.008 * (size - 1.0)
    poser.move("thorax", np.stack([0.006 * np.sin(wave - 0.6), height, 0.0 * wave], -1))
    poser.turn("thorax", compose(yaw(1.6 * np.cos(wave)), roll(1.2 * size * np.sin(wave))))
    poser.turn("head", compose(yaw(-1.6 * np.cos(wave)), pitch(1.5 * np.sin(2 * wave))))
    poser.turn("abdomen", compose(yaw(-3.0 * np.cos(wave - 0.7)), pitch(1.2 * size * np.sin(2 * wave))))
    poser.turn("abdomen_end", compose(yaw(-3.0 * np.cos(wave - 1.4)), pitch(1.2 * size * np.sin(2 * wave - 0.7))))
    _feel(poser, phase, 9.0)
    travel = speed * cycle * duty
    up = spline((0, 0.3, 0.65, 1), (0, 0.9 * lift, lift, 0), (5.0 * lift, -5.0 * lift))
    for row, (_, _, touchdown) in _ROWS.items():
        x, _, z = _leg_places(row)["tarsus"]
        for k, (side, sign) in enumerate(SIDES):
            path = FootPath(speed * cycle, z + travel / 2, sign * x, duty, up, lambda p: 0.0 * p, follow=0.7)
            _step(poser, side, sign, row, path, (phase - touchdown[k]) % 1.0)
    return poser.clip(name, role, cycle, speed)


def _parts(at: dict[str, np.ndarray], index: dict[str, int]) -> list[Part]:
    """Shell, standing."""

    def shell(joint: str, start: tuple, end: tuple, radii: tuple, stretch: tuple = (1, 1, 1)) -> Part:
        return Part(index[joint], (0.0, *start), (0.0, *end), radii, stretch)

    def limb(joint: str, child: str, radii: tuple) -> Part:
        return Part(index[joint], tuple(at[joint]), tuple(at[child]), radii)

    parts = [
        shell("head", (0.392, 0.255), (0.380, 0.300), (0.074, 0.055), (1.15, 0.9, 1)),
        shell("thorax", (0.375, 0.205), (0.375, 0.17), (0.040, 0.05)),
        shell("thorax", (0.368, 0.125), (0.362, -0.11), (0.078, 0.078), (1.1, 1, 1)),
        shell("abdomen", (0.370, -0.165), (0.372, -0.20), (0.045, 0.055)),
        shell("abdomen", (0.380, -0.255), (0.385, -0.34), (0.108, 0.122), (1.15, 0.95, 1)),
        shell("abdomen_end", (0.383, -0.36), (0.362, -0.49), (0.120, 0.045), (1.15, 0.95, 1)),
    ]
    for side, sign in SIDES:
        antenna, bend = at[f"{side}_antenna"], at[f"{side}_antenna_tip"]
        tip = bend + np.array([0.045 * sign, -0.035, 0.120])
        parts += [
            Part(index["head"], (0.058 * sign, 0.420, 0.285), (0.060 * sign, 0.415, 0.270), (0.033, 0.033)),
            Part(index[f"{side}_antenna"], tuple(antenna - 0.2 * (bend - antenna)), tuple(bend), (0.016, 0.010)),
            Part(index[f"{side}_antenna_tip"], tuple(bend), tuple(tip), (0.010, 0.006)),
        ]
        for row in _ROWS:
            leg = [f"{side}_{row}_{name}" for name in _LEG]
            parts += [
                limb(leg[0], leg[1], (0.040, 0.034)),
                limb(leg[1], leg[2], (0.038, 0.026)),
                limb(leg[2], leg[3], (0.027, 0.014)),
                Part(index[leg[3]], tuple(at[leg[3]]), tuple(at[leg[3]] + np.array([0, -0.016, 0])), (0.016, 0.018)),
            ]
    return parts


_STRIPS = (  # from the mouth to the tail: middle y, z
    (0.380, 0.335),
    (0.388, 0.290),
    (0.390, 0.240),
    (0.378, 0.200),
    (0.370, 0.172),
    (0.367, 0.133),
    (0.366, 0.090),
    (0.366, 0.045),
    (0.365, 0.000),
    (0.364, -0.045),
    (0.363, -0.086),
    (0.363, -0.128),
    (0.368, -0.162),
    (0.372, -0.195),
    (0.380, -0.240),
    (0.384, -0.310),
    (0.382, -0.390),
    (0.370, -0.460),
)
_ANGLES = (0.0, 42.0, 74.0, 106.0, 140.0, 180.0)
_HOLES = {1: 1, 4: 2, 5: 2, 7: 2, 8: 2, 10: 2, 11: 2}  # strip: column left open for an antenna or a leg


def _surface(parts: list[Part], at: dict[str, np.ndarray], index: dict[str, int]) -> tuple[np.ndarray, np.ndarray]:
    """Left half of the shell."""

    def joints(*names: str) -> frozenset[int]:
        return frozenset(index[name] for name in names)

    loft = Loft(parts, 0.006, 0.0)
    body = joints(*_CENTRE)
    rows = [loft.strip((0.0, y, z), (0.0, 1.0, 0.0), _ANGLES, body) for y, z in _STRIPS]
    for strip, (before, after) in enumerate(pairwise(rows)):
        loft.skin(before, after, skip=(_HOLES[strip],) if strip in _HOLES else ())
    ways = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    loft.cap(rows[0][::-1], loft.cast(np.array([0.0, 0.375, 0.3]), ways[:1])[0], closed=False)
    loft.cap(rows[-1], loft.cast(np.array([0.0, 0.365, -0.46]), ways[1:])[0], closed=False)
    antenna, bend = at["left_antenna"], at["left_antenna_tip"]
    feeler = [
        *rings_along(antenna, bend, (0.25, 0.97)),
        *rings_along(bend, bend + np.array([0.045, -0.035, 0.120]), (0.9,)),
    ]
    loft.limb(hole_border(rows[1:3], (1, 2)), feeler, joints("left_antenna", "left_antenna_tip"), 0.05)
    for first, row in ((4, "front"), (7, "middle"), (10, "hind")):
        names = [f"left_{row}_{name}" for name in _LEG]
        coxa, femur, tibia, tarsus = (at[name] for name in names)
        rings = [
            *rings_along(coxa, femur, (0.75,)),
            *rings_along(femur, tibia, (0.22, 0.8)),
            (tibia, _bisector(tibia - femur, tarsus - tibia)),
            *rings_along(tibia, tarsus, (0.1, 0.97)),
        ]
        loft.limb(hole_border(rows[first : first + 3], (2, 3)), rings, joints(*names), 0.06)
    return loft.finish()


def _bisector(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Normal of the mitre between two bones: rings across either would run along the other at so sharp a bend."""
    normal = before / np.linalg.norm(before) + after / np.linalg.norm(after)
    return normal / np.linalg.norm(normal)


def _mesh(skeleton: Skeleton) -> Mesh:
    rest = posing.world_transforms(skeleton, posing.rest_motion(skeleton))[1]
    index = {name: joint for joint, name in enumerate(skeleton.names)}
    at = {name: rest[joint] for name, joint in index.items()}
    parts = _parts(at, index)
    vertices, triangles = _surface(parts, at, index)
    return skinned(vertices, triangles, parts, skeleton.parents, rest, None, other_side(skeleton.names))


def build() -> Archetype:
    """The hexapod; `height` is that of the knees."""
    skeleton = _skeleton()
    legs = tuple(
        leg(skeleton, f"{row}_{side}", int(sign), _names(row), _TARSUS) for row in _ROWS for side, sign in SIDES
    )
    clips = (
        _idle(skeleton),
        _tripod(skeleton, "walk", "walk", 0.9, 0.50, 0.6, 0.07),
        _tripod(skeleton, "run", "run", 1.8, 0.32, 0.45, 0.09),
    )
    return Archetype(
        "hexapod", skeleton, _mesh(skeleton), legs, (), clips, skeleton.names.index("thorax"), HEIGHT, MASS
    )
