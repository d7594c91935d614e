"""A generated body bound to a skeleton without mesh, in a pose where its limbs do not touch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crowd.characters.body_mesh import for_skeleton
from crowd.characters.raw_rig import RawMesh, RawRig
from crowd.characters.subject import posed_vertices
from crowd.errors import fail
from crowd.posing import conjugate, multiply, rotate

LIMB = 0.25  # of the height: longer branches beside the trunk are limbs
ASIDE = np.radians(12.0)  # legs are spread until they point this far outwards
HANGING = np.radians(50.0)  # and hanging arms until they leave the vertical by this much


def with_body(raw: RawRig) -> RawRig:
    """The rig (y up) with a closed mesh round its bones, unchanged where it has one. Needs `metres_per_unit`.

    The rest pose may have its feet side by side, as in a stride; a skin made there would join the legs. The mesh is
    therefore made and bound with the limbs turned outwards. Raises InputError naming the file.
    """
    if raw.mesh is not None:
        return raw
    if raw.metres_per_unit is None:
        raise ValueError("the length unit must be known before a body is made")
    scale = raw.metres_per_unit
    position, rotation = spread(raw)
    try:
        mesh = for_skeleton(raw.names, raw.parents, position * scale, rotations=rotation)
    except ValueError as error:
        raise fail(raw.path.name, f"no body can be made round this skeleton: {error}") from None
    inverse_bind = mesh.inverse_bind.copy()
    inverse_bind[:, :3, 3] /= scale
    made = RawMesh(mesh.vertices / scale, mesh.triangles, mesh.joints, mesh.weights, inverse_bind)
    made = _soled(raw, _ends_merged(raw, made), position, rotation)
    return replace(raw, mesh=made, notes=(*raw.notes, "the file has no mesh; a body is made round the bones"))


def _ends_merged(raw: RawRig, mesh: RawMesh) -> RawMesh:
    """The mesh with the skin of joints that end a chain and never turn there given to the joint above them."""
    holder = np.arange(raw.count)
    for joint, parent in enumerate(raw.parents):
        if parent >= 0 and joint not in raw.parents and all(_rigid(clip.rotation, joint, parent) for clip in raw.clips):
            holder[joint] = parent
    return replace(mesh, joints=holder[mesh.joints])


def _rigid(rotation: np.ndarray, joint: int, parent: int) -> bool:
    local = multiply(conjugate(rotation[:, parent]), rotation[:, joint])
    return bool(np.abs(np.sum(local * local[:1], -1)).min() > 1.0 - 1e-6)


def _soled(raw: RawRig, mesh: RawMesh, position: np.ndarray, rotation: np.ndarray) -> RawMesh:
    """The mesh with a vertex drawn to the sole of every foot whose skin ends above the others'.

    Simplification rounds off the tips of thin legs, each differently; on uneven soles only some legs would stand.
    """
    rest, height = raw.rest_position, float(np.ptp(raw.rest_position[:, 1]))
    level = rest[:, 1].min() + 0.05 * height
    tips = [j for j in range(raw.count) if j not in raw.parents and rest[j, 1] < level]
    skin = posed_vertices(mesh, raw.rest_rotation, rest)
    around = [np.linalg.norm((skin - rest[tip])[:, [0, 2]], axis=1) < 0.06 * height for tip in tips]
    lowest = np.array([skin[near, 1].min() if near.any() else np.inf for near in around])
    if not len(tips) or not np.isfinite(lowest).any():
        return mesh
    sole = max(float(lowest.min()), float(rest[tips, 1].min()) - 0.04 * height)
    vertices, joints, weights = mesh.vertices.copy(), mesh.joints.copy(), mesh.weights.copy()
    for tip, low in zip(tips, lowest, strict=True):
        if low < sole + 0.01 * height:
            continue
        turn = multiply(rotation[tip], conjugate(raw.rest_rotation[tip]))
        goal = position[tip] + rotate(turn, np.array([0.0, sole - rest[tip, 1], 0.0]))
        vertex = int(np.argmin(np.linalg.norm(vertices - goal, axis=1)))
        vertices[vertex] = goal
        joints[vertex], weights[vertex] = [max(raw.parents[tip], 0), 0, 0, 0], [1.0, 0.0, 0.0, 0.0]
    return replace(mesh, vertices=vertices, joints=joints, weights=weights)


def spread(raw: RawRig) -> tuple[np.ndarray, np.ndarray]:
    """The rest pose with legs and arms turned outwards where they hang close to the body: position [J, 3], rotation."""
    position, rotation = raw.rest_position.copy(), raw.rest_rotation.copy()
    below = [[j] for j in range(raw.count)]
    for joint in reversed(range(raw.count)):
        if raw.parents[joint] >= 0:
            below[raw.parents[joint]].extend(below[joint])
    height = float(np.ptp(position[:, 1]))
    ground = float(position[:, 1].min())
    for start in _limbs(raw, below, height):
        items = below[start]
        tip = max(items, key=lambda j: float(np.linalg.norm(position[j] - position[start])))
        is_leg = min(position[j, 1] for j in items) < ground + 0.15 * height
        pivot, bone = position[start].copy(), position[tip] - position[start]
        others = [j for j in range(raw.count) if raw.parents[j] == raw.parents[start] and j != start]
        outward = (pivot - position[[raw.parents[start], *others]].mean(0)) * np.array([1.0, 0.0, 1.0])
        if np.linalg.norm(outward) < 0.005 * height:
            continue
        outward = outward / np.linalg.norm(outward)
        now = np.arctan2(bone @ outward, -bone[1])  # 0 hanging, positive outwards
        turn = (ASIDE if is_leg else HANGING) - now
        if turn <= 0:
            continue
        axis = np.cross(np.array([0.0, -1.0, 0.0]), outward)
        q = np.array([np.cos(turn / 2), *(np.sin(turn / 2) * axis)])
        position[items] = pivot + rotate(q, position[items] - pivot)
        rotation[items] = multiply(q, rotation[items])
    return position, rotation


def _limbs(raw: RawRig, below: list[list[int]], height: float) -> list[int]:
    """First joints of the long chains that leave the trunk, away from its middle."""
    reach = [
        max(float(np.linalg.norm(raw.rest_position[k] - raw.rest_position[j])) for k in below[j])
        for j in range(raw.count)
    ]
    starts = []
    for joint, parent in enumerate(raw.parents):
        if parent < 0 or reach[joint] < LIMB * height:
            continue
        if any(_branches(raw, item, reach, height) for item in below[joint]):
            continue  # still trunk
        above = parent
        if any(start in _ancestors(raw, joint) for start in starts):
            continue
        beside = [j for j, p in enumerate(raw.parents) if p == above and j != joint and reach[j] > 0.5 * reach[joint]]
        if beside:
            starts.append(joint)
    return [_first_swinging(raw, start, reach, height) for start in starts]


def _branches(raw: RawRig, joint: int, reach: list[float], height: float) -> bool:
    long = [j for j, p in enumerate(raw.parents) if p == joint and reach[j] > 0.5 * LIMB * height]
    return len(long) > 1


def _ancestors(raw: RawRig, joint: int) -> list[int]:
    out = [joint]
    while raw.parents[out[-1]] >= 0:
        out.append(raw.parents[out[-1]])
    return out


def _first_swinging(raw: RawRig, start: int, reach: list[float], height: float) -> int:
    """The shoulder rather than the collar bone: skips short first bones."""
    children = [j for j, p in enumerate(raw.parents) if p == start]
    if len(children) != 1 or reach[children[0]] <= LIMB * height:
        return start
    first_bone = np.linalg.norm(raw.rest_position[children[0]] - raw.rest_position[start])
    return children[0] if first_bone < 0.12 * height else start
