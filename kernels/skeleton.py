"""Forward kinematics of a joint tree, one level of the tree at a time."""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from kernels import quat
from kernels.rows import merged, picked
from kernels.vec import plus
from kernels.wall import Wall, no_wall


def levels(parents: Sequence[int]) -> list[np.ndarray]:
    """Joints by depth: level 0 holds the roots."""
    depth: list[int] = []
    for parent in parents:
        depth.append(0 if parent < 0 else depth[parent] + 1)
    return [np.flatnonzero(np.array(depth) == level) for level in range(max(depth) + 1)]


def forward_kinematics(
    parents: tuple[int, ...],
    rotation: Float[Array, "4 joints *b"],
    translation: Float[Array, "3 joints *#b"],
    root_rotation: Float[Array, "4 *b"],
    root_position: Float[Array, "3 *b"],
    wall: Wall = no_wall,
) -> Float[Array, "7 joints *b"]:
    """Every joint's rotation (rows 0-3) and position (rows 4-6) in the frame that holds the root.

    rotation, translation: joint to parent, m (already scaled). The tree's roots hang from root_rotation, root_position.
    Rotations need not be unit: they are normalised first. One wall per level: a chain fused into one loop is slow.
    """

    def own(rotation: Array, translation: Array) -> Array:
        unit = quat.normalize(rotation)
        return jnp.concatenate([unit, jnp.broadcast_to(translation, (3, *unit.shape[1:]))])

    def hung(above: Array, own: Array) -> Array:
        position = plus(above[4:], quat.rotate(above[:4], own[4:]))
        return jnp.concatenate([quat.multiply(above[:4], own[:4]), position])

    def roots(rotation: Array, position: Array, own: Array) -> Array:
        return hung(jnp.concatenate([rotation, position])[:, None], own)

    tree = levels(parents)
    local = picked(wall(own, rotation, translation), np.concatenate(tree), wall)
    top, *below = jnp.split(local, np.cumsum([len(joints) for joints in tree])[:-1], axis=1)
    done = [wall(roots, root_rotation, root_position, top)]
    for joints, over, each in zip(tree[1:], tree, below, strict=False):
        above = np.searchsorted(over, [parents[joint] for joint in joints])
        done.append(wall(hung, picked(done[-1], above, wall), each))
    return merged(done, tree, wall)
