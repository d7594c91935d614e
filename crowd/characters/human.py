"""A person of 1.70 m and 70 kg, generated.

Walk: sagittal angles guided by the adult curves of Perry and Burnfield
2010 and Winter 2009 (touchdown knee 5°, 18° after loading, 62° in swing; push-off ankle -15°); jog: usual values at
2.6 m/s. Mesh, arms and trunk are modelled by hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
from crowd.characters.human_body import BALL, HEIGHT, mesh, upright
from crowd.characters.two_sided import leg, leg_joints
from crowd.types import Archetype, Arm, Clip, Skeleton

_SAMPLES = 60
_MASS = 70.0  # kg
_FOOT_X = 0.08  # m, half the distance between the feet
_SIDES = (("left", 1.0, 0.0), ("right", -1.0, 0.5))  # the right foot lands half a cycle after the left
_LEG = ("thigh", "shank", "foot", "toes")


def _leg(side: str, sign: float) -> LegJoints:
    return leg_joints(side, _LEG, BALL, (0.05 * sign, 0.0, 1.0))


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
    still = upright()
    poser = Poser(still, 1)
    _standing(poser, 0.004)
    return Skeleton(still.names, still.parents, poser.rotation[0], poser.translation[0])


def _idle() -> Clip:
    """Breathing and a slight sway; the feet do not move."""
    poser = Poser(upright(), 120)
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

    lift = spline(
        (0, 0.1, 0.25, 0.4, 0.6, 0.8, 0.93, 1), (0, 0.0985, 0.228, 0.223, 0.110, 0.070, 0.033, 0), (0.8, -0.55)
    )
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
    poser = Poser(upright(), _SAMPLES)
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


def build() -> Archetype:
    """The person."""
    skeleton = _skeleton()
    legs = tuple(leg(skeleton, side, int(sign), _LEG, BALL) for side, sign, _ in _SIDES)
    arms = tuple(_arm(skeleton, side, int(sign)) for side, sign, _ in _SIDES)
    clips = (_idle(), _walk(), _jog())
    return Archetype("human", skeleton, mesh(), legs, arms, clips, skeleton.names.index("pelvis"), HEIGHT, _MASS)


def _arm(skeleton: Skeleton, side: str, sign: int) -> Arm:
    shoulder, elbow, hand = (skeleton.names.index(f"{side}_{name}") for name in ("upper_arm", "forearm", "hand"))
    return Arm(side, shoulder, elbow, hand, sign)
