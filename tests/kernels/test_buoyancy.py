"""Submerged volume and waterline against solids whose caps are known, and against the mesh cut triangle by triangle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh

from kernels import buoyancy, drag_moments
from kernels.wall import apart, no_wall
from tests.kernels import meshes
from tests.kernels.checks import (
    BATCHES,
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    in_double,
    in_single,
)
from tests.kernels.drag_cases import rigid_blob


def skinned(triangles: np.ndarray, flag: bool = False, line: bool = True):
    def run(vertices: Any, surface: Any) -> Any:
        wall = apart if flag else no_wall
        found = buoyancy.skinned(triangles, vertices.swapaxes(0, 1), surface, line, wall)
        return tuple(x for x in found if x is not None)

    return run


def blobs(batch: tuple[int, ...], seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """triangles, vertices [3, V, *b] and surfaces that cross them."""
    rng = np.random.default_rng(seed)
    vertices, triangles = meshes.blob(seed)
    wide = vertices.T.reshape(3, -1, *(1,) * len(batch))
    placed = wide * rng.uniform(0.5, 2, batch) + rng.normal(size=(3, 1, *batch))
    return triangles, placed, placed[1].mean(0) + rng.uniform(-0.2, 0.2, batch)


def cut(vertices: np.ndarray, triangles: np.ndarray, surface: Any) -> tuple[float, float]:
    """Volume below and length of the waterline of one body [V, 3]: tetrahedra from a point of the surface, trimesh."""
    point = np.array([0, surface, 0])
    volume = 0.0
    for corners in vertices[triangles] - point:  # the lid of what is cut off is seen edge-on from the point
        kept, depth = [], -corners[:, 1]
        for k in range(3):
            a, b, da, db = corners[k], corners[(k + 1) % 3], depth[k], depth[(k + 1) % 3]
            kept += [a] if da > 0 else []
            kept += [a + (b - a) * da / (da - db)] if (da > 0) != (db > 0) else []
        volume += sum(np.cross(kept[0], kept[k]) @ kept[k + 1] / 6 for k in range(1, len(kept) - 1))
    lines = trimesh.intersections.mesh_plane(trimesh.Trimesh(vertices, triangles, process=False), [0, 1, 0], point)
    return volume, float(np.linalg.norm(np.diff(lines, axis=1), axis=-1).sum())


@pytest.mark.parametrize("batch", BATCHES)
def test_against_the_cut_mesh(batch: tuple[int, ...]) -> None:
    triangles, vertices, surface = blobs(batch)
    expected = np.array([cut(vertices[(..., *i)].T, triangles, surface[i]) for i in np.ndindex(batch)])
    expected = tuple(expected.T.reshape(2, *batch))
    assert min(x.min() for x in expected) > 1e-3
    assert_close(in_double(skinned(triangles), vertices, surface), expected, 1e-9)
    assert_close(in_single(skinned(triangles, flag=True), vertices, surface), expected, 2e-5)


@pytest.mark.parametrize("batch", BATCHES)
def test_rigid_is_skinned(batch: tuple[int, ...]) -> None:
    """The same triangles carried by bones, each body of its own size."""
    bones, mesh, (transforms, _, scale), (triangles, world, _) = rigid_blob(batch, seed=2)
    surface = np.random.default_rng(3).uniform(-0.3, 0.3, batch)

    def run(mesh: Any, transforms: Any, scale: Any, surface: Any) -> Any:
        return buoyancy.rigid(
            bones.astype(np.int32), drag_moments.RigidMesh(*mesh), transforms, scale, surface, line=True
        )

    expected = in_double(skinned(triangles), world, surface)
    assert_close(in_double(run, mesh, transforms, scale, surface), expected, 1e-9)
    assert_close(in_single(run, mesh, transforms, scale, surface), expected, 1e-4)


def test_box_and_sphere() -> None:
    """A floating box to its draught, at any height; a cap of a sphere, pi h^2 (3 r - h) / 3, with refinement."""
    vertices, triangles = meshes.box((0.4, 0.6, 0.5))
    for height in (0.0, 40.0):
        draught = np.linspace(-0.1, 0.7, 17)
        at = np.repeat((vertices + np.array([0, height, 0])).T[..., None], 17, -1)
        volume, length = in_double(skinned(triangles), at, height - 0.3 + draught)
        assert_close(volume, 0.2 * np.clip(draught, 0, 0.6), 1e-9)
        assert_close(length[[4, 8, 12]], np.full(3, 1.8), 1e-9)
        assert_close(length[[0, -1]], np.zeros(2), 1e-12)
    errors = []
    for refinement in (2, 3):
        vertices, triangles = meshes.sphere(refinement)
        h = np.array([0.3, 1.0, 1.6])
        volume, length = in_double(skinned(triangles), np.repeat(vertices.T[..., None], 3, -1), h - 1.0)
        expected = np.pi * h**2 * (3 - h) / 3
        errors.append(np.abs(volume - expected).max())
        np.testing.assert_allclose(length, 2 * np.pi * np.sqrt(h * (2 - h)), rtol=0.04)
    assert errors[1] < 0.3 * errors[0]


def test_the_surface_may_slope() -> None:
    """A half of a cube below a sloping surface through its middle; equal heights are the level surface."""
    vertices, triangles = meshes.box((1.0, 1.0, 1.0))
    at = vertices.T[..., None]
    run = skinned(triangles, line=False)
    assert_close(in_double(run, at, np.full((8, 1), 0.2)), in_double(run, at, np.full(1, 0.2)), 1e-12)
    assert_close(in_double(run, at, 0.4 * at[0])[0], np.array([0.5]), 1e-9)


def test_smooth_in_depth() -> None:
    """The slope of the volume is the area at the waterline: continuous."""
    triangles, vertices, _ = blobs((1,), seed=4)
    surface = np.linspace(vertices[1].min() - 0.1, vertices[1].max() + 0.1, 800)
    volume, _ = in_double(skinned(triangles), np.repeat(vertices, 800, -1), surface)
    slope = np.diff(volume) / np.diff(surface)
    assert slope.min() > -1e-6
    assert np.abs(np.diff(slope)).max() < 0.05 * slope.max()


def test_gradients() -> None:
    triangles, vertices, surface = blobs((2,), seed=5)
    assert_gradients_agree(skinned(triangles), vertices, surface, tolerance=1e-4)
    for surface in (np.full(2, -np.inf), np.full(2, 1e3), vertices[1, 3]):
        assert_gradient_finite(skinned(triangles), vertices, np.maximum(surface, -1e6))
    level = vertices.copy()
    level[1] = 0.0  # a body flattened into the surface
    assert_gradient_finite(skinned(triangles), level, np.zeros(2))
