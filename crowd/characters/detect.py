"""Legs, arms, pelvis, facing, size and gaits of any rig, by geometry and motion; names only break ties.

A rig description overrides any part. What detection is unsure of comes back as notes for the user.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from crowd.characters.arms import ArmChain, find_arms
from crowd.characters.attachment import reattached, wander
from crowd.characters.description import Axis, RigDescription
from crowd.characters.facing import AXES, Facing, find_facing, rotation_to, upright
from crowd.characters.limbs import (
    FootJoints,
    LegChain,
    find_feet,
    ground_foot,
    leg_chain,
    limb_places,
    paired,
    trunk_of,
)
from crowd.characters.locomotion import ClipReport, along_its_way, assess, best_idle, with_a_walk
from crowd.characters.naming import (
    ankle_index,
    arms_from,
    check_attachments,
    check_names,
    clip_name,
    joint_index,
    legs_from,
)
from crowd.characters.raw_rig import RawRig
from crowd.characters.size import metres_per_unit
from crowd.characters.subject import Subject, prepare, shifted, turned
from crowd.characters.tips import add_joint
from crowd.characters.travel import in_place
from crowd.errors import fail
from crowd.types import ClipRole


@dataclass(frozen=True, eq=False)
class Detection:
    """What a rig is. `subject` is turned to y up, +z forward, and has a joint at every ankle; still in file units."""

    subject: Subject
    up: Axis
    forward: Axis  # nearest file axis
    metres: float  # per file unit
    pelvis: int
    legs: tuple[LegChain, ...]  # front to hind, left before right; every `ankle` is a joint
    leg_names: tuple[str, ...]
    arms: tuple[ArmChain, ...]
    attached: dict[int, int]  # joints re-hung: joint -> new parent
    clips: tuple[ClipReport, ...]
    notes: tuple[str, ...]  # what was assumed
    unsure: tuple[str, ...]  # what may be wrong


def detect(raw: RawRig, description: RigDescription | None = None) -> Detection:
    """Find everything in a rig. Raises InputError when there are no legs or the description names unknown things."""
    given = description or RigDescription()
    notes, unsure = list(raw.notes), []
    up = given.up or raw.up or "+y"
    check_names(raw, given)
    first = upright(up)
    subject = prepare(turned(raw, first))
    attach = {joint_index(raw, c, "attach"): joint_index(raw, p, "attach") for c, p in (given.attach or {}).items()}
    check_attachments(subject, attach)
    subject, attached = reattached(subject, attach)
    notes += [
        f"'{raw.names[child]}' moves with '{raw.names[parent]}' and was attached to it"
        for child, parent in attached.items()
    ]
    feet = find_feet(subject) if given.legs is None else []
    tips = [foot.tip for foot in feet] or [ankle_index(raw, leg.ankle, "legs") for leg in given.legs or []]
    if not tips:
        raise _no_legs(raw)
    subject, travel_notes = in_place(subject, tips)
    notes += travel_notes
    facing, turn = _facing(subject, tips, given, first)
    if facing.motion < 0.4 and given.forward is None:
        unsure.append(_facing_doubt(facing))
    # Motion and skin are computed anew in the final frame; the hierarchy stays as re-hung.
    parents = subject.parents
    frame = turned(subject.raw, turn)
    middle = turn @ limb_places(subject, tips).mean(0) * np.array([1.0, 0.0, 1.0])
    subject = replace(prepare(shifted(frame, -middle)), parents=parents)
    whole_turn = turn @ first
    soles, trunk = _soles(subject, given, feet, notes, raw)
    return _Rest(subject, given, soles, trunk, notes, unsure).finish(up, whole_turn, attached)


def _facing(subject: Subject, tips: list[int], given: RigDescription, first: np.ndarray) -> tuple[Facing, np.ndarray]:
    facing = find_facing(subject, tips, np.array([0.0, 0.0, 1.0]))
    forward = facing.forward if given.forward is None else first @ AXES[given.forward]
    return facing, rotation_to(np.array([0.0, 1.0, 0.0]), forward)


def _facing_doubt(facing: Facing) -> str:
    if facing.motion == 0.0:
        return "facing: no clip walks clearly in one direction, so the format's front is taken; set 'forward' if wrong"
    return f"facing: clips disagree ({facing.motion:.0%} agreement on the chosen front); set 'forward' if wrong"


def _no_legs(raw: RawRig, reason: str = "at least two mirrored chains of joints must reach the ground") -> Exception:
    return fail(
        raw.path.name,
        f"no legs found: {reason}; "
        f"name them under 'legs' in a rig description (joints: {', '.join(raw.names[:12])}, ...)",
    )


def _soles(
    subject: Subject, given: RigDescription, feet: list, notes: list[str], raw: RawRig
) -> tuple[list[FootJoints], list[int]]:
    """The ground ends of all legs and the trunk joints between them."""
    if given.legs is not None:
        return legs_from(subject, given.legs)
    kept, lone = paired(subject, feet)
    if len(kept) < 2:
        raise _no_legs(raw)
    notes += [f"'{raw.names[foot.tip]}' reaches the ground but has no mirror partner; not a leg" for foot in lone]
    trunk = trunk_of(subject, kept)
    return [ground_foot(subject, foot, trunk) for foot in kept], trunk


@dataclass
class _Rest:
    """The steps after the feet are known."""

    subject: Subject
    given: RigDescription
    soles: list[FootJoints]
    trunk: list[int]
    notes: list[str]
    unsure: list[str]

    def finish(self, up: Axis, turn: np.ndarray, attached: dict[int, int]) -> Detection:
        subject, raw = self.subject, self.subject.raw
        length = [np.linalg.norm(raw.rest_position[s.chain[0]] - s.contact) for s in self.soles]
        leg = float(np.mean(length))
        pelvis = self._pelvis()
        metres = 1.0  # the Froude numbers follow once the size is known
        clips = [assess(subject, clip, self.soles, leg, pelvis, metres) for clip in raw.clips]
        metres = metres_per_unit(subject, self.given, leg, len(self.soles), clips, self.notes, self.unsure)
        clips = [assess(subject, clip, self.soles, leg, pelvis, metres) for clip in raw.clips]
        clips = self._roles(with_a_walk(self._of_normal(clips)))
        moves = [clip for clip, report in zip(raw.clips, clips, strict=True) if report.role in ("walk", "run")]
        legs = self._legs(moves)
        arms = self._arms(legs)
        subject, legs = with_tips(subject, legs)
        legs, names = named(subject, legs, [g.name for g in self.given.legs] if self.given.legs else None)
        rows = {sole.chain[0]: k for k, sole in enumerate(self.soles)}
        order = [rows[leg.chain[0]] for leg in legs]
        clips = [
            replace(r, duty=tuple(r.duty[k] for k in order), touchdown=tuple(r.touchdown[k] for k in order))
            for r in clips
        ]
        forward = max(AXES, key=lambda axis: float((turn @ AXES[axis])[2]))
        return Detection(
            subject,
            up,
            forward,
            metres,
            pelvis,
            tuple(legs),
            tuple(names),
            tuple(arms),
            attached,
            tuple(clips),
            tuple(dict.fromkeys(self.notes)),
            tuple(dict.fromkeys(self.unsure)),
        )

    def _pelvis(self) -> int:
        """The joint above all legs, or the nearest one above it that the clips translate."""
        subject = self.subject
        if self.given.pelvis is not None:
            return joint_index(subject.raw, self.given.pelvis, "pelvis")
        shared = set.intersection(*(set(subject.above(sole.chain[0])) for sole in self.soles))
        if not shared:
            return self.trunk[0] if self.trunk else self.soles[0].chain[0]
        lowest = max(shared, key=lambda j: len(subject.above(j)))
        for joint in subject.above(lowest):
            if _translated(subject, joint):
                return joint
        return lowest

    def _of_normal(self, clips: list[ClipReport]) -> list[ClipReport]:
        """Walks, runs and steps that only other styles name are none of style "normal", where it keeps a gait."""
        styles = self.given.clips.styles
        moves = [(n, key) for key, style in styles.items() for n, role in style.listed if role != "idle"]
        taken = {clip_name(self.subject.raw, name, key): key for name, key in moves}
        own = {name for role in ("walk", "run") for name in getattr(self.given.clips, role) or []}
        if not own and all(r.name in taken for r in clips if r.role in ("walk", "run")):
            return clips
        return [
            replace(r, role="other", why=f"plays in style '{taken[r.name]}'") if r.name in taken else r for r in clips
        ]

    def _roles(self, clips: list[ClipReport]) -> list[ClipReport]:
        roles = self.given.clips
        named: dict[str, ClipRole] = {}
        for role in ("idle", "walk", "run", "step", "other"):
            listed = getattr(roles, role)
            for name in [listed] if isinstance(listed, str) else listed or []:
                named[clip_name(self.subject.raw, name, role)] = role
        idle = best_idle(clips)
        out = []
        for report in clips:
            role, why = report.role, report.why
            if role == "idle" and report is not idle:
                role, why = "other", "stands, but another clip is the quieter idle"
            if getattr(roles, role, None) is not None:
                role, why = "other", f"the description names other clips for {role}"
            if report.name in named:
                role, why = named[report.name], "named in the description"
            if role == "step" and report.role != "step":
                report = along_its_way(report)
            out.append(replace(report, role=role, why=why))
        if not any(report.role in ("walk", "run") for report in out):
            raise _no_gait(self.subject.raw, out)
        if not any(report.role == "idle" for report in out):
            self.notes.append("no idle clip; standing is made from the slowest gait")
        return out

    def _legs(self, moves: list) -> list[LegChain]:
        raw = self.subject.raw
        if self.given.legs is not None:
            pairs = [(joint_index(raw, g.hip, "legs"), joint_index(raw, g.knee, "legs")) for g in self.given.legs]
            chains = [leg_chain(self.subject, s, moves, p) for s, p in zip(self.soles, pairs, strict=True)]
            return [chain for chain in chains if isinstance(chain, LegChain)]
        legs = []
        for sole in self.soles:
            found = leg_chain(self.subject, sole, moves)
            if isinstance(found, str):
                self.notes.append(f"not taken as a leg: {found}")
            else:
                legs.append(found)
        if len(legs) < 2:
            raise _no_legs(self.subject.raw, "; ".join(n for n in self.notes if n.startswith("not taken as a leg")))
        legs = mirrored(legs)
        self.unsure += [note for leg in legs if leg.side >= 0 for note in leg.notes]
        return legs

    def _arms(self, legs: list[LegChain]) -> list[ArmChain]:
        if self.given.arms is not None:
            return arms_from(self.subject, self.given.arms)
        if len(legs) != 2:
            return []
        own = {j for leg in legs for j in self.subject.below(leg.chain[0])}
        hips = self.subject.raw.rest_position[[leg.hip for leg in legs]]
        return find_arms(self.subject, own, self.trunk, float(hips[:, 1].mean()))


def _no_gait(raw: RawRig, clips: list[ClipReport]) -> Exception:
    listed = "; ".join(f"'{report.name}': {report.why}" for report in clips[:8])
    return fail(
        f"{raw.path.name} animations", f"no clip walks or runs ({listed}); name one under clips.walk or clips.run"
    )


def _translated(subject: Subject, joint: int) -> bool:
    parent = subject.parents[joint]
    return any(
        wander(joint, parent, clip.rotation, clip.position) > 0.002 * subject.height for clip in subject.raw.clips
    )


def mirrored(legs: list[LegChain]) -> list[LegChain]:
    """Legs whose left and right agree: where hip or knee differ in place along the chain, the left one decides."""
    out = list(legs)
    for k, leg in enumerate(legs):
        image = leg.place * np.array([-1.0, 1, 1])
        lefts = [other for other in legs if other.side > 0 and len(other.chain) == len(leg.chain)]
        if leg.side > 0 or not lefts:
            continue
        left = min(lefts, key=lambda other: float(np.linalg.norm(other.place - image)))
        hip, knee = (leg.chain[left.chain.index(j)] for j in (left.hip, left.knee))
        out[k] = replace(leg, hip=hip, knee=knee)
    return out


def with_tips(subject: Subject, legs: list[LegChain]) -> tuple[Subject, list[LegChain]]:
    """Adds a joint at the contact point of every leg that ends in a bare tip; it becomes the leg's ankle and ball."""
    out = []
    for leg in legs:
        if leg.ankle is None:
            subject, tip = add_joint(subject, leg.ball, f"{subject.raw.names[leg.ball]}.tip", leg.contact)
            leg = replace(leg, ankle=tip, ball=tip, chain=(*leg.chain, tip))
        out.append(leg)
    return subject, out


