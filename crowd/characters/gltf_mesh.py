"""Meshes of a glTF file merged into one skinned mesh: several skins and primitives, rigid and un-indexed parts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from crowd.characters.glb import Document, objects
from crowd.characters.gltf_nodes import NodeTree
from crowd.characters.raw_rig import RawMesh
from crowd.errors import fail
from crowd.posing import matrix

MAX_TRIANGLES = 2_000_000
MAX_JOINTS = 1024


@dataclass
class _Merged:
    """Parts collected so far, in node indices; `inverse_bind` grows with the joints met."""

    inverse_bind: dict[int, np.ndarray] = field(default_factory=dict)
    vertices: list[np.ndarray] = field(default_factory=list)
    triangles: list[np.ndarray] = field(default_factory=list)
    joints: list[np.ndarray] = field(default_factory=list)
    weights: list[np.ndarray] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    count: int = 0

    def add(self, vertices: np.ndarray, triangles: np.ndarray, joints: np.ndarray, weights: np.ndarray) -> None:
        self.vertices.append(vertices)
        self.triangles.append(triangles + self.count)
        self.joints.append(joints)
        self.weights.append(weights)
        self.count += len(vertices)


@dataclass(frozen=True, eq=False)
class _Rest:
    """Global transforms of all nodes at rest."""

    linear: np.ndarray  # [N, 3, 3]
    rigid: np.ndarray  # [N, 4, 4] rotation and position alone
    full: np.ndarray  # [N, 4, 4]


def _homogeneous(linear: np.ndarray, position: np.ndarray) -> np.ndarray:
    out = np.zeros((*position.shape[:-1], 4, 4))
    out[..., :3, :3], out[..., :3, 3], out[..., 3, 3] = linear, position, 1.0
    return out


def read_skins(document: Document, tree: NodeTree) -> list[tuple[list[int], np.ndarray]]:
    """Joint nodes and inverse bind matrices [J, 4, 4] of every skin."""
    skins = []
    for index, entry in enumerate(document.items("skins")):
        place = f"skin {index}"
        joints = entry.get("joints")
        if not isinstance(joints, list) or not joints:
            raise fail(document.where(place), "has no joints")
        if len(joints) > MAX_JOINTS:
            raise fail(document.where(place), f"{len(joints)} joints; at most {MAX_JOINTS} are supported")
        for number, joint in enumerate(joints):
            document.item("nodes", joint, f"{place} joint {number}")
        if len(set(joints)) < len(joints):
            twice = next(j for j in joints if joints.count(j) > 1)
            raise fail(document.where(place), f"joint node {twice} '{tree.names[twice]}' is listed twice")
        inverse_bind = np.tile(np.eye(4), (len(joints), 1, 1))
        if "inverseBindMatrices" in entry:
            inverse_bind = document.accessor(entry["inverseBindMatrices"], place, "MAT4").astype(np.float64)
            if len(inverse_bind) < len(joints):
                raise fail(document.where(place), f"{len(inverse_bind)} inverse bind matrices for {len(joints)} joints")
        for joint, bind in zip(joints, inverse_bind, strict=False):
            if abs(np.linalg.det(bind[:3, :3])) < 1e-18:
                raise fail(
                    document.where(place), f"inverse bind matrix of joint '{tree.names[joint]}' cannot be inverted"
                )
        skins.append((joints, inverse_bind[: len(joints)]))
    return skins


def read_mesh(
    document: Document,
    tree: NodeTree,
    skins: list[tuple[list[int], np.ndarray]],
    moving: np.ndarray,
    rest: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> tuple[RawMesh | None, list[str]]:
    """One mesh over node indices in the bind pose, or None when nothing in the file is attached to a moving node.

    moving: [N] nodes that are joints or move; a mesh without skin hangs rigidly on the nearest such node above it.
    rest: global linear maps [N, 3, 3], rotations [N, 4], positions [N, 3] of the nodes at rest.
    """
    linear, rotation, position = rest
    placed = _Rest(linear, _homogeneous(matrix(rotation), position), _homogeneous(linear, position))
    merged = _Merged()
    skinned = [n for n in tree.order if tree.mesh[n] is not None and tree.skin[n] is not None]
    rigid = [n for n in tree.order if tree.mesh[n] is not None and tree.skin[n] is None]
    for node in skinned:
        _add_skinned(document, tree, node, skins[tree.skin[node] or 0], placed, merged)
    for node in rigid:
        _add_rigid(document, tree, node, moving, placed, merged)
    if merged.count == 0:
        if rigid and not skins:
            names = ", ".join(f"'{tree.names[n]}'" for n in rigid[:3])
            raise fail(
                document.where("skins"),
                f"no skin: mesh {names} is bound to no joint and hangs on no animated node, so nothing would move it",
            )
        return None, merged.notes
    inverse_bind = np.tile(np.eye(4), (tree.count, 1, 1))
    for joint, bind in merged.inverse_bind.items():
        inverse_bind[joint] = bind
    mesh = RawMesh(
        np.concatenate(merged.vertices),
        np.concatenate(merged.triangles),
        np.concatenate(merged.joints),
        np.concatenate(merged.weights),
        inverse_bind,
    )
    return mesh, merged.notes


def _add_skinned(
    document: Document,
    tree: NodeTree,
    node: int,
    skin: tuple[list[int], np.ndarray],
    rest: _Rest,
    merged: _Merged,
) -> None:
    nodes = np.asarray(skin[0])
    for place, primitive in _primitives(document, tree, node, merged.notes):
        vertices, triangles = _geometry(document, primitive, place)
        local_joints, weights = _influences(document, tree, primitive, place, len(vertices), skin[0])
        # Scale baked into the joint transforms goes to the bind matrices: joints stay rigid, vertices land the same.
        stretch = np.einsum("jkr,jkc->jrc", rest.rigid[nodes][:, :3, :3], rest.linear[nodes])
        bind = _homogeneous(stretch, np.zeros((len(nodes), 3))) @ skin[1]
        use = np.zeros(len(nodes))
        np.add.at(use, local_joints, weights)
        place_vertices = _bind_frame(nodes, bind, use, rest, merged)
        homogeneous = np.concatenate([vertices, np.ones((len(vertices), 1))], 1)
        if place_vertices is not None:
            out = homogeneous @ place_vertices[:3].T
        else:
            shared = np.stack([np.linalg.inv(merged.inverse_bind[n]) for n in nodes])
            out = np.einsum("vk,vkrc,vc->vr", weights, (shared @ bind)[local_joints][..., :3, :], homogeneous)
            merged.notes.append(
                f"mesh '{tree.names[node]}' has a bind pose of its own; it was posed to the first skin's"
            )
        merged.add(out, triangles, nodes[local_joints], weights)


def _bind_frame(
    nodes: np.ndarray, bind: np.ndarray, use: np.ndarray, rest: _Rest, merged: _Merged
) -> np.ndarray | None:
    """Map [4, 4] from this skin's mesh space to the common bind pose; None when the bind poses differ in shape.

    Records inverse bind matrices of joints not met before.
    """
    known = [k for k, n in enumerate(nodes) if int(n) in merged.inverse_bind]
    if known:
        best = max(known, key=lambda k: use[k])
        to_common = np.linalg.inv(merged.inverse_bind[int(nodes[best])]) @ bind[best]
    else:
        best = int(np.argmax(use))
        to_common = rest.rigid[nodes[best]] @ bind[best]
    back = np.linalg.inv(to_common)
    same = True
    for k, node in enumerate(nodes):
        candidate = bind[k] @ back
        if int(node) not in merged.inverse_bind:
            merged.inverse_bind[int(node)] = candidate
        elif use[k] > 0 and not _agree(candidate, merged.inverse_bind[int(node)]):
            same = False
    return to_common if same else None


def _agree(a: np.ndarray, b: np.ndarray) -> bool:
    size = 1e-6 + np.abs(b[:3, 3]).max()
    return bool(np.abs(a[:3, :3] - b[:3, :3]).max() < 1e-2 and np.abs(a[:3, 3] - b[:3, 3]).max() < 1e-2 * size)


def _add_rigid(document: Document, tree: NodeTree, node: int, moving: np.ndarray, rest: _Rest, merged: _Merged) -> None:
    holder = node
    while holder >= 0 and not moving[holder]:
        holder = tree.parents[holder]
    if holder < 0:
        merged.notes.append(f"mesh '{tree.names[node]}' hangs on no joint and was left out")
        return
    for place, primitive in _primitives(document, tree, node, merged.notes):
        vertices, triangles = _geometry(document, primitive, place)
        if np.linalg.det(rest.linear[node]) < 0:
            triangles = triangles[:, ::-1]
        homogeneous = np.concatenate([vertices, np.ones((len(vertices), 1))], 1)
        merged.inverse_bind.setdefault(holder, np.linalg.inv(rest.rigid[holder]))
        to_joint = np.linalg.inv(rest.rigid[holder]) @ rest.full[node]
        to_common = np.linalg.inv(merged.inverse_bind[holder]) @ to_joint
        joints = np.zeros((len(vertices), 4), np.int64)
        weights = np.zeros((len(vertices), 4))
        joints[:, 0], weights[:, 0] = holder, 1.0
        merged.add(homogeneous @ to_common[:3].T, triangles, joints, weights)


def _primitives(document: Document, tree: NodeTree, node: int, notes: list[str]) -> list[tuple[str, dict]]:
    mesh = tree.mesh[node]
    entry = document.item("meshes", mesh, f"node {node}")
    primitives = objects(document, entry, "primitives", f"mesh {mesh}")
    if not primitives:
        raise fail(document.where(f"mesh {mesh}"), "has no primitives")
    out = []
    for index, primitive in enumerate(primitives):
        place = f"mesh {mesh} primitive {index}"
        mode = primitive.get("mode", 4)
        if mode not in range(7):
            raise fail(document.where(place), f"mode {mode!r}; allowed: 0 to 6 (4 is triangles)")
        if mode < 4:
            notes.append(f"{place}: points or lines are left out")
            continue
        if primitive.get("targets"):
            notes.append(f"mesh '{entry.get('name', mesh)}': morph targets are ignored")
        out.append((place, primitive))
    return out


def _geometry(document: Document, primitive: dict, place: str) -> tuple[np.ndarray, np.ndarray]:
    """Positions [V, 3] and triangles [T, 3] of one primitive."""
    attributes = primitive.get("attributes")
    if not isinstance(attributes, dict) or "POSITION" not in attributes:
        raise fail(document.where(place), "has no POSITION attribute")
    vertices = document.accessor(attributes["POSITION"], f"{place} POSITION", "VEC3").astype(np.float64)
    if "indices" in primitive:
        indices = document.accessor(primitive["indices"], f"{place} indices", "SCALAR")
        if indices.dtype.kind != "u":
            raise fail(document.where(f"{place} indices"), f"are {indices.dtype}; must be unsigned integers")
        indices = indices[:, 0].astype(np.int64)
        if indices.max() >= len(vertices):
            raise fail(
                document.where(f"{place} indices"),
                f"vertex {indices.max()} is out of range; POSITION has 0..{len(vertices) - 1}",
            )
    else:
        indices = np.arange(len(vertices))
    mode = primitive.get("mode", 4)
    if mode == 4:
        triangles = indices[: len(indices) // 3 * 3].reshape(-1, 3)
    elif mode == 5:
        triangles = np.stack([indices[:-2], indices[1:-1], indices[2:]], 1)
        triangles[1::2] = triangles[1::2, ::-1]
    else:
        triangles = np.stack([np.full(max(len(indices) - 2, 0), indices[0]), indices[1:-1], indices[2:]], 1)
    if len(triangles) > MAX_TRIANGLES:
        raise fail(document.where(place), f"{len(triangles)} triangles; at most {MAX_TRIANGLES} are supported")
    return vertices, triangles


def _influences(
    document: Document, tree: NodeTree, primitive: dict, place: str, count: int, skin: list[int]
) -> tuple[np.ndarray, np.ndarray]:
    """The four strongest joints (indices into the skin) and weights [V, 4] of each vertex."""
    attributes = primitive["attributes"]
    joints, weights = [], []
    for number in range(4):
        keys = f"JOINTS_{number}", f"WEIGHTS_{number}"
        if number > 0 and not any(key in attributes for key in keys):
            break
        for key, out in zip(keys, (joints, weights), strict=True):
            if key not in attributes:
                raise fail(document.where(place), f"is skinned but has no {key} attribute")
            values = document.accessor(attributes[key], f"{place} {key}", "VEC4")
            if len(values) != count:
                raise fail(document.where(f"{place} {key}"), f"{len(values)} rows for {count} vertices")
            out.append(values)
    joint = np.concatenate(joints, 1).astype(np.int64)
    weight = np.maximum(np.concatenate(weights, 1).astype(np.float64), 0.0)
    outside = (weight > 0) & ((joint >= len(skin)) | (joint < 0))
    if outside.any():
        vertex = int(np.argmax(outside.any(1)))
        raise fail(
            document.where(f"{place} JOINTS"),
            f"vertex {vertex} is bound to joint {joint[outside][0]}; the skin has 0..{len(skin) - 1}",
        )
    joint = np.where(weight > 0, joint, 0)
    if joint.shape[1] > 4:
        strongest = np.argsort(-weight, 1, kind="stable")[:, :4]
        joint, weight = np.take_along_axis(joint, strongest, 1), np.take_along_axis(weight, strongest, 1)
    total = weight.sum(1, keepdims=True)
    if np.any(total <= 1e-6):
        raise fail(
            document.where(f"{place} WEIGHTS"),
            f"all weights of vertex {int(np.argmin(total[:, 0]))} are zero "
            f"({int(np.sum(total <= 1e-6))} such vertices)",
        )
    return joint, weight / total
