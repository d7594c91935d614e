"""Sizes of the herds of a program, for `benchmarks.roofline`; triangles as far as they are in the water after a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.roofline import Sizes


def sizes_of(program: Any, counts: tuple[tuple[str, int], ...], depth: float) -> list[Sizes]:
    """Of every herd of (layout, assets, params, states); depth: m of level water, 0 for none. counts: characters."""
    layout, assets, params, states = program
    found = []
    for which, (archetype, count) in enumerate(counts):
        herd, own = layout.herds[which], assets.herds[which]
        triangles, blocks = 0.0, 0.0
        arms = herd.arms if layout.regions and layout.arms_up[which] else 0
        first = herd.legs * (len(herd.chain[0]) if herd.chain else 0)  # segment of an arm
        if layout.regions:
            parts = _rigid if layout.mesh == "rigid" else _skinned
            triangles, blocks = parts(herd, own, params.characters[which], states[which], depth)
        found.append(
            Sizes(
                archetype=archetype,
                count=count,
                joints=herd.joints,
                legs=herd.legs,
                arms=arms,
                leg_joints=int(((herd.limb_segments >= 0) & (herd.limb_segments < first)).sum()),
                arm_joints=int((herd.limb_segments >= first).sum()) if arms else 0,
                triangles=round(triangles, 1),
                blocks=round(blocks, 1),
                vertices=len(herd.vertex_bones.values),
                influences=herd.vertex_bones.values.shape[1],
                gaits=herd.gaits,
                clips=min(herd.gaits, 2) + 1,
                moving=len(herd.moving),
            )
        )
    return found


def _skinned(herd: Any, own: Any, character: Any, state: Any, depth: float) -> tuple[float, float]:
    """(triangles, 0) of groups up to the last with a vertex under the surface on some character, mean over tiles."""
    del own, character
    from kernels.drag_skinned import grouped

    height = np.asarray(state.previous[:, :, 1] + state.position[:, 1:2])  # [tiles, V, n] m
    wet = np.any(height < depth, 2)  # [tiles, V]
    groups = grouped(herd.triangles.values)
    real = np.array([(group[0] != group[1]).sum() for group in groups])
    inside = _up_to_last(np.stack([wet[:, group].any((1, 2)) for group in groups], 1))
    return float((inside * real).sum(1).mean()), 0.0


def _rigid(herd: Any, own: Any, character: Any, state: Any, depth: float) -> tuple[float, float]:
    """(triangles, blocks) of groups up to the last with a block whose box is under the surface on some character."""
    from kernels.drag_rigid import groups_of

    bones, mesh = herd.block_bones.values, own.rigid_mesh
    w, x, y, z, _, above, _ = np.moveaxis(np.asarray(state.previous)[:, :, bones], 1, 0)  # [tiles, blocks, n]
    up = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)  # vertical in the bone's frame
    middle, half = np.split(np.asarray(mesh.bounds), 2)
    scale = np.asarray(character.scale)[:, None]
    lowest = sum(u * at - np.abs(u) * out for u, at, out in zip(up, middle, half, strict=True))
    height = above + scale * lowest + np.asarray(state.position)[:, 1:2]
    wet = np.any(height < depth, 2)  # [tiles, blocks]
    groups = groups_of(len(bones))
    inside = _up_to_last(wet.reshape(len(wet), groups, -1).any(2))
    real = (np.asarray(mesh.area) != 0).any((0, 3)).sum(1).reshape(groups, -1).sum(1)
    return float((inside * real).sum(1).mean()), float(inside.sum(1).mean() * len(bones) / groups)


def _up_to_last(wet: np.ndarray) -> np.ndarray:
    """[tiles, groups] whether a group goes through: all do up to the last that is wet."""
    return np.logical_or.accumulate(wet[:, ::-1], 1)[:, ::-1]
