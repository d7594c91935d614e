"""Legs and arms as chains of joints, found by where skin meets the ground and by which joints bend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from crowd.characters.facing import CONTACT
from crowd.characters.raw_rig import RawClip
from crowd.characters.subject import Subject, rest_vertices
from crowd.posing import conjugate, rotate

LOW = 0.2  # of the height: a group of touching joints below this is one foot
TREAD = 0.03  # of the leg's height: joints whose skin comes this low tread the ground
FOOT = 0.35  # of the leg's height: the ankle lies below this


@dataclass(frozen=True)
class Foot:
    """Joints that touch the ground together."""

    top: int  # the highest joint of the foot
    members: tuple[int, ...]  # touching joints in and below it
    tip: int  # the lowest touching joint


@dataclass(frozen=True, eq=False)
class FootJoints:
    """The ground end of a leg."""

    chain: tuple[int, ...]  # from below the trunk to the tip
    ankle: int | None  # None: the leg ends in a bare tip
    ball: int
    contact: np.ndarray  # [3] of the rest pose
    sole: tuple[int, ...]  # joints whose skin treads the ground


@dataclass(frozen=True, eq=False)
class LegChain:
    """A leg as joints of the subject; `ankle` None: the leg ends in a bare tip and needs a joint there."""

    hip: int
    knee: int
    ankle: int | None
    ball: int  # joint that carries the contact point
    contact: np.ndarray  # [3] contact point of the rest pose
    chain: tuple[int, ...]  # from below the trunk to the tip
    place: np.ndarray  # [3] mean of the chain's joints at rest
    side: int  # +1 left (+x), -1 right, 0 middle
    notes: tuple[str, ...] = ()


def find_feet(subject: Subject) -> list[Foot]:
    """Groups of joints whose skin touches the ground in the rest pose (or, failing that, in some clip)."""
    touching = subject.carries & (subject.rest_lowest < subject.ground + CONTACT * subject.height)
    feet = _grouped(subject, touching)
    return feet if len(feet) > 1 else _grouped(subject, _touching_in_clips(subject))


def _touching_in_clips(subject: Subject) -> np.ndarray:
    count = np.zeros(subject.raw.count)
    for clip in subject.raw.clips:
        low = np.where(subject.carries, subject.lowest(clip.rotation, clip.position), np.inf)
        ground = np.percentile(low.min(1), 5)
        count += (low < ground + CONTACT * subject.height).mean(0) > 0.1
    return count > 0.5 * len(subject.raw.clips)


def _grouped(subject: Subject, touching: np.ndarray) -> list[Foot]:
    children = subject.children
    level = (subject.raw.rest_position[:, 1] - subject.ground) / subject.height
    members: list[list[int]] = [[j] if touching[j] else [] for j in range(subject.raw.count)]
    reach = np.where(touching, level, -np.inf)  # highest joint on the way down to a touching one
    order = topological(subject.parents)
    for joint in reversed(order):
        for child in children[joint]:
            members[joint] = members[joint] + members[child]
            reach[joint] = max(reach[joint], reach[child])
        if members[joint]:
            reach[joint] = max(reach[joint], level[joint])
    feet = []
    stack = [j for j in order if subject.parents[j] < 0 and members[j]]
    while stack:
        joint = stack.pop()
        branches = [c for c in children[joint] if members[c]]
        if reach[joint] < LOW or not branches:
            tip = min(members[joint], key=lambda j: (-len(subject.above(j)), j))
            feet.append(Foot(joint, tuple(sorted(members[joint])), tip))
        else:
            stack.extend(branches)
    return sorted(feet, key=lambda foot: foot.top)


def topological(parents: tuple[int, ...]) -> list[int]:
    """Joints with parents before children. Parents must form a forest."""
    children: list[list[int]] = [[] for _ in parents]
    for joint, parent in enumerate(parents):
        if parent >= 0:
            children[parent].append(joint)
    order = [j for j, parent in enumerate(parents) if parent < 0]
    for joint in order:
        order.extend(children[joint])
    return order


def limb_places(subject: Subject, tips: list[int]) -> np.ndarray:
    """Place [L, 3] of the joints that lead to each tip alone (see `chain_place`)."""
    counts = np.zeros(subject.raw.count, int)
    chains = [subject.above(tip) for tip in tips]
    for chain in chains:
        counts[chain] += 1
    return np.stack([chain_place(subject, [j for j in c if counts[j] == 1] or c[:1]) for c in chains])


def chain_place(subject: Subject, chain: Sequence[int]) -> np.ndarray:
    """Mean place [3] of joints, the high ones counting most: tells left from right even where feet cross."""
    rest = subject.raw.rest_position[list(chain)]
    weight = rest[:, 1] - subject.ground + 0.05 * subject.height
    return np.average(rest, axis=0, weights=np.maximum(weight, 1e-9))


def paired(subject: Subject, feet: list[Foot]) -> tuple[list[Foot], list[Foot]]:
    """Feet with a mirror partner across the middle plane, and the others (tails, capes)."""
    places = limb_places(subject, [foot.tip for foot in feet])
    center = mirror_center(places[:, 0])
    kept, lone = [], []
    for k, foot in enumerate(feet):
        mirror = places[k] * np.array([-1.0, 1, 1]) + np.array([2.0 * center, 0, 0])
        other = [m for m in range(len(feet)) if m != k]
        near = min((np.linalg.norm(places[m] - mirror) for m in other), default=np.inf)
        off_middle = abs(places[k, 0] - center) > 0.01 * subject.height
        (kept if near < 0.2 * subject.height and off_middle else lone).append(foot)
    return kept, lone


def mirror_center(x: np.ndarray) -> float:
    """The x about which most of the given places have a mirror image: the densest among all midpoints."""
    middles = ((x[:, None] + x[None]) / 2)[np.triu_indices(len(x), 1)]
    if len(middles) == 0:
        return float(x.mean())
    spread = 0.05 * max(float(np.ptp(x)), 1e-9)
    votes = np.exp(-(((middles[:, None] - middles[None]) / spread) ** 2)).sum(1)
    return float(middles[np.argmax(votes - 1e-3 * np.abs(middles - np.median(x)) / spread)])


def trunk_of(subject: Subject, feet: list[Foot]) -> list[int]:
    """Joints above two or more feet, from the lowest common one of all feet downwards."""
    counts = np.zeros(subject.raw.count, int)
    for foot in feet:
        counts[subject.above(foot.top)] += 1
    return [j for j in topological(subject.parents) if counts[j] > 1]


def ground_foot(subject: Subject, foot: Foot, trunk: list[int]) -> FootJoints:
    """Ankle, ball and contact point of a foot, from the rest pose."""
    above = [j for j in subject.above(foot.tip)[::-1] if j not in set(trunk)]
    touching = [j for j in above if j in foot.members]
    level = float(subject.rest_lowest[list(foot.members)].min())
    ankle, ball, flat = _foot_joints(subject, above, touching, foot.members, level)
    contact = contact_point(subject, ankle, ball, flat, level)
    sole = tuple(sorted({ball, *(() if ankle is None else (ankle,)), *(foot.members if ankle is not None else ())}))
    if ankle is not None:
        sole = tuple(j for j in sole if j in subject.below(ankle))
    return FootJoints(tuple(above), ankle, ball, contact, sole)


def leg_chain(
    subject: Subject, foot: FootJoints, moves: list[RawClip], given: tuple[int, int] | None = None
) -> LegChain | str:
    """The leg above a foot, or why it cannot be one. moves: walking clips. given: hip and knee, if named."""
    rest, above, ankle, ball, contact = subject.raw.rest_position, foot.chain, foot.ankle, foot.ball, foot.contact
    top = float(np.linalg.norm(rest[above[0]] - contact))
    place = chain_place(subject, above)
    side = int(np.sign(place[0])) if abs(place[0]) > 0.01 * subject.height else 0
    if given is not None:
        return LegChain(given[0], given[1], ankle, ball, contact, above, place, side)
    upper = list(above[: above.index(ankle)] if ankle is not None else above[: above.index(ball) + 1])
    same = [j for j, last in zip(upper[1:], upper, strict=False) if np.linalg.norm(rest[j] - rest[last]) < 0.01 * top]
    upper = [j for j in upper if j not in same]
    if len(upper) < 2:
        names = subject.raw.names
        why = "".join(f" ('{names[j]}' lies in the place of its parent, a bone of no length)" for j in same)
        return f"the chain {' > '.join(names[j] for j in above)} has no joint that could be a knee{why}"
    hip, swing_note = _hip(subject, upper, contact, ball, moves)
    below_hip = upper[upper.index(hip) + 1 :]
    knee, knee_note = _knee(subject, hip, below_hip, ankle, ball, contact, moves)
    notes = tuple(note for note in (swing_note, knee_note) if note)
    return LegChain(hip, knee, ankle, ball, contact, above, place, side, notes)


def _foot_joints(
    subject: Subject, above: list[int], touching: list[int], members: Sequence[int], level: float
) -> tuple[int | None, int, bool]:
    """Ankle, ball and whether the sole is flat from the ankle on (plantigrade)."""
    rest = subject.raw.rest_position
    height = rest[list(above), 1] - level
    low = height <= FOOT * height.max()
    tread = level + TREAD * height.max()
    near = [j for j in touching if low[above.index(j)] and above.index(j) > 0 and subject.rest_lowest[j] < tread]
    if not near:
        return None, touching[-1], False
    bone = 0.02 * float(np.linalg.norm(rest[above[0]] - rest[touching[-1]]))
    first = above.index(near[0])

    def toes(joint: int) -> int:
        return sum(bool(set(subject.below(child)) & set(members)) for child in subject.children[joint])

    if first > 2 and low[first - 1]:
        step = rest[near[0]] - rest[above[first - 1]]
        if np.hypot(step[0], step[2]) > max(-step[1], bone):
            ankle = above[first - 1]
            return (ankle, ankle, False) if toes(ankle) > 1 else (ankle, near[0], True)
    if toes(near[0]) > 1:  # no single toe carries the foot
        return near[0], near[0], False
    ball = near[1] if len(near) > 1 and np.linalg.norm(rest[near[1]] - rest[near[0]]) > bone else near[0]
    return near[0], ball, ball != near[0]


def contact_point(subject: Subject, ankle: int | None, ball: int, flat: bool, level: float) -> np.ndarray:
    """The point [3] of the rest pose that stays on the ground in stance.

    Under the ball joint of a flat foot, else under the middle of the sole. level: height of the ground there.
    """
    rest = subject.raw.rest_position
    mesh = subject.raw.mesh
    if flat or mesh is None:
        return np.array([rest[ball, 0], level, rest[ball, 2]])
    own = np.isin(mesh.dominant, subject.below(ball))
    vertices = rest_vertices(subject.raw)[own]
    sole = vertices[vertices[:, 1] < vertices[:, 1].min() + 0.025 * subject.height]
    heel, toe = sole[:, 2].min(), sole[:, 2].max()
    center = (sole.min(0) + sole.max(0)) / 2
    ahead = toe - rest[ball, 2]
    # A sole that reaches far ahead of its joint is a whole foot: its ball lies two thirds along it.
    z = heel + 0.67 * (toe - heel) if ankle == ball and ahead > 0.6 * (toe - heel) else center[2]
    return np.array([center[0], level, z])


def _hip(subject: Subject, upper: list[int], contact: np.ndarray, ball: int, moves: list[RawClip]) -> tuple[int, str]:
    """The first joint that swings the leg: how far turning it moves the foot, against the most any joint does."""
    candidates = upper[:-1]
    if len(candidates) == 1 or not moves:
        return candidates[0], ""
    lever = np.array([np.linalg.norm(subject.raw.rest_position[j] - contact) for j in candidates])
    turn = np.array([_turn_range(subject, j, upper, ball, moves) for j in candidates])
    swing = lever * turn
    bone = np.linalg.norm(np.diff(subject.raw.rest_position[upper], axis=0), axis=1)
    # Short stubs between trunk and leg count if they swing it a good deal; a long bone unless it hardly moves.
    needed = np.where(bone > 0.15 * lever[0], 0.15, 0.5) * swing.max()
    first = int(np.argmax(swing >= np.minimum(needed, swing.max())))
    unsure = np.any((swing > 0.8 * needed) & (swing < 1.25 * needed))
    note = f"hip could also be another joint than '{subject.raw.names[candidates[first]]}'" if unsure else ""
    return candidates[first], note


def _turn_range(subject: Subject, joint: int, upper: list[int], ball: int, moves: list[RawClip]) -> float:
    """Range (rad) over which the bone below `joint` swings in the frame of the joint's parent."""
    after = upper[upper.index(joint) + 1] if joint != upper[-1] else ball
    parent = subject.parents[joint]
    widest = 0.0
    for clip in moves:
        bone = clip.position[:, after] - clip.position[:, joint]
        if parent >= 0:
            bone = rotate(conjugate(clip.rotation[:, parent]), bone)
        unit = bone / np.maximum(np.linalg.norm(bone, axis=1, keepdims=True), 1e-12)
        mean = unit.mean(0) / max(float(np.linalg.norm(unit.mean(0))), 1e-12)
        widest = max(widest, float(np.percentile(np.arccos(np.clip(unit @ mean, -1, 1)), 95)))
    return widest


