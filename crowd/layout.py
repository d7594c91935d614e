"""What is fixed when the program is compiled: topology, chosen components, capacities. Hashable, no arrays of state."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from crowd.tree import StaticArray
from kernels.drag import OffsetMode, Submersion
from kernels.stepping import Schedule
from kernels.terrain import Kind

Gait = Literal["semi_procedural", "footsteps", "clip"]
Faces = Literal["along", "heading", "point", "track"]

TILE = 128  # characters per tile on a CPU; see docs/architecture.md
SMALL_TILE = 64  # of herds that would leave half of a tile empty; in narrower ones sums are added in another order
WIDE = 0  # instead of a width: as many whole times TILE as hold a device's share of the herd


def tile_width(count: int) -> int:
    """Characters per tile on a CPU for a herd of `count`."""
    return SMALL_TILE if count <= SMALL_TILE else TILE


@dataclass(frozen=True)
class Motion:
    """An analysed motion of a herd."""

    name: str
    style: int  # number of its group
    walks: bool  # a walk cycle; otherwise grounded


@dataclass(frozen=True)
class Pace:
    """How a herd is stepped that is not stepped every frame; see `crowd.pace`."""

    every: int  # frames
    far: bool  # only tiles that are far
    calm: bool  # only tiles that are calm


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
    gaits: int  # locomotion clips, slowest first; the idle clip follows them in the tables (footsteps)
    motions: tuple[Motion, ...]  # semi-procedural: analysed motions, in the order of the tables
    extras: tuple[bool, ...]  # other clips, after them in the tables; whether each is cyclic
    chain: tuple[tuple[int, ...], ...]  # joints of each leg that are bent, from hip to ankle, all of one length
    flight_samples: int
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
    responses: tuple[str, ...] = ()  # fields of `crowd.params.Responses` that this herd has
    near: tuple[tuple[int, int], ...] = ()  # legs that give way and those they give way to, with `clearance`
    mesh: Literal["skinned", "rigid"] | None = None  # None: as the layout says
    pace: Pace | None = None  # None: stepped every frame

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

        Segments: every bone of the chain and the foot of each leg, then of each arm, segment-major in both.
        """
        segment = np.full(self.joints, -1)
        legs, arms, parts = self.legs, self.arms, len(self.chain[0]) if self.chain else 0
        starts = {}
        for i, chain in enumerate(self.chain):
            starts |= {joint: part * legs + i for part, joint in enumerate(chain)}
        for i in range(arms):
            for part, joint in enumerate((self.shoulders[i], self.elbows[i], self.hands[i])):
                starts[joint] = parts * legs + part * arms + i
        for joint, parent in enumerate(self.parents):
            segment[joint] = starts.get(joint, segment[parent] if parent >= 0 else -1)
        return segment


@dataclass(frozen=True)
class GroundLayout:
    """One level of the ground."""

    kind: Kind
    shape: tuple[int, int] = (1, 1)  # rows and columns of a grid
    post: tuple[int, int] = (0, 0)  # row and column that the grid's origin is at
    gaps: bool = False  # cells across a jump, and all places off the grid, are no ground
    bounded: bool = False  # covers a rectangle only


@dataclass(frozen=True)
class FluidLayout:
    """What fluid has beyond a level surface and a constant flow; parts that are 0 or False are not in the program."""

    waves: int = 0  # components, of all regions
    layers: int = 0  # below the top fluid, of the region with most
    rivers: bool = False
    modes: int = 0  # of turbulence, of all regions
    buoyancy: bool = False  # the weight on the feet is recorded
    tension: tuple[bool, ...] = ()  # per herd: small enough for surface tension to matter

    @property
    def moving(self) -> bool:
        """Whether surface or flow differ within a body, or with time."""
        return bool(self.waves or self.rivers or self.modes)


@dataclass(frozen=True)
class WaterLayout:
    """A water surface that the crowd moves."""

    shape: tuple[int, int]  # rows and columns
    feedback: bool  # characters feel it
    counts: tuple[int, ...]  # characters of each herd: padding makes no waves


@dataclass(frozen=True)
class Layout:
    """The whole program."""

    herds: tuple[HerdLayout, ...]
    dt: Any  # s, of a step; in one of several frames (`crowd.pace`) an Array
    ground: tuple[GroundLayout, ...]  # the first one is everywhere
    regions: int  # fluid regions; 0: the drag components are absent
    turns: int  # events that change the desired velocity
    gait: Gait
    bands: Literal["polar", "cartesian"]  # semi-procedural: how motions are weighted
    compat: bool  # semi-procedural: the original's defects too
    schedule: Schedule
    mesh: Literal["skinned", "rigid"]
    submersion: Submersion
    offset_mode: OffsetMode
    arms_up: tuple[bool, ...]  # per herd
    forces: tuple[str, ...]  # names in crowd.components.forces.FORCES
    record_pose: bool
    record_every: int  # frames
    walls: bool  # False where kernels are better large (GPU)
    fluid: FluidLayout = FluidLayout()
    water: WaterLayout | None = None  # None: surfaces stay level
    as_functions: bool = True  # with walls: a tile's step is one compiled function; False: kernels, as a profiler wants
    tick: float = 0.0  # s, of a frame, where a step takes more than one (`crowd.pace`); 0: each takes one

    @property
    def frame_s(self) -> float:
        """Length of a frame."""
        return self.tick or self.dt

    def of(self, which: int) -> Layout:
        """The layout as herd number `which` sees it: with what that herd has of its own."""
        own = self.herds[which].mesh
        return self if own is None else replace(self, mesh=own)
