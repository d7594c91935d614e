"""A dog of 0.60 m at the withers and 28 kg, generated.

Lengths and stance are those of a medium-large, long-legged breed, modelled by hand. Gaits: lateral-sequence walk, trot
and transverse gallop with Hildebrand's (1965) phase offsets and the duty factors usual for their speeds (dogs walk up
to about 1.2 m/s and trot to about 2.6 m/s). Digitigrade: what inverse kinematics calls ankle is the wrist and the
hock, the foot below it stands on its toes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from crowd.characters.body_mesh import skinned
from crowd.characters.gait_clips import (
    Curve,
    FootPath,
    LegJoints,
    Poser,
    compose,
    periodic,
    pitch,
    roll,
    spline,
    step_leg,
    yaw,
)
from crowd.characters.loft import Loft, hole_border, rings_along
from crowd.characters.surface import Part
from crowd.types import Archetype, Clip, ClipRole, Leg, Mesh, Skeleton

HEIGHT, MASS = 0.60, 28.0  # withers
_PAW = 0.026  # m, height of the toe joint above the ground
_SAMPLES = 60
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
_SIDE = {
    "ear": ("head", (0.042, 0.758, 0.392)),
    "scapula": ("chest", (0.050, 0.570, 0.190)),
    "upper_arm": ("scapula", (0.082, 0.420, 0.285)),
    "forearm": ("upper_arm", (0.085, 0.305, 0.170)),
    "wrist": ("forearm", (0.085, 0.128, 0.185)),
    "fore_paw": ("wrist", (0.085, _PAW, 0.215)),
    "thigh": ("pelvis", (0.075, 0.495, -0.285)),
    "shank": ("thigh", (0.085, 0.340, -0.195)),
    "hock": ("shank", (0.082, 0.172, -0.350)),
    "hind_paw": ("hock", (0.080, _PAW, -0.322)),
}
_SIDES = (("left", 1.0), ("right", -1.0))
_FORE = ("upper_arm", "forearm", "wrist", "fore_paw")
_HIND = ("thigh", "shank", "hock", "hind_paw")


def _skeleton() -> Skeleton:
    rows = [(name, above, place) for name, (above, place) in _CENTRE.items()]
    for side, sign in _SIDES:
        for name, (above, (x, y, z)) in _SIDE.items():
            rows.append((f"{side}_{name}", above if above in _CENTRE else f"{side}_{above}", (sign * x, y, z)))
    names = [row[0] for row in rows]
    parents = [names.index(row[1]) if row[1] else -1 for row in rows]
    positions = np.array([row[2] for row in rows])
    offsets = positions - np.where(np.array(parents)[:, None] >= 0, positions[parents], 0.0)
    return Skeleton(tuple(names), tuple(parents), np.tile([1.0, 0, 0, 0], (len(names), 1)), offsets)


@dataclass(frozen=True)
class _Limb:
    """A pair of legs in a gait: touchdown phases (left, right), z of touchdown from the joint's own, lift, pitch."""

    touchdown: tuple[float, float]
    front: float
    lift: Curve
    pitch: Curve
    follow: float = 1.0


@dataclass(frozen=True)
class _Gait:
    name: str
    role: ClipRole
    speed: float
    cycle: float
    duty: float
    fore: _Limb
    hind: _Limb
    drop: float
    shoulder: float  # degrees the shoulder blades swing to and fro


def _leg(side: str, pair: tuple[str, ...]) -> LegJoints:
    back = -1.0 if pair is _FORE else 1.0  # elbows point back, stifles forward
    names = (f"{side}_{name}" for name in pair)
    return LegJoints(*names, np.array([0.0, -_PAW, 0.0]), np.array([0.0, -0.4, back]))


def _own_phase(phase: np.ndarray, touchdown: float) -> np.ndarray:
    return (phase - touchdown) % 1.0


def _step(poser: Poser, gait: _Gait) -> None:
    """All four legs of a gait on their paths, shoulder blades included."""
    phase = np.arange(_SAMPLES) / _SAMPLES
    for pair, limb in ((_FORE, gait.fore), (_HIND, gait.hind)):
        for k, (side, sign) in enumerate(_SIDES):
            own = _own_phase(phase, limb.touchdown[k])
            x, _, z = _SIDE[pair[3]][1]
            if pair is _FORE:
                half = np.where(own < gait.duty, own / gait.duty, 1.0 + (own - gait.duty) / (1.0 - gait.duty)) / 2.0
                poser.turn(f"{side}_scapula", pitch(2.0 - gait.shoulder * np.cos(2 * np.pi * half)))
            stride = gait.speed * gait.cycle
            path = FootPath(stride, z + limb.front, sign * x, gait.duty, limb.lift, limb.pitch, follow=limb.follow)
            step_leg(poser, _leg(side, pair), path, own)


