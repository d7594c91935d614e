"""Linear blend skinning with up to four bones a vertex."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from kernels import quat


def bone_columns(transforms: Float[Array, "7 joints *b"], scale: Float[Array, "*b"]) -> Float[Array, "joints 4 3 *b"]:
    """Columns of each bone's 3x4 matrix: three scaled axes, then the position.

    What belongs to a bone, and to a vertex of `skin`, lies together: a gather along the first axis copies whole pieces.
    """
    axes = quat.matrix(transforms[:4]) * scale
    return jnp.moveaxis(jnp.concatenate([axes, transforms[None, 4:]]), 2, 0)


def skin(
    bones: np.ndarray,
    local: Float[Array, "influences 4 vertices"],
    columns: Float[Array, "joints 4 3 *b"],
) -> Float[Array, "vertices 3 *b"]:
    """Vertices of the blended mesh, in the frame of the bones.

    bones [vertices, influences] (static): which bones move a vertex, heaviest first.
    local: for each influence the vertex in the bone's own bind frame times its weight, and the weight itself.
    Influences that no vertex uses should be cut off beforehand: the sum is unrolled over all of them.
    """
    batch = (1,) * (columns.ndim - 2)
    out = None
    for k in range(bones.shape[1]):
        for c in range(4):
            term = local[k, c].reshape(-1, *batch) * columns[:, c][bones[:, k]]
            out = term if out is None else out + term
    assert out is not None
    return out


def unskinned(
    bones: np.ndarray, local: Float[Array, "influences 4 vertices"], joints: int, on: Float[Array, "vertices 3 *b"]
) -> Float[Array, "joints 4 3 *b"]:
    """The transpose of `skin` in the columns: every vertex adds to each of its bones, one after the other."""
    influences = bones.shape[1]
    bone, own = jnp.asarray(bones.reshape(-1)), jnp.moveaxis(local, 2, 0).reshape(-1, 4)
    batch = (1,) * (on.ndim - 1)

    def added(i: Array | int, total: Array) -> Array:
        weights = jax.lax.dynamic_index_in_dim(own, i, keepdims=False).reshape(4, *batch)
        change = weights * jax.lax.dynamic_slice_in_dim(on, i // influences, 1)
        now = jax.lax.dynamic_index_in_dim(total, bone[i], keepdims=False)
        return jax.lax.dynamic_update_index_in_dim(total, now + change, bone[i], 0)

    return jax.lax.fori_loop(0, len(bone), added, jnp.zeros((joints, 4, *on.shape[1:]), on.dtype))
