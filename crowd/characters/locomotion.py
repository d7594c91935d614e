"""What the clips of a rig are: walk, run, step (not forward), idle or something else.

Judged by what the feet do, not by their names.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from crowd.characters.facing import without_drift
from crowd.characters.limbs import FootJoints
from crowd.characters.raw_rig import RawClip
from crowd.characters.subject import Subject
from crowd.posing import conjugate, rotate
from crowd.resampling import resample
from crowd.types import ClipRole

FINE = 240  # samples per clip used to judge it
_STILL = 0.06  # of the leg: feet that move less are planted
_STRIDE = 0.45  # of the leg: a shorter stride is shuffling
_SIDE_STRIDE = 0.3  # the same for strides that do not go forward
_NOT_FORWARD = ("backwards", "sideways", "sideways steps")


@dataclass(frozen=True)
class ClipReport:
    """Measures of one clip; lengths in file units, `speed` positive along `direction` (forward but for steps)."""

    name: str
    role: ClipRole
    why: str
    duration: float
    speed: float
    sideways: float
    duty: tuple[float, ...]
    touchdown: tuple[float, ...]  # phase 0..1 of each foot's first touchdown
    strides: int
    closed: float  # mean joint distance between both ends, against the height
    bounce: float  # vertical range of the body, against the leg
    clearance: float  # greatest height of the lowest foot, against the leg
    flight: float  # share of the cycle with no foot near the ground
    froude: float  # speed squared over gravity and leg
    unrest: float  # mean joint motion range, against the height
    pace: float  # typical way of a planted foot per cycle, against the leg; positive against `direction`
    direction: tuple[float, float] = (0.0, 1.0)  # unit (x, z)


def contact_tracks(
    subject: Subject, clip: RawClip, feet: Sequence[FootJoints], samples: int = FINE + 1
) -> tuple[np.ndarray, np.ndarray]:
    """Contact points [S, L, 3] and height of the lowest skin of each foot [S, L], drift of the body taken out."""
    raw = subject.raw
    joints = [foot.ball for foot in feet]
    points = np.stack([foot.contact for foot in feet])
    local = rotate(conjugate(raw.rest_rotation[joints]), points - raw.rest_position[joints])
    position = without_drift(clip)
    point = position[:, joints] + rotate(clip.rotation[:, joints], local)
    low = subject.lowest(clip.rotation, position)
    sole = np.minimum(np.stack([low[:, list(foot.sole)].min(1) for foot in feet], 1), point[..., 1])
    at = np.linspace(0, len(position) - 1, samples)
    return resample(point, at, cyclic=False), resample(sole, at, cyclic=False)


def assess(
    subject: Subject, clip: RawClip, feet: Sequence[FootJoints], leg: float, pelvis: int, metres: float
) -> ClipReport:
    """Role and measures of a clip in a y-up, +z-forward frame.

    leg: length of the legs, file units. metres: metres per unit, for the Froude number.
    """
    foot, sole = contact_tracks(subject, clip, feet)
    measured, per_foot = _measured(subject, clip, foot, sole, leg, pelvis, metres)
    role, why = _role(subject, clip, foot, measured, per_foot, leg)
    if why in _NOT_FORWARD:
        toward = _travel(foot[:-1], leg)
        turned = _turned(foot, toward)
        ahead, per_foot = _measured(subject, clip, turned, sole, leg, pelvis, metres)
        doubt = _doubt(turned, ahead, per_foot, leg, _SIDE_STRIDE)
        if doubt is None:
            measured = replace(ahead, speed=abs(ahead.speed), sideways=0.0, direction=toward)
            role, why = "step", f"feet on the ground {np.median(ahead.duty):.0%} of the time"
        else:
            why = f"{why}, but {doubt}"
    return replace(measured, role=role, why=why)


def _measured(
    subject: Subject, clip: RawClip, foot: np.ndarray, sole: np.ndarray, leg: float, pelvis: int, metres: float
) -> tuple[ClipReport, list[float]]:
    """Measures with +z taken as the way ahead, without a role, and the speed of each foot's ground."""
    position = without_drift(clip)
    planted, pace = planted_samples(foot[:-1], leg)
    velocity = _velocity(foot[:-1]) / clip.duration
    legs = range(foot.shape[1])
    per_foot = [-float(velocity[planted[:, k], k, 2].mean()) if planted[:, k].any() else 0.0 for k in legs]
    sideways = [-float(velocity[planted[:, k], k, 0].mean()) if planted[:, k].any() else 0.0 for k in legs]
    touch = [np.flatnonzero(planted[:, k] & ~np.roll(planted[:, k], 1)) for k in legs]
    speed = float(np.mean(per_foot))
    if clip.speed is not None:
        speed = clip.speed if speed >= 0.0 else -clip.speed
    low = sole[:-1] < np.percentile(sole, 2, axis=0) + 0.05 * leg
    report = ClipReport(
        name=clip.name,
        role="other",
        why="",
        duration=clip.duration,
        speed=speed,
        sideways=float(np.mean(sideways)),
        duty=tuple(float(d) for d in planted.mean(0)),
        touchdown=tuple(float(t[0] / FINE) if len(t) else float("nan") for t in touch),
        strides=int(np.median([max(1, len(t)) for t in touch])),
        closed=float(np.linalg.norm(position[-1] - position[0], axis=-1).mean()) / subject.height,
        bounce=float(np.ptp(position[:, pelvis, 1])) / leg,
        clearance=float(np.max(sole.min(1) - np.percentile(sole.min(1), 10))) / leg,
        flight=float(1.0 - low.any(1).mean()),
        froude=(speed * metres) ** 2 / (9.81 * leg * metres),
        unrest=float(np.linalg.norm(np.ptp(position, axis=0), axis=-1).mean()) / subject.height,
        pace=pace / leg,
    )
    return report, per_foot


