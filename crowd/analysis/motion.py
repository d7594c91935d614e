"""The motion that one clip of a character makes: key times, foot flight and speed, with its poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from crowd import posing
from crowd.analysis import planting
from crowd.analysis.clip_checks import check_clip, check_heights
from crowd.analysis.flight import flight_table, lookup, phase_time
from crowd.analysis.foot import Foot, feet_of
from crowd.analysis.gait import FINE
from crowd.analysis.samples import (
    EDGE,
    KEYTIMES,
    SAMPLES,
    LegAnalysis,
    MotionAnalysis,
    analyse_samples,
    hat,
)
from crowd.analysis.stride import stride_count, stride_poses, transforms
from crowd.resampling import resample, resample_rotation
from crowd.types import Archetype, Clip

Kind = Literal["walk", "grounded"]
GROUND = 0.0  # m: contacts of an archetype's clips lie at y = 0


@dataclass(frozen=True, eq=False)
class Motion:
    """A clip as the semi-procedural system plays it. Arrays over legs are in the archetype's order.

    The clock of a walk motion is common to all motions of a set: at clock p it shows its clip at phase
    p - cycle_offset, a backwards twin at 1 - (p - cycle_offset). Leg-cycle time is clock - stance_time (mod 1). A
    grounded motion plays on a clock of its own.
    """

    name: str
    kind: Kind
    duration: float  # s, one cycle
    distance: float  # m per cycle (D); 0 for grounded motions
    direction: np.ndarray  # [3] unit, horizontal, character frame; compat: mean of the legs', hardly shorter than 1
    velocity: np.ndarray  # [3] m/s, character frame; a twin's is the negative
    cycle_offset: float  # cycles, added to the clip's phases by alignment
    stance_time: np.ndarray  # [L] on the common clock, [0, 1]; 1 is 0 again
    keytimes: np.ndarray  # [L, 6] lift, liftoff, postlift, preland, strike, land, in leg-cycle time
    stance_position: np.ndarray  # [L, 3] m, footbase at the stance time of a body that travels evenly, y = 0
    foot_vector: np.ndarray  # [L, 3] m, heel to toe at the stance time, horizontal
    flight: np.ndarray  # [50, L, 3] normalised footbase over leg-cycle time: x, y in m, z 0..1 of a stride
    analysis: MotionAnalysis  # of the samples; of the clip as it is, also for a twin
    backwards: bool  # played backwards
    compat: bool  # as the original computes it
    rotation: np.ndarray  # [F, J, 4] wxyz, joint to parent: one cycle of the clip, as recorded
    translation: np.ndarray  # [F, J, 3] m, in the parent's frame
    notes: tuple[str, ...] = ()

    @property
    def speed(self) -> float:
        """m/s, distance over duration."""
        return self.distance / self.duration

    def clip_phase(self, clock: np.ndarray | float) -> np.ndarray:
        """Phase of the clip, in [0, 1), that is shown at a clock."""
        phase = np.asarray(clock, float) - self.cycle_offset
        return np.mod(1.0 - phase if self.backwards else phase, 1.0)

    def pose(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Rotation [count, J, 4] (wxyz, hemisphere-continuous) and translation [count, J, 3] at clocks i / count."""
        at = self.clip_phase(np.arange(count) / count) * len(self.rotation)
        return resample_rotation(self.rotation, at, True), resample(self.translation, at, True)

    def flight_at(self, leg: int, phase: int, progress: np.ndarray | float) -> np.ndarray:
        """Normalised footbase [..., 3] (2.12): phase 0 until liftoff, 1 in flight, 2 from strike; progress 0..1."""
        progress = np.clip(np.asarray(progress, float), 0.0, 1.0)
        if self.kind == "grounded":
            z = (np.zeros_like(progress), 0.5 - 0.5 * np.cos(np.pi * progress), np.ones_like(progress))[phase]
            return np.stack([0 * z, 0 * z, z], -1)
        liftoff, strike = self.keytimes[leg, 1], self.keytimes[leg, 4]
        time = phase_time(phase, progress, liftoff, strike)
        if self.compat and self.backwards:  # what is held at the end of the clip's table comes first here
            x, y, z = np.moveaxis(lookup(mirrored(self.flight[:, leg]), 1.0 - time, True), -1, 0)
            return np.stack([-x, y, 1.0 - z], -1)
        return lookup(self.flight[:, leg], time, self.compat)


