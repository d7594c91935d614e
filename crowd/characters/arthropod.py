"""Walkers of any even number of legs on an arthropod's plan, generated from a table of places and thicknesses.

A thorax between the legs carries a head with two feelers and an abdomen of two parts; each leg has coxa, femur and
tibia and ends in a short tarsus. All gaits share the touchdown phases of the rows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from crowd import posing
from crowd.characters.body_mesh import skinned
from crowd.characters.gait_clips import FootPath, Poser, compose, pitch, roll, spline, step_leg, yaw
from crowd.characters.loft import Loft, hole_border, rings_along
from crowd.characters.surface import Part
from crowd.characters.two_sided import SIDES, Table, leg, leg_joints, other_side, two_sided
from crowd.types import Archetype, Clip, Mesh, Skeleton

_SAMPLES = 60
Place = tuple[float, float, float]
Pair = tuple[float, float]


@dataclass(frozen=True)
class Gait:
    """A clip: m/s, s, share of the cycle on the ground, m."""

    name: Literal["walk", "run"]
    speed: float
    cycle: float
    duty: float
    lift: float


@dataclass(frozen=True)
class Plan:
    """An arthropod standing: m, degrees; of what comes in twos, the left one."""

    name: str
    height: float
    mass: float  # kg
    centre: Table  # thorax, head, abdomen, abdomen_end
    feeler: str  # its joint's name
    feeler_places: tuple[Place, Place]
    feeler_end: Place  # from the second joint
    feeler_radii: Place
    rows: Mapping[str, tuple[float, float, Pair]]  # front first: z of the coxa, azimuth of the leg from +x to +z,
    #                                                 touchdown phases left and right
    leg: Mapping[str, Pair]  # coxa, femur, tibia, tarsus: distance out along the azimuth, height
    shin_rings: tuple[float, ...]  # rings of the skin between knee and tarsus, as shares of the way
    gaits: tuple[Gait, ...]
    shells: tuple[tuple[str, Pair, Pair, Pair, Place], ...]  # joint, ends (y, z), radii, stretch
    eyes: tuple[tuple[Place, Place, float], ...]
    strips: tuple[Pair, ...]  # middle (y, z) of the skin's strips, from the mouth to the tail
    angles: tuple[float, ...]  # of a strip's vertices, from the top
    ends: tuple[Pair, Pair]  # from where mouth and tail are looked for
    feeler_strip: int  # its hole is between this strip and the next
    leg_strips: tuple[int, ...]  # first of the three strips round each leg's hole


def _feelers(plan: Plan) -> Table:
    first, second = plan.feeler_places
    return {plan.feeler: ("head", first), f"{plan.feeler}_tip": (plan.feeler, second)}


def _leg_places(plan: Plan, row: str) -> dict[str, tuple[float, float, float]]:
    """Joints of a left leg, standing."""
    z, azimuth, _ = plan.rows[row]
    a = np.radians(azimuth)
    base = plan.leg["coxa"][0]  # the coxae sit beside the body's axis, whatever way the leg points
    return {
        name: (base + (out - base) * np.cos(a), height, z + (out - base) * np.sin(a))
        for name, (out, height) in plan.leg.items()
    }


def _skeleton(plan: Plan) -> Skeleton:
    side: dict[str, tuple[str, tuple[float, float, float]]] = dict(_feelers(plan))
    for row in plan.rows:
        above = "thorax"
        for name, place in _leg_places(plan, row).items():
            side[f"{row}_{name}"] = (above, place)
            above = f"{row}_{name}"
    return two_sided(plan.centre, side)


def _names(row: str) -> tuple[str, ...]:
    """Hip, knee, ankle and ball; the tarsus is both of the last."""
    return tuple(f"{row}_{name}" for name in ("femur", "tibia", "tarsus", "tarsus"))


def _step(plan: Plan, poser: Poser, side: str, sign: float, row: str, path: FootPath, phase: np.ndarray) -> None:
    """One leg on its path; the coxa turns most of the way with the foot."""
    places = _leg_places(plan, row)
    coxa = f"{side}_{row}_coxa"
    base = poser.world()[1][:, poser.index[coxa]]
    rest = np.subtract(places["tarsus"], places["coxa"])
    to_foot = path.contact(phase) - base
    turned = np.degrees(np.arctan2(-to_foot[:, 2], to_foot[:, 0] * sign) - np.arctan2(-rest[2], rest[0]))
    poser.turn(coxa, yaw(0.75 * sign * turned))
    step_leg(poser, leg_joints(side, _names(row), plan.leg["tarsus"][1], (0.0, 1.0, 0.0)), path, phase)


def _feel(plan: Plan, poser: Poser, phase: np.ndarray, degrees: float) -> None:
    """Feelers waving, one after the other."""
    for side, sign, lag in (("left", 1.0, 0.0), ("right", -1.0, 0.35)):
        wave = 2 * np.pi * (phase + lag)
        poser.turn(
            f"{side}_{plan.feeler}", compose(yaw(sign * degrees * np.sin(wave)), pitch(0.7 * degrees * np.cos(wave)))
        )
        poser.turn(f"{side}_{plan.feeler}_tip", pitch(0.8 * degrees * np.sin(wave - 0.8)))


def _idle(plan: Plan, skeleton: Skeleton) -> Clip:
    poser = Poser(skeleton, 120)
    phase = np.arange(120) / 120
    wave = 2 * np.pi * phase
    poser.move("thorax", np.stack([0.003 * np.sin(wave), 0.004 * np.sin(2 * wave), 0.0 * wave], -1))
    poser.turn("abdomen", pitch(1.5 * np.sin(3 * wave)))
    poser.turn("abdomen_end", pitch(1.5 * np.sin(3 * wave - 0.6)))
    poser.turn("head", compose(yaw(7.0 * np.sin(wave)), roll(4.0 * np.sin(wave - 0.5))))
    _feel(plan, poser, 2 * phase, 14.0)
    for row in plan.rows:
        x, _, z = _leg_places(plan, row)["tarsus"]
        for side, sign in SIDES:
            path = FootPath(0.0, z, sign * x, 1.0, lambda s: 0.0 * s, lambda p: 0.0 * p)
            _step(plan, poser, side, sign, row, path, np.zeros(120))
    return poser.clip("idle", "idle", 4.0, None)


def _gait(plan: Plan, skeleton: Skeleton, gait: Gait) -> Clip:
    speed, cycle, duty, lift = gait.speed, gait.cycle, gait.duty, gait.lift
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
    _feel(plan, poser, phase, 9.0)
    travel = speed * cycle * duty
    up = spline((0, 0.3, 0.65, 1), (0, 0.9 * lift, lift, 0), (5.0 * lift, -5.0 * lift))
    for row, (_, _, touchdown) in plan.rows.items():
        x, _, z = _leg_places(plan, row)["tarsus"]
        for k, (side, sign) in enumerate(SIDES):
            path = FootPath(speed * cycle, z + travel / 2, sign * x, duty, up, lambda p: 0.0 * p, follow=0.7)
            _step(plan, poser, side, sign, row, path, (phase - touchdown[k]) % 1.0)
    return poser.clip(gait.name, gait.name, cycle, speed)


def _parts(plan: Plan, at: dict[str, np.ndarray], index: dict[str, int]) -> list[Part]:
    """Shell, standing."""

    def shell(joint: str, start: tuple, end: tuple, radii: tuple, stretch: tuple = (1, 1, 1)) -> Part:
        return Part(index[joint], (0.0, *start), (0.0, *end), radii, stretch)

    def limb(joint: str, child: str, radii: tuple) -> Part:
        return Part(index[joint], tuple(at[joint]), tuple(at[child]), radii)

    parts = [shell(*row) for row in plan.shells]
    for side, sign in SIDES:
        feeler, bend = at[f"{side}_{plan.feeler}"], at[f"{side}_{plan.feeler}_tip"]
        tip = bend + np.array(plan.feeler_end) * (sign, 1.0, 1.0)
        thick, thin, end = plan.feeler_radii
        for (x, y, z), (x2, y2, z2), radius in plan.eyes:
            parts.append(Part(index["head"], (x * sign, y, z), (x2 * sign, y2, z2), (radius, radius)))
        parts += [
            Part(index[f"{side}_{plan.feeler}"], tuple(feeler - 0.2 * (bend - feeler)), tuple(bend), (thick, thin)),
            Part(index[f"{side}_{plan.feeler}_tip"], tuple(bend), tuple(tip), (thin, end)),
        ]
        for row in plan.rows:
            leg = [f"{side}_{row}_{name}" for name in plan.leg]
            parts += [
                limb(leg[0], leg[1], (0.040, 0.034)),
                limb(leg[1], leg[2], (0.038, 0.026)),
                limb(leg[2], leg[3], (0.027, 0.014)),
                Part(index[leg[3]], tuple(at[leg[3]]), tuple(at[leg[3]] + np.array([0, -0.016, 0])), (0.016, 0.018)),
            ]
    return parts


def _surface(
    plan: Plan, parts: list[Part], at: dict[str, np.ndarray], index: dict[str, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Left half of the shell."""

    def joints(*names: str) -> frozenset[int]:
        return frozenset(index[name] for name in names)

    loft = Loft(parts, 0.006, 0.0)
    body = joints(*plan.centre)
    rows = [loft.strip((0.0, y, z), (0.0, 1.0, 0.0), plan.angles, body) for y, z in plan.strips]
    holes = {plan.feeler_strip: 1} | {first + k: 2 for first in plan.leg_strips for k in (0, 1)}
    for strip, (before, after) in enumerate(pairwise(rows)):
        loft.skin(before, after, skip=(holes[strip],) if strip in holes else ())
    ways = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    for row, way, (y, z) in zip((rows[0][::-1], rows[-1]), ways, plan.ends, strict=True):
        loft.cap(row, loft.cast(np.array([0.0, y, z]), way[None])[0], closed=False)
    feeler, bend = at[f"left_{plan.feeler}"], at[f"left_{plan.feeler}_tip"]
    rings = [*rings_along(feeler, bend, (0.25, 0.97)), *rings_along(bend, bend + np.array(plan.feeler_end), (0.9,))]
    first = plan.feeler_strip
    feelers = joints(f"left_{plan.feeler}", f"left_{plan.feeler}_tip")
    loft.limb(hole_border(rows[first : first + 2], (1, 2)), rings, feelers, 0.05)
    for first, row in zip(plan.leg_strips, plan.rows, strict=True):
        names = [f"left_{row}_{name}" for name in plan.leg]
        coxa, femur, tibia, tarsus = (at[name] for name in names)
        rings = [
            *rings_along(coxa, femur, (0.75,)),
            *rings_along(femur, tibia, (0.22, 0.8)),
            (tibia, _bisector(tibia - femur, tarsus - tibia)),
            *rings_along(tibia, tarsus, plan.shin_rings),
        ]
        loft.limb(hole_border(rows[first : first + 3], (2, 3)), rings, joints(*names), 0.06)
    return loft.finish()


