"""The dog's skeleton and skin: a medium-large, long-legged breed, modelled by hand."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from crowd import posing
from crowd.characters.body_mesh import skinned
from crowd.characters.loft import Loft, hole_border, rings_along
from crowd.characters.surface import Part
from crowd.characters.two_sided import SIDES, other_side, two_sided
from crowd.types import Mesh, Skeleton

HEIGHT = 0.60  # m, withers
PAW = 0.026  # m, height of the toe joint above the ground
_CENTRE = {  # name: (parent, position standing, m)
    "pelvis": ("", (0.0, 0.530, -0.270)),
    "loin": ("pelvis", (0.0, 0.545, -0.150)),
    "back": ("loin", (0.0, 0.545, -0.010)),
    "chest": ("back", (0.0, 0.535, 0.120)),
    "neck": ("chest", (0.0, 0.560, 0.260)),
    "neck_upper": ("neck", (0.0, 0.640, 0.345)),
    "head": ("neck_upper", (0.0, 0.708, 0.402)),
    "tail": ("pelvis", (0.0, 0.545, -0.365)),
    "tail_middle": ("tail", (0.0, 0.500, -0.445)),
    "tail_end": ("tail_middle", (0.0, 0.435, -0.510)),
}
SIDE = {
    "ear": ("head", (0.042, 0.758, 0.392)),
    "scapula": ("chest", (0.050, 0.570, 0.190)),
    "upper_arm": ("scapula", (0.082, 0.420, 0.285)),
    "forearm": ("upper_arm", (0.085, 0.305, 0.170)),
    "wrist": ("forearm", (0.085, 0.128, 0.185)),
    "fore_paw": ("wrist", (0.085, PAW, 0.215)),
    "thigh": ("pelvis", (0.075, 0.495, -0.285)),
    "shank": ("thigh", (0.085, 0.340, -0.195)),
    "hock": ("shank", (0.082, 0.172, -0.350)),
    "hind_paw": ("hock", (0.080, PAW, -0.322)),
}
FORE = ("upper_arm", "forearm", "wrist", "fore_paw")
HIND = ("thigh", "shank", "hock", "hind_paw")


def standing() -> Skeleton:
    """All frames parallel to the character's."""
    return two_sided(_CENTRE, SIDE)


def _parts(at: dict[str, np.ndarray], index: dict[str, int]) -> list[Part]:
    """Flesh, standing."""

    def trunk(joint: str, start: tuple, end: tuple, radii: tuple, width: float = 1.0) -> Part:
        return Part(index[joint], (0.0, *start), (0.0, *end), radii, (width, 1.0, 1.0))

    def limb(joint: str, child: str, radii: tuple, stretch: tuple = (1, 1, 1), cut: tuple = (0.0, 1.0)) -> Part:
        a, b = at[joint], at[child]
        return Part(index[joint], tuple(a + cut[0] * (b - a)), tuple(a + cut[1] * (b - a)), radii, stretch)

    parts = [
        trunk("pelvis", (0.508, -0.21), (0.505, -0.325), (0.080, 0.066), 1.0),
        trunk("loin", (0.497, -0.10), (0.508, -0.21), (0.090, 0.080), 0.92),
        trunk("back", (0.480, 0.02), (0.495, -0.10), (0.116, 0.092), 0.85),
        trunk("chest", (0.468, 0.18), (0.476, 0.04), (0.116, 0.121), 0.80),
        trunk("neck", (0.525, 0.225), (0.632, 0.338), (0.097, 0.072), 0.84),
        trunk("neck_upper", (0.636, 0.342), (0.690, 0.395), (0.072, 0.064), 0.9),
        trunk("head", (0.718, 0.402), (0.714, 0.450), (0.070, 0.062), 1.0),
        trunk("head", (0.688, 0.465), (0.672, 0.565), (0.047, 0.034), 0.9),
        limb("tail", "tail_middle", (0.030, 0.024)),
        limb("tail_middle", "tail_end", (0.024, 0.019)),
        Part(index["tail_end"], tuple(at["tail_end"]), tuple(at["tail_end"] + [0.0, -0.085, -0.035]), (0.019, 0.011)),
    ]
    for side, sign in SIDES:

        def own(name: str, side: str = side) -> str:
            return f"{side}_{name}"

        ear = at[own("ear")]
        fore, hind = at[own("fore_paw")], at[own("hind_paw")]
        parts += [
            Part(
                index[own("ear")],
                tuple(ear),
                tuple(ear + np.array([0.012 * sign, 0.062, -0.010])),
                (0.030, 0.008),
                (1, 1, 0.5),
            ),
            Part(index["pelvis"], (0.045 * sign, 0.488, -0.25), (0.05 * sign, 0.475, -0.30), (0.078, 0.072)),
            limb(own("scapula"), own("upper_arm"), (0.050, 0.056), (0.8, 1, 1)),
            limb(own("upper_arm"), own("forearm"), (0.056, 0.043), (0.8, 1, 1)),
            limb(own("forearm"), own("wrist"), (0.038, 0.023), (0.85, 1, 1)),
            limb(own("wrist"), own("fore_paw"), (0.023, 0.024)),
            Part(
                index[own("fore_paw")],
                tuple(fore),
                tuple(fore + np.array([0, -0.004, 0.04])),
                (0.027, 0.021),
                (1.2, 1, 1),
            ),
            limb(own("thigh"), own("shank"), (0.095, 0.060), (0.58, 1, 1)),
            Part(
                index[own("thigh")],
                tuple(at[own("thigh")] + [0.0, -0.03, -0.010]),
                tuple(at[own("thigh")] + [0.0, -0.10, 0.008]),
                (0.066, 0.056),
                (0.6, 1, 1),
            ),
            limb(own("shank"), own("hock"), (0.050, 0.024), (0.75, 1, 1)),
            limb(own("hock"), own("hind_paw"), (0.024, 0.023)),
            Part(
                index[own("hind_paw")],
                tuple(hind),
                tuple(hind + np.array([0, -0.004, 0.04])),
                (0.026, 0.021),
                (1.2, 1, 1),
            ),
        ]
    return parts


