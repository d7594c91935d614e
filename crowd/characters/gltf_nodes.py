"""The node tree of a glTF file: parents, local transforms, global rotations and positions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowd.characters.glb import Document, numbers
from crowd.errors import fail
from crowd.posing import matrix, multiply, quaternion

MAX_NODES = 4096


@dataclass(frozen=True, eq=False)
class NodeTree:
    """Nodes of the file in file order; `order` lists parents before children."""

    names: tuple[str, ...]
    parents: tuple[int, ...]
    order: tuple[int, ...]
    translation: np.ndarray  # [N, 3]
    rotation: np.ndarray  # [N, 4] wxyz
    scale: np.ndarray  # [N, 3]
    linear: np.ndarray  # [N, 3, 3] rotation and scale (matrix nodes: as given, shear included)
    mesh: tuple[int | None, ...]
    skin: tuple[int | None, ...]

    @property
    def count(self) -> int:
        return len(self.names)


def read_nodes(document: Document) -> NodeTree:
    """All nodes; InputError on children out of range, two parents, cycles and transforms that are not finite."""
    entries = document.items("nodes")
    if not entries:
        raise fail(document.where("nodes"), "the file has no nodes")
    if len(entries) > MAX_NODES:
        raise fail(document.where("nodes"), f"{len(entries)} nodes; at most {MAX_NODES} are supported")
    parents = _parents(document, entries)
    names = _unique([str(entry.get("name") or f"node {index}") for index, entry in enumerate(entries)])
    order = _topological(document, parents, names)
    translation = np.zeros((len(entries), 3))
    rotation = np.tile([1.0, 0, 0, 0], (len(entries), 1))
    scale = np.ones((len(entries), 3))
    linear = np.tile(np.eye(3), (len(entries), 1, 1))
    for index, entry in enumerate(entries):
        place = f"node {index} '{names[index]}'"
        given = numbers(document, entry, "matrix", 16, place)
        if given is not None:
            columns = given.reshape(4, 4).T
            translation[index], linear[index] = columns[:3, 3], columns[:3, :3]
            rotation[index] = quaternion(polar_rotation(linear[index]))
            scale[index] = np.linalg.norm(linear[index], axis=0)
            continue
        translation[index] = _or(numbers(document, entry, "translation", 3, place), translation[index])
        scale[index] = _or(numbers(document, entry, "scale", 3, place), scale[index])
        xyzw = numbers(document, entry, "rotation", 4, place)
        if xyzw is not None:
            if np.linalg.norm(xyzw) < 1e-6:
                raise fail(document.where(place), "rotation is a zero quaternion")
            rotation[index] = np.roll(xyzw, 1) / np.linalg.norm(xyzw)
        scale[index] = np.where(np.abs(scale[index]) < 1e-9, 1.0, scale[index])  # hidden by zero scale: shown
        linear[index] = matrix(rotation[index]) * scale[index]
    return NodeTree(
        tuple(names),
        tuple(parents),
        order,
        translation,
        rotation,
        scale,
        linear,
        tuple(_reference(document, entry, "mesh", "meshes", i) for i, entry in enumerate(entries)),
        tuple(_reference(document, entry, "skin", "skins", i) for i, entry in enumerate(entries)),
    )


def _or(value: np.ndarray | None, default: np.ndarray) -> np.ndarray:
    return default if value is None else value


def _reference(document: Document, entry: dict, key: str, kind: str, node: int) -> int | None:
    if key in entry:
        document.item(kind, entry[key], f"node {node} {key}")
    return entry.get(key)


def _parents(document: Document, entries: list[dict]) -> list[int]:
    parents = [-1] * len(entries)
    for index, entry in enumerate(entries):
        children = entry.get("children", [])
        if not isinstance(children, list):
            raise fail(document.where(f"node {index}"), "children must be an array of node indices")
        for child in children:
            document.item("nodes", child, f"node {index} children")
            if child == index:
                raise fail(document.where(f"node {index} children"), "the node is its own child, a cycle")
            if parents[child] >= 0:
                raise fail(
                    document.where(f"node {index} children"),
                    f"node {child} is already a child of node {parents[child]}; the nodes must form a tree",
                )
            parents[child] = index
    return parents


def _topological(document: Document, parents: list[int], names: list[str]) -> tuple[int, ...]:
    children: list[list[int]] = [[] for _ in parents]
    for index, parent in enumerate(parents):
        if parent >= 0:
            children[parent].append(index)
    order = [index for index, parent in enumerate(parents) if parent < 0]
    for index in order:
        order.extend(children[index])
    if len(order) < len(parents):
        lost = min(set(range(len(parents))) - set(order))
        loop = [lost]
        while parents[loop[-1]] not in loop:
            loop.append(parents[loop[-1]])
        loop = loop[loop.index(parents[loop[-1]]) :]
        listed = " -> ".join(f"{i} '{names[i]}'" for i in [*loop[::-1], loop[-1]])
        raise fail(document.where(f"node {loop[-1]}"), f"cycle in the node tree: {listed}")
    return tuple(_depth_first(parents, children))


def _depth_first(parents: list[int], children: list[list[int]]) -> list[int]:
    stack = [index for index, parent in enumerate(parents) if parent < 0][::-1]
    order: list[int] = []
    while stack:
        index = stack.pop()
        order.append(index)
        stack.extend(reversed(children[index]))
    return order


def _unique(names: list[str]) -> list[str]:
    used: set[str] = set()
    for name in names:
        candidate, number = name, 2
        while candidate in used:
            candidate, number = f"{name}#{number}", number + 1
        used.add(candidate)
        names = [*names[: len(used) - 1], candidate, *names[len(used) :]]
    return names


def polar_rotation(linear: np.ndarray) -> np.ndarray:
    """Nearest proper rotations [..., 3, 3] of linear maps [..., 3, 3]; of a mirrored map, that of its negative."""
    flipped = np.where(np.linalg.det(linear)[..., None, None] < 0, -linear, linear)
    u, _, v = np.linalg.svd(flipped)
    sign = np.sign(np.linalg.det(u @ v))[..., None]
    u = np.concatenate([u[..., :, :2], u[..., :, 2:] * sign[..., None]], -1)
    return u @ v


def global_transforms(
    tree: NodeTree, translation: np.ndarray, rotation: np.ndarray, linear: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Global linear maps [F, N, 3, 3], rotations [F, N, 4] and positions [F, N, 3] of sampled local transforms.

    Rotations compose exactly where scales are uniform and positive (the rule); other nodes get the polar rotation.
    """
    globals_m, globals_p, globals_q = np.empty_like(linear), np.empty_like(translation), np.empty_like(rotation)
    plain = _uniform(linear)
    for node in tree.order:
        parent = tree.parents[node]
        if parent < 0:
            globals_m[:, node], globals_p[:, node] = linear[:, node], translation[:, node]
            globals_q[:, node] = rotation[:, node]
        else:
            above = globals_m[:, parent]
            globals_m[:, node] = above @ linear[:, node]
            globals_p[:, node] = globals_p[:, parent] + np.einsum("frc,fc->fr", above, translation[:, node])
            globals_q[:, node] = multiply(globals_q[:, parent], rotation[:, node])
            plain[node] &= plain[parent]
        if not plain[node]:
            globals_q[:, node] = quaternion(polar_rotation(globals_m[:, node]))
    return globals_m, globals_q, globals_p


def _uniform(linear: np.ndarray) -> np.ndarray:
    """Which nodes [N] scale uniformly, without mirror, at all samples."""
    gram = np.einsum("fnrc,fnrd->fncd", linear, linear)
    size = np.trace(gram, axis1=-2, axis2=-1) / 3
    error = np.abs(gram - size[..., None, None] * np.eye(3)).max((-1, -2))
    return np.all((error <= 1e-3 * size) & (np.linalg.det(linear) >= 0), axis=0)
