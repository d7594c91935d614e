"""A body round any skeleton: one closed skin per character, a few hundred triangles, skinned with smooth weights.

Chosen: the zero level of a smooth union of tapered capsules (surface nets on a fine grid), then simplified by quadric
error. A union has no faces inside the body: where limbs join the trunk separate tubes would leave caps, and fluid drag
would count their area. One function serves people, animals, insects and motion-capture skeletons. Rejected: rings
stitched along the bones (fewer steps, but joints with many or very short bones, as in capture rigs, break it).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crowd.characters.simplification import simplify
from crowd.characters.surface import Part, make_well_composed, sample, smooth_union, surface_nets
from crowd.posing import conjugate, matrix
from crowd.types import Mesh

_IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def for_skeleton(
    names: Sequence[str],
    parents: Sequence[int],
    positions: np.ndarray,
    radii: np.ndarray | None = None,
    rotations: np.ndarray | None = None,
    triangles: int = 800,
    cells: int = 72,
) -> Mesh:
    """A mesh for bones given by the joints alone.

    positions: [J, 3] m, bind pose, character frame. rotations: [J, 4] joint to character in it; None: identity.
    radii: [J] m of the body at each joint; None: `guess_radii`. triangles: budget. cells: grid cells along the longest
    side; a radius below 0.9 cells is raised to it, so fingers closer than that merge. A joint without children is a
    sphere, and a skeleton of one joint therefore a ball. Raises ValueError for non-finite positions or no joints.
    """
    positions = np.asarray(positions, float)
    if len(names) == 0 or not np.isfinite(positions).all():
        raise ValueError(f"a body needs joints at finite positions; got {len(names)} joints")
    radii = guess_radii(parents, positions) if radii is None else np.asarray(radii, float)
    extent = float(np.max(np.ptp(positions, axis=0))) + 2.0 * float(radii.max())
    cell = extent / cells
    radii = np.maximum(radii, 0.9 * cell)
    parts = []
    trunk, stretch = _breadth(parents, positions)
    for joint, parent in enumerate(parents):
        if parent >= 0 and not np.allclose(positions[joint], positions[parent]):
            ends = (tuple(positions[parent]), tuple(positions[joint]))
            widest = radii[joint] * 1.6 + 0.02 * extent  # a bone from a wide trunk to a limb starts inside the trunk
            bone = np.abs(positions[joint] - positions[parent])
            upright = trunk[parent] and trunk[joint] and bone[1] > 2.0 * max(bone[0], bone[2])
            thick = (min(float(radii[parent]), widest), float(radii[joint]))
            parts.append(Part(parent, *ends, thick, stretch if upright else (1.0, 1.0, 1.0)))
    for joint in sorted(set(range(len(names))) - set(parents)):
        parts.append(
            Part(joint, tuple(positions[joint]), tuple(positions[joint]), (float(radii[joint]), float(radii[joint])))
        )
    return from_parts(parts, parents, positions, rotations, triangles, cell, blend=0.6 * cell)


def from_parts(
    parts: Sequence[Part],
    parents: Sequence[int],
    positions: np.ndarray,
    rotations: np.ndarray | None = None,
    triangles: int = 800,
    cell: float = 0.02,
    blend: float = 0.012,
) -> Mesh:
    """A mesh for explicit parts (bind pose, character frame).

    cell: grid spacing, m, no coarser than the thinnest radius. blend: rounding of creases, m; parts closer than about
    that merge. Parts that do not touch give several closed components.
    """
    field, origin = sample(parts, cell, blend)
    vertices, faces = surface_nets(make_well_composed(field, cell), origin, cell)
    vertices, faces = simplify(vertices, faces, _dense_weights(parts, parents, vertices), triangles)
    vertices = _relaxed(vertices, faces, parts, cell, blend)
    return skinned(vertices, faces, parts, parents, np.asarray(positions, float), rotations)


def _relaxed(
    vertices: np.ndarray, faces: np.ndarray, parts: Sequence[Part], cell: float, blend: float, rounds: int = 3
) -> np.ndarray:
    """Vertices moved along the surface towards the middle of their neighbours, and back onto it: evener triangles."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    count = np.bincount(pairs[:, 0], minlength=len(vertices))[:, None]
    for _ in range(rounds):
        middle = np.zeros_like(vertices)
        np.add.at(middle, pairs[:, 0], vertices[pairs[:, 1]])
        normal, _ = _field_at(vertices, parts, cell, blend)
        step = 0.5 * (middle / count - vertices)
        vertices = vertices + step - np.sum(step * normal, 1, keepdims=True) * normal
        for _ in range(2):
            normal, offset = _field_at(vertices, parts, cell, blend)
            vertices = vertices - np.clip(offset, -cell, cell)[:, None] * normal
    return vertices