def _knee(
    subject: Subject,
    hip: int,
    between: list[int],
    ankle: int | None,
    ball: int,
    contact: np.ndarray,
    moves: list[RawClip],
) -> tuple[int, str]:
    """The joint between hip and ankle with the largest bend, weighed by how evenly it divides the leg."""
    if len(between) == 1:
        return between[0], ""
    rest = subject.raw.rest_position
    end = rest[ankle] if ankle is not None else contact
    chain = [hip, *between]
    scores = []
    for k, joint in enumerate(between, start=1):
        first, second = np.linalg.norm(rest[joint] - rest[hip]), np.linalg.norm(rest[joint] - end)
        after = chain[k + 1] if k + 1 < len(chain) else ankle if ankle is not None else ball
        angles = [_bend(move.position, chain[k - 1], joint, after) for move in moves if after != joint]
        spread = max((float(np.ptp(a)) for a in angles), default=0.0)
        share = min(first, second) / max(first + second, 1e-12)
        scores.append((0.05 + spread) * share * min(1.0, share / 0.2) ** 2)  # a stub next to the hip reaches nowhere
    order = np.argsort(scores)[::-1]
    close = scores[order[1]] > 0.7 * scores[order[0]]
    note = ""
    if close:
        names = subject.raw.names
        note = f"knee '{names[between[order[0]]]}' bends hardly more than '{names[between[order[1]]]}'"
    return between[order[0]], note


def _bend(positions: np.ndarray, before: int, joint: int, after: int) -> np.ndarray:
    a = positions[:, before] - positions[:, joint]
    b = positions[:, after] - positions[:, joint]
    cosine = np.sum(a * b, 1) / np.maximum(np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1), 1e-12)
    return np.arccos(np.clip(cosine, -1, 1))
