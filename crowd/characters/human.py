"""A person of 1.70 m and 70 kg, generated.

Lengths: Drillis and Contini 1966 (segment lengths as fractions of standing height, as printed in Winter, *Biomechanics
and Motor Control of Human Movement*, fig. 4.1). Walk: sagittal angles guided by the adult curves of Perry and Burnfield
2010 and Winter 2009 (touchdown knee 5°, 18° after loading, 62° in swing; push-off ankle -15°); jog: usual values at
2.6 m/s. Mesh, arms and trunk are modelled by hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from crowd.characters.body_mesh import skinned
from crowd.characters.gait_clips import (
    FootPath,
    LegJoints,
    Poser,
    compose,
    pitch,
    roll,
    spline,
    step_leg,
    yaw,
)
from crowd.characters.loft import Loft, hole_border, rings_along
from crowd.characters.surface import Part
from crowd.types import Archetype, Arm, Clip, Leg, Mesh, Skeleton

HEIGHT, MASS = 1.70, 70.0
_HIP, _KNEE, _ANKLE, _SHOULDER = (fraction * HEIGHT for fraction in (0.530, 0.285, 0.039, 0.818))
_UPPER_ARM, _FOREARM = 0.186 * HEIGHT, 0.146 * HEIGHT
_FOOT_X = 0.08  # m, half the distance between the feet
_BALL = 0.022  # m, height of the toe joint above the sole
_SAMPLES = 60
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
    "toes": ("foot", (0.085, _BALL, 0.128)),
}


def _tables() -> tuple[list[str], list[int], np.ndarray]:
    rows = [(name, above, place) for name, (above, place) in _CENTRE.items()]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for name, (above, (x, y, z)) in _SIDE.items():
            rows.append((f"{side}_{name}", above if above in _CENTRE else f"{side}_{above}", (sign * x, y, z)))
    names = [row[0] for row in rows]
    return names, [names.index(row[1]) if row[1] else -1 for row in rows], np.array([row[2] for row in rows])


def _upright() -> Skeleton:
    """All frames parallel to the character's, arms straight down."""
    names, parents, positions = _tables()
    offsets = positions - np.where(np.array(parents)[:, None] >= 0, positions[parents], 0.0)
    return Skeleton(tuple(names), tuple(parents), np.tile([1.0, 0, 0, 0], (len(names), 1)), offsets)


def _leg(side: str, sign: float) -> LegJoints:
    names = (f"{side}_{name}" for name in ("thigh", "shank", "foot", "toes"))
    return LegJoints(*names, np.array([0.0, -_BALL, 0.0]), np.array([0.05 * sign, 0.0, 1.0]))


_SIDES = (("left", 1.0, 0.0), ("right", -1.0, 0.5))


def _hang_arms(poser: Poser, swing: np.ndarray | float, elbow: np.ndarray | float, side: str, sign: float) -> None:
    """Arm hanging beside the body; swing: degrees forward, elbow: degrees of flexion."""
    poser.turn(f"{side}_upper_arm", compose(pitch(-np.asarray(swing)), roll(sign * 9.0), yaw(-sign * 12.0)))
    poser.turn(f"{side}_forearm", compose(pitch(-np.asarray(elbow)), roll(-sign * 5.0)))
    poser.turn(f"{side}_hand", pitch(-6.0))


def _standing(poser: Poser, drop: np.ndarray | float) -> None:
    """Feet side by side, pelvis lowered by drop [F] m."""
    still = FootPath(0.0, 0.105, 0.0, 1.0, lambda s: 0.0 * s, lambda p: 0.0 * p)
    offset = np.zeros((poser.samples, 3))
    offset[:, 1] = -np.asarray(drop)
    poser.move("pelvis", offset)
    for side, sign, _ in _SIDES:
        path = FootPath(0.0, still.front, sign * _FOOT_X, 1.0, still.lift, still.pitch)
        step_leg(poser, _leg(side, sign), path, np.zeros(poser.samples), sign * 6.0)
        _hang_arms(poser, 4.0, 14.0, side, sign)


def _skeleton() -> Skeleton:
    upright = _upright()
    poser = Poser(upright, 1)
    _standing(poser, 0.004)
    return Skeleton(upright.names, upright.parents, poser.rotation[0], poser.translation[0])


