"""Joints a rig description names: looked up, checked against the hierarchy, and completed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from crowd.characters.arms import ArmChain
from crowd.characters.description import ArmDescription, LegDescription, RigDescription
from crowd.characters.limbs import FootJoints, contact_point
from crowd.characters.raw_rig import RawRig
from crowd.characters.subject import Subject
from crowd.errors import InputError, Problem, fail, nearest
from crowd.scenario_styles import unknown

TIP = ".tip"  # ends the name of a joint that is added where a leg ends in a bare tip


def joint_index(raw: RawRig, name: str, key: str) -> int:
    """Index of a joint. Raises InputError with the nearest known name."""
    if name in raw.names:
        return raw.names.index(name)
    listed = ", ".join(raw.names[:20]) + (", ..." if raw.count > 20 else "")
    raise fail(f"{raw.path.name} {key}", f"no joint '{name}'{nearest(name, raw.names)}; joints: {listed}")


def ankle_index(raw: RawRig, name: str, key: str) -> int:
    """Index of an ankle, or of the joint whose bare tip it is ("tibia.tip")."""
    return joint_index(raw, name.removesuffix(TIP) if name not in raw.names else name, key)


def clip_name(raw: RawRig, name: str, key: str) -> str:
    """A clip's full name; the part before '|' may be left out. Raises InputError with the nearest known name."""
    names = [clip.name for clip in raw.clips]
    full = full_name(name, names)
    if full is None:
        raise fail(f"{raw.path.name} clips.{key}", unknown("clip", name, names))
    return full


def full_name(name: str, names: Sequence[str]) -> str | None:
    """The one of `names` that is meant; the part before '|' may be left out. None when there is none."""
    if name in names:
        return name
    short = [full for full in names if full.split("|")[-1] == name]
    return short[0] if len(short) == 1 else None


def check_names(raw: RawRig, given: RigDescription) -> None:
    """Raises InputError with every joint and clip of the description that the file does not have."""
    problems: list[Problem] = []

    def wanted(find: Callable[[RawRig, str, str], object], name: str | None, key: str) -> None:
        try:
            if name is not None:
                find(raw, name, key)
        except InputError as error:
            problems.extend(error.problems)

    if given.legs is not None and not given.legs:
        problems.append(Problem(f"{raw.path.name} legs", "the list is empty; leave it out to have legs detected"))
    wanted(joint_index, given.pelvis, "pelvis")
    for number, leg in enumerate(given.legs or []):
        for part in ("hip", "knee"):
            wanted(joint_index, getattr(leg, part), f"legs[{number}].{part}")
        for part in ("ankle", "ball"):
            wanted(ankle_index, getattr(leg, part), f"legs[{number}].{part}")
    for number, arm in enumerate(given.arms or []):
        for part in ("shoulder", "elbow", "hand"):
            wanted(joint_index, getattr(arm, part), f"arms[{number}].{part}")
    for child, parent in (given.attach or {}).items():
        wanted(joint_index, child, "attach")
        wanted(joint_index, parent, f"attach.{child}")
    for key, name in given.clips.named():
        wanted(clip_name, name, key)
    if problems:
        raise InputError(problems)


def check_attachments(subject: Subject, attach: Mapping[int, int]) -> None:
    """Raises InputError where a joint is attached to itself or to something that hangs from it."""
    parents = list(subject.parents)
    for child, parent in attach.items():
        parents[child] = parent
    names = subject.raw.names
    for child, parent in attach.items():
        above, seen = parent, {child}
        while above >= 0 and above not in seen:
            seen.add(above)
            above = parents[above]
        if above >= 0:
            raise fail(
                f"{subject.raw.path.name} attach.{names[child]}",
                f"'{names[parent]}' hangs from '{names[child]}' itself",
            )


def legs_from(subject: Subject, legs: Sequence[LegDescription]) -> tuple[list[FootJoints], list[int]]:
    """Feet of described legs, and the trunk joints above two or more of them.

    Raises InputError with every unknown or misplaced joint.
    """
    problems: list[Problem] = []
    out = []
    for number, leg in enumerate(legs):
        try:
            out.append(_foot(subject, leg, f"legs[{number}]"))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    above = [set(subject.above(foot.chain[0])[1:]) for foot in out]
    trunk = [j for j in range(subject.raw.count) if sum(j in chain for chain in above) > 1]
    return out, trunk


def _foot(subject: Subject, leg: LegDescription, key: str) -> FootJoints:
    raw = subject.raw
    problems: list[Problem] = []
    tip = leg.ankle.endswith(TIP) and leg.ankle not in raw.names
    wanted = {"hip": leg.hip, "knee": leg.knee, "ankle": leg.ankle.removesuffix(TIP) if tip else leg.ankle}
    wanted["ball"] = wanted["ankle"] if tip or leg.ball is None else leg.ball
    found: dict[str, int] = {}
    for part, name in wanted.items():
        try:
            found[part] = joint_index(raw, name, f"{key}.{part}")
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    order = [found["hip"], found["knee"], found["ankle"], found["ball"]]
    for (part, upper), (below, lower) in zip(
        zip(("hip", "knee", "ankle"), order, strict=False), zip(("knee", "ankle", "ball"), order[1:], strict=True),
        strict=True,
    ):  # fmt: skip
        same_allowed = below == "ball" or (tip and below == "ankle")
        if (upper == lower and not same_allowed) or upper not in subject.above(lower):
            problems.append(
                Problem(
                    f"{raw.path.name} {key}.{below}",
                    f"'{raw.names[lower]}' does not hang below the {part} '{raw.names[upper]}'",
                )
            )
    if problems:
        raise InputError(problems)
    up = subject.above(found["ball"])
    chain = tuple(up[: up.index(found["hip"]) + 1][::-1])
    ball = found["ball"]
    ankle = None if tip else found["ankle"]
    treading = subject.below(ball if ankle is None else ankle)
    level = float(subject.rest_lowest[[j for j in treading if subject.carries[j]] or [ball]].min())
    flat = ball != found["ankle"]
    contact = contact_point(subject, ankle, ball, flat, level)
    sole = tuple(j for j in treading if subject.carries[j]) or (ball,)
    return FootJoints(chain, ankle, ball, contact, sole if ankle is not None else (ball,))


def arms_from(subject: Subject, arms: Sequence[ArmDescription]) -> list[ArmChain]:
    """Described arms. Every unknown joint is reported at once."""
    problems: list[Problem] = []
    out = []
    for number, arm in enumerate(arms):
        found = []
        for part in ("shoulder", "elbow", "hand"):
            try:
                found.append(joint_index(subject.raw, getattr(arm, part), f"arms[{number}].{part}"))
            except InputError as error:
                problems += error.problems
        if len(found) == 3:
            if found[0] not in subject.above(found[1])[1:] or found[1] not in subject.above(found[2])[1:]:
                message = f"'{arm.shoulder}', '{arm.elbow}', '{arm.hand}' do not hang below each other"
                problems.append(Problem(f"{subject.raw.path.name} arms[{number}]", message))
            side = 1 if subject.raw.rest_position[found[2], 0] >= 0 else -1
            out.append(ArmChain(found[0], found[1], found[2], side))
    if problems:
        raise InputError(problems)
    return out