def mirrored(table: np.ndarray) -> np.ndarray:
    """Tables [50, ..., 3] of the motion played backwards (2.13); twice is the same table again."""
    back = np.roll(table[::-1], 1, 0)  # row j: leg-cycle time 1 - j / 50; row 0 stands for time 1, one stride on
    out = np.stack([-back[..., 0], back[..., 1], 1.0 - back[..., 2]], -1)
    out[0, ..., 2] -= 1.0
    return out


def analyse_clip(
    archetype: Archetype,
    clip: Clip,
    feet: Sequence[Foot] | None = None,
    *,
    grounded: bool = False,
    compat: bool = False,
) -> Motion:
    """The motion of an in-place clip whose planted feet are at y = 0.

    feet: of the archetype (`feet_of`), found when None. grounded: the character stands (its sample 0 is its stance).
    A clip of several equal strides is averaged into one. `clip.speed` tells the distance where given.
    compat: key times, distance and tables exactly as `analyse_samples` tells (section 2), of the clip's feet alone.
    Default: stances as `planting` finds them, and tables at rest in stance (section 8.2, g and h).
    Raises InputError naming clip and leg: legs of one bone, clips that do not loop or never touch the ground, walks in
    which no foot moves.
    """
    where = f"{archetype.source} clip '{clip.name}'"
    check_clip(archetype, clip, where, grounded)
    own = tuple(feet) if feet is not None else feet_of(archetype)
    strides = 1 if grounded else stride_count(archetype, clip)
    period = clip.duration / strides
    notes = [f"clip '{clip.name}' holds {strides} strides; their mean is used"] if strides > 1 else []
    points = _sampled(archetype, clip, own, strides, period, grounded)
    notes += check_heights(archetype, clip, own, points, where)
    if not (grounded or compat):
        points, more = _planted(archetype, clip, own, strides, points)
        notes += more
    return _motion(clip, points, strides, notes, "grounded" if grounded else "walk", compat)


def _sampled(
    archetype: Archetype, clip: Clip, own: Sequence[Foot], strides: int, period: float, grounded: bool
) -> MotionAnalysis:
    """The reference analysis of the clip."""
    ankle_q, ankle_p, ball_q, ball_p = _foot_joints(archetype, clip, strides, SAMPLES)
    lengths = np.array([foot.length for foot in own])
    heel, toe = np.array([foot.heel for foot in own]), np.array([foot.toe_tip for foot in own])
    ankle, ball = _matrices(ankle_q, ankle_p), _matrices(ball_q, ball_p)
    return analyse_samples(ankle, ball, heel, toe, lengths, GROUND, period, grounded=grounded)