def _idle(skeleton: Skeleton) -> Clip:
    """Breathing and a slight sway; the feet do not move."""
    poser = Poser(_upright(), 120)
    phase = np.arange(120) / 120
    breath, sway = np.sin(4 * np.pi * phase), np.sin(2 * np.pi * phase)
    shift = np.stack([0.012 * sway, np.zeros(120), 0.004 * np.cos(2 * np.pi * phase)], -1)
    poser.move("pelvis", shift)
    poser.turn("pelvis", roll(0.8 * sway))
    poser.turn("lumbar", roll(-0.6 * sway))
    poser.turn("spine", pitch(0.5 * breath))
    poser.turn("chest", pitch(-1.2 * breath))
    poser.turn("head", compose(yaw(3.0 * sway), pitch(0.7 * breath)))
    _standing(poser, 0.006 + 0.002 * breath)
    for side, sign, _ in _SIDES:
        _hang_arms(poser, 4.0 + 1.0 * breath, 14.0 + 1.5 * breath, side, sign)
        poser.turn(f"{side}_clavicle", roll(sign * 1.5 * breath))
    return poser.clip("idle", "idle", 5.0, None)


def _walk_path(stride: float, duty: float) -> dict:
    rise = 0.355  # phase at which the heel leaves the ground
    toe_off, power = -60.0, 2.1
    speed_at_toe_off = toe_off * power / (duty - rise) * (1.0 - duty)
    swing = spline((0, 0.12, 0.28, 0.5, 0.72, 0.88, 1), (toe_off, -83, -62, -8, 1.5, 9, 0), (speed_at_toe_off, -60.0))

    def angle(phase: np.ndarray) -> np.ndarray:
        phase = np.asarray(phase, float)
        lifting = toe_off * np.clip((phase - rise) / (duty - rise), 0.0, 1.0) ** power
        return np.where(phase <= duty, lifting, swing((phase - duty) / (1.0 - duty)))

    lift = spline((0, 0.14, 0.32, 0.52, 0.72, 0.88, 1), (0, 0.083, 0.072, 0.030, 0.015, 0.036, 0))
    return {"stride": stride, "front": 0.398, "duty": duty, "lift": lift, "pitch": angle}


def _jog_path(stride: float, duty: float) -> dict:
    rise, toe_off, power = 0.14, -62.0, 1.8
    speed_at_toe_off = toe_off * power / (duty - rise) * (1.0 - duty)
    swing = spline((0, 0.1, 0.3, 0.5, 0.7, 0.88, 1), (toe_off, -101, -92, -39, -16, 7, 0), (speed_at_toe_off, -30.0))

    def angle(phase: np.ndarray) -> np.ndarray:
        phase = np.asarray(phase, float)
        lifting = toe_off * np.clip((phase - rise) / (duty - rise), 0.0, 1.0) ** power
        return np.where(phase <= duty, lifting, swing((phase - duty) / (1.0 - duty)))

    lift = spline((0, 0.1, 0.25, 0.4, 0.6, 0.8, 0.93, 1), (0, 0.0985, 0.228, 0.223, 0.110, 0.070, 0.033, 0))
    return {"stride": stride, "front": 0.29, "duty": duty, "lift": lift, "pitch": angle, "late": 1.04}


@dataclass(frozen=True)
class _Carriage:
    """How the trunk is carried: lean, twist and list in degrees, drop of the pelvis, bob and surge in m, phases."""

    lean: float
    twist: float
    list: float
    drop: float
    bob: float
    lowest: float  # phase of the left foot at which the pelvis is lowest
    surge: float = 0.0


def _trunk(poser: Poser, phase: np.ndarray, carriage: _Carriage) -> None:
    """Pelvis and trunk over the left foot's phase: two vertical waves, one of list, twist and sway per cycle."""
    lean, twist, list_ = carriage.lean, carriage.twist, carriage.list
    wave = 2 * np.pi * phase
    sway = 0.020 * np.cos(wave - 2 * np.pi * 0.28)
    bounce = 2 * (wave - 2 * np.pi * carriage.lowest)
    height = -carriage.drop - carriage.bob * np.cos(bounce)
    poser.move("pelvis", np.stack([sway, height, carriage.surge * np.sin(bounce)], -1))
    hips = compose(yaw(-twist * np.cos(wave)), roll(list_ * np.sin(wave + 2 * np.pi * 0.11)), pitch(0.35 * lean))
    poser.turn("pelvis", hips)
    poser.turn("lumbar", compose(roll(-0.5 * list_ * np.sin(wave + 2 * np.pi * 0.11)), pitch(0.3 * lean)))
    poser.turn("spine", compose(yaw(0.9 * twist * np.cos(wave)), roll(-0.4 * list_ * np.sin(wave)), pitch(0.2 * lean)))
    poser.turn("chest", compose(yaw(1.0 * twist * np.cos(wave)), pitch(0.15 * lean)))
    poser.turn("neck", compose(yaw(-0.5 * twist * np.cos(wave)), pitch(-0.3 * lean)))
    poser.turn_world("head", pitch(0.1 * lean))