def _carry(poser: Poser, height: np.ndarray, tilt: np.ndarray, flex: np.ndarray, along: np.ndarray) -> None:
    """Trunk: height and shift of the pelvis, m; its tilt, forward positive; arching of the back; degrees; [F] each.

    The head stays nearly level.
    """
    poser.move("pelvis", np.stack([0.0 * height, height, along], -1))
    poser.turn("pelvis", pitch(tilt - 0.55 * flex))
    poser.turn("loin", pitch(0.55 * flex))
    poser.turn("back", pitch(0.45 * flex))
    poser.turn("chest", pitch(0.1 * flex))
    poser.turn("neck", pitch(-0.5 * tilt - 0.35 * flex))


def _wag(poser: Poser, phase: np.ndarray, degrees: float, raised: float | np.ndarray) -> None:
    wave = np.sin(2 * np.pi * phase)
    poser.turn("tail", compose(pitch(raised), yaw(degrees * wave)))
    poser.turn("tail_middle", compose(pitch(0.8 * raised), yaw(degrees * np.sin(2 * np.pi * (phase - 0.12)))))
    poser.turn("tail_end", compose(pitch(0.8 * raised), yaw(degrees * np.sin(2 * np.pi * (phase - 0.24)))))


def _idle(skeleton: Skeleton) -> Clip:
    poser = Poser(skeleton, 120)
    phase = np.arange(120) / 120
    wave, breath = 2 * np.pi * phase, np.sin(6 * np.pi * phase)
    poser.move("pelvis", np.stack([0.004 * np.sin(wave), -0.008 + 0.001 * breath, 0.0 * wave], -1))
    poser.turn("chest", pitch(0.5 * breath))
    poser.turn("neck", compose(yaw(6.0 * np.sin(wave)), pitch(-1.0 * breath)))
    poser.turn("head", compose(yaw(10.0 * np.sin(wave - 0.4)), roll(3.0 * np.sin(wave))))
    _wag(poser, 3 * phase, 16.0, -4.0)
    for pair in (_FORE, _HIND):
        for side, sign in _SIDES:
            x, _, z = _SIDE[pair[3]][1]
            path = FootPath(0.0, z, sign * x, 1.0, lambda s: 0.0 * s, lambda p: 0.0 * p)
            step_leg(poser, _leg(side, pair), path, np.zeros(120))
    return poser.clip("idle", "idle", 4.0, None)


def _walk(skeleton: Skeleton) -> Clip:
    lift = spline((0, 0.25, 0.5, 0.8, 1), (0, 0.045, 0.055, 0.03, 0))
    fore = _Limb((0.25, 0.75), 0.305, lift, periodic((0, 0.25, 0.45, 0.65, 0.77, 0.9), (4, 12, 2, -50, -85, -25)), 0.8)
    hind = _Limb((0.0, 0.5), 0.245, lift, periodic((0, 0.2, 0.45, 0.65, 0.77, 0.9), (22, 12, -4, -38, -42, 6)), 0.9)
    gait = _Gait("walk", "walk", 1.1, 0.70, 0.65, fore, hind, 0.02, 11.0)
    phase = np.arange(_SAMPLES) / _SAMPLES
    wave = 2 * np.pi * phase
    poser = Poser(skeleton, _SAMPLES)
    _carry(poser, -gait.drop + 0.006 * np.cos(2 * wave), 0.8 * np.sin(2 * wave), 0.0 * wave, 0.0 * wave)
    poser.turn(
        "pelvis", compose(yaw(-3.0 * np.cos(wave - 0.3)), roll(3.0 * np.sin(wave)), pitch(0.5 * np.sin(2 * wave)))
    )
    poser.turn("loin", yaw(3.0 * np.cos(wave - 0.3)))
    poser.turn("back", roll(-3.0 * np.sin(wave)))
    poser.turn("neck", pitch(4.0 + 3.0 * np.cos(2 * wave - 0.8)))
    poser.turn("head", pitch(2.0 - 2.5 * np.cos(2 * wave - 0.8)))
    _wag(poser, phase, 10.0, -2.0)
    _step(poser, gait)
    return poser.clip(gait.name, gait.role, gait.cycle, gait.speed)


def _trot(skeleton: Skeleton) -> Clip:
    lift = spline((0, 0.25, 0.5, 0.8, 1), (0, 0.075, 0.095, 0.045, 0))
    fore = _Limb(
        (0.5, 0.0), 0.265, lift, periodic((0, 0.2, 0.34, 0.45, 0.6, 0.76, 0.9), (4, 14, 0, -48, -100, -80, -18)), 0.5
    )
    hind = _Limb(
        (0.0, 0.5), 0.24, lift, periodic((0, 0.18, 0.34, 0.45, 0.6, 0.8, 0.92), (20, 14, -8, -38, -55, -20, 10)), 0.6
    )
    gait = _Gait("trot", "run", 2.2, 0.46, 0.45, fore, hind, 0.022, 12.0)
    phase = np.arange(_SAMPLES) / _SAMPLES
    wave = 2 * np.pi * phase
    poser = Poser(skeleton, _SAMPLES)
    bounce = -0.016 * np.cos(2 * (wave - 2 * np.pi * 0.21))
    _carry(poser, -gait.drop + bounce, 0.0 * wave, 0.0 * wave, 0.0 * wave)
    poser.turn("loin", yaw(2.0 * np.cos(wave)))
    poser.turn("pelvis", yaw(-2.0 * np.cos(wave)))
    poser.turn("neck", pitch(2.0 * np.cos(2 * wave - 2.0)))
    poser.turn("head", pitch(3.0 - 1.5 * np.cos(2 * wave - 2.0)))
    _wag(poser, phase, 6.0, 8.0)
    _step(poser, gait)
    return poser.clip(gait.name, gait.role, gait.cycle, gait.speed)


