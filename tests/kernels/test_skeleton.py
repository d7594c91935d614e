"""Forward kinematics against the host's, on random trees, with and without walls."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from crowd import posing
from crowd.types import Motion, Skeleton
from kernels import skeleton
from kernels.wall import Wall, apart, no_wall
from tests.kernels.checks import (
    BATCHES,
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    assert_matches,
    in_single,
    last,
    unit_vectors,
)

TREES = {
    "one joint": (-1,),
    "chain": (-1, 0, 1, 2, 3),
    "biped": (-1, 0, 1, 1, 0, 4, 0, 6, 2),
    "two roots": (-1, 0, -1, 2, 0, 3),
}
BIPED = TREES["biped"]


def pose(parents: tuple[int, ...], batch: tuple[int, ...], seed: int = 0) -> tuple[np.ndarray, ...]:
    """rotation, translation, root rotation, root position: components first."""
    rng = np.random.default_rng(seed)
    joints = len(parents)
    return (
        unit_vectors(rng, 4, joints, *batch),
        rng.normal(size=(3, joints, *batch)),
        unit_vectors(rng, 4, *batch),
        rng.normal(size=(3, *batch)),
    )


def reference(parents: tuple[int, ...], rotation, translation, root_rotation, root_position) -> np.ndarray:
    """[7, J, *b] by the host's forward kinematics."""
    names = tuple(map(str, parents))
    rig = Skeleton(names, parents, np.zeros((len(parents), 4)), np.zeros((len(parents), 3)))

    def joints_then_components(x: np.ndarray) -> np.ndarray:
        return np.moveaxis(x, (1, 0), (-2, -1))

    motion = Motion(
        last(root_position),
        last(root_rotation),
        joints_then_components(rotation),
        joints_then_components(translation),
        np.ones(root_position.shape[1:]),
    )
    placed = np.concatenate(posing.world_transforms(rig, motion), -1)
    return np.moveaxis(placed, (-1, -2), (0, 1))


def kinematics(parents: tuple[int, ...], wall: Wall = no_wall):
    return lambda *pose: skeleton.forward_kinematics(parents, *pose, wall=wall)


def test_levels_hold_every_joint_once_below_its_parent() -> None:
    levels = skeleton.levels(BIPED)
    assert [level.tolist() for level in levels] == [[0], [1, 4, 6], [2, 3, 5, 7], [8]]
    assert [level.tolist() for level in skeleton.levels((-1, -1))] == [[0, 1]]


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("tree", TREES)
def test_against_host(tree: str, batch: tuple[int, ...]) -> None:
    parents = TREES[tree]
    at = pose(parents, batch)
    expected = reference(parents, *at)
    if tree == "biped":
        assert_matches(kinematics(parents), expected, *at)
    else:
        assert_close(in_single(kinematics(parents), *at), expected, 2e-6)


def test_one_translation_for_all_characters() -> None:
    rotation, _, root_rotation, root_position = pose(BIPED, (5,))
    translation = np.random.default_rng(1).normal(size=(3, len(BIPED), 1))
    wide = np.broadcast_to(translation, (3, len(BIPED), 5))
    expected = reference(BIPED, rotation, wide, root_rotation, root_position)
    assert_close(in_single(kinematics(BIPED), rotation, translation, root_rotation, root_position), expected, 2e-6)


def test_rotations_are_normalised_first() -> None:
    """Blends of clips arrive unnormalised; a root rotation does not."""
    rotation, *others = pose(BIPED, (4,))
    longer = rotation * np.random.default_rng(2).uniform(0.5, 2.0, size=rotation.shape[1:])
    assert_close(in_single(kinematics(BIPED), longer, *others), reference(BIPED, rotation, *others), 5e-6)


def test_zero_quaternion_is_finite() -> None:
    rotation, *others = pose(BIPED, (2,))
    rotation[:, 1] = 0.0
    assert_gradient_finite(kinematics(BIPED), rotation, *others)


def test_walls_change_nothing() -> None:
    """Under jit, and under a vmap."""
    at = tuple(jnp.asarray(x, jnp.float32) for x in pose(BIPED, (3, 2)))
    plain = jax.jit(kinematics(BIPED))(*at)

    @jax.jit
    def walled(*at):
        return kinematics(BIPED, apart)(*at)

    assert_close(walled(*at), plain, 1e-6)
    vectorised = jax.jit(jax.vmap(walled, in_axes=(2, 2, 1, 1), out_axes=2))
    assert_close(vectorised(*at), plain, 1e-6)


@pytest.mark.parametrize("walled", [False, True], ids=["no_wall", "walls"])
def test_gradients(walled: bool) -> None:
    fork = (-1, 0, 0, 1)
    at = pose(fork, (2,))
    assert_gradients_agree(kinematics(fork, apart if walled else no_wall), *at)
