"""How the generated person carries trunk and arms and stands: what its clips share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowd.characters.gait_clips import FootPath, LegJoints, Poser, compose, pitch, roll, spline, step_leg, yaw
from crowd.characters.human_body import BALL, upright
from crowd.characters.two_sided import leg_joints

SAMPLES = 60  # of a gait
FOOT_X = 0.08  # m, half the distance between the feet
SIDES = (("left", 1.0, 0.0), ("right", -1.0, 0.5))  # the right foot lands half a cycle after the left
LEG = ("thigh", "shank", "foot", "toes")


def leg_of(side: str, sign: float) -> LegJoints:
    """The leg of a side; sign: +1 left."""
    return leg_joints(side, LEG, BALL, (0.05 * sign, 0.0, 1.0))


def hang_arms(poser: Poser, swing: np.ndarray | float, elbow: np.ndarray | float, side: str, sign: float) -> None:
    """Arm hanging beside the body; swing: degrees forward, elbow: degrees of flexion."""
    poser.turn(f"{side}_upper_arm", compose(pitch(-np.asarray(swing)), roll(sign * 9.0), yaw(-sign * 12.0)))
    poser.turn(f"{side}_forearm", compose(pitch(-np.asarray(elbow)), roll(-sign * 5.0)))
    poser.turn(f"{side}_hand", pitch(-6.0))


def standing(poser: Poser, drop: np.ndarray | float) -> None:
    """Feet side by side, pelvis lowered by drop [F] m."""
    still = FootPath(0.0, 0.105, 0.0, 1.0, lambda s: 0.0 * s, lambda p: 0.0 * p)
    offset = np.zeros((poser.samples, 3))
    offset[:, 1] = -np.asarray(drop)
    poser.move("pelvis", offset)
    for side, sign, _ in SIDES:
        path = FootPath(0.0, still.front, sign * FOOT_X, 1.0, still.lift, still.pitch)
        step_leg(poser, leg_of(side, sign), path, np.zeros(poser.samples), sign * 6.0)
        hang_arms(poser, 4.0, 14.0, side, sign)


@dataclass(frozen=True)
class Carriage:
    """How the trunk is carried: lean, twist and list in degrees, drop of the pelvis, bob, surge and shift back in m."""

    lean: float
    twist: float
    list: float
    drop: float
    bob: float
    lowest: float  # phase of the left foot at which the pelvis is lowest
    surge: float = 0.0
    back: float = 0.0


def trunk(poser: Poser, phase: np.ndarray, carriage: Carriage) -> None:
    """Pelvis and trunk over the left foot's phase: two vertical waves, one of list, twist and sway per cycle."""
    lean, twist, list_ = carriage.lean, carriage.twist, carriage.list
    wave = 2 * np.pi * phase
    sway = 0.020 * np.cos(wave - 2 * np.pi * 0.28)
    bounce = 2 * (wave - 2 * np.pi * carriage.lowest)
    height = -carriage.drop - carriage.bob * np.cos(bounce)
    poser.move("pelvis", np.stack([sway, height, carriage.surge * np.sin(bounce) - carriage.back], -1))
    hips = compose(yaw(-twist * np.cos(wave)), roll(list_ * np.sin(wave + 2 * np.pi * 0.11)), pitch(0.35 * lean))
    poser.turn("pelvis", hips)
    poser.turn("lumbar", compose(roll(-0.5 * list_ * np.sin(wave + 2 * np.pi * 0.11)), pitch(0.3 * lean)))
    poser.turn("spine", compose(yaw(0.9 * twist * np.cos(wave)), roll(-0.4 * list_ * np.sin(wave)), pitch(0.2 * lean)))
    poser.turn("chest", compose(yaw(1.0 * twist * np.cos(wave)), pitch(0.15 * lean)))
    poser.turn("neck", compose(yaw(-0.5 * twist * np.cos(wave)), pitch(-0.3 * lean)))
    poser.turn_world("head", pitch(0.1 * lean))


def gait_poser(paths: dict, carriage: Carriage, half_width: float = FOOT_X) -> Poser:
    """A gait on given foot paths without its arms; half_width: half the mean distance of the feet, m."""
    poser = Poser(upright(), SAMPLES)
    phase = np.arange(SAMPLES) / SAMPLES
    trunk(poser, phase, carriage)
    for side, sign, start in SIDES:
        step_leg(poser, leg_of(side, sign), FootPath(side=sign * half_width, **paths), (phase + start) % 1.0)
    return poser


def walk_path(stride: float, duty: float) -> dict:
    """What `FootPath` needs of a foot in a walk."""
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