def _gallop(skeleton: Skeleton) -> Clip:
    lift = spline((0, 0.15, 0.4, 0.7, 1), (0, 0.10, 0.16, 0.11, 0))
    low = spline((0, 0.2, 0.5, 0.8, 1), (0, 0.07, 0.10, 0.06, 0))
    fore = _Limb(
        (0.5, 0.6), 0.25, lift, periodic((0, 0.12, 0.2, 0.25, 0.4, 0.62, 0.85), (4, 14, -6, -45, -110, -95, -25)), 0.2
    )
    hind = _Limb(
        (0.0, 0.1), 0.31, low, periodic((0, 0.12, 0.2, 0.25, 0.4, 0.7, 0.9), (24, 14, -12, -40, -50, -14, 16)), 0.3
    )
    gait = _Gait("gallop", "run", 5.0, 0.40, 0.25, fore, hind, 0.035, 15.0)
    phase = np.arange(_SAMPLES) / _SAMPLES
    wave = 2 * np.pi * phase
    poser = Poser(skeleton, _SAMPLES)
    flex = 16.0 * np.cos(wave - 2 * np.pi * 0.95) + 3.0
    tilt = 5.0 * np.cos(wave - 2 * np.pi * 0.62)
    height = -gait.drop + 0.022 * np.cos(wave - 2 * np.pi * 0.42)
    _carry(poser, height, tilt, flex, 0.02 * np.cos(wave - 2 * np.pi * 0.95))
    poser.turn("head", pitch(6.0 - 0.3 * tilt))
    _wag(poser, phase, 3.0, 22.0 + 0.0 * phase)
    for side, sign in _SIDES:
        poser.turn(f"{side}_ear", compose(pitch(-25.0), roll(-sign * 10.0)))
    _step(poser, gait)
    return poser.clip(gait.name, gait.role, gait.cycle, gait.speed)


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
        trunk("head", (0.716, 0.405), (0.710, 0.455), (0.067, 0.060), 1.0),
        trunk("head", (0.694, 0.465), (0.682, 0.565), (0.047, 0.034), 0.9),
        limb("tail", "tail_middle", (0.030, 0.024)),
        limb("tail_middle", "tail_end", (0.024, 0.019)),
        Part(index["tail_end"], tuple(at["tail_end"]), tuple(at["tail_end"] + [0.0, -0.085, -0.035]), (0.019, 0.011)),
    ]
    for side, sign in _SIDES:

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
    (0.682, 0.568, (1.0, 0.25)),
    (0.692, 0.500, (1.0, 0.05)),
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
    ends = np.array([[0.0, 0.681, 0.560], [0.0, 0.43, -0.514]])
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
    hip, stifle, hock, paw = (at[f"left_{name}"] for name in _HIND)
    return [
        _across(hip + np.array([0.004, -0.100, 0.026]), -1.0, 0.0),
        _across(stifle + np.array([0.0, -0.002, -0.01]), -1.0, -0.45),
        *rings_along(stifle, hock, (0.38, 0.85)),
        *rings_along(hock, paw, (0.1, 0.6)),
        *_toe_rings(paw),
    ]


def _mesh(skeleton: Skeleton) -> Mesh:
    positions = np.zeros((skeleton.count, 3))
    for joint, above in enumerate(skeleton.parents):
        positions[joint] = skeleton.rest_translation[joint] + (positions[above] if above >= 0 else 0.0)
    index = {name: joint for joint, name in enumerate(skeleton.names)}
    at = {name: positions[joint] for name, joint in index.items()}
    parts = _parts(at, index)
    vertices, triangles = _surface(parts, at, index)
    swap = {"left": "right", "right": "left"}
    mirror = []
    for name in skeleton.names:
        head, _, rest = name.partition("_")
        mirror.append(index[f"{swap[head]}_{rest}"] if head in swap else index[name])
    return skinned(vertices, triangles, parts, skeleton.parents, positions, None, mirror)


def build() -> Archetype:
    """The dog; `height` is that of the withers."""
    skeleton = _skeleton()
    index = {name: joint for joint, name in enumerate(skeleton.names)}
    legs = tuple(
        Leg(f"{kind}_{side}", *(index[f"{side}_{name}"] for name in pair), (0.0, -_PAW, 0.0), int(sign))
        for kind, pair in (("front", _FORE), ("hind", _HIND))
        for side, sign in _SIDES
    )
    clips = (_idle(skeleton), _walk(skeleton), _trot(skeleton), _gallop(skeleton))
    return Archetype("dog", skeleton, _mesh(skeleton), legs, (), clips, index["pelvis"], HEIGHT, MASS)
