"""Clips of a rig as an archetype holds them: in place, uniformly sampled, joint to parent, on the ground."""

from __future__ import annotations

import numpy as np

from crowd.characters.detect import Detection
from crowd.characters.frame import Frame, global_motion, local_motion
from crowd.characters.raw_rig import RawClip
from crowd.characters.travel import TRAVELS
from crowd.posing import rotate
from crowd.resampling import align_hemispheres, resample, resample_rotation
from crowd.types import Clip, Leg, Style

CLOSED = 0.05  # of the height: ends of a clip this near make it cyclic
MIN_RATE_HZ, MAX_RATE_HZ, MIN_SAMPLES = 30.0, 60.0, 16


def clips_of(
    found: Detection,
    frame: Frame,
    order: list[int],
    parents: tuple[int, ...],
    legs: tuple[Leg, ...],
    styles: tuple[Style, ...],
) -> tuple[Clip, ...]:
    """All clips of the file: idle, walks, runs, steps by speed, then the others in the file's order."""
    ranks = {"idle": 0, "walk": 1, "run": 2, "step": 3, "other": 4}
    pairs = list(zip(found.subject.raw.clips, found.clips, strict=True))
    pairs.sort(key=lambda pair: (ranks[pair[1].role], pair[1].speed if pair[1].role != "other" else 0.0))
    in_style = {name: role for style in styles for name, role in style.clips}
    out, home = [], None
    for clip, report in pairs:
        part = report.role if report.role != "other" else in_style.get(clip.name, "other")
        cyclic = part != "other" or report.closed <= CLOSED
        rotation, position = _uniform(clip) if cyclic else _once(clip)
        q, p = global_motion(frame, order, rotation, position)
        if part != "other":
            shift = _shift(p, q, legs, part != "idle")
            home = shift if home is None else home
        else:
            p = p if cyclic else _without_travel(p, legs)
            shift = _near_home(p, home, legs, found.subject.height * found.metres)
        p = p - shift
        if parents.count(-1) == 1 and order[0] < 0:
            p[:, 0] = 0.0  # an added root stays at the origin
        local_q, local_t = local_motion(q, p, parents)
        speed = None if clip.speed is None else float(clip.speed * found.metres)
        out.append(Clip(clip.name, report.role, clip.duration, align_hemispheres(local_q), local_t, cyclic, speed))
    return tuple(out)


def _rate(clip: RawClip) -> int:
    """Samples of the duration, 30 to 60 per second."""
    rate = (len(clip.position) - 1) / clip.duration
    return max(MIN_SAMPLES, round(clip.duration * float(np.clip(rate, MIN_RATE_HZ, MAX_RATE_HZ))))


def _uniform(clip: RawClip) -> tuple[np.ndarray, np.ndarray]:
    """Global rotation and position of F samples at f / F of the duration, of a cycle."""
    intervals, wanted = len(clip.position) - 1, _rate(clip)
    # Steady drift is spread over the cycle, so that the sample after the last is the first.
    drift = (clip.position[-1] - clip.position[0]).mean(0) * np.array([1.0, 0.0, 1.0])
    position = clip.position - np.linspace(0, 1, intervals + 1)[:, None, None] * drift
    rotation = align_hemispheres(clip.rotation)
    if wanted == intervals:
        return rotation[:-1], position[:-1]
    at = np.arange(wanted) * (intervals / wanted)
    return resample_rotation(rotation, at, cyclic=False), resample(position, at, cyclic=False)


def _once(clip: RawClip) -> tuple[np.ndarray, np.ndarray]:
    """Global rotation and position of F samples at f / (F - 1) of the duration, of a motion that ends elsewhere."""
    intervals, wanted = len(clip.position) - 1, _rate(clip)
    if wanted == intervals:
        return align_hemispheres(clip.rotation), clip.position
    at = np.linspace(0.0, intervals, wanted + 1)
    rotation = align_hemispheres(clip.rotation)
    return resample_rotation(rotation, at, cyclic=False), resample(clip.position, at, cyclic=False)


def _without_travel(position: np.ndarray, legs: tuple[Leg, ...]) -> np.ndarray:
    """Positions [F, J, 3] with the way of the feet from the first sample to the last taken out steadily."""
    feet = position[:, [leg.ball for leg in legs]].mean(1)
    way = (feet[-1] - feet[0]) * np.array([1.0, 0.0, 1.0])
    return position - np.linspace(0, 1, len(position))[:, None, None] * way


def _shift(position: np.ndarray, rotation: np.ndarray, legs: tuple[Leg, ...], lowest: bool) -> np.ndarray:
    """Offset [3] of the point on the ground under the hips' mean place in a clip [F, J, 3].

    lowest: the lowest contact of the clip is at y = 0 (gaits); otherwise the typical lowest one (standing).
    """
    hips = position[:, [leg.hip for leg in legs]].mean((0, 1))
    contacts = [position[:, leg.ball] + rotate(rotation[:, leg.ball], np.asarray(leg.ball_offset)) for leg in legs]
    heights = np.stack(contacts)[..., 1]
    return np.array([hips[0], heights.min() if lowest else np.median(heights.min(0)), hips[2]])


def _near_home(position: np.ndarray, home: np.ndarray | None, legs: tuple[Leg, ...], height: float) -> np.ndarray:
    """Offset [3] of a clip that is no gait: that of the idle clip (else the slowest gait), whose ground it shares.

    A clip made elsewhere (its hips start farther than TRAVELS from there) begins with the hips over the origin.
    """
    first = position[0, [leg.hip for leg in legs]].mean(0)
    home = np.zeros(3) if home is None else home
    if np.linalg.norm((first - home)[[0, 2]]) < TRAVELS * height:
        return home
    return np.array([first[0], home[1], first[2]])
