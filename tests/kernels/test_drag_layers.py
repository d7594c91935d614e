"""Drag between two levels: triangles cut into thin slices by hand, sums over layers, surfaces that are not level."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from kernels import drag, drag_moments, drag_rigid, drag_skinned
from kernels.wall import apart, no_wall
from tests.kernels import meshes
from tests.kernels.checks import BATCHES, assert_close, assert_gradients_agree, in_double, in_single
from tests.kernels.drag_cases import OFFSET, fluid, moving_blob, rigid_blob


def skinned(triangles: np.ndarray, floor: Any, submersion: Any = "clipped", flag: bool = False):
    def run(vertices, velocity, floor, *water):
        wall = apart if flag else no_wall
        mesh = vertices.swapaxes(0, 1), velocity.swapaxes(0, 1)
        return tuple(drag_skinned.skinned(triangles, *mesh, drag.Fluid(*water), submersion, "area", wall, floor))

    return lambda vertices, velocity, *water: run(vertices, velocity, jnp.asarray(floor), *water)


def rigid(bones: np.ndarray, floor: Any, flag: bool = False):
    def run(mesh, transforms, velocity, scale, *water):
        wall = apart if flag else no_wall
        mesh, water = drag_moments.RigidMesh(*mesh), drag.Fluid(*water)
        return tuple(
            drag_rigid.rigid(bones, mesh, transforms, velocity, scale, water, wall=wall, floor=jnp.asarray(floor))
        )

    return run


def sliced(vertices: np.ndarray, velocity: np.ndarray, triangles: np.ndarray, low: float, high: float) -> np.ndarray:
    """Force on the part of a body [V, 3] between two heights: polygons cut twice, then as in the paper."""
    force = np.zeros(3)
    for corners, moving in zip(vertices[triangles], velocity[triangles], strict=True):
        polygon = np.concatenate([corners, moving], 1)
        for sign, level in ((1, high), (-1, low)):
            kept, depth = [], sign * (level - polygon[:, 1]) if len(polygon) else np.zeros(0)
            for k in range(len(polygon)):
                a, b, da, db = polygon[k], polygon[(k + 1) % len(polygon)], depth[k], depth[(k + 1) % len(polygon)]
                kept += [a] if da > 0 else []
                kept += [a + (b - a) * da / (da - db)] if (da > 0) != (db > 0) else []
            polygon = np.array(kept)
        if len(polygon) < 3:
            continue
        fan = [(polygon[0], polygon[k], polygon[k + 1]) for k in range(1, len(polygon) - 1)]
        area = np.array([0.5 * np.cross(b[:3] - a[:3], c[:3] - a[:3]) for a, b, c in fan])
        size = np.linalg.norm(area, axis=1)
        if size.sum() < 1e-14:
            continue
        u = -(size[:, None] * np.array([(a + b + c)[3:] / 3 for a, b, c in fan])).sum(0) / size.sum()
        speed = np.linalg.norm(u)
        projected = max(-area.sum(0) @ u / speed, 0.0)
        offset = OFFSET / meshes.REFERENCE_AREA * projected * speed**2 / (speed**2 + meshes.FADE_SPEED**2)
        force += (1080.0 * projected * speed**2 + offset) * u / speed
    return force


def test_a_slice_of_the_body() -> None:
    """The layer between two levels is the body cut at both."""
    triangles, vertices, velocity, _ = moving_blob((3,), seed=3)
    water = fluid(np.array([0.2, 0.05, 0.5]), OFFSET, batch=(3,))
    floor = np.array([0.0, -0.2, -0.6])
    expected = np.stack(
        [sliced(vertices[..., i].T, velocity[..., i].T, triangles, floor[i], water[2][i]) for i in range(3)],
        1,
    )
    assert np.abs(expected).max() > 10
    assert_close(in_double(skinned(triangles, floor), vertices, velocity, *water)[0], expected, 1e-6)
    assert_close(in_single(skinned(triangles, floor, flag=True), vertices, velocity, *water)[0], expected, 1e-3)


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("kind", ["skinned", "rigid"])
def test_layers_of_one_fluid_are_that_fluid(kind: str, batch: tuple[int, ...]) -> None:
    """To the wet area; forces differ by what the velocity varies within a triangle, not at all where it does not."""
    if kind == "skinned":
        triangles, vertices, velocity, _ = moving_blob(batch)
        velocity = np.broadcast_to(velocity[:, :1], velocity.shape).copy()
        at, run = (vertices, velocity), lambda floor: skinned(triangles, floor)
    else:
        bones, mesh, moved, _ = rigid_blob(batch)
        at, run = (mesh, *moved), lambda floor: rigid(bones, floor)
    top, middle = 0.25, -0.05
    whole = in_double(run(np.full(batch, -1e4)), *at, *fluid(top, OFFSET, batch=batch))
    parts = [
        in_double(run(np.full(batch, middle)), *at, *fluid(top, OFFSET, batch=batch)),
        in_double(run(np.full(batch, -1e4)), *at, *fluid(middle, OFFSET, batch=batch)),
    ]
    for number in (0, 1, 3):
        assert_close(parts[0][number] + parts[1][number], whole[number], 1e-8)


@pytest.mark.parametrize("submersion", ["clipped", "centroid"])
def test_a_floor_above_the_surface_leaves_nothing(submersion: str) -> None:
    triangles, vertices, velocity, water = moving_blob((2,))
    found = in_single(skinned(triangles, water[2] + 0.1, submersion), vertices, velocity, *water)
    assert all((x == 0).all() for x in found)


def test_continuous_in_the_floor() -> None:
    triangles, vertices, velocity, _ = moving_blob((1,), seed=5)
    floor = np.linspace(-0.6, 0.6, 400)
    many = [np.repeat(x, 400, -1) for x in (vertices, velocity)]
    force = in_double(skinned(triangles, floor), *many, *fluid(0.3, OFFSET, batch=(400,)))[0]
    assert np.abs(np.diff(force)).max() < 0.02 * np.ptp(force, axis=1).max()
    assert_close(force[:, -1], np.zeros(3), 1e-12)


@pytest.mark.parametrize("flag", [False, True], ids=["plain", "walls"])
def test_gradients_between_levels(flag: bool) -> None:
    triangles, vertices, velocity, water = moving_blob((2,), seed=2)

    def run(vertices, velocity, floor, *water):
        return skinned(triangles[::4], floor, flag=flag)(vertices, velocity, *water)

    assert_gradients_agree(run, vertices, velocity, water[2] - 0.21, *water, tolerance=1e-4, seed=3)


@pytest.mark.parametrize("flag", [False, True], ids=["plain", "walls"])
def test_gradients_between_uneven_levels(flag: bool) -> None:
    """Surface and floor of every vertex its own."""
    triangles, vertices, velocity, water = moving_blob((2,), seed=8)
    surface = water[2] + 0.2 * vertices[0]

    def run(vertices, velocity, floor, surface):
        return skinned(triangles[::4], floor, flag=flag)(vertices, velocity, *water[:2], surface, water[3])

    assert_gradients_agree(run, vertices, velocity, surface - 0.24, surface, tolerance=1e-4, seed=3)


@pytest.mark.parametrize("flag", [False, True], ids=["plain", "walls"])
def test_rigid_gradients_between_levels(flag: bool) -> None:
    bones, mesh, at, _ = rigid_blob((2,), seed=9)
    water = fluid(0.11, OFFSET, batch=(2,))

    def run(transforms, velocity, scale, floor, *water):
        with jax.enable_x64(True):
            wide = tuple(jnp.asarray(x) for x in mesh)
        return rigid(bones, floor, flag)(wide, transforms, velocity, scale, *water)

    assert_gradients_agree(run, *at, np.array([-0.13, 0.02]), *water, tolerance=1e-4)


def test_a_surface_of_its_own_over_every_vertex() -> None:
    """A sloping surface is a level one over a body that is sheared; equal heights are the level surface."""
    triangles, vertices, velocity, water = moving_blob((2,), seed=7)
    run = skinned(triangles, np.full(2, -1e4))
    over = (*water[:2], np.broadcast_to(water[2], vertices.shape[1:]).copy(), water[3])
    assert_close(in_double(run, vertices, velocity, *over), in_double(run, vertices, velocity, *water), 1e-12)
    sloping = (*water[:2], water[2] + 0.3 * vertices[0], water[3])
    wet = in_double(run, vertices, 0 * velocity + np.array([1.0, 0, 0]).reshape(3, 1, 1), *sloping)
    for i in range(2):
        depth = sloping[2][:, i] - vertices[1, :, i]
        size = 0.0
        for triangle in triangles:
            a, b, c = vertices[:, triangle, i].T
            share, _ = meshes.wet_part(depth[triangle])
            size += share * max(0.5 * np.cross(b - a, c - a)[0], 0.0)
        expected = 1080.0 * size + OFFSET / 0.2 * size / (1 + 1e-4)
        np.testing.assert_allclose(wet[1][i], expected, rtol=1e-6)
