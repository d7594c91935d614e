"""What is fixed when the program is compiled: topology, chosen components, capacities. Hashable, no arrays of state."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from crowd.tree import StaticArray
from kernels.drag import OffsetMode, Submersion
from kernels.stepping import Schedule
from kernels.terrain import Kind

Faces = Literal["along", "heading", "point", "track"]

TILE = 128  # characters per tile; see docs/architecture.md


@dataclass(frozen=True)
class HerdLayout:
    """One archetype in this run."""

    name: str
    parents: tuple[int, ...]
    hips: tuple[int, ...]  # joints of each leg, in the archetype's order
    knees: tuple[int, ...]
    ankles: tuple[int, ...]
    balls: tuple[int, ...]
    partners: tuple[int, ...]  # the leg on the other side of the same girdle; itself when there is none
    sides: tuple[int, ...]  # +1 left, -1 right, 0 middle
    shoulders: tuple[int, ...]
    elbows: tuple[int, ...]
    hands: tuple[int, ...]
    moving: tuple[int, ...]  # joints whose translation is animated
    gaits: int  # locomotion clips, slowest first; the idle clip follows them in the tables
    samples: int  # of every clip's table
    swing_samples: int
    triangles: StaticArray  # [T, 3]
    vertex_bones: StaticArray  # [V, influences]
    block_bones: StaticArray  # [blocks], for rigid drag
    waypoints: int
    loop: bool
    path: bool  # a curve to walk along
    closed: bool  # round and round
    track: bool  # trajectories to follow
    limits: bool  # of acceleration; otherwise what is asked for is commanded at once
    faces: Faces  # where characters look when no event says otherwise

    @property
    def joints(self) -> int:
        return len(self.parents)

    @property
    def legs(self) -> int:
        return len(self.hips)

    @property
    def arms(self) -> int:
        return len(self.shoulders)

    @cached_property
    def limb_segments(self) -> np.ndarray:
        """[J] segment that carries each joint after inverse kinematics, -1 for none.

        Segments: upper, lower, end of every leg, then of every arm, segment-major within legs and within arms.
        """
        segment = np.full(self.joints, -1)
        legs, arms = self.legs, self.arms
        starts = {}
        for i in range(legs):
            for part, joint in enumerate((self.hips[i], self.knees[i], self.ankles[i])):
                starts[joint] = part * legs + i
        for i in range(arms):
            for part, joint in enumerate((self.shoulders[i], self.elbows[i], self.hands[i])):
                starts[joint] = 3 * legs + part * arms + i
        for joint, parent in enumerate(self.parents):
            segment[joint] = starts.get(joint, segment[parent] if parent >= 0 else -1)
        return segment


@dataclass(frozen=True)
class Layout:
    """The whole program."""

    herds: tuple[HerdLayout, ...]
    dt: float  # s
    ground: Kind
    ground_shape: tuple[int, int]  # rows and columns of a grid, (1, 1) for profiles
    regions: int  # fluid regions; 0: the drag components are absent
    turns: int  # events that change the desired velocity
    footsteps: bool  # False: the clip plays, and skates
    schedule: Schedule
    mesh: Literal["skinned", "rigid"]
    submersion: Submersion
    offset_mode: OffsetMode
    arms_up: tuple[bool, ...]  # per herd
    forces: tuple[str, ...]  # names in crowd.components.forces.FORCES
    record_pose: bool
    record_every: int  # frames
    walls: bool  # False where kernels are better large (GPU)
