"""Skeletons with a left and a right side from tables of the middle and of the left: names, parents, places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from crowd.characters.gait_clips import LegJoints
from crowd.types import Leg, Skeleton

SIDES = (("left", 1.0), ("right", -1.0))  # name and sign of x
Table = Mapping[str, tuple[str, tuple[float, float, float]]]  # joint: (parent, place in m, character frame)


def two_sided(centre: Table, left: Table) -> Skeleton:
    """All frames parallel to the character's; joints of the sides are called left_<name> and right_<name>.

    The first joint of `centre` is the root and has the parent "". Parents come before their children.
    """
    rows = [(name, above, place) for name, (above, place) in centre.items()]
    for side, sign in SIDES:
        for name, (above, (x, y, z)) in left.items():
            rows.append((f"{side}_{name}", above if above in centre else f"{side}_{above}", (sign * x, y, z)))
    names = [row[0] for row in rows]
    parents = [names.index(row[1]) if row[1] else -1 for row in rows]
    places = np.array([row[2] for row in rows])
    offsets = places - np.where(np.array(parents)[:, None] >= 0, places[parents], 0.0)
    return Skeleton(tuple(names), tuple(parents), np.tile([1.0, 0, 0, 0], (len(names), 1)), offsets)


def other_side(names: Sequence[str]) -> list[int]:
    """[J] the joint on the other side; joints of the middle are their own."""
    swap = {"left": "right", "right": "left"}
    out = []
    for name in names:
        head, _, tail = name.partition("_")
        out.append(names.index(f"{swap[head]}_{tail}" if head in swap else name))
    return out


def leg_joints(side: str, names: Sequence[str], contact_height: float, pole: Sequence[float]) -> LegJoints:
    """The leg whose hip, knee, ankle and ball have these names; contact_height: of the ball's joint standing, m."""
    hip, knee, ankle, ball = (f"{side}_{name}" for name in names)
    return LegJoints(hip, knee, ankle, ball, np.array([0.0, -contact_height, 0.0]), np.asarray(pole, float))


def leg(skeleton: Skeleton, name: str, side: int, names: Sequence[str], contact_height: float) -> Leg:
    """The same leg as an archetype describes it."""
    prefix = "left" if side > 0 else "right"
    hip, knee, ankle, ball = (skeleton.names.index(f"{prefix}_{joint}") for joint in names)
    return Leg(name, hip, knee, ankle, ball, (0.0, -contact_height, 0.0), side)
