"""Linear blend skinning against the host's."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from crowd import posing
from crowd.types import Mesh
from kernels import skinning
from tests.kernels.checks import (
    BATCHES,
    assert_close,
    assert_gradients_agree,
    assert_matches,
    in_double,
    last,
    unit_vectors,
)

JOINTS, VERTICES = 5, 11


def mesh(influences: int, seed: int = 0) -> Mesh:
    """Vertices on random bones; weights sum to 1."""
    rng = np.random.default_rng(seed)
    weights = rng.uniform(size=(VERTICES, influences))
    inverse_bind = np.tile(np.eye(4), (JOINTS, 1, 1))
    inverse_bind[:, :3, :3] = posing.matrix(last(unit_vectors(rng, 4, JOINTS)))
    inverse_bind[:, :3, 3] = rng.normal(size=(JOINTS, 3))
    return Mesh(
        vertices=rng.normal(size=(VERTICES, 3)),
        triangles=np.zeros((0, 3), np.int32),
        joints=rng.integers(0, JOINTS, (VERTICES, influences)).astype(np.int32),
        weights=weights / weights.sum(1, keepdims=True),
        inverse_bind=inverse_bind,
    )


def local(mesh: Mesh) -> np.ndarray:
    """[influences, 4, V]: weight times the vertex in each bone's bind frame, and the weight."""
    homogeneous = np.concatenate([mesh.vertices, np.ones((VERTICES, 1))], 1)
    in_bone = np.einsum("vkrc,vc->kvr", mesh.inverse_bind[mesh.joints], homogeneous)
    return (in_bone * mesh.weights.T[..., None]).transpose(0, 2, 1)


def placed(batch: tuple[int, ...], seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Joint transforms [7, J, *b] and scales [*b]."""
    rng = np.random.default_rng(seed)
    transforms = np.concatenate([unit_vectors(rng, 4, JOINTS, *batch), rng.normal(size=(3, JOINTS, *batch))])
    return transforms, rng.uniform(0.5, 1.5, batch)


def skinned(mesh: Mesh):
    table = local(mesh)

    def run(transforms, scale, local):
        return skinning.skin(mesh.joints, local, skinning.bone_columns(transforms, scale))

    return run, table


def reference(mesh: Mesh, transforms: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """[V, 3, *b]"""
    joints_last = np.moveaxis(transforms, (1, 0), (-2, -1))
    return np.moveaxis(posing.skin(mesh, joints_last[..., :4], joints_last[..., 4:], scale), (-1, -2), (1, 0))


@pytest.mark.parametrize("influences", [1, 3, 4])
@pytest.mark.parametrize("batch", BATCHES)
def test_against_host(batch: tuple[int, ...], influences: int) -> None:
    body = mesh(influences)
    run, table = skinned(body)
    transforms, scale = placed(batch)
    expected = reference(body, transforms, scale)
    if influences == 4:
        assert_matches(run, expected, transforms, scale, table)
    else:
        assert_close(in_double(run, transforms, scale, table), expected, 1e-9)


def test_columns_are_scaled_axes_and_the_position() -> None:
    transforms, scale = placed((2,))
    columns = in_double(skinning.bone_columns, transforms, scale)
    lengths = np.linalg.norm(columns[:, :3], axis=2)
    assert_close(lengths, np.broadcast_to(scale, lengths.shape), 1e-12)
    assert_close(columns[:, 3], transforms[4:].swapaxes(0, 1), 0)


def test_bind_pose_gives_the_mesh_back() -> None:
    """Bones where they were bound, scale 1: the vertices themselves, whatever the weights."""
    body = mesh(4)
    run, table = skinned(body)
    bind = np.linalg.inv(body.inverse_bind)
    transforms = np.concatenate([posing.quaternion(bind[:, :3, :3]).T, bind[:, :3, 3].T])
    assert_matches(run, body.vertices, transforms, np.array(1.0), table)


def test_gradients() -> None:
    run, table = skinned(mesh(4))
    transforms, scale = placed((2,))
    assert_gradients_agree(run, transforms, scale, table)


@pytest.mark.parametrize("influences", [1, 4])
@pytest.mark.parametrize("batch", BATCHES)
def test_its_transpose_as_told(influences: int, batch: tuple[int, ...]) -> None:
    made = mesh(influences)
    columns = np.random.default_rng(2).normal(size=(JOINTS, 4, 3, *batch))
    on = np.random.default_rng(3).normal(size=(VERTICES, 3, *batch))

    def both(columns, local, on):
        pull = jax.vjp(lambda columns: skinning.skin(made.joints, local, columns), columns)[1]
        return pull(on)[0], skinning.unskinned(made.joints, local, JOINTS, on)

    expected, found = in_double(both, columns, local(made), on)
    assert_close(found, expected, 1e-12)