def named(subject: Subject, legs: list[LegChain], given: list[str | None] | None) -> tuple[list[LegChain], list[str]]:
    """Legs front to hind, left before right, with names by place ("hind left"); given names are kept."""
    rows: list[list[int]] = []
    for k in sorted(range(len(legs)), key=lambda k: -legs[k].place[2]):
        row = next((r for r in rows if _pair(legs, r, k)), None)
        rows.append([k]) if row is None else row.append(k)
    rows.sort(key=lambda row: -float(np.mean([subject.raw.rest_position[legs[k].hip, 2] for k in row])))
    order = [k for row in rows for k in sorted(row, key=lambda k: -legs[k].side)]
    words = {1: [""], 2: ["front ", "hind "]}.get(len(rows), [f"{n} " for n in range(1, len(rows) + 1)])
    names = {}
    for word, row in zip(words, rows, strict=True):
        for k in row:
            names[k] = f"{word}{ {1: 'left', -1: 'right', 0: 'middle'}[legs[k].side] }"
            if given is not None and given[k]:
                names[k] = given[k]
    return [legs[k] for k in order], [names[k] for k in order]


def _pair(legs: list[LegChain], row: list[int], k: int) -> bool:
    """Whether leg k is the mirror image of the one leg in the row."""
    if len(row) != 1 or legs[row[0]].side != -legs[k].side or legs[k].side == 0:
        return False
    image = legs[row[0]].place * np.array([-1.0, 1, 1])
    rivals = [np.linalg.norm(leg.place - image) for leg in legs if leg.side == legs[k].side]
    return bool(np.linalg.norm(legs[k].place - image) <= min(rivals) + 1e-9)
