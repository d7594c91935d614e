"""A dog of 0.60 m at the withers and 30 kg, generated.

Gaits: lateral-sequence walk, trot
and transverse gallop with Hildebrand's (1965) phase offsets and the duty factors usual for their speeds (dogs walk up
to about 1.2 m/s and trot to about 2.6 m/s). Digitigrade: what inverse kinematics calls ankle is the wrist and the
hock, the foot below it stands on its toes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowd.characters.dog_body import FORE, HEIGHT, HIND, PAW, SIDE, mesh, standing
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
from crowd.characters.two_sided import SIDES, leg, leg_joints
from crowd.types import Archetype, Clip, ClipRole, Skeleton

_MASS = 30.0  # kg
_SAMPLES = 60


def _leg(side: str, pair: tuple[str, ...]) -> LegJoints:
    return leg_joints(side, pair, PAW, (0.0, -0.4, -1.0 if pair is FORE else 1.0))  # elbows point back, stifles forward


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
    speed: float  # m/s, negative backwards
    cycle: float
    duty: float
    fore: _Limb
    hind: _Limb
    drop: float
    shoulder: float  # degrees the shoulder blades swing to and fro


def _own_phase(phase: np.ndarray, touchdown: float) -> np.ndarray:
    return (phase - touchdown) % 1.0


def _step(poser: Poser, gait: _Gait) -> None:
    """All four legs of a gait on their paths, shoulder blades included."""
    phase = np.arange(_SAMPLES) / _SAMPLES
    for pair, limb in ((FORE, gait.fore), (HIND, gait.hind)):
        for k, (side, sign) in enumerate(SIDES):
            own = _own_phase(phase, limb.touchdown[k])
            x, _, z = SIDE[pair[3]][1]
            if pair is FORE:
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
    for pair in (FORE, HIND):
        for side, sign in SIDES:
            x, _, z = SIDE[pair[3]][1]
            path = FootPath(0.0, z, sign * x, 1.0, lambda s: 0.0 * s, lambda p: 0.0 * p)
            step_leg(poser, _leg(side, pair), path, np.zeros(120))
    return poser.clip("idle", "idle", 4.0, None)


def _walk(skeleton: Skeleton) -> Clip:
    lift = spline((0, 0.25, 0.5, 0.8, 1), (0, 0.045, 0.055, 0.03, 0), (0.2, -0.2))
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


def _backwards(skeleton: Skeleton) -> Clip:
    """Short steps back in the walk's order of feet, with the walk's swings run through in reverse."""
    lift = spline((0, 0.3, 0.6, 1), (0, 0.035, 0.04, 0), (0.2, -0.2))
    duty = 0.66
    walk_fore = periodic((0, 0.25, 0.45, 0.65, 0.77, 0.9), (4, 12, 2, -50, -85, -25))
    walk_hind = periodic((0, 0.2, 0.45, 0.65, 0.77, 0.9), (22, 12, -4, -38, -42, 6))
    fore = _Limb((0.25, 0.75), -0.08, lift, lambda p: 4.0 + 0.6 * (walk_fore((duty - p) % 1.0) - 4.0))
    hind = _Limb((0.0, 0.5), -0.11, lift, lambda p: 0.6 * walk_hind((duty - p) % 1.0))
    gait = _Gait("walk_backwards", "step", -0.6, 0.70, duty, fore, hind, 0.022, -6.0)
    phase = np.arange(_SAMPLES) / _SAMPLES
    wave = 2 * np.pi * phase
    poser = Poser(skeleton, _SAMPLES)
    _carry(poser, -gait.drop + 0.004 * np.cos(2 * wave), 0.5 * np.sin(2 * wave), 0.0 * wave, 0.0 * wave)
    poser.turn("pelvis", compose(yaw(2.0 * np.cos(wave)), roll(2.0 * np.sin(wave))))
    poser.turn("loin", yaw(-2.0 * np.cos(wave)))
    poser.turn("back", roll(-2.0 * np.sin(wave)))
    poser.turn("head", pitch(6.0 - 1.5 * np.cos(2 * wave)))
    _wag(poser, phase, 5.0, -8.0)
    _step(poser, gait)
    return poser.clip(gait.name, gait.role, gait.cycle, -gait.speed)


def _trot(skeleton: Skeleton) -> Clip:
    lift = spline((0, 0.25, 0.5, 0.8, 1), (0, 0.075, 0.095, 0.045, 0), (0.5, -0.4))
    low = spline((0, 0.25, 0.5, 0.8, 1), (0, 0.050, 0.060, 0.032, 0), (0.35, -0.3))
    fore = _Limb(
        (0.5, 0.0), 0.265, lift, periodic((0, 0.2, 0.34, 0.45, 0.6, 0.76, 0.9), (4, 14, 0, -48, -100, -80, -18)), 0.5
    )
    hind = _Limb(
        (0.0, 0.5), 0.24, low, periodic((0, 0.18, 0.34, 0.45, 0.6, 0.8, 0.92), (20, 14, -8, -38, -48, -6, 16)), 0.6
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
    lift = spline((0, 0.15, 0.4, 0.7, 1), (0, 0.10, 0.16, 0.11, 0), (0.8, -0.6))
    low = spline((0, 0.2, 0.5, 0.8, 1), (0, 0.055, 0.065, 0.045, 0), (0.4, -0.35))
    fore = _Limb(
        (0.5, 0.6), 0.225, lift, periodic((0, 0.12, 0.2, 0.25, 0.4, 0.62, 0.85), (4, 14, -6, -45, -110, -95, -25)), 0.2
    )
    hind = _Limb(
        (0.0, 0.1), 0.31, low, periodic((0, 0.12, 0.2, 0.25, 0.4, 0.7, 0.9), (24, 14, -12, -40, -48, 4, 26)), 0.3
    )
    gait = _Gait("gallop", "run", 5.0, 0.40, 0.25, fore, hind, 0.024, 15.0)
    phase = np.arange(_SAMPLES) / _SAMPLES
    wave = 2 * np.pi * phase
    poser = Poser(skeleton, _SAMPLES)
    flex = 16.0 * np.cos(wave - 2 * np.pi * 0.95) + 3.0
    tilt = 5.0 * np.cos(wave - 2 * np.pi * 0.62)
    height = -gait.drop + 0.022 * np.cos(wave - 2 * np.pi * 0.42)
    _carry(poser, height, tilt, flex, 0.02 * np.cos(wave - 2 * np.pi * 0.95))
    poser.turn("head", pitch(6.0 - 0.3 * tilt))
    _wag(poser, phase, 3.0, 22.0 + 0.0 * phase)
    for side, sign in SIDES:
        poser.turn(f"{side}_ear", compose(pitch(-25.0), roll(-sign * 10.0)))
    _step(poser, gait)
    return poser.clip(gait.name, gait.role, gait.cycle, gait.speed)


def build() -> Archetype:
    """The dog; `height` is that of the withers."""
    skeleton = standing()
    legs = tuple(
        leg(skeleton, f"{kind}_{side}", int(sign), pair, PAW)
        for kind, pair in (("front", FORE), ("hind", HIND))
        for side, sign in SIDES
    )
    clips = (_idle(skeleton), _walk(skeleton), _trot(skeleton), _gallop(skeleton), _backwards(skeleton))
    return Archetype("dog", skeleton, mesh(skeleton), legs, (), clips, skeleton.names.index("pelvis"), HEIGHT, _MASS)