def _field_at(points: np.ndarray, parts: Sequence[Part], cell: float, blend: float) -> tuple[np.ndarray, np.ndarray]:
    """Unit normal [V, 3] and distance [V] of the smooth union at points, by central differences."""
    h = 0.05 * cell
    shifts = h * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    value = smooth_union(parts, points + shifts[:, None], blend)
    slope = (value[1:4] - value[4:7]).T / (2.0 * h)
    size = np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9)
    return slope / size, value[0] / size[:, 0]


def skinned(
    vertices: np.ndarray,
    faces: np.ndarray,
    parts: Sequence[Part],
    parents: Sequence[int],
    positions: np.ndarray,
    rotations: np.ndarray | None = None,
    mirror: Sequence[int] | None = None,
) -> Mesh:
    """Weights from the parts for a surface (bind pose); with mirror, for its half x >= 0, which is then completed."""
    dense = _dense_weights(parts, parents, vertices)
    if mirror is not None:
        vertices, faces, dense = _mirrored(vertices, faces, dense, np.asarray(mirror))
    joints, weights = _four_largest(dense)
    rotations = np.tile(_IDENTITY, (len(positions), 1)) if rotations is None else np.asarray(rotations, float)
    return Mesh(vertices, faces.astype(np.int32), joints, weights, inverse_bind_of(rotations, positions))


