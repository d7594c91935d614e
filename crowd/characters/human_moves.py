"""What the generated person can do beside idling, walking and jogging: steps, a crouch, a jump, a wave.

Steps and the crouched walk have the same ideal stances as the walk; their angles are modelled by hand.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crowd.characters.gait_clips import Curve, FootPath, Poser, compose, pitch, roll, smoothstep, spline, step_leg, yaw
from crowd.characters.human_body import upright
from crowd.characters.human_posture import (
    FOOT_X,
    SAMPLES,
    SIDES,
    Carriage,
    gait_poser,
    hang_arms,
    leg_of,
    standing,
    walk_path,
)
from crowd.types import Clip, Style

CROUCH = Style("crouch", (("crouch_idle", "idle"), ("crouch_walk", "walk")))
GRAVITY = 9.81  # m/s2


def moves() -> tuple[Clip, ...]:
    """Steps first, then clips of no role in style normal."""
    steps = (_backwards(), _sideways("side_left", 90.0), _sideways("side_right", -90.0))
    return (*steps, _crouch_idle(), _crouch_walk(), _jump(), _wave())


def _phase() -> np.ndarray:
    return np.arange(SAMPLES) / SAMPLES


def _backwards() -> Clip:
    """The walk's foot paths run through in reverse, with shorter and flatter strides: toes land first."""
    speed, cycle, duty = 0.9, 1.0, 0.62
    ahead = walk_path(1.3, duty)
    forward_lift, forward_pitch = ahead["lift"], ahead["pitch"]

    def angle(phase: np.ndarray) -> np.ndarray:
        return 0.5 * forward_pitch((duty - np.asarray(phase, float)) % 1.0)

    paths = {
        "stride": -speed * cycle,
        "front": 0.06 - 0.5 * speed * cycle * duty,
        "duty": duty,
        "lift": lambda s: 0.6 * forward_lift(1.0 - s),
        "pitch": angle,
    }
    poser = gait_poser(paths, Carriage(lean=-1.0, twist=-2.5, list=3.0, drop=0.032, bob=0.012, lowest=-0.004))
    for side, sign, start in SIDES:
        wave = 2 * np.pi * (_phase() + start)
        hang_arms(poser, 2.0 + 11.0 * np.cos(wave), 22.0 + 6.0 * np.cos(wave), side, sign)
    return poser.clip("walk_backwards", "step", cycle, speed)


def _sideways(name: str, toward: float) -> Clip:
    """Quick short steps: the trailing foot closes up to the leading one without passing it."""
    speed, cycle, duty = 0.7, 0.7, 0.6
    stride = speed * cycle
    lift = spline((0, 0.3, 0.6, 1), (0, 0.045, 0.04, 0), (0.25, -0.2))
    paths = {
        "stride": stride,
        "front": 0.5 * stride * duty,
        "duty": duty,
        "lift": lift,
        "pitch": _toes_hang(duty, 9.0),
        "toward": toward,
        "ahead": 0.105,
    }
    carriage = Carriage(lean=5.0, twist=0.0, list=1.5, drop=0.075, bob=0.008, lowest=0.05, back=0.02)
    poser = gait_poser(paths, carriage, half_width=0.25 * stride + 0.06)
    for side, sign, start in SIDES:
        wave = 2 * np.pi * (_phase() + start)
        hang_arms(poser, 10.0 + 3.0 * np.cos(wave), 38.0 + 4.0 * np.sin(wave), side, 1.6 * sign)
    return poser.clip(name, "step", cycle, speed)


def _toes_hang(duty: float, degrees: float) -> Curve:
    """Pitch of a foot that lies flat on the ground and lets its toes hang in mid-swing."""
    swing = spline((0, 0.5, 1), (0, -degrees, 0))
    return lambda phase: np.where(np.asarray(phase) <= duty, 0.0, swing((np.asarray(phase) - duty) / (1.0 - duty)))


def _crouch_walk() -> Clip:
    speed, cycle, duty = 0.8, 1.0, 0.64
    upright_path = walk_path(1.3, duty)
    paths = {
        "stride": speed * cycle,
        "front": 0.5 * speed * cycle * duty + 0.07,
        "duty": duty,
        "lift": lambda s: 0.9 * upright_path["lift"](s),
        "pitch": lambda p: 0.6 * upright_path["pitch"](p),
    }
    carriage = Carriage(lean=34.0, twist=3.0, list=2.0, drop=0.21, bob=0.010, lowest=-0.004, back=0.07)
    poser = gait_poser(paths, carriage, half_width=1.2 * FOOT_X)
    for side, sign, start in SIDES:
        wave = 2 * np.pi * (_phase() + start)
        _arms_forward(poser, 6.0 * np.cos(wave), side, sign)
    return poser.clip("crouch_walk", "other", cycle, speed)


def _arms_forward(poser: Poser, swing: np.ndarray, side: str, sign: float) -> None:
    """Arms held out before a trunk that leans forward; swing: degrees backward."""
    hang_arms(poser, 62.0 - swing, 58.0 - 0.5 * swing, side, sign)
    poser.turn(f"{side}_hand", pitch(20.0))


