"""Clips that travel (motion capture, root motion) turned into one stride in place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crowd.characters.cycle import extract_cycle, to_global, to_local
from crowd.characters.facing import without_drift
from crowd.characters.raw_rig import RawClip
from crowd.characters.subject import Subject
from crowd.errors import InputError

TRAVELS = 0.25  # of the height: a body that ends this far from its start has root motion
OPEN = 0.06  # of the height: ends this different do not loop


def in_place(subject: Subject, feet: list[int]) -> tuple[Subject, list[str]]:
    """The subject (y up) with travelling clips replaced by one stride in place whose speed is known, and notes.

    Where no clip travels and none loops, loops are searched in the clips as they are.
    """
    clips = subject.raw.clips
    travels = [_travel(clip) > TRAVELS * subject.height for clip in clips]
    if not any(travels) and not any(_loops(subject, clip) for clip in clips):
        travels = [True] * len(clips)
    out, notes, failed = [], [], []
    for clip, moves in zip(clips, travels, strict=True):
        if not moves:
            out.append(clip)
            continue
        try:
            out.append(_stride(subject, clip, feet))
            notes.append(
                f"clip '{clip.name}': {out[-1].duration:.2f} s of {clip.duration:.2f} s kept, one stride in place"
            )
        except InputError as error:
            out.append(clip)
            failed.append(f"clip '{clip.name}' gives no stride: {error.problems[0].message}")
    if not notes and not any(_loops(subject, clip) for clip in clips):
        notes = failed  # falls and the like need no word beside clips that loop
    return replace(subject, raw=replace(subject.raw, clips=tuple(out))), notes


def _travel(clip: RawClip) -> float:
    body = clip.position.mean(1)
    return float(np.linalg.norm((body[-1] - body[0])[[0, 2]]))


def _loops(subject: Subject, clip: RawClip) -> bool:
    position = without_drift(clip)
    closed = np.linalg.norm(position[-1] - position[0], axis=-1).mean() < OPEN * subject.height
    return bool(closed and np.linalg.norm(np.ptp(position, axis=0), axis=-1).mean() > 0.02 * subject.height)


def _stride(subject: Subject, clip: RawClip, feet: list[int]) -> RawClip:
    parents = subject.raw.parents  # the file's: parents come first there
    rotation, translation = to_local(parents, clip.rotation, clip.position)
    rate = (len(clip.position) - 1) / clip.duration
    piece = extract_cycle(rotation, translation, parents, feet, rate, f"{subject.raw.path.name} clip '{clip.name}'")
    closed_q = np.concatenate([piece.rotation, piece.rotation[:1]])
    closed_p = np.concatenate([piece.translation, piece.translation[:1]])
    turns, places = to_global(parents, closed_q, closed_p)
    return RawClip(clip.name, piece.duration, places, turns, piece.speed)
