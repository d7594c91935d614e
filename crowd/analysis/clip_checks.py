"""What is wrong with a clip before it is analysed, told with its name, the leg and what to do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crowd.analysis.foot import Foot
from crowd.analysis.samples import MotionAnalysis
from crowd.analysis.stride import feet, leg_lengths
from crowd.errors import InputError, Problem, fail
from crowd.types import Archetype, Clip

JUMP = 4.0  # times the usual change between frames: a clip whose ends differ by more does not loop ...
GAP = 0.08  # ... when it is also this much of the leg
AIR = 0.25  # of the leg: a clip whose feet all stay higher never touches the ground
FOOT_HEIGHT = (0.03, 0.15)  # of the leg: bounds on the height of a foot
STILL = 0.02  # of the leg


def check_clip(archetype: Archetype, clip: Clip, where: str, grounded: bool) -> None:
    """Raises InputError for a rig or clip that no motion can be made of; tells all that is wrong."""
    if not archetype.legs:
        raise fail(where, "the archetype has no legs; a motion needs at least one")
    problems = [
        Problem(
            f"{archetype.source} leg '{leg.name}'",
            "has one bone from hip to ankle; name a knee between them in the rig description",
        )
        for leg in archetype.legs
        if len({leg.hip, leg.knee, leg.ankle}) < 3
    ]
    if problems:
        raise InputError(problems)
    if grounded:
        return
    if len(clip.rotation) < 4:
        raise fail(where, f"has {len(clip.rotation)} samples; a walk needs at least 4")
    if not clip.cyclic:
        raise fail(where, "does not loop; cut it to one stride, or use it as a grounded motion")
    contact, _ = feet(archetype, clip.rotation, clip.translation)
    lengths = leg_lengths(archetype)
    if np.all(np.ptp(contact, axis=0).max(-1) < STILL * lengths):
        raise fail(where, "no foot moves by more than 2 % of its leg's length: no walk; use it as a grounded motion")
    step = np.linalg.norm(np.roll(contact, -1, 0) - contact, axis=-1)  # [F, L], the last one closes the loop
    torn = (step[-1] > JUMP * step[:-1].max(0)) & (step[-1] > GAP * lengths)
    if torn.any():
        leg = int(np.argmax(step[-1] / lengths))
        raise fail(
            where,
            f"does not loop: foot '{archetype.legs[leg].name}' jumps by {step[-1, leg]:.3g} m from the last frame to "
            "the first; cut the clip to whole strides",
        )


def check_heights(
    archetype: Archetype, clip: Clip, own: Sequence[Foot], found: MotionAnalysis, where: str
) -> list[str]:
    """Notes on feet that stay above the ground or sink into it. Raises InputError when no foot comes near to it."""
    lengths = leg_lengths(archetype)
    lowest = np.array([np.minimum(leg.heel[:, 1], leg.toe_tip[:, 1]).min() for leg in found.legs])
    if np.all(lowest > AIR * lengths):
        raise fail(
            where,
            f"never touches the ground: its feet stay {lowest.min():.3g} m above y = 0; lower the clip or leave it out",
        )
    notes = []
    for leg, foot, low, length in zip(found.legs, own, lowest, lengths, strict=True):
        height = float(np.clip(foot.height, FOOT_HEIGHT[0] * length, FOOT_HEIGHT[1] * length))
        base = float(leg.footbase[:, 1].min())
        if low > height:
            notes.append(
                f"clip '{clip.name}': foot '{foot.name}' stays {low:.3g} m above the ground; its stance is a guess"
            )
        elif base < -height:
            notes.append(
                f"clip '{clip.name}': foot '{foot.name}' sinks {-base:.3g} m into the ground, more than its height; "
                "check the feet of the rig or the clip's height"
            )
    return notes
