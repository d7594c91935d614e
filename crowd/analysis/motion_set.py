"""All motions of one character on one clock: which clips, their groups, and their alignment."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from crowd.analysis.alignment import cycle_offsets, wrapped
from crowd.analysis.backwards import backwards_twin, travels_backwards
from crowd.analysis.clip_cache import analysed
from crowd.analysis.foot import Foot, feet_of
from crowd.analysis.motion import Motion
from crowd.errors import InputError, Problem, fail
from crowd.types import Archetype, Clip

GROUP = "locomotion"
WALKS = ("walk", "run", "step")  # roles of clips that travel
SAME_SPEED, SAME_DIRECTION = 0.1, 10.0  # share and degrees within which motions are near duplicates
EQUAL = 1e-3  # of the faster speed: velocities this near divide by nothing in the blending

Entry = tuple[Clip, str, bool]  # clip, group ("": ungrouped), whether its backwards twin is wanted too


@dataclass(frozen=True, eq=False)
class MotionSet:
    """The motions of one character, aligned. Arrays are motion-major: M motions, L legs, in the archetype's order."""

    archetype: Archetype
    feet: tuple[Foot, ...]
    motions: tuple[Motion, ...]  # walks and grounded ones, in the order given; a twin follows its original
    groups: tuple[str, ...]  # [M] name of each one's group; "": ungrouped
    notes: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(motion.name for motion in self.motions)

    @property
    def grounded(self) -> np.ndarray:
        """[M] whether a motion stands."""
        return np.array([motion.kind == "grounded" for motion in self.motions])

    def stacked(self, name: str) -> np.ndarray:
        """[M, ...] an array of every motion: duration, distance, velocity, keytimes, stance_time, flight, ..."""
        return np.stack([np.asarray(getattr(motion, name)) for motion in self.motions])


def motion_set(
    archetype: Archetype,
    clips: Iterable[Entry] | None = None,
    compat: bool = False,
    feet: Sequence[Foot] | None = None,
) -> MotionSet:
    """Analysed and aligned motions of the named clips, or of `default_clips` when None.

    Clips with a role of WALKS travel; others are grounded. compat: analysis and alignment as the original's.
    Raises InputError for clips that cannot be analysed, and for two motions of equal velocity in one group.
    """
    own = tuple(feet) if feet is not None else feet_of(archetype)
    notes: list[str] = [note for foot in own for note in foot.notes]
    if clips is None:
        named, more = _selected(archetype, own, compat)
        notes += more
    else:
        named = _analysed(archetype, list(clips), own, compat)
    if not named:
        raise fail(archetype.source, "no clip gives a motion")
    motions = _aligned([motion for motion, _ in named], compat)
    groups = tuple(group for _, group in named)
    _refuse_equal(archetype, motions, groups)
    notes += [note for motion in motions if not motion.backwards for note in motion.notes]
    return MotionSet(archetype, own, tuple(motions), groups, tuple(notes))


def default_clips(archetype: Archetype, feet: Sequence[Foot] | None = None) -> list[Entry]:
    """The idle, every locomotion clip but near duplicates, and a backwards twin where nothing travels backwards.

    All are in the group "locomotion". Near duplicates: speed within 10 % and direction within 10 degrees of an earlier
    clip. Clips that the archetype names as serving backwards too do so; where still nothing travels backwards, the
    slowest walk that goes forwards does.
    """
    own = tuple(feet) if feet is not None else feet_of(archetype)
    motions = [motion for motion, _ in _selected(archetype, own, False)[0]]
    twins = {motion.name for motion in map(backwards_twin, filter(lambda m: m.backwards, motions))}
    kept = {motion.name for motion in motions if not motion.backwards}
    return [(clip, GROUP, clip.name in twins) for clip in _candidates(archetype) if clip.name in kept]


def _candidates(archetype: Archetype) -> list[Clip]:
    idle = [clip for clip in archetype.clips if clip.role == "idle"][:1]
    return idle + [clip for clip in archetype.clips if clip.role in WALKS]


