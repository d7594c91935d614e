"""Standing made from walking, for characters whose file holds no idle clip.

Each leg stands as in the middle of its stance, side by side with its partner; trunk and arms are at the walk's mean
(a bind pose may hold the arms out); the feet stay where they are while the body breathes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crowd.analysis.gait import Gait, analyse
from crowd.errors import fail
from crowd.posing import conjugate, multiply, rotate
from crowd.types import Archetype, Clip, Leg, Skeleton

PERIOD = 4.0  # s, one breath of an adult at rest
RATE = 30.0  # Hz
BOB = 0.003  # of the leg's length, rise and fall of the body
SWAY = np.radians(0.6)  # of the chest
STRAIGHT = 0.995  # of hip to ankle along the bones: no leg is stretched beyond
TRACK = 0.7  # of the hip's distance from the middle: feet stand at least that far apart


def with_idle(archetype: Archetype) -> Archetype:
    """The archetype with a synthesised idle clip (a note says so), unchanged where it has one."""
    if any(clip.role == "idle" for clip in archetype.clips):
        return archetype
    idle = synthesise_idle(archetype)
    note = "no idle clip; standing is made from the slowest gait"
    notes = tuple(dict.fromkeys((*archetype.notes, note)))
    return replace(archetype, clips=(idle, *archetype.clips), notes=notes)


def synthesise_idle(archetype: Archetype) -> Clip:
    """A cyclic clip of standing and breathing, 4 s at 30 Hz, feet planted on y = 0.

    Raises InputError where the archetype has no walk or run to take the pose from.
    """
    moves = [clip for clip in archetype.clips if clip.role in ("walk", "run")]
    if not moves:
        raise fail(archetype.source, "has neither an idle clip nor a walk to make one from")
    gait = min((analyse(archetype, clip) for clip in moves), key=lambda g: g.speed)
    rotation, translation = _stance_pose(archetype, gait)
    count = round(PERIOD * RATE)
    breath = np.sin(2 * np.pi * np.arange(count) / count)
    rotation = np.tile(rotation, (count, 1, 1))
    translation = np.tile(translation, (count, 1, 1))
    soles, reach = _soles(archetype, gait, rotation[:1], translation[:1])
    lift = _lift(archetype, rotation[0], translation[0], soles[0], reach)
    bob = BOB * float(reach.mean()) * (breath - 1.0)  # downwards from the straightest stand
    translation = _raised(archetype, rotation, translation, lift + bob)
    chest = _chest(archetype)
    if chest is not None:
        rotation = _swayed(archetype.skeleton, rotation, translation, chest, SWAY * breath)
    for leg, target, foot in zip(archetype.legs, *soles, strict=True):
        rotation = _planted(archetype.skeleton, leg, rotation, translation, target, foot)
    return Clip("idle (made)", "idle", PERIOD, rotation, translation, cyclic=True)


def _stance_pose(archetype: Archetype, gait: Gait) -> tuple[np.ndarray, np.ndarray]:
    """Rotation [J, 4] and translation [J, 3]: every leg at its mid-stance, all else at the mean of the cycle."""
    signs = np.where(np.sum(gait.rotation * gait.rotation[:1], -1, keepdims=True) < 0, -1.0, 1.0)
    rotation = np.sum(gait.rotation * signs, 0)
    rotation = rotation / np.linalg.norm(rotation, axis=-1, keepdims=True)
    translation = gait.translation.mean(0)
    samples = len(gait.rotation)
    for index, leg in enumerate(archetype.legs):
        middle = np.mod(gait.lift[index] - 0.5 * gait.duty[index], 1.0)
        frame = round(middle * samples) % samples
        chain = _between(archetype.skeleton, leg.hip, leg.ball)
        rotation[chain], translation[chain[1:]] = gait.rotation[frame, chain], gait.translation[frame, chain[1:]]
    return rotation, translation


def _between(skeleton: Skeleton, top: int, bottom: int) -> list[int]:
    """Joints from `top` down to `bottom` (only `bottom`'s branch up to a root when `top` is not above it)."""
    chain = [bottom]
    while chain[-1] != top and skeleton.parents[chain[-1]] >= 0:
        chain.append(skeleton.parents[chain[-1]])
    return chain[::-1]


def _globals(skeleton: Skeleton, rotation: np.ndarray, translation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    q, p = rotation.copy(), translation.copy()
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            q[:, joint] = multiply(q[:, parent], rotation[:, joint])
            p[:, joint] = p[:, parent] + rotate(q[:, parent], translation[:, joint])
    return q, p


def _soles(
    archetype: Archetype, gait: Gait, rotation: np.ndarray, translation: np.ndarray
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Ankle targets [L, 3] and foot rotations [L, 4] in the character frame, and the length of hip to ankle [L]."""
    q, p = (part[0] for part in _globals(archetype.skeleton, rotation, translation))
    targets, turns, reach = [], [], []
    for index, leg in enumerate(archetype.legs):
        contact = p[leg.ball] + rotate(q[leg.ball], np.array(leg.ball_offset))
        x, z = _place(archetype, gait, index, p)
        targets.append(p[leg.ankle] + np.array([x, 0.0, z]) - contact)
        turns.append(q[leg.ankle])
        reach.append(np.linalg.norm(p[leg.knee] - p[leg.hip]) + np.linalg.norm(p[leg.ankle] - p[leg.knee]))
    return (np.array(targets), np.array(turns)), np.array(reach)


def _place(archetype: Archetype, gait: Gait, index: int, position: np.ndarray) -> tuple[float, float]:
    """Where a foot stands (x, z): beside its partner on the other side, not closer to the middle than hips allow."""
    leg = archetype.legs[index]
    x, z = (float(value) for value in gait.rest[index])
    others = [k for k, other in enumerate(archetype.legs) if other.side == -leg.side and leg.side != 0]
    if others:
        partner = min(others, key=lambda k: abs(position[archetype.legs[k].hip, 2] - position[leg.hip, 2]))
        z = 0.5 * (z + float(gait.rest[partner, 1]))
    least = TRACK * abs(float(position[leg.hip, 0]))
    return (x if leg.side * x >= least else leg.side * least) if leg.side else x, z


def _lift(
    archetype: Archetype, rotation: np.ndarray, translation: np.ndarray, targets: np.ndarray, reach: np.ndarray
) -> float:
    """How far the body is raised: to the hips' height of the rest pose, as far as every leg reaches."""
    _, now = _globals(archetype.skeleton, rotation[None], translation[None])
    skeleton = archetype.skeleton
    _, rest = _globals(skeleton, skeleton.rest_rotation[None], skeleton.rest_translation[None])
    hips = [leg.hip for leg in archetype.legs]
    wanted = max(float(np.mean(rest[0, hips, 1] - now[0, hips, 1])), 0.0)
    away = np.linalg.norm((targets - now[0, hips])[:, [0, 2]], axis=1)
    highest = targets[:, 1] + np.sqrt(np.maximum((STRAIGHT * reach) ** 2 - away**2, 0.0))
    return min(wanted, float((highest - now[0, hips, 1]).min()))


def _raised(archetype: Archetype, rotation: np.ndarray, translation: np.ndarray, lift: np.ndarray) -> np.ndarray:
    """Translations [F, J, 3] with the body moved up by `lift` [F] m through the joint that carries all legs."""
    skeleton = archetype.skeleton
    joint = archetype.pelvis
    if any(joint not in _between(skeleton, joint, leg.hip) for leg in archetype.legs):
        joint = 0
    q, _ = _globals(skeleton, rotation, translation)
    up = np.stack([0 * lift, lift, 0 * lift], -1)
    parent = skeleton.parents[joint]
    out = translation.copy()
    out[:, joint] += up if parent < 0 else rotate(conjugate(q[:, parent]), up)
    return out


def _chest(archetype: Archetype) -> int | None:
    """The lowest joint above both arms that carries no leg; None without arms."""
    if not archetype.arms:
        return None
    skeleton = archetype.skeleton
    above = [set(_between(skeleton, -1, arm.shoulder)) for arm in archetype.arms]
    legs = {joint for leg in archetype.legs for joint in _between(skeleton, -1, leg.hip)}
    shared = set.intersection(*above) - legs
    return max(shared) if shared else None


def _swayed(
    skeleton: Skeleton, rotation: np.ndarray, translation: np.ndarray, joint: int, angle: np.ndarray
) -> np.ndarray:
    """Local rotations with `joint` pitched by `angle` [F] rad about the character's x axis."""
    q, _ = _globals(skeleton, rotation, translation)
    turn = np.stack([np.cos(angle / 2), np.sin(angle / 2), 0 * angle, 0 * angle], -1)
    parent = skeleton.parents[joint]
    out = rotation.copy()
    turned = multiply(turn, q[:, joint])
    out[:, joint] = turned if parent < 0 else multiply(conjugate(q[:, parent]), turned)
    return out


def _planted(
    skeleton: Skeleton, leg: Leg, rotation: np.ndarray, translation: np.ndarray, target: np.ndarray, foot: np.ndarray
) -> np.ndarray:
    """Local rotations with the ankle at `target` [3] and the foot turned as `foot` [4]; the knee keeps its side."""
    out = rotation.copy()
    q, p = _globals(skeleton, out, translation)
    hip, knee, ankle = p[:, leg.hip], p[:, leg.knee], p[:, leg.ankle]
    upper, lower = knee - hip, ankle - knee
    a, b = (np.linalg.norm(v, axis=-1) for v in (upper, lower))
    goal = np.linalg.norm(target - hip, axis=-1)
    goal = np.clip(goal, np.abs(a - b) + 1e-6 * a, (a + b) * (1 - 1e-9))
    normal = np.cross(upper, lower)
    weak = np.linalg.norm(normal, axis=-1) < 1e-4 * a * b  # a straight leg bends as knees do, forward
    side = np.cross(np.array([0.0, 0.0, 1.0]), upper)
    normal = np.where(weak[:, None], -side, normal)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    bend = np.arccos(np.clip(np.sum(upper * lower, -1) / np.maximum(a * b, 1e-12), -1, 1))
    wanted = np.pi - np.arccos(np.clip((a**2 + b**2 - goal**2) / np.maximum(2 * a * b, 1e-12), -1, 1))
    out[:, leg.knee] = _turned(skeleton, q, leg.knee, _about(normal, wanted - bend))
    q, p = _globals(skeleton, out, translation)
    out[:, leg.hip] = _turned(skeleton, q, leg.hip, _onto(p[:, leg.ankle] - hip, target - hip))
    q, _ = _globals(skeleton, out, translation)
    parent = skeleton.parents[leg.ankle]
    out[:, leg.ankle] = multiply(conjugate(q[:, parent]), np.broadcast_to(foot, q[:, parent].shape))
    return out


def _turned(skeleton: Skeleton, q: np.ndarray, joint: int, turn: np.ndarray) -> np.ndarray:
    """Local rotation [F, 4] of `joint` after `turn` [F, 4] in the character frame; q: global rotations."""
    turned = multiply(turn, q[:, joint])
    parent = skeleton.parents[joint]
    return turned if parent < 0 else multiply(conjugate(q[:, parent]), turned)


def _about(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    return np.concatenate([np.cos(angle / 2)[:, None], axis * np.sin(angle / 2)[:, None]], -1)


def _onto(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Shortest rotation [F, 4] that takes the direction of a to that of b; the identity for opposite ones."""
    a = a / np.maximum(np.linalg.norm(a, axis=-1, keepdims=True), 1e-12)
    b = b / np.maximum(np.linalg.norm(b, axis=-1, keepdims=True), 1e-12)
    q = np.concatenate([1 + np.sum(a * b, -1, keepdims=True), np.cross(a, b)], -1)
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(norm > 1e-9, q / np.maximum(norm, 1e-12), np.array([1.0, 0, 0, 0]))