def _gait(paths: dict, carriage: _Carriage) -> Poser:
    poser = Poser(_upright(), _SAMPLES)
    phase = np.arange(_SAMPLES) / _SAMPLES
    _trunk(poser, phase, carriage)
    for side, sign, start in _SIDES:
        step_leg(poser, _leg(side, sign), FootPath(side=sign * _FOOT_X, **paths), (phase + start) % 1.0)
    return poser


def _walk() -> Clip:
    carriage = _Carriage(lean=3.0, twist=4.5, list=4.0, drop=0.0325, bob=0.0205, lowest=-0.004, surge=-0.01)
    poser = _gait(_walk_path(1.3, 0.6), carriage)
    phase = np.arange(_SAMPLES) / _SAMPLES
    for side, sign, start in _SIDES:
        wave = 2 * np.pi * (phase + start)
        _hang_arms(poser, -3.0 - 20.0 * np.cos(wave), 20.0 - 11.0 * np.cos(wave - 0.4), side, sign)
    return poser.clip("walk", "walk", 1.0, 1.3)


def _jog() -> Clip:
    cycle = 0.74
    carriage = _Carriage(lean=9.0, twist=6.0, list=4.0, drop=0.053, bob=0.026, lowest=0.235)
    poser = _gait(_jog_path(2.6 * cycle, 0.37), carriage)
    phase = np.arange(_SAMPLES) / _SAMPLES
    for side, sign, start in _SIDES:
        wave = 2 * np.pi * (phase + start)
        _hang_arms(poser, -8.0 - 30.0 * np.cos(wave), 88.0 - 14.0 * np.cos(wave), side, sign)
    return poser.clip("jog", "run", cycle, 2.6)


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
        part("head", (0.0, 0.002, 0.052), (0.0, 0.05, 0.055), (0.044, 0.056)),
        part("head", (0.0, 0.055, 0.100), (0.0, 0.038, 0.117), (0.018, 0.020)),
    ]
    for side, sign in (("left", 1.0), ("right", -1.0)):

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


def _bind(upright: Skeleton) -> tuple[np.ndarray, np.ndarray]:
    """Joint rotations [J, 4] and positions [J, 3] with arms and legs spread, so that the skin between them is clear."""
    poser = Poser(upright, 1)
    for side, sign, _ in _SIDES:
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
    (1.522, 0.020, (0.1, 1.0)),
    (1.568, 0.015, (0.0, 1.0)),
    (1.635, 0.010, (0.1, 1.0)),
    (1.675, 0.005, (0.0, 1.0)),
)
_ANGLES = (0.0, 38.0, 72.0, 108.0, 142.0, 180.0)


def _surface(parts: list[Part], at: dict[str, np.ndarray], index: dict[str, int]) -> tuple[np.ndarray, np.ndarray]:
    """Left half of the skin in the bind pose."""
    arm = frozenset(index[f"left_{name}"] for name in ("clavicle", "upper_arm", "forearm", "hand"))
    leg = frozenset(index[f"left_{name}"] for name in ("thigh", "shank", "foot", "toes")) | {index["pelvis"]}
    trunk = frozenset(range(len(index))) - (arm | leg) | {index["left_clavicle"], index["pelvis"], index["left_thigh"]}
    loft = Loft(parts, 0.012, float(at["left_toes"][1]) - _BALL)
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


def _mesh() -> Mesh:
    upright = _upright()
    rotations, positions = _bind(upright)
    index = {name: joint for joint, name in enumerate(upright.names)}
    at = {name: positions[joint] for name, joint in index.items()}
    parts = _parts(at, index)
    vertices, triangles = _surface(parts, at, index)
    mirror = [index[_other(name)] for name in upright.names]
    return skinned(vertices, triangles, parts, upright.parents, positions, rotations, mirror)


def _other(name: str) -> str:
    swap = {"left": "right", "right": "left"}
    head, _, tail = name.partition("_")
    return f"{swap[head]}_{tail}" if head in swap else name


def build() -> Archetype:
    """The person."""
    skeleton = _skeleton()
    index = {name: joint for joint, name in enumerate(skeleton.names)}
    legs = tuple(
        Leg(side, *(index[f"{side}_{j}"] for j in ("thigh", "shank", "foot", "toes")), (0.0, -_BALL, 0.0), int(sign))
        for side, sign, _ in _SIDES
    )
    arms = tuple(
        Arm(side, *(index[f"{side}_{j}"] for j in ("upper_arm", "forearm", "hand")), int(sign))
        for side, sign, _ in _SIDES
    )
    clips = (_idle(skeleton), _walk(), _jog())
    return Archetype("human", skeleton, _mesh(), legs, arms, clips, index["pelvis"], HEIGHT, MASS)
