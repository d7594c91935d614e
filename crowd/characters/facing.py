"""Which way a character walks, from the motion of feet on the ground and from symmetry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowd.characters.description import Axis
from crowd.characters.raw_rig import RawClip
from crowd.characters.subject import Subject

AXES: dict[Axis, np.ndarray] = {
    "+x": np.array([1.0, 0, 0]),
    "-x": np.array([-1.0, 0, 0]),
    "+y": np.array([0, 1.0, 0]),
    "-y": np.array([0, -1.0, 0]),
    "+z": np.array([0, 0, 1.0]),
    "-z": np.array([0, 0, -1.0]),
}
CONTACT = 0.04  # of the height above the ground: skin this low touches it


def rotation_to(up: np.ndarray, forward: np.ndarray) -> np.ndarray:
    """Rotation matrix [3, 3] that takes `up` to +y and `forward` (made perpendicular to it) to +z."""
    up = up / np.linalg.norm(up)
    forward = forward - up * (forward @ up)
    forward = forward / np.linalg.norm(forward)
    return np.stack([np.cross(up, forward), up, forward])


def upright(up: Axis) -> np.ndarray:
    """Rotation matrix [3, 3] from a frame with the named up axis to y up, keeping +z (or else +x) horizontal."""
    axis = AXES[up]
    return rotation_to(axis, np.array([0.0, 0, 1]) if abs(axis[2]) < 0.5 else np.array([0.0, -1, 0]) * axis[2])


def without_drift(clip: RawClip) -> np.ndarray:
    """Joint positions [F, J, 3] with the steady motion of the whole body taken out."""
    body = clip.position.mean(1)
    drift = body[-1] - body[0]
    return clip.position - np.linspace(0, 1, len(body))[:, None, None] * drift


@dataclass(frozen=True)
class Facing:
    """Horizontal directions in a y-up frame."""

    forward: np.ndarray  # [3] unit
    motion: float  # 0..1: how well stance motion agrees on forward (0: no stepping found)
    asymmetry: float  # of the joints against the mirror plane, as a share of the height


def find_facing(subject: Subject, tips: list[int], prior: np.ndarray) -> Facing:
    """Forward from the motion of feet on the ground (opposite to it), squared up with the body's mirror plane.

    tips: lowest joint of every foot. prior: the format's forward, used where motion says nothing.
    """
    slides = [slide for clip in subject.raw.clips if (slide := stance_slide(subject, clip, tips)) is not None]
    strong = [s for s in slides if np.linalg.norm(s) > 0.05 * subject.height]
    line, agreement = _common_line(strong)
    normal, asymmetry = mirror_normal(subject, tips, line)
    forward = np.cross(normal, np.array([0.0, 1.0, 0.0]))
    along = np.array([np.clip(-(s @ forward) / (0.3 * subject.height), -1, 1) for s in strong if agreement > 0])
    if len(along) and abs(along.sum()) > 0.2 * np.abs(along).sum():
        sign = np.sign(along.sum())
        return Facing(forward * sign, float(abs(along.sum()) / np.abs(along).sum()), asymmetry)
    return Facing(forward * (1.0 if forward @ prior >= 0 else -1.0), 0.0, asymmetry)


def stance_slide(subject: Subject, clip: RawClip, tips: list[int]) -> np.ndarray | None:
    """Mean horizontal way [3] of the feet against the body while on the ground, per foot.

    None for falls and for clips that are not cyclic.
    """
    position = without_drift(clip)
    if np.linalg.norm(position[-1] - position[0], axis=-1).mean() > 0.06 * subject.height:
        return None
    low = subject.lowest(clip.rotation, position)
    skinned = np.flatnonzero(subject.carries)
    tall = (position[:, skinned, 1].mean(1) - low[:, skinned].min(1)) / subject.height
    rest_tall = (subject.raw.rest_position[skinned, 1].mean() - subject.ground) / subject.height
    if tall.min() < 0.7 * rest_tall:
        return None
    feet = low[:, tips]
    rise = np.ptp(feet, axis=0)
    planted = feet < np.percentile(feet, 2, axis=0) + np.maximum(0.2 * rise, 0.003 * subject.height)
    steps = np.diff(position[:, tips], axis=0)
    both = (planted[1:] & planted[:-1])[..., None]
    slide = np.sum(np.where(both, steps, 0.0), (0, 1)) / len(tips)
    return slide * np.array([1.0, 0.0, 1.0])


def _common_line(slides: list[np.ndarray]) -> tuple[np.ndarray, float]:
    """Direction [3] (sign free) along which most clips slide, and the agreement in 0..1."""
    if not slides:
        return np.zeros(3), 0.0
    angles = np.array([np.arctan2(s[2], s[0]) for s in slides])
    double = np.exp(2j * angles).mean()
    angle = np.angle(double) / 2
    return np.array([np.cos(angle), 0.0, np.sin(angle)]), float(abs(double))


def mirror_normal(subject: Subject, tips: list[int], line: np.ndarray) -> tuple[np.ndarray, float]:
    """Horizontal unit normal [3] of the plane that mirrors the rest pose best, and the asymmetry it leaves.

    line: walking direction [3] the plane should hold (zeros: unknown). The asymmetry is a share of the height.
    """
    joints = subject.raw.rest_position[subject.carries]
    center = subject.raw.rest_position[tips].mean(0)

    def asymmetry(degrees: float) -> tuple[float, np.ndarray]:
        normal = np.array([np.cos(np.radians(degrees)), 0.0, np.sin(np.radians(degrees))])
        mirrored = joints - 2.0 * ((joints - center) @ normal)[:, None] * normal
        gaps = np.linalg.norm(mirrored[:, None] - joints[None], axis=-1).min(1)
        return float(gaps.mean()) / subject.height, normal

    def cost(degrees: float) -> float:
        gap, normal = asymmetry(degrees)
        # Square axes are what rigs are drawn in: they win near ties; x first, because +z is the usual front.
        return gap + 0.3 * float(line @ normal) ** 2 + (0.01 if degrees == 90 else 0.015 if degrees else 0.0)

    best = float(min(range(0, 180, 5), key=cost))
    if best not in (0.0, 90.0):
        for step in (1.0, 0.2, 0.04):
            best = min((best + k * step for k in range(-5, 6)), key=lambda d: asymmetry(d)[0])
    gap, normal = asymmetry(best)
    return normal, gap
