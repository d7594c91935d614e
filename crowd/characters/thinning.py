"""Which joints a character keeps: those that move skin or that legs, arms and pelvis are made of; nothing else."""

from __future__ import annotations

import numpy as np

from crowd.characters.detect import Detection
from crowd.characters.limbs import topological


def kept_joints(found: Detection) -> tuple[list[int], tuple[int, ...]]:
    """Joints kept, parents first, and their parents among them; joint -1 is a root added above several."""
    subject = found.subject
    needed = {found.pelvis}
    for leg in found.legs:
        needed |= {leg.hip, leg.knee, leg.ball} | ({leg.ankle} if leg.ankle is not None else set())
    for arm in found.arms:
        needed |= {arm.shoulder, arm.elbow, arm.hand}
    mesh = subject.raw.mesh
    if mesh is not None:
        needed |= {int(j) for j in np.unique(mesh.joints[mesh.weights > 1e-6])}
    kept = _with_root(subject.parents, needed)
    order = [j for j in topological(subject.parents) if j in kept]
    if sum(not (set(subject.above(j)[1:]) & kept) for j in order) > 1:
        order = [-1, *order]
    number = {joint: k for k, joint in enumerate(order)}
    parents = []
    for joint in order:
        above = next((a for a in (subject.above(joint)[1:] if joint >= 0 else []) if a in kept), -1)
        parents.append(number.get(above, -1))
    parents[0] = -1
    return order, tuple(parents)


def _with_root(parents: tuple[int, ...], needed: set[int]) -> set[int]:
    """The needed joints and, if they have several tops, their lowest common joint where the file has one."""

    def above(joint: int) -> list[int]:
        chain = [joint]
        while parents[chain[-1]] >= 0:
            chain.append(parents[chain[-1]])
        return chain

    tops = [j for j in needed if not set(above(j)[1:]) & needed]
    if len(tops) < 2:
        return needed
    shared = set.intersection(*(set(above(j)) for j in tops))
    return needed | ({max(shared, key=lambda j: len(above(j)))} if shared else set())
