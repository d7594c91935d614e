"""The person's skeleton and skin.

Lengths: Drillis and Contini 1966 (segment lengths as fractions of standing height, as printed in Winter, *Biomechanics
and Motor Control of Human Movement*, fig. 4.1). The flesh is modelled by hand.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from crowd.characters.body_mesh import skinned
from crowd.characters.gait_clips import Poser, compose, pitch, roll
from crowd.characters.loft import Loft, hole_border, rings_along
from crowd.characters.surface import Part
from crowd.characters.two_sided import SIDES, other_side, two_sided
from crowd.types import Mesh, Skeleton

HEIGHT = 1.70
_HIP, _KNEE, _ANKLE, _SHOULDER = (fraction * HEIGHT for fraction in (0.530, 0.285, 0.039, 0.818))
_UPPER_ARM, _FOREARM = 0.186 * HEIGHT, 0.146 * HEIGHT
BALL = 0.022  # m, height of the toe joint above the sole
_CENTRE = {  # name: (parent, position in the upright pose, m)
    "pelvis": ("", (0.0, 0.930, 0.0)),
    "lumbar": ("pelvis", (0.0, 1.030, -0.008)),
    "spine": ("lumbar", (0.0, 1.130, -0.018)),
    "chest": ("spine", (0.0, 1.240, -0.022)),
    "neck": ("chest", (0.0, 1.435, -0.022)),
    "head": ("neck", (0.0, 1.530, 0.0)),
}
_SIDE = {
    "clavicle": ("chest", (0.025, _SHOULDER + 0.005, -0.005)),
    "upper_arm": ("clavicle", (0.178, _SHOULDER, -0.022)),
    "forearm": ("upper_arm", (0.178, _SHOULDER - _UPPER_ARM, -0.022)),
    "hand": ("forearm", (0.178, _SHOULDER - _UPPER_ARM - _FOREARM, -0.022)),
    "thigh": ("pelvis", (0.085, _HIP, 0.0)),
    "shank": ("thigh", (0.085, _KNEE, 0.0)),
    "foot": ("shank", (0.085, _ANKLE, 0.0)),
    "toes": ("foot", (0.085, BALL, 0.128)),
}


def upright() -> Skeleton:
    """Standing with straight legs and arms, all frames parallel to the character's."""
    return two_sided(_CENTRE, _SIDE)


