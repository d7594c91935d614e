"""What a character file says before anything is known about it: joints, motion, mesh in its own units and axes.

The readers (glTF, BVH) produce a `RawRig`; detection finds legs, arms, facing and gaits in it; normalisation makes
it an `Archetype`. Everything is global (file frame): the hierarchy's offsets, scales and conventions are already gone,
which is what lets joints be dropped, re-hung and added without touching the motion.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from crowd.characters.description import Axis


@dataclass(frozen=True, eq=False)
class RawClip:
    """A motion as uniform samples that include both ends: sample f lies at f / (F - 1) of the duration."""

    name: str
    duration: float  # s
    position: np.ndarray  # [F, J, 3] joint positions, file frame and units
    rotation: np.ndarray  # [F, J, 4] wxyz, joint to file frame
    speed: float | None = None  # file units per second, where known (root motion removed); None: measured

    @property
    def times(self) -> np.ndarray:
        """Sample times [F] in s."""
        return np.linspace(0.0, self.duration, len(self.position))


@dataclass(frozen=True, eq=False)
class RawMesh:
    """Triangles in a bind pose of the file frame; `inverse_bind` takes them to unscaled joint frames (file units)."""

    vertices: np.ndarray  # [V, 3]
    triangles: np.ndarray  # [T, 3] int
    joints: np.ndarray  # [V, 4] int
    weights: np.ndarray  # [V, 4], rows sum to 1
    inverse_bind: np.ndarray  # [J, 4, 4]

    @property
    def dominant(self) -> np.ndarray:
        """The joint that moves each vertex most [V]."""
        return np.take_along_axis(self.joints, np.argmax(self.weights, 1)[:, None], 1)[:, 0]


@dataclass(frozen=True, eq=False)
class RawRig:
    """Everything read from one file. Joints are in topological order; `parents[j] < j`, several roots (-1) allowed."""

    path: Path
    names: tuple[str, ...]  # unique
    parents: tuple[int, ...]
    rest_position: np.ndarray  # [J, 3] file frame and units
    rest_rotation: np.ndarray  # [J, 4] wxyz, joint to file frame
    clips: tuple[RawClip, ...]
    mesh: RawMesh | None  # None: skeleton only
    up: Axis | None = None  # axis the format prescribes ("+y" for glTF), None: unknown
    metres_per_unit: float | None = None  # what the format prescribes (glTF: 1), None: unknown
    notes: tuple[str, ...] = field(default=())

    @property
    def count(self) -> int:
        return len(self.names)
