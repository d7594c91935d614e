"""Bodies in fluid for the tests of drag: arguments of both kernels, and what the reference says of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from crowd import posing
from kernels import drag, drag_moments, drag_rigid, drag_skinned
from kernels.wall import apart, no_wall
from tests.kernels import meshes
from tests.kernels.checks import (
    in_double,
    unit_vectors,
)

DENSITY_DRAG, OFFSET = 1080.0, 50.0


def fluid(surface: Any = 1e3, offset: float = 0.0, flow: Any = (0.0, 0.0, 0.0), batch: tuple[int, ...] = ()) -> tuple:
    """Arguments of `drag.Fluid` for a batch."""
    flow = np.asarray(flow, float).reshape(3, *(1,) * len(batch))
    return (
        np.full(batch, DENSITY_DRAG),
        np.full(batch, offset),
        np.broadcast_to(np.asarray(surface, float), batch).copy(),
        np.broadcast_to(flow, (3, *batch)).copy(),
    )


def skinned(triangles: np.ndarray, submersion: Any = "clipped", mode: Any = "area", flag: Any = None):
    """The kernel, of vertices and velocities [3, V, *b]."""

    def run(vertices, velocity, *fluid):
        wall = apart if flag else no_wall
        mesh = vertices.swapaxes(0, 1), velocity.swapaxes(0, 1)
        return tuple(drag_skinned.skinned(triangles, *mesh, drag.Fluid(*fluid), submersion, mode, wall))

    return run


def batched_reference(triangles, vertices, velocity, fluid, submersion, mode, whole=False) -> tuple[np.ndarray, ...]:
    """The reference for every character of a batch; vertices [3, V, *b]."""
    batch = vertices.shape[2:]
    results = []
    for at in np.ndindex(batch):
        here = (slice(None), slice(None), *at)
        constants = float(fluid[0][at]), float(fluid[1][at])
        results.append(
            meshes.reference(
                triangles, vertices[here].T, velocity[here].T, constants, float(fluid[2][at]), submersion, mode, whole
            )
        )
    force, size, moment, slope = (np.array(x) for x in zip(*results, strict=True))
    return force.T.reshape(3, *batch), size.reshape(batch), moment.T.reshape(3, *batch), slope.reshape(batch)


def moving_blob(batch: tuple[int, ...], seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple]:
    """triangles, vertices [3, V, *b], their velocities, and a fluid that covers some of the body."""
    rng = np.random.default_rng(seed)
    vertices, triangles = meshes.blob(seed)
    wide = vertices.T.reshape(3, -1, *(1,) * len(batch))
    placed = wide + 0.03 * rng.normal(size=(3, len(vertices), *batch)) + 0.1 * rng.normal(size=(3, 1, *batch))
    velocity = rng.normal(size=(3, 1, *batch)) + 0.5 * rng.normal(size=placed.shape)
    return triangles, placed, velocity, fluid(rng.uniform(-0.3, 0.4, batch), OFFSET, batch=batch)


def total(
    body: tuple, velocity: Any, surface: Any = 1e3, offset: float = 0.0, **options: Any
) -> tuple[np.ndarray, ...]:
    """Drag in x64 on one body [V, 3] for each velocity [3, n] through the fluid (the same at all its vertices)."""
    vertices, triangles = body
    velocity = np.asarray(velocity, float).reshape(3, -1)
    batch = velocity.shape[1:]
    at = (np.broadcast_to(x, (3, len(vertices), *batch)) for x in (vertices.T[..., None], velocity[:, None]))
    return in_double(skinned(triangles, **options), *at, *fluid(surface, offset, batch=batch))


BONES = 3


def rigid_blob(batch: tuple[int, ...], seed: int = 0, still: bool = False) -> tuple[Any, ...]:
    """bones, mesh, (transforms, velocity, scale), and the same body in the world: triangles, vertices, velocities."""
    rng = np.random.default_rng(seed)
    vertices, faces = meshes.blob(seed)
    size, blocks = 8, len(faces) // 8
    bones = rng.integers(0, BONES, blocks)
    corners = vertices[faces].reshape(blocks, size, 3, 3)  # block, triangle, corner, component
    corners[-1, -1] = corners[-1, -1, :1]  # padding: no area
    mesh = drag_rigid.rigid_mesh(corners)
    tail = (1,) * len(batch)  # the kernel's layout has one axis of characters: [..., 1]
    constant = (mesh.moments, mesh.readings)
    mesh = tuple(x if any(x is one for one in constant) else x.reshape(*x.shape[:-1], *tail) for x in mesh)
    transforms = np.concatenate([unit_vectors(rng, 4, BONES, *batch), 0.2 * rng.normal(size=(3, BONES, *batch))])
    velocity = rng.normal(size=(6, BONES, *batch)) * (np.arange(6) < 3 if still else np.ones(6)).reshape(
        6, 1, *(1,) * len(batch)
    )
    scale = rng.uniform(0.6, 1.6, batch)
    world, moving = in_world(corners, bones, transforms, velocity, scale)
    triangles = np.arange(world.shape[1], dtype=np.int32).reshape(-1, 3)
    return bones, mesh, (transforms, velocity, scale), (triangles, world, moving)


def in_world(corners, bones, transforms, velocity, scale) -> tuple[np.ndarray, np.ndarray]:
    """Every corner of every triangle carried by its bone: positions and velocities [3, 3 T, *b]."""
    batch = scale.shape
    of = np.repeat(bones, corners.shape[1] * 3)
    local = corners.reshape(-1, 3)
    world, moving = np.zeros((2, 3, len(local), *batch))
    for at in np.ndindex(batch):
        here = (slice(None), slice(None), *at)
        t, v = transforms[here][:, of].T, velocity[here][:, of].T
        arm = local * scale[at]
        world[here] = (t[:, 4:] + posing.rotate(t[:, :4], arm)).T
        moving[here] = (v[:, :3] + posing.rotate(t[:, :4], np.cross(v[:, 3:], arm))).T
    return world, moving


def rigid(bones, submersion: Any = "clipped", mode: Any = "area", flag: Any = None):
    def run(mesh, transforms, velocity, scale, *fluid):
        wall = apart if flag else no_wall
        ride, water = drag_moments.RigidMesh(*mesh), drag.Fluid(*fluid)
        return tuple(drag_rigid.rigid(bones, ride, transforms, velocity, scale, water, submersion, mode, wall))

    return run
