"""Forward kinematics of a joint tree, one level of the tree at a time."""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from kernels import quat
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

    def first(rotation: Array, translation: Array, root_rotation: Array, root_position: Array) -> Array:
        position = plus(root_position[:, None], quat.rotate(root_rotation[:, None], translation))
        return jnp.concatenate([quat.multiply(root_rotation[:, None], rotation), position])

    def below(above: Array, rotation: Array, translation: Array) -> Array:
        position = plus(above[4:], quat.rotate(above[:4], translation))
        return jnp.concatenate([quat.multiply(above[:4], rotation), position])

    rotation = wall(quat.normalize, rotation)
    tree = levels(parents)
    joints = tree[0]
    current = wall(first, rotation[:, joints], translation[:, joints], root_rotation, root_position)
    done, order, place = [current], list(joints), {int(j): i for i, j in enumerate(joints)}
    for joints in tree[1:]:
        above = np.array([place[parents[j]] for j in joints])
        current = wall(
            lambda current, rotation, translation, above=above: below(current[:, above], rotation, translation),
            current,
            rotation[:, joints],
            translation[:, joints],
        )
        done.append(current)
        order += list(joints)
        place = {int(j): i for i, j in enumerate(joints)}
    back = np.argsort(order)
    return wall(lambda *done: jnp.concatenate(done, 1)[:, back], *done)
