"""A raw rig made ready for detection: y up (and +z forward once known), with the lowest skin point of every joint."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from crowd.characters.raw_rig import RawClip, RawMesh, RawRig
from crowd.posing import matrix, multiply, quaternion

_DIRECTIONS = np.array(
    [[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)], float
)


def shifted(raw: RawRig, offset: np.ndarray) -> RawRig:
    """The rig with everything moved by `offset` [3]."""
    clips = tuple(replace(clip, position=clip.position + offset) for clip in raw.clips)
    mesh = raw.mesh
    if mesh is not None:
        back = np.eye(4)
        back[:3, 3] = -offset
        mesh = replace(mesh, vertices=mesh.vertices + offset, inverse_bind=mesh.inverse_bind @ back)
    return replace(raw, rest_position=raw.rest_position + offset, clips=clips, mesh=mesh)


def turned(raw: RawRig, rotation: np.ndarray) -> RawRig:
    """The rig with its file frame turned by a rotation matrix [3, 3]."""
    q = quaternion(rotation)
    clips = tuple(
        RawClip(c.name, c.duration, c.position @ rotation.T, multiply(q, c.rotation), c.speed) for c in raw.clips
    )
    mesh = raw.mesh
    if mesh is not None:
        back = np.eye(4)
        back[:3, :3] = rotation.T
        mesh = replace(mesh, vertices=mesh.vertices @ rotation.T, inverse_bind=mesh.inverse_bind @ back)
    return replace(
        raw,
        rest_position=raw.rest_position @ rotation.T,
        rest_rotation=multiply(q, raw.rest_rotation),
        clips=clips,
        mesh=mesh,
    )


@dataclass(frozen=True, eq=False)
class Subject:
    """A rig with y up whose detached parts hang where they belong (`parents` may differ from the file's)."""

    raw: RawRig
    parents: tuple[int, ...]
    carries: np.ndarray  # [J] joints that move skin (skeleton only: every joint)
    points: np.ndarray  # [J, P, 3] extreme skin points in the joint's frame (joints without skin: the joint itself)
    height: float  # of the rest pose, file units
    ground: float  # lowest level of the rest pose

    @property
    def children(self) -> list[list[int]]:
        out: list[list[int]] = [[] for _ in self.parents]
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                out[parent].append(joint)
        return out

    def above(self, joint: int) -> list[int]:
        """The joint and everything above it, root last."""
        chain = [joint]
        while self.parents[chain[-1]] >= 0:
            chain.append(self.parents[chain[-1]])
        return chain

    def below(self, joint: int) -> list[int]:
        """The joint and everything that hangs from it."""
        children, out = self.children, [joint]
        for item in out:
            out.extend(children[item])
        return out

    def lowest(self, rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
        """Height of each joint's lowest skin point [..., J]."""
        down = matrix(rotation)[..., 1, :]
        return position[..., 1] + np.einsum("...jc,jpc->...jp", down, self.points).min(-1)

    @property
    def rest_lowest(self) -> np.ndarray:
        """Height of each joint's lowest skin point in the rest pose [J]."""
        return self.lowest(self.raw.rest_rotation, self.raw.rest_position)


def prepare(raw: RawRig) -> Subject:
    """Skin points and size of a rig that is already y up. The file's parents are kept."""
    points, carries = _skin_points(raw)
    subject = Subject(raw, raw.parents, carries, points, 1.0, 0.0)
    low = subject.rest_lowest[carries]
    top = rest_vertices(raw)[:, 1].max() if raw.mesh is not None else raw.rest_position[:, 1].max()
    return replace(subject, height=max(float(top - low.min()), 1e-9), ground=float(low.min()))


def rest_vertices(raw: RawRig) -> np.ndarray:
    """Skinned vertices [V, 3] of the rest pose (joint positions where there is no mesh)."""
    if raw.mesh is None:
        return raw.rest_position
    return posed_vertices(raw.mesh, raw.rest_rotation, raw.rest_position)


def posed_vertices(mesh: RawMesh, rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Skinned vertices [V, 3] for joint rotations [J, 4] and positions [J, 3]."""
    homogeneous = np.concatenate([mesh.vertices, np.ones((len(mesh.vertices), 1))], 1)
    local = np.einsum("vkrc,vc->vkr", mesh.inverse_bind[mesh.joints][:, :, :3], homogeneous)
    placed = np.einsum("vkrc,vkc->vkr", matrix(rotation)[mesh.joints], local) + position[mesh.joints]
    return np.einsum("vk,vkr->vr", mesh.weights, placed)


def _skin_points(raw: RawRig) -> tuple[np.ndarray, np.ndarray]:
    points = np.zeros((raw.count, len(_DIRECTIONS), 3))
    if raw.mesh is None:
        return points, np.ones(raw.count, bool)
    carries = np.zeros(raw.count, bool)
    homogeneous = np.concatenate([raw.mesh.vertices, np.ones((len(raw.mesh.vertices), 1))], 1)
    dominant = raw.mesh.dominant
    turns = matrix(raw.rest_rotation)
    for joint in np.unique(dominant):
        local = homogeneous[dominant == joint] @ raw.mesh.inverse_bind[joint][:3].T
        extreme = np.argmax((local @ turns[joint].T) @ _DIRECTIONS.T, axis=0)
        points[joint] = local[extreme]
        carries[joint] = True
    return points, carries
