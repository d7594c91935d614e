"""What a character is before it meets JAX: plain NumPy, metres, y up, +z forward, +x the character's left.

The character frame `_c` has its origin on the ground under the hips of the rest pose. Joints are in topological order
(`parents[j] < j`, `parents[0] == -1`). Quaternions are wxyz, Hamilton, unit.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

ClipRole = Literal["idle", "walk", "run", "step", "other"]


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Joint tree and rest (neutral standing) pose."""

    names: tuple[str, ...]
    parents: tuple[int, ...]
    rest_rotation: np.ndarray  # [J, 4] wxyz, joint to parent
    rest_translation: np.ndarray  # [J, 3] m, in the parent's frame; joint 0: in the character frame

    @property
    def count(self) -> int:
        return len(self.names)


@dataclass(frozen=True, eq=False)
class Clip:
    """A motion sampled uniformly over its duration, in place (no net root translation).

    Sample f of a cyclic clip lies at f / F of the duration (the first sample is not repeated at the end), of another
    clip at f / (F - 1).
    """

    name: str
    role: ClipRole  # gaits faster than a walk (jog, trot, gallop) are "run", those not forward "step"
    duration: float  # s
    rotation: np.ndarray  # [F, J, 4] wxyz, joint to parent
    translation: np.ndarray  # [F, J, 3] m, in the parent's frame
    cyclic: bool = True
    speed: float | None = None  # m/s, along its way, where known (root motion removed, authored); None: measured


@dataclass(frozen=True)
class Leg:
    """hip -> knee -> ankle is what inverse kinematics bends; the foot is everything below the ankle.

    Bones between hip and knee or between knee and ankle (digitigrade, many-segment legs) keep the clip's pose.
    """

    name: str
    hip: int
    knee: int
    ankle: int
    ball: int  # joint that carries the contact point (toe base, hoof, or the ankle itself)
    ball_offset: tuple[float, float, float]  # m, contact point in the frame of joint `ball`; rests on the ground
    side: int  # +1 left (+x), -1 right, 0 middle


@dataclass(frozen=True)
class Arm:
    """shoulder (upper arm's joint) -> elbow -> hand (wrist)."""

    name: str
    shoulder: int
    elbow: int
    hand: int
    side: int


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with outward normals (counter-clockwise), skinned by linear blending."""

    vertices: np.ndarray  # [V, 3] m, bind pose, character frame
    triangles: np.ndarray  # [T, 3] int32
    joints: np.ndarray  # [V, 4] int32
    weights: np.ndarray  # [V, 4], rows sum to 1
    inverse_bind: np.ndarray  # [J, 4, 4] character frame (bind) to joint frame


@dataclass(frozen=True)
class Style:
    """A way of moving beside "normal": clips by name, and what each is in it (never "other")."""

    name: str
    clips: tuple[tuple[str, ClipRole], ...]  # at least one walk or run


@dataclass(frozen=True, eq=False)
class Archetype:
    """A species: its rig, its skin and its clips, normalised to the conventions above."""

    name: str
    skeleton: Skeleton
    mesh: Mesh
    legs: tuple[Leg, ...]  # any number; left before right, front before hind
    arms: tuple[Arm, ...]
    clips: tuple[Clip, ...]  # roles in style "normal", with at least one walk or run; "other": played when asked for
    pelvis: int  # joint between the hips; its translation is animated
    height: float  # m, standing
    mass: float  # kg
    source: str = "built-in"
    notes: tuple[str, ...] = field(default=())  # what the importer was unsure of, for the user
    styles: tuple[Style, ...] = ()  # beside "normal"
    also_backwards: tuple[str, ...] = ()  # clips that serve reversed, too, for going the other way


@dataclass(frozen=True, eq=False)
class WaterFrames:
    """Heights of a moving water surface at some moments; its grid lies in the world."""

    time: np.ndarray  # [t] s
    height: Any  # [t, rows, columns] m, above `surface`: an array, or one on disk that is read when indexed
    x: np.ndarray  # [columns] m
    z: np.ndarray  # [rows] m
    surface: float  # m, world, when still


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses of many characters of one archetype on the host. Leading shape `*b` is e.g. (time, character)."""

    position: np.ndarray  # [*b, 3] m, world, of the frame the skeleton hangs from
    orientation: np.ndarray  # [*b, 4] wxyz, character to world
    rotation: np.ndarray  # [*b, J, 4] wxyz, joint to parent
    translation: np.ndarray  # [*b, J, 3] m, in the parent's frame, unscaled
    scale: np.ndarray  # broadcastable to [*b]
