"""Feet: where heel and toe tip of every leg sit on its bones, from the rest pose and the skin (section 1.3).

A foot is the patch of skin below the ankle that lies near the ground: a sole, a paw, the rim of a hoof, the end of a
peg. Its length, width and offset are measured there, so that heel and toe tip lie on the ground under its ends.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from crowd import posing
from crowd.analysis.stride import leg_lengths
from crowd.errors import fail, nearest
from crowd.types import Archetype, Leg

SHORTEST, LONGEST = 0.04, 0.9  # of the leg: bounds on a measured foot; a shorter one would make balance a switch
SOLE = 0.25  # of the ankle's height: skin lower than this may bear the foot ...
SOLE_RANGE = (0.015, 0.05)  # ... within these bounds, of the leg
POINTING = 0.25  # of the sole: an ankle that lies this far behind the ball tells where the foot points
LOW = 0.13  # of the leg: an ankle no higher than this belongs to a foot that stands on its whole sole
ELONGATED = 1.4  # length over width from which a sole tells where it points


@dataclass(frozen=True, eq=False)
class Foot:
    """The foot of one leg. Points are in metres of the unscaled character."""

    name: str  # of the leg
    ankle: str  # joint names
    toe: str  # joint that carries the toe tip: the leg's ball (the ankle where it has no other)
    heel: np.ndarray  # [3] in the ankle's frame (1.3: kH)
    toe_tip: np.ndarray  # [3] in the toe joint's frame (1.3: kT)
    length: float  # m, heel to toe tip; > 0
    width: float  # m, for drawing
    height: float  # m, of the ankle over the ground in the rest pose
    offset: tuple[float, float]  # m: sideways (+ to the left of where the foot points) and along the foot
    direction: np.ndarray  # [3] unit, horizontal, character frame: where the foot points in the rest pose
    notes: tuple[str, ...] = field(default=())


@dataclass(frozen=True)
class FootShape:
    """What is known of a foot; None: measured on the skin."""

    length: float | None = None  # m
    width: float | None = None  # m
    offset: tuple[float, float] | None = None  # m, sideways and along the foot


def feet_of(archetype: Archetype, given: Mapping[str, FootShape] | None = None) -> tuple[Foot, ...]:
    """The feet of the archetype's legs, in their order.

    given: shapes by leg name that override what the skin tells. The ground of the rest pose is y = 0.
    Without skin below an ankle, or with less than 4 % of the leg, the foot is 4 % of the leg long; longer than 90 % it
    is cut; both are noted. Raises InputError for an unknown leg name or a length that is not > 0.
    """
    given = dict(given or {})
    names = [leg.name for leg in archetype.legs]
    for name, shape in given.items():
        where = f"{archetype.source} feet.{name}"
        if name not in names:
            raise fail(where, f"no such leg{nearest(name, names)}; allowed: {', '.join(names)}")
        if shape.length is not None and not shape.length > 0:
            raise fail(f"{where}.length", f"is {shape.length}; must be > 0 m")
    rest = posing.rest_motion(archetype.skeleton)
    rotation, position = posing.world_transforms(archetype.skeleton, rest)
    skin = posing.skin(archetype.mesh, rotation, position) if len(archetype.mesh.vertices) else np.zeros((0, 3))
    carriers = _carriers(archetype)
    lengths = leg_lengths(archetype)
    return tuple(
        _foot(
            archetype, leg, lengths[i], rotation, position, skin[_below(archetype, leg, carriers)], given.get(leg.name)
        )
        for i, leg in enumerate(archetype.legs)
    )


def _carriers(archetype: Archetype) -> np.ndarray:
    """[V] joint that holds most of each vertex."""
    mesh = archetype.mesh
    if not len(mesh.vertices):
        return np.zeros(0, int)
    return np.take_along_axis(mesh.joints, np.argmax(mesh.weights, 1)[:, None], 1)[:, 0]


def _below(archetype: Archetype, leg: Leg, carriers: np.ndarray) -> np.ndarray:
    """[V] whether a vertex hangs on the ankle or a joint below it."""
    inside = np.zeros(archetype.skeleton.count, bool)
    for joint, parent in enumerate(archetype.skeleton.parents):
        inside[joint] = joint == leg.ankle or (parent >= 0 and inside[parent])
    return inside[carriers]


def _foot(
    archetype: Archetype, leg: Leg, leg_length: float, rotation: np.ndarray, position: np.ndarray, skin: np.ndarray,
    given: FootShape | None,
) -> Foot:  # fmt: skip
    given = given or FootShape()
    ankle, ball = position[leg.ankle], position[leg.ball]
    contact = ball + posing.rotate(rotation[leg.ball], np.array(leg.ball_offset))
    sole = _sole(skin, float(ankle[1] - contact[1]), float(contact[1]), leg_length)
    if ankle[1] - contact[1] < LOW * leg_length and _span(sole) < np.linalg.norm(_on_ground(ball - ankle)):
        # a tilted foot, or a skin without a heel: it reaches from under the ankle to its tip all the same
        sole = np.concatenate([skin[skin[:, 1] <= ankle[1]], ankle[None], ball[None]])
    ahead = _pointing(ankle, ball, contact, sole, leg_length)
    left = np.array([ahead[2], 0.0, -ahead[0]])
    middle = _on_ground(0.5 * (ankle + ball))
    notes: list[str] = []
    if len(sole):
        along, aside = (sole - middle) @ ahead, (sole - middle) @ left
        length, width = float(np.ptp(along)), float(np.ptp(aside))
        offset = (0.5 * float(aside.min() + aside.max()), 0.5 * float(along.min() + along.max()))
    else:
        notes.append(f"leg '{leg.name}': no skin below the ankle; its foot is taken as a point under the contact")
        length, width, offset = 0.0, 0.0, (float((contact - middle) @ left), float((contact - middle) @ ahead))
    if length > LONGEST * leg_length and given.length is None:
        notes.append(
            f"leg '{leg.name}': the skin at the ground is {length:.3g} m long, the leg {leg_length:.3g} m; "
            f"the foot is cut to {LONGEST * leg_length:.3g} m: give its length if that is wrong"
        )
    length = given.length or float(np.clip(length, SHORTEST * leg_length, LONGEST * leg_length))
    width = given.width or max(width, 0.5 * SHORTEST * leg_length)
    offset = given.offset or offset
    centre = middle + offset[0] * left + offset[1] * ahead
    heel, tip = centre - 0.5 * length * ahead, centre + 0.5 * length * ahead
    return Foot(
        name=leg.name,
        ankle=archetype.skeleton.names[leg.ankle],
        toe=archetype.skeleton.names[leg.ball],
        heel=posing.rotate(posing.conjugate(rotation[leg.ankle]), heel - ankle),
        toe_tip=posing.rotate(posing.conjugate(rotation[leg.ball]), tip - ball),
        length=length,
        width=width,
        height=float(ankle[1]),
        offset=offset,
        direction=ahead,
        notes=tuple(notes),
    )


def _on_ground(v: np.ndarray) -> np.ndarray:
    return v * np.array([1.0, 0.0, 1.0])


def _sole(skin: np.ndarray, ankle_height: float, ground: float, leg_length: float) -> np.ndarray:
    """Vertices [n, 3] of the foot that lie near its own ground (a foot may hang a little in the rest pose)."""
    if not len(skin):
        return skin
    lowest = min(ground, float(skin[:, 1].min()) + SOLE_RANGE[0] * leg_length)
    level = np.clip(SOLE * ankle_height, SOLE_RANGE[0] * leg_length, SOLE_RANGE[1] * leg_length)
    return skin[skin[:, 1] < max(lowest, float(skin[:, 1].min())) + level]


def _span(points: np.ndarray) -> float:
    """Diagonal of the horizontal box round points [n, 3]; 0 without any."""
    return float(np.linalg.norm(np.ptp(points[:, [0, 2]], axis=0))) if len(points) else 0.0


def _pointing(
    ankle: np.ndarray, ball: np.ndarray, contact: np.ndarray, sole: np.ndarray, leg_length: float
) -> np.ndarray:
    """Unit horizontal direction from heel to toe: ankle to ball; without a ball the sole's long axis; else forward."""
    forward = np.array([0.0, 0.0, 1.0])
    size = _span(sole)
    for end in (ball, contact):
        toes = _on_ground(end - ankle)
        if np.linalg.norm(toes) > POINTING * max(size, SHORTEST * leg_length):
            return toes / np.linalg.norm(toes)
    if len(sole) >= 3:
        spread, axes = np.linalg.eigh(np.cov(sole[:, [0, 2]].T))
        if spread[1] > ELONGATED**2 * max(spread[0], 1e-12):
            long = np.array([axes[0, 1], 0.0, axes[1, 1]])
            return long if long[2] >= 0 else -long
    return forward
