"""What the feet of an in-place locomotion clip do: stance, lift-off, speed, and the clip re-phased to leg 0's lift-off.

A foot is planted while its contact point is low (against this leg's own lowest level) and moves backward with the
ground, or rests on it while the body pauses (a stalking walk). Height alone is not enough: galloping feet swing
forward low before they land. Where the speed is known, a foot that moves exactly as the ground does counts up
to a larger height: it rolls.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from crowd.analysis.stride import feet, leg_lengths, stride_count, stride_poses
from crowd.errors import fail
from crowd.resampling import resample, resample_rotation
from crowd.types import Archetype, Clip

__all__ = ["FINE", "Gait", "analyse", "feet", "leg_lengths", "longest_run", "stances"]

FINE = 240  # samples per cycle used for detection; divisible by every stride count tried
REACH = 5  # samples to either side used for a velocity
SWING_SAMPLES = 33
SLOW = 0.7  # Froude number v^2 / (g leg); people and animals run above about 0.5, mimics of walks stay below


@dataclass(frozen=True, eq=False)
class Gait:
    """One stride of a locomotion clip. Phases are fractions of the cycle; phase 0 is leg 0's lift-off.

    Legs are in the archetype's order. Positions are in the character frame (metres, y up, +z forward).
    """

    name: str
    period: float  # s, one stride (a clip of several strides is averaged into one)
    speed: float  # m/s over the ground along `direction`; 0 for stepping on the spot
    direction: np.ndarray  # [2] unit (x, z) travel in the character frame: (0, 1) forward, (1, 0) to the left
    lift: np.ndarray  # [L] phase of lift-off, in [0, 1); lift[0] == 0
    duty: np.ndarray  # [L] share of the cycle the foot is planted, in [0.05, 0.95]; stance ends at `lift`
    rest: np.ndarray  # [L, 2] m (x, z) place of the contact point at mid-stance
    rotation: np.ndarray  # [S, J, 4] wxyz, joint to parent
    translation: np.ndarray  # [S, J, 3] m, in the parent's frame
    contact_point: np.ndarray  # [S, L, 3] m
    ankle: np.ndarray  # [S, L, 3] m
    swing_height: np.ndarray  # [33, L] m, height of the contact point over swing progress 0..1, zero at both ends
    notes: tuple[str, ...] = field(default=())  # what is unsure, for the user

    @property
    def touchdown(self) -> np.ndarray:
        """[L] phase at which each foot lands, in [0, 1)."""
        return np.mod(self.lift - self.duty, 1.0)

    @property
    def stride(self) -> float:
        """m travelled in one cycle."""
        return self.speed * self.period


def analyse(archetype: Archetype, clip: Clip, samples: int = 64) -> Gait:
    """The gait of an in-place cyclic clip.

    samples: rows S of the re-phased tables. `clip.speed` is taken where given, else the speed is the mean backward
    velocity of the planted contact points.
    Raises InputError when the archetype has no legs or no foot moves in the clip. A foot that stays still while others
    step gets duty 0.95; one that never touches down properly is planted where it is lowest; both are noted.
    """
    where = f"{archetype.source} clip '{clip.name}'"
    if not archetype.legs:
        raise fail(where, "the archetype has no legs, a gait needs at least one")
    if len(clip.rotation) < 4:
        raise fail(where, f"{len(clip.rotation)} samples, a gait needs at least 4")
    strides = stride_count(archetype, clip)
    rotation, translation = stride_poses(clip, strides, FINE)
    period = clip.duration / strides
    contact, _ = feet(archetype, rotation, translation)
    lengths = leg_lengths(archetype)
    if np.all(np.ptp(contact, axis=0).max(-1) < 0.02 * lengths):
        raise fail(where, "no foot moves by more than 2 % of its leg's length, so this is not a walk")
    planted, direction, speed, notes = stances(archetype, clip, contact, period)
    if strides > 1:
        notes.insert(0, f"clip '{clip.name}' holds {strides} strides; their mean is used")
    lift, duty = _intervals(planted)
    rest = np.stack([_middle(contact[planted[:, leg], leg][:, [0, 2]]) for leg in range(len(archetype.legs))])
    start = lift[0] * FINE
    at = start + np.arange(samples) / samples * FINE
    table_q, table_t = resample_rotation(rotation, at, True), resample(translation, at, True)
    table_contact, table_ankle = feet(archetype, table_q, table_t)
    return Gait(
        name=clip.name,
        period=period,
        speed=speed,
        direction=direction,
        lift=np.mod(lift - lift[0], 1.0),
        duty=duty,
        rest=rest,
        rotation=table_q,
        translation=table_t,
        contact_point=table_contact,
        ankle=table_ankle,
        swing_height=_swing_height(contact[..., 1], lift, duty),
        notes=tuple(notes),
    )


def stances(
    archetype: Archetype, clip: Clip, contact: np.ndarray, period: float, supported: bool = True
) -> tuple[np.ndarray, np.ndarray, float, list[str]]:
    """Planted mask [FINE, L] with one interval per leg, travel direction [2], speed in m/s, and notes.

    contact: [FINE, L, 3] m, character frame, points of the feet that rest on the ground in stance. supported: widen the
    stances of a walk until some foot is always planted; else they are what the clip shows.
    """
    lengths = leg_lengths(archetype)
    planted, direction, notes = _stances(archetype, contact, lengths, period, clip.speed)
    pace = clip.speed if clip.speed is not None else _stance_speed(contact, planted, direction, period)
    if supported and clip.role == "walk" and pace**2 < SLOW * 9.81 * lengths.mean() and _unsupported(planted, notes):
        planted = _widened(planted, contact[..., 1])
        pace = clip.speed if clip.speed is not None else _stance_speed(contact, planted, direction, period)
    return planted, direction, float(pace), notes


def _unsupported(planted: np.ndarray, notes: list[str]) -> bool:
    """Whether a walk leaves its body unsupported: a walking foot lands by its heel, before its contact point does."""
    alone = planted.any(1).mean() < 0.98
    if alone:
        notes.append("a walk whose contact points leave the body unsupported; their stances were widened")
    return bool(alone)


def _widened(planted: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Stances grown at whichever end the foot is lower until some foot is always planted."""
    out = planted.copy()
    runs = [list(longest_run(out[:, leg])) for leg in range(out.shape[1])]
    while not out.any(1).all() and out.mean(0).min() < 0.6:
        for leg, run in enumerate(runs):
            before, behind = (run[0] - 1) % FINE, (run[0] + run[1]) % FINE
            if height[before, leg] < height[behind, leg]:
                run[0], grown = before, before
            else:
                grown = behind
            run[1] += 1
            out[grown, leg] = True
    return out