def _bisector(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Normal of the mitre between two bones: rings across either would run along the other at so sharp a bend."""
    normal = before / np.linalg.norm(before) + after / np.linalg.norm(after)
    return normal / np.linalg.norm(normal)


def _mesh(plan: Plan, skeleton: Skeleton) -> Mesh:
    rest = posing.world_transforms(skeleton, posing.rest_motion(skeleton))[1]
    index = {name: joint for joint, name in enumerate(skeleton.names)}
    at = {name: rest[joint] for name, joint in index.items()}
    parts = _parts(plan, at, index)
    vertices, triangles = _surface(plan, parts, at, index)
    return skinned(vertices, triangles, parts, skeleton.parents, rest, None, other_side(skeleton.names))


def build(plan: Plan) -> Archetype:
    """The character; its height is that of the knees."""
    skeleton, height = _skeleton(plan), plan.leg["tarsus"][1]
    legs = tuple(
        leg(skeleton, f"{row}_{side}", int(sign), _names(row), height) for row in plan.rows for side, sign in SIDES
    )
    clips = (_idle(plan, skeleton), *(_gait(plan, skeleton, gait) for gait in plan.gaits))
    pelvis = skeleton.names.index("thorax")
    return Archetype(plan.name, skeleton, _mesh(plan, skeleton), legs, (), clips, pelvis, plan.height, plan.mass)