def _analysed(
    archetype: Archetype, clips: Sequence[Entry], feet: tuple[Foot, ...], compat: bool
) -> list[tuple[Motion, str]]:
    out: list[tuple[Motion, str]] = []
    problems: list[Problem] = []
    for clip, group, backwards in clips:
        try:
            motion = analysed(archetype, clip, feet, grounded=clip.role not in WALKS, compat=compat)
            out.append((motion, group))
            if backwards:
                out.append((backwards_twin(motion), group))
        except InputError as error:
            problems += [problem for problem in error.problems if problem not in problems]
    if problems:
        raise InputError(problems)
    return out


def _selected(archetype: Archetype, feet: tuple[Foot, ...], compat: bool) -> tuple[list[tuple[Motion, str]], list[str]]:
    """The motions of the default selection, not yet aligned, and notes on what was left out."""
    kept: list[Motion] = []
    notes: list[str] = []
    roles = {clip.name: clip.role for clip in archetype.clips}
    for clip in _candidates(archetype):
        try:
            motion = analysed(archetype, clip, feet, grounded=clip.role not in WALKS, compat=compat)
        except InputError as error:
            notes += [f"left out: {problem}" for problem in error.problems]
            continue
        like = next((other for other in kept if _near(motion, other)), None)
        if like is None:
            kept.append(motion)
        else:
            notes.append(f"clip '{clip.name}' is left out: it travels as '{like.name}' does")
    walks = [motion for motion in kept if motion.kind == "walk"]
    if not walks:
        raise fail(archetype.source, "; ".join(["no clip walks or runs", *notes]))
    kept = _with_twins(kept, getattr(archetype, "also_backwards", ()))
    if not any(travels_backwards(motion.velocity) for motion in kept):
        forward = [motion for motion in walks if motion.velocity[2] > 0.7 * motion.speed > 0]
        slow = [motion for motion in forward if roles[motion.name] != "run"] or forward
        if slow:
            slowest = min(slow, key=lambda motion: motion.speed)
            kept.insert(kept.index(slowest) + 1, backwards_twin(slowest))
    return [(motion, GROUP) for motion in kept], notes


def _with_twins(motions: list[Motion], names: Sequence[str]) -> list[Motion]:
    """The motions, and behind each whose clip is named its backwards twin, unless another motion travels so."""
    out: list[Motion] = []
    for motion in motions:
        out.append(motion)
        twin = backwards_twin(motion) if motion.kind == "walk" and motion.name in names else None
        if twin is not None and not any(_near(twin, other) for other in motions):
            out.append(twin)
    return out


def _near(a: Motion, b: Motion) -> bool:
    speeds = sorted((a.speed, b.speed))
    if speeds[1] - speeds[0] > SAME_SPEED * speeds[1]:
        return False
    along = float(a.velocity @ b.velocity)
    return speeds[0] == 0 or along >= math.cos(math.radians(SAME_DIRECTION)) * a.speed * b.speed


def _aligned(motions: list[Motion], compat: bool) -> list[Motion]:
    walks = [index for index, motion in enumerate(motions) if motion.kind == "walk"]
    out = list(motions)
    if walks:
        offsets = cycle_offsets(np.array([motions[index].stance_time for index in walks]), compat)
        for index, offset in zip(walks, offsets, strict=True):
            stance = wrapped(motions[index].stance_time + offset)
            out[index] = replace(motions[index], cycle_offset=float(offset), stance_time=stance)
    return out


def _refuse_equal(archetype: Archetype, motions: Sequence[Motion], groups: Sequence[str]) -> None:
    problems = []
    for i, one in enumerate(motions):
        for other, group in zip(motions[:i], groups[:i], strict=True):
            if group != groups[i] or not group:
                continue
            if np.linalg.norm(one.velocity - other.velocity) <= EQUAL * max(one.speed, other.speed):
                kind = "both stand" if one.speed == 0 else f"both travel at {one.speed:.3g} m/s in one direction"
                problems.append(
                    Problem(
                        f"{archetype.source} group '{group}'",
                        f"clips '{other.name}' and '{one.name}' {kind}; leave one out or give it another group",
                    )
                )
    if problems:
        raise InputError(problems)