def _crouch_idle() -> Clip:
    samples = 120
    poser = Poser(upright(), samples)
    phase = np.arange(samples) / samples
    breath, sway = np.sin(4 * np.pi * phase), np.sin(2 * np.pi * phase)
    lean = 34.0
    poser.move("pelvis", np.stack([0.010 * sway, 0.0 * sway, 0.0 * sway - 0.07], -1))
    poser.turn("pelvis", pitch(0.35 * lean))
    poser.turn("lumbar", pitch(0.3 * lean))
    poser.turn("spine", pitch(0.2 * lean + 0.6 * breath))
    poser.turn("chest", pitch(0.15 * lean - 1.0 * breath))
    poser.turn("neck", pitch(-0.3 * lean))
    poser.turn_world("head", compose(yaw(6.0 * sway), pitch(0.1 * lean)))
    standing(poser, 0.205 + 0.004 * breath)
    for side, sign, _ in SIDES:
        _arms_forward(poser, 1.5 * breath, side, sign)
    return poser.clip("crouch_idle", "other", 4.0, None)


def _once(poser: Poser, name: str, duration: float) -> Clip:
    """A clip that is played once; its samples include both ends."""
    return replace(poser.clip(name, "other", duration, None), cyclic=False)


def _jump() -> Clip:
    """Down, up, and down again on the same spot; both feet in the air for a quarter of a second."""
    duration, samples, off, land = 0.8, 49, 0.32, 0.57  # s
    time = np.linspace(0.0, duration, samples)
    rise = GRAVITY * (land - off) / 2.0  # m/s at take-off
    up, flight = np.clip(time, None, off), np.clip(time - off, 0.0, land - off)
    down = np.clip(time - land, 0.0, None)
    tall, low = 0.035, -0.19  # m, the pelvis at take-off and landing, and at its lowest, against standing
    bend = spline((0, 0.17, off), (0.0, low, tall), (0.0, rise))
    give = spline((0, 0.09, duration - land), (tall, -0.13, 0.0), (-rise, 0.0))
    air = rise * flight - 0.5 * GRAVITY * flight**2
    height = np.where(time < off, bend(up), np.where(time < land, tall + air, give(down)))
    deep = np.clip(height / low, 0.0, 1.0)  # 1 in the deepest crouch
    poser = Poser(upright(), samples)
    poser.move("pelvis", np.stack([0 * time, 0 * time, -0.35 * np.maximum(-height, 0.0)], -1))
    _bowed(poser, 48.0 * deep)
    standing(poser, -height + 0.004)
    heel = spline((0, 0.2, off, 0.5 * (off + land), land, land + 0.1, duration), (0, 0, -48, -40, -26, 0, 0))
    _both_feet(poser, np.clip(heel(time), -60.0, 0.0), air)
    throw = spline((0, 0.17, off + 0.04, land, duration), (4, -38, 75, 45, 4))
    for side, sign, _ in SIDES:
        hang_arms(poser, throw(time), 14.0 + 30.0 * deep + 0.25 * np.maximum(throw(time), 0.0), side, sign)
    return _once(poser, "jump", duration)


def _bowed(poser: Poser, lean: np.ndarray) -> None:
    """Trunk bent forward by lean [F] degrees, the face ahead."""
    for joint, share in (("pelvis", 0.4), ("lumbar", 0.3), ("spine", 0.2), ("chest", 0.1), ("neck", -0.35)):
        poser.turn(joint, pitch(share * lean))
    poser.turn_world("head", pitch(0.2 * lean))


class _Springing(FootPath):
    """A foot on one spot whose height and pitch over the clip are given."""

    def contact(self, phase: np.ndarray) -> np.ndarray:
        place = super().contact(phase)
        place[:, 1] = self.lift(phase)
        return place

    def toe_bend(self, phase: np.ndarray) -> np.ndarray:
        flat = 1.0 - 0.75 * smoothstep(self.lift(phase) / 0.06)  # toes lie on the ground, and follow the foot above it
        return -flat * self.pitch(phase)


def _both_feet(poser: Poser, heel: np.ndarray, height: np.ndarray) -> None:
    """Feet side by side at heights [F] m above the ground and pitches `heel` [F], degrees."""
    phase = np.arange(poser.samples) / poser.samples
    for side, sign, _ in SIDES:
        path = _Springing(
            0.0, 0.105, sign * FOOT_X, 1.0, lambda p: np.interp(p, phase, height), lambda p: np.interp(p, phase, heel)
        )
        step_leg(poser, leg_of(side, sign), path, phase, sign * 6.0)


def _wave() -> Clip:
    """The right hand raised and waved three times, standing."""
    duration, samples = 2.2, 111
    time = np.linspace(0.0, duration, samples)
    up = smoothstep(time / 0.5) * smoothstep((duration - time) / 0.5)
    swing = np.sin(2 * np.pi * 1.9 * (time - 0.4))
    poser = Poser(upright(), samples)
    poser.turn("chest", roll(2.0 * up))
    poser.turn("head", compose(yaw(-4.0 * up), roll(-3.0 * up)))
    standing(poser, np.full(samples, 0.006))
    for side, sign, _ in SIDES:
        hang_arms(poser, 4.0, 14.0, side, sign)
    side, sign = "right", -1.0
    raised = compose(pitch(-4.0 - 30.0 * up), roll(sign * (9.0 + 86.0 * up)), yaw(-sign * 12.0 * (1.0 - up)))
    poser.turn(f"{side}_clavicle", roll(sign * 9.0 * up))
    poser.turn(f"{side}_upper_arm", raised)
    poser.turn(f"{side}_forearm", compose(pitch(-14.0 * (1.0 - up)), roll(sign * (-5.0 + up * (82.0 + 24.0 * swing)))))
    poser.turn(f"{side}_hand", compose(pitch(-6.0), roll(sign * up * 14.0 * swing)))
    return _once(poser, "wave", duration)
