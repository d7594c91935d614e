"""Metres per file unit: what the format says, unless the character would be a giant or a mite."""

from __future__ import annotations

from collections.abc import Sequence

from crowd.characters.description import RigDescription
from crowd.characters.locomotion import ClipReport
from crowd.characters.subject import Subject

PLAUSIBLE_M = (0.15, 6.0)  # standing height
HUMAN_LEG_M = 0.9  # hip to ground of an adult
LEG_RANGE_M = (0.7, 1.1)
# centimetres, inches, feet, decimetres, millimetres, and the 0.45-scaled inches of converted motion capture
UNITS = {"m": 1.0, "cm": 0.01, "in": 0.0254, "ft": 0.3048, "dm": 0.1, "mm": 0.001, "0.45 in": 0.0254 / 0.45}
STRIDE_TIME = 3.6  # of a walk, in units of sqrt(leg / g): 1.1 s for people, and alike over animals


def plausible(height_m: float) -> bool:
    """Whether a character could be this tall."""
    return PLAUSIBLE_M[0] <= height_m <= PLAUSIBLE_M[1]


def metres_per_unit(
    subject: Subject,
    given: RigDescription,
    leg: float,
    legs: int,
    clips: Sequence[ClipReport],
    notes: list[str],
    unsure: list[str],
) -> float:
    """Scale from file units to metres; says in `notes` and `unsure` what was assumed.

    leg: length of the legs in file units. legs: their number. clips: assessed in file units as if they were metres.
    """
    if given.height_m is not None:
        return given.height_m / subject.height
    if given.metres_per_unit is not None:
        return given.metres_per_unit
    stated = subject.raw.metres_per_unit
    if stated is not None and plausible(stated * subject.height):
        _compare_with_stride(subject, stated, leg, clips, unsure)
        return stated
    scale, unit = _guess(subject, leg, legs)
    said = "" if stated is None else f"as the format says it would stand {stated * subject.height:.4g} m tall; "
    unsure.append(
        f"size: {said}taken as {unit}, so {scale * subject.height:.2f} m tall with legs of {scale * leg:.2f} m; "
        "set 'height_m' or 'metres_per_unit' if wrong"
    )
    return scale


def _guess(subject: Subject, leg: float, legs: int) -> tuple[float, str]:
    if legs == 2:
        fitting = {unit: scale for unit, scale in UNITS.items() if LEG_RANGE_M[0] <= scale * leg <= LEG_RANGE_M[1]}
        if fitting:
            unit = min(fitting, key=lambda u: abs(fitting[u] * leg - HUMAN_LEG_M))
            return fitting[unit], f"1 unit = {fitting[unit]:.4g} m ({unit})"
        return HUMAN_LEG_M / leg, f"a biped with legs of {HUMAN_LEG_M} m"
    for unit in ("m", "cm", "mm"):
        if plausible(UNITS[unit] * subject.height):
            return UNITS[unit], f"1 unit = 1 {unit}"
    return 1.0 / subject.height, "1 m tall"


def _compare_with_stride(
    subject: Subject, scale: float, leg: float, clips: Sequence[ClipReport], unsure: list[str]
) -> None:
    """Walking legs are pendulums: the walk's stride time tells their length."""
    walks = [clip for clip in clips if clip.role == "walk"]
    if not walks:
        return
    time = sorted(clip.duration / clip.strides for clip in walks)[len(walks) // 2]
    likely = 9.81 * (time / STRIDE_TIME) ** 2
    if likely / (scale * leg) < 0.5:  # slow walkers tell nothing; too quick ones are smaller
        unsure.append(
            f"size: {scale * subject.height:.2f} m tall as the file says, but its walk of {time:.2f} s per stride "
            f"suits {likely / leg * subject.height:.2f} m; set 'height_m' to change it"
        )