def _parts(at: dict[str, np.ndarray], index: dict[str, int]) -> list[Part]:
    """Flesh in the bind pose (arms and legs spread)."""

    def part(joint: str, start: tuple, end: tuple, radii: tuple, stretch: tuple = (1, 1, 1), frm: str = "") -> Part:
        origin = at[frm or joint]
        return Part(index[joint], tuple(origin + start), tuple(origin + end), radii, stretch)

    def limb(joint: str, child: str, radii: tuple, cut: tuple = (0.0, 1.0), push: tuple = (0, 0, 0)) -> Part:
        a, b = at[joint], at[child]
        return Part(index[joint], tuple(a + cut[0] * (b - a) + push), tuple(a + cut[1] * (b - a) + push), radii)

    parts = [
        part("pelvis", (0.0, 0.0, 0.0), (0.0, 0.06, -0.005), (0.115, 0.105), (1.34, 1, 1.0)),
        part("lumbar", (0.0, 0.0, 0.008), (0.0, 0.09, 0.005), (0.110, 0.108), (1.27, 1, 0.97)),
        part("spine", (0.0, 0.0, 0.012), (0.0, 0.10, 0.01), (0.108, 0.118), (1.32, 1, 1.0)),
        part("chest", (0.0, 0.0, 0.012), (0.0, 0.085, 0.0), (0.119, 0.105), (1.40, 1, 1.02)),
        part("neck", (0.0, -0.05, -0.01), (0.0, 0.09, 0.012), (0.068, 0.056)),
        part("head", (0.0, 0.078, 0.028), (0.0, 0.094, -0.006), (0.080, 0.084), (0.95, 1, 1.06)),
        part("head", (0.0, -0.006, 0.062), (0.0, 0.05, 0.056), (0.042, 0.056)),
        part("head", (0.0, 0.055, 0.092), (0.0, 0.040, 0.101), (0.018, 0.020)),
    ]
    for side, sign in SIDES:

        def joint(name: str, side: str = side) -> str:
            return f"{side}_{name}"

        upper, fore, hand = joint("upper_arm"), joint("forearm"), joint("hand")
        along = at[hand] - at[fore]
        along = along / np.linalg.norm(along)
        knuckles, tips = at[hand] + 0.085 * along, at[hand] + 0.155 * along + np.array([0, 0, 0.015])
        parts += [
            part("pelvis", (0.075 * sign, -0.055, -0.036), (0.08 * sign, -0.02, -0.036), (0.082, 0.08)),
            limb(joint("clavicle"), upper, (0.058, 0.056), (0.25, 0.95), (0, -0.008, 0)),
            part("chest", (0.08 * sign, 0.085, 0.045), (0.06 * sign, 0.08, 0.045), (0.062, 0.062)),
            limb(upper, fore, (0.057, 0.044)),
            limb(fore, hand, (0.045, 0.029)),
            limb(fore, hand, (0.048, 0.040), (0.12, 0.4)),
            Part(index[hand], tuple(at[hand]), tuple(knuckles), (0.029, 0.041), (0.66, 0.9, 1.0)),
            Part(index[hand], tuple(knuckles), tuple(tips), (0.038, 0.028), (0.62, 0.9, 1.05)),
            Part(
                index[hand],
                tuple(at[hand] + 0.02 * along + [0, 0, 0.018]),
                tuple(at[hand] + 0.075 * along + [-0.004 * sign, 0, 0.048]),
                (0.017, 0.014),
            ),
            limb(joint("thigh"), joint("shank"), (0.087, 0.055), (0.03, 1.0)),
            limb(joint("thigh"), joint("shank"), (0.076, 0.058), (0.2, 0.7), (0.004 * sign, 0, 0.012)),
            limb(joint("shank"), joint("foot"), (0.053, 0.036)),
            limb(joint("shank"), joint("foot"), (0.048, 0.042), (0.18, 0.5), (0, 0, -0.02)),
            part(joint("foot"), (0, -0.028, -0.03), (0, -0.03, -0.03), (0.036, 0.036)),
            part(joint("foot"), (0, -0.005, 0.0), (0.004 * sign, -0.042, 0.12), (0.042, 0.027), (1.12, 1, 1)),
            part(joint("foot"), (0, -0.036, -0.025), (0.004 * sign, -0.046, 0.125), (0.032, 0.024), (1.2, 1, 1)),
            part(joint("toes"), (0.004 * sign, -0.002, 0.0), (0.0, -0.006, 0.05), (0.026, 0.018), (1.7, 1, 1)),
        ]
    return parts


def _bind(skeleton: Skeleton) -> tuple[np.ndarray, np.ndarray]:
    """Joint rotations [J, 4] and positions [J, 3] with arms and legs spread, so that the skin between them is clear."""
    poser = Poser(skeleton, 1)
    for side, sign in SIDES:
        poser.turn(f"{side}_upper_arm", compose(roll(sign * 38.0), pitch(-4.0)))
        poser.turn(f"{side}_forearm", pitch(-10.0))
        poser.turn(f"{side}_thigh", roll(sign * 6.0))
        poser.turn_world(f"{side}_foot", np.array([1.0, 0, 0, 0]))
    rotations, positions = poser.world()
    return rotations[0], positions[0]