def _middle(path: np.ndarray) -> np.ndarray:
    """[2] half-way between the ends of a planted foot's path; its mean would lie where a body that pauses pauses."""
    return 0.5 * (path.min(0) + path.max(0))


def _velocity(contact: np.ndarray, period: float) -> np.ndarray:
    """Periodic central difference over 4 % of the cycle, m/s: clips keyed at 24 Hz are piecewise linear."""
    return (np.roll(contact, -REACH, 0) - np.roll(contact, REACH, 0)) * FINE / (2 * REACH * period)


def _stances(
    archetype: Archetype, contact: np.ndarray, lengths: np.ndarray, period: float, speed: float | None
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Planted mask [FINE, L] with one interval per leg, travel direction [2] and notes."""
    height = contact[..., 1] - np.percentile(contact[..., 1], 2, axis=0)
    rise = np.percentile(height, 98, axis=0)
    level = np.maximum(0.15 * rise, 0.012 * lengths)
    low = height < level
    velocity = _velocity(contact, period)[..., [0, 2]]
    direction, pace = _travel(velocity, low, lengths, period)
    pace = speed if speed is not None and pace > 0 else pace
    backward = -velocity @ direction
    follows = np.linalg.norm(velocity + pace * direction, axis=-1) < 0.2 * pace
    usual = np.array([np.median(h[f]) if f.any() else 0.0 for h, f in zip(height.T, follows.T, strict=True)])
    rolls = follows & (height < np.maximum(usual + 0.25 * rise, level)) & (speed is not None)
    notes: list[str] = []
    planted = np.zeros_like(low)
    for leg, name in enumerate(leg.name for leg in archetype.legs):
        moving = (backward[:, leg] > 0.25 * pace) | _pause(height[:, leg], velocity[:, leg], level[leg], pace)
        near = height[:, leg] < 2 * level[leg]
        stands = (low[:, leg] & moving) | rolls[:, leg]
        choices = [stands, low[:, leg], moving] if pace > 0 else [low[:, leg]]
        runs = [longest_run(_closed(choice, near)) for choice in choices]
        usable = [run for run in runs if 0.05 * FINE <= run[1] <= 0.95 * FINE]
        if not usable:
            longest = max(run[1] for run in runs)
            notes.append(
                f"leg '{name}' hardly moves and is taken as planted"
                if longest > 0.5 * FINE
                else f"leg '{name}' never touches the ground for long; it is planted where it is lowest"
            )
            usable = [_around_lowest(height[:, leg], 0.95 if longest > 0.5 * FINE else 0.1)]
        elif usable[0] is not runs[0]:
            notes.append(f"leg '{name}': the foot is never both low and free of forward motion; its stance is a guess")
        start, length = usable[0]
        planted[(start + np.arange(length)) % FINE, leg] = True
    return planted, direction, notes


def _travel(velocity: np.ndarray, low: np.ndarray, lengths: np.ndarray, period: float) -> tuple[np.ndarray, float]:
    """Travel direction [2] and typical backward speed of low feet (0: stepping on the spot)."""
    mean = velocity[low].mean(0)
    pace = float(np.linalg.norm(mean))
    if pace * period < 0.05 * lengths.mean():
        return np.array([0.0, 1.0]), 0.0
    direction = -mean / pace
    axis = np.round(direction)
    # sway of the feet turns a straight walk by a few degrees; an intended diagonal is far from every axis
    if np.abs(direction).max() > np.cos(np.radians(12)):
        direction = axis
    speeds = -(velocity[low] @ direction)
    return direction, float(np.median(speeds[speeds > 0]))


def _pause(height: np.ndarray, velocity: np.ndarray, level: float, pace: float) -> np.ndarray:
    """Where a foot lies still on the ground for at least 10 % of the cycle; shorter rests are turns of the swing."""
    still = (height < level / 3) & (np.linalg.norm(velocity, axis=-1) < 0.1 * pace)
    out = np.zeros_like(still)
    while still.any():
        start, length = longest_run(still)
        if length < 0.1 * FINE:
            break
        run = (start + np.arange(length)) % FINE
        out[run], still[run] = True, False
    return out


def _closed(mask: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Gaps of up to 6 % of the cycle filled where the foot stays near the ground (a bounce, a rolling foot)."""
    if not mask.any() or mask.all():
        return mask
    out = mask.copy()
    edge = int(np.argmax(mask & ~np.roll(mask, -1)))  # last sample of some run, so that no gap wraps
    order = (edge + 1 + np.arange(FINE)) % FINE
    gap: list[int] = []
    for index in order:
        if mask[index]:
            if len(gap) <= 0.06 * FINE and near[gap].all():
                out[gap] = True
            gap = []
        else:
            gap.append(int(index))
    return out


def longest_run(mask: np.ndarray) -> tuple[int, int]:
    """(first sample, length) of the longest run of a periodic mask."""
    if mask.all():
        return 0, len(mask)
    best, start, length = (0, 0), 0, 0
    offset = int(np.argmin(mask))  # begin outside every run
    for step in range(1, len(mask) + 1):
        index = (offset + step) % len(mask)
        if mask[index]:
            start = index if length == 0 else start
            length += 1
            best = (start, length) if length > best[1] else best
        else:
            length = 0
    return best


def _around_lowest(height: np.ndarray, share: float) -> tuple[int, int]:
    length = round(share * FINE)
    window = np.convolve(np.concatenate([height, height[: length - 1]]), np.ones(length), "valid")
    return int(np.argmin(window)), length


def _intervals(planted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lift-off phase [L] (clip time) and duty [L] of masks with one run each; edges lie midway between samples."""
    runs = [longest_run(planted[:, leg]) for leg in range(planted.shape[1])]
    lift = np.array([(start + length - 0.5) / FINE for start, length in runs])
    duty = np.array([length / FINE for _, length in runs])
    return np.mod(lift, 1.0), np.clip(duty, 0.05, 0.95)


def _stance_speed(contact: np.ndarray, planted: np.ndarray, direction: np.ndarray, period: float) -> float:
    """Mean over the cycle of the ground's backward speed, told at each instant by the feet planted then.

    The ends of a stance, where the smoothed velocity knows of the swing, do not count. Averaging over time rather than
    over feet is right for bodies that surge or pause.
    """
    backward = -_velocity(contact, period)[..., [0, 2]] @ direction
    sure = np.zeros_like(planted)
    for leg in range(planted.shape[1]):
        start, length = longest_run(planted[:, leg])
        margin = min(REACH, length // 4)
        sure[(start + np.arange(margin, max(length - margin, margin + 1))) % FINE, leg] = True
    told = sure.any(1)
    speed = np.sum(backward * sure, 1)[told] / sure.sum(1)[told]
    return max(float(speed.mean()), 0.0)


def _swing_height(height: np.ndarray, lift: np.ndarray, duty: np.ndarray) -> np.ndarray:
    progress = np.linspace(0.0, 1.0, SWING_SAMPLES)
    rows = []
    for leg in range(height.shape[1]):
        curve = resample(height[:, leg], (lift[leg] + progress * (1 - duty[leg])) * FINE, True)
        rows.append(np.maximum(curve - curve[0] * (1 - progress) - curve[-1] * progress, 0.0))
    return np.stack(rows, -1)