def _travel(foot: np.ndarray, leg: float) -> tuple[float, float]:
    """Unit (x, z) against the mean motion of low contact points [S, L, 3] of a cycle; forward where they rest."""
    height = foot[..., 1] - np.percentile(foot[..., 1], 2, axis=0)
    low = height < np.maximum(0.15 * np.percentile(height, 98, axis=0), 0.012 * leg)
    way = -_velocity(foot)[low][:, [0, 2]].mean(0)
    toward = way / np.linalg.norm(way) if np.linalg.norm(way) > 0.05 * leg else np.array([0.0, 1.0])
    planted, _ = planted_samples(_turned(foot, (float(toward[0]), float(toward[1]))), leg)
    if planted.any():
        way = -_velocity(foot)[planted][:, [0, 2]].mean(0)
        toward = way / np.linalg.norm(way) if np.linalg.norm(way) > 0.05 * leg else toward
    return float(toward[0]), float(toward[1])


def along_its_way(report: ClipReport) -> ClipReport:
    """The report with its speed told along the way its feet go, whatever that is."""
    way = np.array([report.sideways, report.speed])
    speed = float(np.linalg.norm(way))
    x, z = way / speed if speed > 1e-9 else (0.0, 1.0)
    return replace(report, speed=speed, sideways=0.0, direction=(float(x), float(z)))


def _turned(foot: np.ndarray, toward: tuple[float, float]) -> np.ndarray:
    """Points [..., 3] turned about y so that the horizontal unit direction (x, z) comes to +z."""
    x, z = toward
    return np.stack([foot[..., 0] * z - foot[..., 2] * x, foot[..., 1], foot[..., 0] * x + foot[..., 2] * z], -1)


def _velocity(foot: np.ndarray) -> np.ndarray:
    """Periodic central difference over 4 % of the cycle, per cycle: keyed motion is piecewise linear."""
    reach = round(0.02 * len(foot))
    return (np.roll(foot, -reach, 0) - np.roll(foot, reach, 0)) * len(foot) / (2 * reach)


def planted_samples(foot: np.ndarray, leg: float) -> tuple[np.ndarray, float]:
    """Samples in which each contact point [S, L, 3] of a cycle is on the ground [S, L], and the pace per cycle.

    Low against its own lowest level and going backwards with the ground, or lying still there: galloping feet come
    forward low before they land, stalking bodies pause.
    """
    height = foot[..., 1] - np.percentile(foot[..., 1], 2, axis=0)
    level = np.maximum(0.15 * np.percentile(height, 98, axis=0), 0.012 * leg)
    low = height < level
    velocity = _velocity(foot)
    backward = -velocity[..., 2]
    going = backward[low & (np.abs(backward) > 0.05 * leg)]
    pace = float(np.median(going)) if len(going) else 0.0
    if abs(pace) < 0.05 * leg:
        return low, pace
    still = (height < level / 3) & (np.linalg.norm(velocity[..., [0, 2]], axis=-1) < 0.1 * abs(pace))
    planted = low & ((backward * np.sign(pace) > 0.25 * abs(pace)) | still)
    near = height < 2 * level
    return np.stack([_gaps_closed(planted[:, k], near[:, k]) for k in range(foot.shape[1])], 1), pace