_STRIPS = (  # trunk, neck and head from below: height, z of the middle, forward direction (y, z)
    (0.872, 0.000, (0.16, 1.0)),
    (0.950, 0.000, (0.04, 1.0)),
    (1.040, 0.000, (0.0, 1.0)),
    (1.135, -0.004, (0.0, 1.0)),
    (1.225, -0.006, (0.0, 1.0)),
    (1.310, -0.010, (-0.05, 1.0)),
    (1.385, -0.015, (-0.2, 1.0)),
    (1.437, -0.022, (-0.3, 1.0)),
    (1.485, -0.012, (-0.2, 1.0)),
    (1.518, 0.020, (0.0, 1.0)),
    (1.568, 0.015, (0.0, 1.0)),
    (1.635, 0.010, (0.1, 1.0)),
    (1.682, 0.004, (0.0, 1.0)),
)
_ANGLES = (0.0, 38.0, 72.0, 108.0, 142.0, 180.0)


def _surface(parts: list[Part], at: dict[str, np.ndarray], index: dict[str, int]) -> tuple[np.ndarray, np.ndarray]:
    """Left half of the skin in the bind pose."""
    arm = frozenset(index[f"left_{name}"] for name in ("clavicle", "upper_arm", "forearm", "hand"))
    leg = frozenset(index[f"left_{name}"] for name in ("thigh", "shank", "foot", "toes")) | {index["pelvis"]}
    trunk = frozenset(range(len(index))) - (arm | leg) | {index["left_clavicle"], index["pelvis"], index["left_thigh"]}
    loft = Loft(parts, 0.012, float(at["left_toes"][1]) - BALL)
    rows = [loft.strip((0.0, y, z), (0.0, *front), _ANGLES, trunk) for y, z, front in _STRIPS]
    for low, (below, above) in enumerate(pairwise(rows)):
        loft.skin(below, above, skip=(2,) if low in (4, 5) else ())
    loft.cap(rows[-1], loft.cast(np.array([0.0, 1.6, 0.0]), np.array([[0.0, 1.0, 0.0]]))[0], closed=False)
    shoulder, elbow, wrist = (at[f"left_{name}"] for name in ("upper_arm", "forearm", "hand"))
    fist = wrist + (wrist - elbow) / np.linalg.norm(wrist - elbow) * 0.17
    arm_rings = [
        *rings_along(shoulder, elbow, (0.24, 0.86)),
        *rings_along(elbow, wrist, (0.12, 0.4, 0.95)),
        *rings_along(wrist, fist + np.array([0.0, 0.0, 0.02]), (0.42, 0.92)),
    ]
    loft.limb(hole_border(rows[4:7], (2, 3)), arm_rings, arm, 0.12)
    crotch = loft.vertex(loft.cast(np.array([0.0, 0.93, 0.0]), np.array([[0.0, -1.0, 0.0]]))[0])
    loft.limb([*reversed(rows[0]), crotch], _leg_rings(at), leg, 0.08)
    return loft.finish()


def _leg_rings(at: dict[str, np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    hip, knee, ankle, toes = (at[f"left_{name}"] for name in ("thigh", "shank", "foot", "toes"))

    def tilted(offset: tuple[float, float, float], degrees: float) -> tuple[np.ndarray, np.ndarray]:
        a = np.radians(degrees)
        return ankle + np.asarray(offset), np.array([0.0, -np.cos(a), np.sin(a)])

    return [
        *rings_along(hip, knee, (0.2, 0.5, 0.9)),
        *rings_along(knee, ankle, (0.1, 0.32, 0.65, 0.95)),
        tilted((0.0, -0.022, -0.004), 25.0),
        tilted((0.0, -0.030, 0.022), 62.0),
        tilted((0.0, -0.038, 0.070), 85.0),
        (toes + np.array([0.0, -0.004, 0.0]), np.array([0.0, 0.0, 1.0])),
        (toes + np.array([0.0, -0.008, 0.042]), np.array([0.0, 0.0, 1.0])),
    ]


def mesh() -> Mesh:
    """The skin, bound with arms and legs spread."""
    skeleton = upright()
    rotations, positions = _bind(skeleton)
    index = {name: joint for joint, name in enumerate(skeleton.names)}
    at = {name: positions[joint] for name, joint in index.items()}
    parts = _parts(at, index)
    vertices, triangles = _surface(parts, at, index)
    return skinned(vertices, triangles, parts, skeleton.parents, positions, rotations, other_side(skeleton.names))