def _matrices(rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    """[L, 51, 4, 4] of rotation [50, L, 4] and position [50, L, 3] of a cycle."""
    out = np.zeros((*rotation.shape[:-1], 4, 4))
    out[..., :3, :3], out[..., :3, 3], out[..., 3, 3] = posing.matrix(rotation), position, 1.0
    return np.moveaxis(np.concatenate([out, out[:1]]), 1, 0)


def _foot_joints(archetype: Archetype, clip: Clip, strides: int, count: int) -> tuple[np.ndarray, ...]:
    """Ankle rotation [count, L, 4] and position, ball rotation and position, character frame."""
    legs = archetype.legs
    rotation, translation = stride_poses(clip, strides, count)
    joints = [leg.ankle for leg in legs] + [leg.ball for leg in legs]
    q, p = transforms(archetype.skeleton, rotation, translation, joints)
    return q[:, : len(legs)], p[:, : len(legs)], q[:, len(legs) :], p[:, len(legs) :]


def _planted(
    archetype: Archetype, clip: Clip, own: Sequence[Foot], strides: int, found: MotionAnalysis
) -> tuple[MotionAnalysis, tuple[str, ...]]:
    """The analysis with the default mode's stances, distance and tables, and notes."""
    contact, footbase = _fine_paths(archetype, clip, own, strides, found)
    stances = planting.find_stances(archetype, clip, contact, footbase, found.duration)
    distance = stances.speed * found.duration
    legs = []
    for leg, foot, start, duty in zip(found.legs, own, stances.start, stances.duty, strict=True):
        stance = planting.stance_index(leg, start, duty)
        times = planting.key_times(leg, stance, start, duty, GROUND)
        moved = _with_stance(leg, foot, stance, times)
        moved = replace(moved, stance_position=_stance_place(moved, times, stances.direction * distance))
        table = flight_table(moved.footbase, stance, times[1], times[4], stances.direction, distance)
        legs.append(replace(moved, normalised_footbase=table))
    velocity = stances.direction * stances.speed
    out = replace(
        found, legs=tuple(legs), distance=distance, direction=stances.direction, speed=stances.speed, velocity=velocity
    )
    return out, stances.notes


def _fine_paths(
    archetype: Archetype, clip: Clip, own: Sequence[Foot], strides: int, found: MotionAnalysis
) -> tuple[np.ndarray, np.ndarray]:
    """Contact points and footbases [FINE, L, 3], the latter with the reference's foot vectors."""
    ankle_q, ankle_p, ball_q, ball_p = _foot_joints(archetype, clip, strides, FINE)
    contact = ball_p + posing.rotate(ball_q, np.array([leg.ball_offset for leg in archetype.legs]))
    heel = ankle_p + posing.rotate(ankle_q, np.array([foot.heel for foot in own]))
    toe = ball_p + posing.rotate(ball_q, np.array([foot.toe_tip for foot in own]))
    lengths = np.array([foot.length for foot in own])
    balance = np.arctan(EDGE * (heel[..., 1] - toe[..., 1]) / lengths)[..., None] / np.pi + 0.5
    vectors = np.array([leg.foot_vector for leg in found.legs])
    return contact, (1 - balance) * heel + balance * (toe - vectors)


def _with_stance(leg: LegAnalysis, foot: Foot, stance: int, times: np.ndarray) -> LegAnalysis:
    """The leg analysed anew (2.4, 2.5, 2.9) for another stance and other key times."""
    along = leg.toe_tip[stance] - leg.heel[stance]
    vector = hat(along * [1.0, 0.0, 1.0]) * foot.length
    balance = leg.balance[:, None]
    footbase = (1 - balance) * leg.heel + balance * (leg.toe_tip - vector)
    first, last = (round((times[k] + stance / SAMPLES) * SAMPLES) % SAMPLES for k in (1, 4))
    slide = (footbase[first] - footbase[last]) * [1.0, 0.0, 1.0]
    return replace(
        leg,
        footbase=footbase,
        stance_index=stance,
        stance_time=stance / SAMPLES,
        foot_vector=vector,
        stance_position=footbase[stance] * [1.0, 0.0, 1.0],
        distance=float(np.linalg.norm(slide) / (times[1] - times[4] + 1)),
        direction=-hat(slide),
        **dict(zip(KEYTIMES, (float(t) for t in times), strict=True)),
    )


def _stance_place(leg: LegAnalysis, times: np.ndarray, way: np.ndarray) -> np.ndarray:
    """[3] where the foot stands at its stance time, for a body that travels evenly by `way` [3] a cycle; y = 0.

    The mean over the stance of where it is, less what the body has travelled. On clips whose bodies travel evenly every
    sample says the same; on those that surge or pause one sample would put all strides too far ahead or behind.
    """
    since = np.mod(np.arange(SAMPLES) - leg.stance_index, SAMPLES) / SAMPLES
    stands = (since <= times[1]) | (since >= times[4])
    since = np.where(since >= times[4], since - 1.0, since)
    place = leg.footbase[:SAMPLES] + since[:, None] * way
    return place[stands].mean(0) * [1.0, 0.0, 1.0]


def _motion(clip: Clip, found: MotionAnalysis, strides: int, notes: list[str], kind: Kind, compat: bool) -> Motion:
    legs = found.legs
    rotation, translation = clip.rotation, clip.translation
    if strides > 1:
        rotation, translation = stride_poses(clip, strides, FINE)
    return Motion(
        name=clip.name,
        kind=kind,
        duration=found.duration,
        distance=found.distance,
        direction=found.direction,
        velocity=found.velocity,
        cycle_offset=0.0,
        stance_time=np.array([leg.stance_time for leg in legs]),
        keytimes=np.array([leg.keytimes for leg in legs]),
        stance_position=np.array([leg.stance_position for leg in legs]),
        foot_vector=np.array([leg.foot_vector for leg in legs]),
        flight=np.stack([leg.normalised_footbase for leg in legs], 1),
        analysis=found,
        backwards=False,
        compat=compat,
        rotation=rotation,
        translation=translation,
        notes=tuple(notes),
    )