def _gaps_closed(mask: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Gaps of up to 6 % of the cycle filled where the foot stays near the ground, islands of less than 4 % dropped."""
    for value, share in ((True, 0.06), (False, 0.04)):
        if mask.all() or not mask.any():
            return mask
        out = mask.copy()
        shift = int(np.argmax(mask & ~np.roll(mask, 1)) if value else np.argmax(~mask & np.roll(mask, 1)))
        rolled, close = np.roll(mask, -shift), np.roll(near, -shift)
        edges = np.flatnonzero(np.diff(np.concatenate([[value], rolled, [value]]).astype(int)))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            run = np.arange(start, stop)
            if len(run) <= share * len(mask) and (close[run].all() or not value):
                out[(run + shift) % len(mask)] = value
        mask = out
    return mask


def _role(
    subject: Subject, clip: RawClip, foot: np.ndarray, report: ClipReport, per_foot: list[float], leg: float
) -> tuple[ClipRole, str]:
    rest_body = subject.raw.rest_position[subject.carries, 1].mean() - subject.ground
    tall = (clip.position[:, subject.carries, 1].mean(1) - foot[..., 1].min()) / max(rest_body, 1e-12)
    if tall.min() < 0.6:
        return "other", "the body goes down"
    stray = np.linalg.norm(foot - np.median(foot, axis=0), axis=-1) > _STILL * leg
    if np.all(stray.mean(0) < 0.3):
        if report.closed > 0.04:
            return "other", "the feet stand but the ends of the clip differ"
        if report.bounce > 0.3 or report.clearance > 0.05:
            return "other", "both a stand and a leap"
        return "idle", "the feet stand"
    if report.closed > 0.05:
        return "other", "not cyclic: its ends differ"
    return _gait(foot, report, per_foot, leg)


def _gait(foot: np.ndarray, report: ClipReport, per_foot: list[float], leg: float) -> tuple[ClipRole, str]:
    reach = np.ptp(foot, axis=0)  # [L, 3]
    lifts = reach[:, 1] > 0.015 * leg
    if np.mean(lifts & (reach[:, 2] > 0.15 * leg)) < 0.7:
        sideways = np.mean(lifts & (np.hypot(reach[:, 0], reach[:, 2]) > 0.15 * leg)) >= 0.7
        return "other", "sideways steps" if sideways else "not all feet step"
    if report.speed < 0.0 or abs(report.sideways) > 0.6 * report.speed:
        return "other", "backwards" if report.speed < -abs(report.sideways) else "sideways"
    doubt = _doubt(foot, report, per_foot, leg, _STRIDE)
    return _pace(report) if doubt is None else ("other", doubt)


def _doubt(foot: np.ndarray, report: ClipReport, per_foot: list[float], leg: float, stride: float) -> str | None:
    """Why feet that go along +z do not walk, if so; stride: of the leg, the least."""
    reach = np.ptp(foot, axis=0)
    if np.mean((reach[:, 1] > 0.015 * leg) & (reach[:, 2] > 0.15 * leg)) < 0.7:
        return "not all feet step"
    if report.pace / report.strides < stride:
        return "steps on the spot"
    stepping = np.array(per_foot)[np.array(report.duty) > 0]
    if min(report.duty) < 0.04 or max(report.duty) > 4.0 * min(report.duty):
        return "the feet take uneven turns on the ground"
    if stepping.min() < 0.3 * stepping.max():
        return "the feet do not move together with the ground"
    if len(report.duty) == 2 and report.strides == 1 and _together(report.touchdown):
        return "both feet land together: a jump"
    if report.clearance > (0.4 if len(report.duty) > 2 else 1.0):
        return "the body leaps"
    return None


def _pace(report: ClipReport) -> tuple[ClipRole, str]:
    """Walk or run, by time on the ground, flight and Froude number; near the border the name decides."""
    duty = float(np.median(report.duty))
    walking = (duty - 0.42) / 0.15 - 1.5 * np.log2(max(report.froude, 1e-3) / 0.6) - report.flight / 0.3
    why = f"feet on the ground {duty:.0%} of the time, Froude number {report.froude:.2f}"
    if abs(walking) < 1.5:
        for role in ("walk", "run"):
            if named_like(report.name, role) and not named_like(report.name, "run" if role == "walk" else "walk"):
                return role, f"{why}; between walk and run, its name decides"
    return ("walk" if walking > 0 else "run"), why


def _together(touchdown: tuple[float, ...]) -> bool:
    lag = abs(touchdown[0] - touchdown[1]) % 1.0
    return min(lag, 1.0 - lag) < 0.12


_WORDS = {"idle": r"idle|stand|rest", "walk": r"walk", "run": r"run|jog|trot|gallop|canter|sprint"}


def named_like(name: str, role: str) -> bool:
    """Whether a clip's name suggests a role; only ever breaks ties."""
    return role in _WORDS and re.search(_WORDS[role], name, re.IGNORECASE) is not None


def with_a_walk(reports: list[ClipReport]) -> list[ClipReport]:
    """Roles made relative: of several runs at clearly different speeds the slowest is the walk of this body."""
    gaits = [r for r in reports if r.role in ("walk", "run")]
    if not gaits or any(r.role == "walk" for r in gaits):
        return reports
    slowest, fastest = min(gaits, key=lambda r: r.speed), max(gaits, key=lambda r: r.speed)
    if fastest.speed < 1.4 * slowest.speed:
        return reports
    walk = replace(slowest, role="walk", why=f"{slowest.why}; taken as the walk because it is the slowest gait")
    return [walk if r is slowest else r for r in reports]


def best_idle(reports: list[ClipReport]) -> ClipReport | None:
    """The quietest cyclic clip on planted feet that still breathes; a telling name wins over small differences."""
    idle = [r for r in reports if r.role == "idle"]
    if not idle:
        return None
    return min(idle, key=lambda r: r.unrest + (0.0 if named_like(r.name, "idle") else 0.15) + 0.001 * len(r.name))