_STRIPS = (  # from the nose to the tail: middle (y, z), upward direction (y, z)
    (0.672, 0.568, (1.0, 0.25)),
    (0.684, 0.505, (1.0, 0.1)),
    (0.706, 0.448, (1.0, -0.1)),
    (0.706, 0.398, (1.0, -0.5)),
    (0.645, 0.350, (0.8, -0.6)),
    (0.575, 0.285, (0.8, -0.6)),
    (0.490, 0.235, (1.0, -0.3)),
    (0.468, 0.165, (1.0, 0.0)),
    (0.474, 0.085, (1.0, 0.0)),
    (0.485, -0.035, (1.0, 0.0)),
    (0.500, -0.165, (1.0, 0.0)),
    (0.505, -0.262, (1.0, 0.0)),
    (0.508, -0.345, (1.0, -0.05)),
    (0.534, -0.385, (0.87, -0.49)),
    (0.497, -0.448, (0.8, -0.6)),
    (0.430, -0.514, (0.6, -0.8)),
)
_ANGLES = (0.0, 36.0, 70.0, 105.0, 142.0, 180.0)


def _surface(parts: list[Part], at: dict[str, np.ndarray], index: dict[str, int]) -> tuple[np.ndarray, np.ndarray]:
    """Left half of the skin."""

    def joints(*names: str) -> frozenset[int]:
        return frozenset(index[name] for name in names)

    trunk = joints(*_CENTRE, "left_scapula")
    loft = Loft(parts, 0.008, 0.0)
    rows = [loft.strip((0.0, y, z), (0.0, *up), _ANGLES, trunk) for y, z, up in _STRIPS]
    holes = {2: 1, 6: 3, 7: 3, 10: 3, 11: 3}  # strip: column left open for an ear or a leg
    for strip, (before, after) in enumerate(pairwise(rows)):
        loft.skin(before, after, skip=(holes[strip],) if strip in holes else ())
    ends = np.array([[0.0, 0.671, 0.560], [0.0, 0.43, -0.514]])
    ways = np.array([[0.0, -0.1, 1.0], [0.0, -0.9, -0.4]])
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    loft.cap(rows[0][::-1], loft.cast(ends[0], ways[:1])[0], closed=False)
    loft.cap(rows[-1], loft.cast(ends[1], ways[1:])[0], closed=False)
    ear = at["left_ear"]
    loft.limb(
        hole_border(rows[2:4], (1, 2)),
        rings_along(ear, ear + np.array([0.012, 0.062, -0.010]), (0.35,)),
        joints("left_ear"),
        0.1,
    )
    fore = joints("left_upper_arm", "left_forearm", "left_wrist", "left_fore_paw")
    loft.limb(hole_border(rows[6:9], (3, 4)), _fore_rings(at), fore, 0.05)
    hind = joints("left_thigh", "left_shank", "left_hock", "left_hind_paw")
    loft.limb(hole_border(rows[10:13], (3, 4)), _hind_rings(at), hind, 0.05)
    return loft.finish()


def _across(centre: np.ndarray, y: float, z: float) -> tuple[np.ndarray, np.ndarray]:
    normal = np.array([0.0, y, z])
    return centre, normal / np.linalg.norm(normal)


def _toe_rings(paw: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    return [
        _across(paw + np.array([0.0, 0.006, -0.004]), -0.8, 0.6),
        _across(paw + np.array([0.0, -0.004, 0.030]), -0.15, 1.0),
    ]


def _fore_rings(at: dict[str, np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    elbow, wrist, paw = (at[f"left_{name}"] for name in ("forearm", "wrist", "fore_paw"))
    return [
        _across(elbow + np.array([0.0, 0.025, 0.012]), -1.0, 0.0),
        *rings_along(elbow, wrist, (0.22, 0.55, 0.97)),
        *rings_along(wrist, paw, (0.55,)),
        *_toe_rings(paw),
    ]


def _hind_rings(at: dict[str, np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    hip, stifle, hock, paw = (at[f"left_{name}"] for name in HIND)
    return [
        _across(hip + np.array([0.004, -0.100, 0.026]), -1.0, 0.0),
        _across(stifle + np.array([0.0, -0.002, -0.01]), -1.0, -0.45),
        *rings_along(stifle, hock, (0.38, 0.85)),
        *rings_along(hock, paw, (0.1, 0.6)),
        *_toe_rings(paw),
    ]


def mesh(skeleton: Skeleton) -> Mesh:
    """The skin, bound in the standing pose."""
    rest = posing.world_transforms(skeleton, posing.rest_motion(skeleton))[1]
    index = {name: joint for joint, name in enumerate(skeleton.names)}
    at = {name: rest[joint] for name, joint in index.items()}
    parts = _parts(at, index)
    vertices, triangles = _surface(parts, at, index)
    return skinned(vertices, triangles, parts, skeleton.parents, rest, None, other_side(skeleton.names))