def inverse_bind_of(rotations: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """[J, 4, 4] character frame to joint frame, of joints at positions [J, 3] turned by rotations [J, 4]."""
    out = np.tile(np.eye(4), (len(positions), 1, 1))
    out[:, :3, :3] = matrix(conjugate(rotations))
    out[:, :3, 3] = -np.einsum("jrc,jc->jr", out[:, :3, :3], positions)
    return out


def guess_radii(parents: Sequence[int], positions: np.ndarray) -> np.ndarray:
    """Radius of the body at each joint, m, from the tree alone.

    A limb is as thick as what it carries: 0.08 m per metre of chain beyond the joint to the power 0.7, scaled to the
    size of the body (fits hip 0.085, knee 0.06, wrist 0.025, finger 0.01 m of a person of 1.7 m). Joints that carry
    several large limbs are trunk and reach out to where these begin. The highest joint, if a trunk's end, is the head.
    """
    positions = np.asarray(positions, float)
    count = len(parents)
    size = float(np.max(np.ptp(positions, axis=0))) if count > 1 else 1.0
    size = size if size > 0.0 else 1.0
    chain = _chain_lengths(parents, positions)
    children = [[k for k in range(count) if parents[k] == j] for j in range(count)]
    unit = size / 1.7
    radii = 0.08 * unit * (np.maximum(chain / unit, 0.03)) ** 0.7
    trunk = _trunk(parents, positions, chain)
    for joint in np.flatnonzero(trunk).tolist():
        limbs = [k for k in children[joint] if not trunk[k]]
        reach = max((_bone(positions, k, joint) for k in limbs if chain[k] > 0.2 * size), default=0.0)
        radii[joint] = np.clip(0.7 * reach, 0.06 * size, 0.07 * size)
    top = int(np.argmax(positions[:, 1]))
    if not trunk[top] and chain[top] < 1e-9 and parents[top] >= 0:
        radii[top] = max(radii[top], 0.045 * size)
        radii[parents[top]] = max(radii[parents[top]], 0.04 * size)
    return radii


def _trunk(parents: Sequence[int], positions: np.ndarray, chain: np.ndarray) -> np.ndarray:
    """[J] whether a joint carries at least two large limbs, by itself or further out."""
    size = float(np.max(np.ptp(positions, axis=0)))
    trunk = np.zeros(len(parents), bool)
    for joint in reversed(range(len(parents))):
        children = [k for k in range(len(parents)) if parents[k] == joint]
        large = sum(chain[k] + _bone(positions, k, joint) > 0.25 * size for k in children)
        trunk[joint] = large >= 2 or any(trunk[k] for k in children)
    return trunk


def _breadth(parents: Sequence[int], positions: np.ndarray) -> tuple[np.ndarray, tuple[float, float, float]]:
    """[J] trunk joints and the stretch of an upright trunk: wider than deep, along the line between its limbs."""
    chain = _chain_lengths(parents, positions)
    trunk = _trunk(parents, positions, chain)
    size = float(np.max(np.ptp(positions, axis=0))) if len(parents) > 1 else 1.0
    starts = [j for j, p in enumerate(parents) if p >= 0 and trunk[p] and not trunk[j] and chain[j] > 0.2 * size]
    if len(starts) < 2:
        return trunk, (1.0, 1.0, 1.0)
    x, _, z = np.std(positions[starts], axis=0)
    if max(x, z) < 1.5 * min(x, z):
        return trunk, (1.0, 1.0, 1.0)
    return trunk, (1.25, 1.0, 0.92) if x > z else (0.92, 1.0, 1.25)


def _bone(positions: np.ndarray, joint: int, parent: int) -> float:
    return float(np.linalg.norm(positions[joint] - positions[parent]))


def _chain_lengths(parents: Sequence[int], positions: np.ndarray) -> np.ndarray:
    """Length of the longest chain of bones below each joint, m."""
    chain = np.zeros(len(parents))
    for joint in reversed(range(len(parents))):
        parent = parents[joint]
        if parent >= 0:
            chain[parent] = max(chain[parent], chain[joint] + _bone(positions, joint, parent))
    return chain


def _dense_weights(parts: Sequence[Part], parents: Sequence[int], points: np.ndarray) -> np.ndarray:
    """[V, J] weights: the joint of the nearest part, blended with its parent and children over about a radius.

    Only neighbours in the tree take part: the inner side of one thigh is near the other, but must not follow it.
    """
    count = len(parents)
    offsets = np.full((count, len(points)), np.inf)
    width = np.ones((count, len(points)))
    for part in parts:
        from_part = _beyond(part, points)
        nearer = from_part < offsets[part.joint]
        offsets[part.joint] = np.where(nearer, from_part, offsets[part.joint])
        width[part.joint] = np.where(nearer, 0.18 * (part.radii[0] + part.radii[1]) * 0.5, width[part.joint])
    owner = np.argmin(offsets, 0)
    linked = np.eye(count, dtype=bool)
    for joint in range(count):
        above = _carrying_parent(joint, parents, offsets)
        if above >= 0:
            linked[joint, above] = linked[above, joint] = True
    best = np.take_along_axis(offsets, owner[None], 0)[0]
    reach = np.take_along_axis(width, owner[None], 0)[0]
    score = np.exp(-np.clip((offsets - best) / reach, 0.0, 60.0)) * linked[owner].T
    score[~np.isfinite(offsets)] = 0.0
    score = np.where(score < 0.01, 0.0, score)
    return (score / score.sum(0)).T


def _carrying_parent(joint: int, parents: Sequence[int], offsets: np.ndarray) -> int:
    """The nearest ancestor that has flesh of its own."""
    above = parents[joint]
    while above >= 0 and not np.isfinite(offsets[above, 0]):
        above = parents[above]
    return above


def _beyond(part: Part, points: np.ndarray) -> np.ndarray:
    """Distance outside a part, with its stretch undone: ordering of parts, not a length."""
    start, axis = np.asarray(part.start), np.subtract(part.end, part.start)
    length2 = float(axis @ axis)
    along = np.clip((points - start) @ axis / length2, 0.0, 1.0) if length2 > 0.0 else np.zeros(len(points))
    across = (points - start - along[:, None] * axis) / np.asarray(part.stretch)
    return np.linalg.norm(across, axis=1) - (part.radii[0] + along * (part.radii[1] - part.radii[0]))


def _mirrored(
    vertices: np.ndarray, faces: np.ndarray, dense: np.ndarray, mirror: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Both halves, welded along x = 0."""
    middle = vertices[:, 0] == 0.0
    dense = np.where(middle[:, None], 0.5 * (dense + dense[:, mirror]), dense)
    other = np.where(middle, np.arange(len(vertices)), 0)
    other[~middle] = len(vertices) + np.arange((~middle).sum())
    reflected = vertices[~middle] * np.array([-1.0, 1.0, 1.0])
    return (
        np.concatenate([vertices, reflected]),
        np.concatenate([faces, other[faces][:, ::-1]]),
        np.concatenate([dense, dense[~middle][:, mirror]]),
    )


def _four_largest(dense: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    slots = min(4, dense.shape[1])
    order = np.argsort(-dense, axis=1, kind="stable")[:, :slots]
    weights = np.take_along_axis(dense, order, 1)
    weights = weights / weights.sum(1, keepdims=True)
    joints = np.where(weights > 0.0, order, 0)
    pad = ((0, 0), (0, 4 - slots))
    return np.pad(joints, pad).astype(np.int32), np.pad(weights, pad)
