"""A glTF file as a `RawRig`: its moving nodes, its merged mesh and its sampled clips, in the file's own frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from crowd.characters.glb import read_document
from crowd.characters.gltf_clips import Animation, pose, read_animations, sample_times
from crowd.characters.gltf_mesh import read_mesh, read_skins
from crowd.characters.gltf_nodes import NodeTree, global_transforms, read_nodes
from crowd.characters.raw_rig import RawClip, RawMesh, RawRig
from crowd.errors import fail


def read_rig(path: Path) -> RawRig:
    """Joints, mesh and clips of a .glb or .gltf file. Raises InputError naming the file and the place."""
    document = read_document(path)
    tree = read_nodes(document)
    skins = read_skins(document, tree)
    animations, notes = read_animations(document, tree)
    if not document.items("animations"):
        raise fail(document.where("animations"), "the file has no animation; a character needs a walk or a run")
    still = [animation for animation in animations if animation.span[1] - animation.span[0] < 1e-3]
    playing = [animation for animation in animations if animation not in still]
    if not playing:
        names = ", ".join(f"'{a.name}'" for a in animations[:5]) or "none that moves a node"
        raise fail(document.where("animations"), f"no clip lasts longer than one frame (clips: {names})")
    if still:
        notes.append(f"clips of a single frame are poses and were left out: {', '.join(a.name for a in still)}")
    moving = _moving(tree, skins, playing)
    local = (tree.translation[None], tree.rotation[None], tree.linear[None])
    linear, rotation, position = (part[0] for part in global_transforms(tree, *local))
    mesh, mesh_notes = read_mesh(document, tree, skins, moving, (linear, rotation, position))
    keep = _joints(tree, skins, moving, mesh)
    clips = [_clip(tree, animation, keep) for animation in playing]
    number = {node: k for k, node in enumerate(keep)}
    return RawRig(
        path,
        tuple(tree.names[n] for n in keep),
        tuple(number.get(_kept_above(tree, n, number), -1) for n in keep),
        position[keep],
        rotation[keep],
        tuple(clips),
        None if mesh is None else _renumbered(mesh, keep, number),
        up="+y",
        metres_per_unit=1.0,
        notes=tuple(dict.fromkeys([*notes, *mesh_notes])),
    )


def _moving(tree: NodeTree, skins: list[tuple[list[int], np.ndarray]], animations: list[Animation]) -> np.ndarray:
    moving = np.zeros(tree.count, bool)
    for joints, _ in skins:
        moving[joints] = True
    for animation in animations:
        moving[[track.node for track in animation.tracks]] = True
    return moving


def _joints(
    tree: NodeTree, skins: list[tuple[list[int], np.ndarray]], moving: np.ndarray, mesh: RawMesh | None
) -> list[int]:
    """Nodes that become joints, parents first: moving ones and the bare nodes below them (ends of bones)."""
    below = moving.copy()
    for node in tree.order:
        if tree.parents[node] >= 0 and below[tree.parents[node]] and tree.mesh[node] is None:
            below[node] = True
    return [node for node in tree.order if below[node]]


def _kept_above(tree: NodeTree, node: int, number: dict[int, int]) -> int:
    above = tree.parents[node]
    while above >= 0 and above not in number:
        above = tree.parents[above]
    return above


def _renumbered(mesh: RawMesh, keep: list[int], number: dict[int, int]) -> RawMesh:
    table = np.zeros(len(mesh.inverse_bind), np.int64)
    for node, k in number.items():
        table[node] = k
    return replace(mesh, joints=table[mesh.joints], inverse_bind=mesh.inverse_bind[keep])


def _clip(tree: NodeTree, animation: Animation, keep: list[int]) -> RawClip:
    times = sample_times(animation)
    _, rotation, position = pose(tree, animation, times)
    return RawClip(animation.name, float(times[-1] - times[0]), position[:, keep], rotation[:, keep])
