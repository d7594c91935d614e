"""`crowd analyze CHARACTER`: what the motion analysis finds in a character's clips."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from crowd import characters
from crowd.analysis.motion import Motion
from crowd.analysis.motion_set import GROUP, WALKS, Entry, MotionSet, motion_set
from crowd.analysis.samples import KEYTIMES
from crowd.errors import fail, nearest
from crowd.types import Archetype


def report(character: str, clips: Sequence[str] = (), out: Path | None = None, compat: bool = False) -> MotionSet:
    """Prints the tables of a character's motions; draws them into `out` unless that is None.

    clips: names of clips; none: the default selection. A clip that neither stands nor walks by its role is analysed as
    a walk. Raises InputError for unknown names and for what cannot be analysed.
    """
    archetype = characters.load(character)
    found = motion_set(archetype, _entries(archetype, clips) if clips else None, compat)
    print("\n".join(lines(found)))
    if out is not None:
        from crowd.report_analysis import draw

        out.mkdir(parents=True, exist_ok=True)
        paths = draw(found, out)
        print(f"wrote {len(paths)} pictures to {out}")
    return found


def _entries(archetype: Archetype, names: Sequence[str]) -> list[Entry]:
    by_name = {clip.name: clip for clip in archetype.clips}
    entries: list[Entry] = []
    for name in names:
        if name not in by_name:
            known = ", ".join(f"'{clip}'" for clip in by_name)
            raise fail(f"--clip {name}", f"{archetype.source} has no such clip{nearest(name, list(by_name))}: {known}")
        clip = by_name[name]
        entries.append((clip if clip.role in ("idle", *WALKS) else replace(clip, role="walk"), GROUP, False))
    return entries


def lines(found: MotionSet) -> Iterator[str]:
    """The report: feet, motions, legs of each motion, notes."""
    archetype = found.archetype
    yield f"{archetype.name}: {len(archetype.legs)} legs, {len(found.motions)} motions"
    yield ""
    yield from _table(
        ["foot", "length m", "width m", "points to", "ankle", "toe"],
        [
            [foot.name, f"{foot.length:.3f}", f"{foot.width:.3f}", _bearing(foot.direction), foot.ankle, foot.toe]
            for foot in found.feet
        ],
    )
    yield ""
    yield from _table(
        ["motion", "group", "kind", "cycle s", "distance m", "speed m/s", "towards", "velocity x, z", "offset"],
        [_motion_row(motion, group) for motion, group in zip(found.motions, found.groups, strict=True)],
    )
    for motion in found.motions:
        if motion.kind == "walk":
            yield ""
            yield f"{motion.name}"
            yield from _table(
                ["  leg", "stance", *KEYTIMES, "distance m", "stance at x, z", "foot m"], list(_leg_rows(found, motion))
            )
    if found.notes:
        yield ""
        yield from (f"note: {note}" for note in found.notes)


def _motion_row(motion: Motion, group: str) -> list[str]:
    if motion.kind == "grounded":
        return [motion.name, group or "-", motion.kind, f"{motion.duration:.3f}", "-", "-", "-", "-", "-"]
    return [
        motion.name,
        group or "-",
        motion.kind,
        f"{motion.duration:.3f}",
        f"{motion.distance:.3f}",
        f"{motion.speed:.3f}",
        _bearing(motion.velocity),
        f"{_number(motion.velocity[0])}, {_number(motion.velocity[2])}",
        f"{motion.cycle_offset:+.3f}",
    ]


def _leg_rows(found: MotionSet, motion: Motion) -> Iterator[list[str]]:
    for index, foot in enumerate(found.feet):
        place = motion.stance_position[index]
        yield [
            f"  {foot.name}",
            f"{motion.stance_time[index]:.2f}",
            *(f"{time:.2f}" for time in motion.keytimes[index]),
            f"{motion.analysis.legs[index].distance:.3f}",
            f"{_number(place[0])}, {_number(place[2])}",
            f"{np.linalg.norm(motion.foot_vector[index]):.3f}",
        ]


def _number(value: float) -> str:
    return f"{value + 0.0:.3f}" if abs(value) >= 5e-4 else "0.000"  # no minus zero


def _bearing(v: np.ndarray) -> str:
    """Where a horizontal vector [3] points, in degrees from forward to the left."""
    if not np.any(v):
        return "-"
    angle = round(float(np.degrees(np.arctan2(v[0], v[2]))))
    named = {0: "forward", 90: "left", -90: "right", 180: "back", -180: "back"}
    return named.get(angle, f"{abs(angle)} deg {'left' if angle > 0 else 'right'}")


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Aligned columns: text to the left, what starts with a digit or sign to the right."""
    widths = [max(len(row[column]) for row in (head, *rows)) for column in range(len(head))]
    right = [column > 0 and all(row[column][:1] in "0123456789+-" for row in rows) for column in range(len(head))]
    for row in (head, *rows):
        cells = (
            cell.rjust(width) if to_right else cell.ljust(width)
            for cell, width, to_right in zip(row, widths, right, strict=True)
        )
        yield "  ".join(cells).rstrip()
