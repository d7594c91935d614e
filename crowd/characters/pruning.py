"""Joints of a motion-capture rig that a crowd does not need: fingers, faces, twist bones, roots on the ground.

A joint is dropped by where it is and how it moves, never by its name. Everything is global, so that dropping one
leaves all others where they were.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crowd.characters.raw_rig import RawClip, RawRig
from crowd.posing import conjugate, multiply, rotate

ALONGSIDE = 0.03  # of the height: a side branch this near to a bone is a twist joint of it
DIGITS = 0.125  # of the height: everything beyond a joint that is nearer than this is fingers, toes or a face
TIP = 0.04  # of the height: the end of a hand or foot that is worth a bone
STUB = 0.13  # of the height: a shorter branch beside longer ones carries nothing
STATIC = np.radians(1.0)


def pruned(raw: RawRig, height: float, feet: list[int]) -> tuple[RawRig, list[int]]:
    """The rig (y up, without mesh) without needless joints, and the joints of the input that remain.

    height: of the body in file units. feet: joints that come near the ground; they and what carries them are kept
    (but toes are gathered in the ball of the foot).
    """
    tree = _Tree(raw, height, set(feet))
    tree.drop_alongside()
    tree.gather_digits()
    tree.drop_stubs()
    tree.drop_static()
    tree.drop_ground_root()
    return tree.result()


class _Tree:
    """Parents being rewritten; -2 marks a dropped joint."""

    def __init__(self, raw: RawRig, height: float, feet: set[int]):
        self.raw, self.height, self.feet = raw, height, feet
        self.parents = list(raw.parents)
        clip = max(raw.clips, key=lambda c: len(c.position))
        self.clip = clip
        self.place = clip.position[len(clip.position) // 2]
        self.top = int(np.argmax(np.median(clip.position[..., 1], axis=0)))
        self.rigid: dict[int, int] = {}  # tip: the joint it is fixed to

    def children(self, joint: int) -> list[int]:
        return [k for k, parent in enumerate(self.parents) if parent == joint]

    def below(self, joint: int) -> list[int]:
        out = [joint]
        for item in out:
            out.extend(self.children(item))
        return out

    def above(self, joint: int) -> list[int]:
        out = [joint]
        while self.parents[out[-1]] >= 0:
            out.append(self.parents[out[-1]])
        return out

    def gap(self, a: int, b: int) -> float:
        return float(np.linalg.norm(self.place[a] - self.place[b]))

    def reach(self, joint: int) -> float:
        return max(self.gap(joint, k) for k in self.below(joint))

    def drop(self, joint: int) -> None:
        for item in self.below(joint):
            self.parents[item] = -2

    def drop_alongside(self) -> None:
        """Branches that lie along the bone to a sibling with more below it: twist and helper joints."""
        for joint in range(len(self.parents)):
            siblings = self.children(joint)
            for child in siblings:
                others = [s for s in siblings if s != child and self.parents[s] == joint]
                if any(self._along(child, joint, other) for other in others):
                    self.drop(child)

    def _along(self, branch: int, start: int, end: int) -> bool:
        mine = self.gap(start, branch) + self.reach(branch)
        theirs = self.gap(start, end) + self.reach(end)
        if theirs < mine or (theirs == mine and branch < end):
            return False
        axis = self.place[end] - self.place[start]
        for item in self.below(branch):
            share = np.clip((self.place[item] - self.place[start]) @ axis / max(axis @ axis, 1e-12), 0, 1)
            if np.linalg.norm(self.place[item] - self.place[start] - share * axis) > ALONGSIDE * self.height:
                return False
        return True

    def gather_digits(self) -> None:
        """Several short branches at the end of a limb become one rigid tip, the farthest of their ends."""
        for joint in range(len(self.parents)):
            if self.parents[joint] == -2 or len(self.children(joint)) < 2:
                continue
            below = self.below(joint)[1:]
            if self.reach(joint) > DIGITS * self.height:
                continue
            tip = max(below, key=lambda k: self.gap(joint, k))
            for child in self.children(joint):
                self.drop(child)
            if self.gap(joint, tip) > TIP * self.height and self.top not in (joint, *below):
                self.parents[tip] = joint
                self.rigid[tip] = joint
            if self.top in below:
                self.top = joint

    def drop_stubs(self) -> None:
        """Short branches of the trunk beside longer ones; never the one with the highest joint or a foot."""
        for joint in range(len(self.parents)):
            if self.parents[joint] == -2:
                continue
            children = self.children(joint)
            lengths = {child: self.gap(joint, child) + self.reach(child) for child in children}
            for child in children:
                needed = self.top in self.below(child) or self.feet & set(self.below(child))
                if lengths[child] < STUB * self.height and 2 * lengths[child] < max(lengths.values()) and not needed:
                    self.drop(child)

    def drop_static(self) -> None:
        """Joints that never turn against their parent and hardly change the course of the chain."""
        for joint in range(len(self.parents)):
            parent, children = self.parents[joint], self.children(joint)
            if parent < 0 or not children or self.gap(parent, joint) > 0.1 * self.height:
                continue
            zero = self.gap(parent, joint) < 0.003 * self.height
            if joint in self.feet and not zero:
                continue  # the ball of a foot matters even where it does not bend
            if (zero or len(children) == 1) and self._is_static(joint, parent) and self._on_course(joint):
                for child in children:
                    self.parents[child] = parent
                self.parents[joint] = -2

    def _is_static(self, joint: int, parent: int) -> bool:
        for clip in self.raw.clips:
            local = multiply(conjugate(clip.rotation[:, parent]), clip.rotation[:, joint])
            cosine = np.abs(np.sum(local * local[:1], -1)).min()
            if 2 * np.arccos(min(cosine, 1.0)) > STATIC:
                return False
        return True

    def _on_course(self, joint: int) -> bool:
        start = self.place[self.parents[joint]]
        for child in self.children(joint):
            axis = self.place[child] - start
            share = np.clip((self.place[joint] - start) @ axis / max(axis @ axis, 1e-12), 0, 1)
            if np.linalg.norm(self.place[joint] - start - share * axis) > 0.06 * self.height:
                return False
        return True

    def drop_ground_root(self) -> None:
        """A root below the body with a single child: it only carries the motion."""
        low = np.percentile(self.clip.position[..., 1].min(1), 5)
        for joint in range(len(self.parents)):
            children = self.children(joint)
            if self.parents[joint] != -1 or len(children) != 1:
                continue
            if np.median(self.clip.position[:, joint, 1]) - low < 0.2 * self.height and joint not in self.feet:
                self.parents[joint], self.parents[children[0]] = -2, -1

    def result(self) -> tuple[RawRig, list[int]]:
        keep = [joint for joint, parent in enumerate(self.parents) if parent != -2]
        number = {joint: k for k, joint in enumerate(keep)}
        parents = tuple(number.get(self.parents[joint], -1) for joint in keep)
        fixed = {number[tip]: (tip, joint) for tip, joint in self.rigid.items() if tip in number}
        clips = []
        for clip in self.raw.clips:
            position, rotation = clip.position[:, keep].copy(), clip.rotation[:, keep].copy()
            for k, (tip, joint) in fixed.items():
                offset = _mean_offset(self.clip, tip, joint)
                rotation[:, k] = clip.rotation[:, joint]
                position[:, k] = clip.position[:, joint] + rotate(clip.rotation[:, joint], offset)
            clips.append(RawClip(clip.name, clip.duration, position, rotation, clip.speed))
        rig = replace(
            self.raw,
            names=tuple(self.raw.names[joint] for joint in keep),
            parents=parents,
            rest_position=self.raw.rest_position[keep],
            rest_rotation=self.raw.rest_rotation[keep],
            clips=tuple(clips),
        )
        return rig, keep


def _mean_offset(clip: RawClip, tip: int, joint: int) -> np.ndarray:
    return rotate(conjugate(clip.rotation[:, joint]), clip.position[:, tip] - clip.position[:, joint]).mean(0)
