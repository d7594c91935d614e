"""A person of 1.70 m and 70 kg, generated.

Walk: sagittal angles guided by the adult curves of Perry and Burnfield
2010 and Winter 2009 (touchdown knee 5°, 18° after loading, 62° in swing; push-off ankle -15°); jog: usual values at
2.6 m/s. Mesh, arms and trunk are modelled by hand.
"""

from __future__ import annotations

import numpy as np

from crowd.characters.gait_clips import Poser, compose, pitch, roll, spline, yaw
from crowd.characters.human_body import BALL, HEIGHT, mesh, upright
from crowd.characters.human_moves import CROUCH, moves
from crowd.characters.human_posture import LEG, SAMPLES, SIDES, Carriage, gait_poser, hang_arms, standing, walk_path
from crowd.characters.two_sided import leg
from crowd.types import Archetype, Arm, Clip, Skeleton

_MASS = 70.0  # kg


def _skeleton() -> Skeleton:
    still = upright()
    poser = Poser(still, 1)
    standing(poser, 0.004)
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
    standing(poser, 0.006 + 0.002 * breath)
    for side, sign, _ in SIDES:
        hang_arms(poser, 4.0 + 1.0 * breath, 14.0 + 1.5 * breath, side, sign)
        poser.turn(f"{side}_clavicle", roll(sign * 1.5 * breath))
    return poser.clip("idle", "idle", 5.0, None)


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


def _walk() -> Clip:
    carriage = Carriage(lean=3.0, twist=4.5, list=4.0, drop=0.0325, bob=0.0205, lowest=-0.004, surge=-0.01)
    poser = gait_poser(walk_path(1.3, 0.6), carriage)
    phase = np.arange(SAMPLES) / SAMPLES
    for side, sign, start in SIDES:
        wave = 2 * np.pi * (phase + start)
        hang_arms(poser, -3.0 - 20.0 * np.cos(wave), 20.0 - 11.0 * np.cos(wave - 0.4), side, sign)
    return poser.clip("walk", "walk", 1.0, 1.3)


def _jog() -> Clip:
    cycle = 0.74
    carriage = Carriage(lean=9.0, twist=6.0, list=4.0, drop=0.053, bob=0.026, lowest=0.235)
    poser = gait_poser(_jog_path(2.6 * cycle, 0.37), carriage)
    phase = np.arange(SAMPLES) / SAMPLES
    for side, sign, start in SIDES:
        wave = 2 * np.pi * (phase + start)
        hang_arms(poser, -8.0 - 30.0 * np.cos(wave), 88.0 - 14.0 * np.cos(wave), side, sign)
    return poser.clip("jog", "run", cycle, 2.6)


def build() -> Archetype:
    """The person."""
    skeleton = _skeleton()
    legs = tuple(leg(skeleton, side, int(sign), LEG, BALL) for side, sign, _ in SIDES)
    arms = tuple(_arm(skeleton, side, int(sign)) for side, sign, _ in SIDES)
    clips = (_idle(), _walk(), _jog(), *moves())
    pelvis = skeleton.names.index("pelvis")
    return Archetype("human", skeleton, mesh(), legs, arms, clips, pelvis, HEIGHT, _MASS, styles=(CROUCH,))


def _arm(skeleton: Skeleton, side: str, sign: int) -> Arm:
    shoulder, elbow, hand = (skeleton.names.index(f"{side}_{name}") for name in ("upper_arm", "forearm", "hand"))
    return Arm(side, shoulder, elbow, hand, sign)
