"""Drag on bodies whose drag is known: plates, boxes, spheres; at rest, dry, refined, turned."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from kernels.drag_rigid import rigid_mesh
from tests.kernels import meshes
from tests.kernels.checks import (
    assert_close,
    assert_gradient_finite,
    in_double,
    in_single,
    unit_vectors,
)
from tests.kernels.drag_cases import (
    DENSITY_DRAG,
    OFFSET,
    fluid,
    moving_blob,
    rigid,
    rigid_blob,
    skinned,
    total,
)


def test_tilted_plate() -> None:
    """C_D rho A u^2 exactly; tilted by phi: A cos phi along the flow; the back face feels nothing."""
    phi = np.radians([0.0, 20.0, 60.0, 89.0, 91.0, 150.0, 180.0])
    velocity = 2.0 * np.stack([np.sin(phi), 0 * phi, np.cos(phi)])
    side = 0.7
    force, size, _, slope = total(meshes.plate(side=side), velocity)
    expected = DENSITY_DRAG * side**2 * np.maximum(np.cos(phi), 0.0) * 4.0
    assert_close(size, expected, 1e-9)
    assert_close(force, -velocity / 2.0 * expected, 1e-9)
    assert_close(slope, expected / 2.0, 1e-9)


def test_offset_force_of_a_plate() -> None:
    """`area`: B per 0.2 m2 whatever the mesh; `paper`: B per triangle; faded as |u|^2 / (|u|^2 + u_0^2)."""
    speed = np.array([1e-3, 0.01, 1.0])
    velocity = np.stack([0 * speed, 0 * speed, speed])
    fade = speed**2 / (speed**2 + 0.01**2)
    shape = DENSITY_DRAG * speed**2
    for cells in (1, 3):
        body = meshes.plate(cells)
        assert_close(total(body, velocity, offset=OFFSET)[1], shape + OFFSET * fade / 0.2, 1e-8)
        per_triangle = total(body, velocity, offset=OFFSET, mode="paper")[1]
        assert_close(per_triangle, shape + OFFSET * fade * 2 * cells**2, 2e-5)


@pytest.mark.parametrize("cells", [1, 2, 3, 7])
def test_half_a_plate_under_water(cells: int) -> None:
    """One half, centred in the lower half, however the plate is cut into triangles."""
    force, size, moment, _ = total(meshes.plate(cells), [0.0, 0.0, 1.0], surface=0.0)
    assert_close(force[:, 0], np.array([0.0, 0.0, -0.5 * DENSITY_DRAG]), 1e-9)
    assert_close(moment[:, 0] / size[0], np.array([0.0, -0.25, 0.0]), 1e-6)


def test_centroid_submersion_counts_whole_triangles() -> None:
    """Two triangles whose centroids lie at +1/6 and -1/6: one, none or both count."""
    for surface, expected in ((0.0, 0.5), (-0.2, 0.0), (0.2, 1.0)):
        _, size, _, _ = total(meshes.plate(), [0.0, 0.0, 1.0], surface=surface, submersion="centroid")
        assert_close(size[0], expected * DENSITY_DRAG, 1e-9)


@pytest.mark.parametrize("submersion", ["clipped", "centroid"])
def test_dry(submersion: str) -> None:
    """Surface at -inf, or far below: nothing, and gradients that say so."""
    vertices, triangles = meshes.blob()
    shape = (3, len(vertices), 2)
    at = np.broadcast_to(vertices.T[..., None], shape), np.random.default_rng(0).normal(size=shape)
    water = fluid(np.array([-np.inf, -5.0]), OFFSET, batch=(2,))
    run = skinned(triangles, submersion)
    assert all((result == 0).all() for result in in_single(run, *at, *water))
    bones, mesh, placed, _ = rigid_blob((2,))
    ride = rigid(bones, submersion)
    assert all((result == 0).all() for result in in_single(ride, mesh, *placed, *water))
    if submersion == "clipped":
        assert_gradient_finite(run, *at, *water)
        assert_gradient_finite(ride, mesh, *placed, *water)


@pytest.mark.parametrize("mode", ["area", "paper"])
def test_gradient_finite_at_every_degeneracy(mode: str) -> None:
    """At rest, without area, with corners on the surface, level with it; in both forms."""
    vertices, triangles = meshes.plate(2)
    vertices = np.concatenate([vertices, vertices[:, [0, 2, 1]], vertices[:1]])
    corners = len(vertices) - 1
    triangles = np.concatenate([triangles, triangles + 9, [[corners, corners, corners], [0, 0, 1]]]).astype(np.int32)
    shape = (3, len(vertices), 3)
    speed = np.array([0.0, 1e-4, 1.0])
    at = np.broadcast_to(vertices.T[..., None], shape), np.broadcast_to(speed, shape)
    assert_gradient_finite(skinned(triangles, mode=mode), *at, *fluid(0.0, OFFSET, batch=(3,)))
    if mode == "paper":
        return
    mesh = tuple(rigid_mesh(vertices[triangles][None]))  # one block
    transforms = np.zeros((7, 1, 3))
    transforms[0] = 1.0
    velocity = np.zeros((6, 1, 3))
    velocity[:3] = speed
    still = transforms, velocity, np.ones(3)
    assert_gradient_finite(rigid(np.zeros(1, int), mode=mode), mesh, *still, *fluid(0.0, OFFSET, batch=(3,)))


def test_drifting_body_feels_nothing() -> None:
    """Velocity equal to the flow, or to within the stillness threshold."""
    for speed in (0.0, 5e-5):
        result = total(meshes.blob(), [speed, 0.0, 0.0], offset=OFFSET, mode="paper")
        assert all((x == 0).all() for x in result)


def test_closed_convex_body_shows_its_silhouette() -> None:
    """A box: the sum of facing areas is its shadow, from any side; reversing the flow reverses the force."""
    box = meshes.box((0.4, 0.9, 0.6))
    direction = unit_vectors(np.random.default_rng(1), 3, 40)
    shadow = (np.abs(direction) * np.array([[0.9 * 0.6], [0.4 * 0.6], [0.4 * 0.9]])).sum(0)
    force, size, _, _ = total(box, direction)
    assert_close(size / DENSITY_DRAG, shadow, 1e-9)
    assert_close(total(box, -direction)[0], -force, 1e-9)


def test_sphere_shows_a_disc_to_second_order() -> None:
    error = []
    for refinement in (1, 2, 3):
        _, size, _, _ = total(meshes.sphere(refinement), [0.3, -0.5, np.sqrt(1 - 0.34)])
        error.append(abs(size[0] / DENSITY_DRAG - np.pi))
    order = np.log2(np.array(error[:-1]) / error[1:])
    assert ((order > 1.7) & (order < 2.4)).all()
    assert error[-1] < 0.02 * np.pi


@pytest.mark.parametrize("mode", ["area", "paper"])
def test_force_resists(mode: str) -> None:
    """F_i . u_i >= 0 for every triangle, whatever moves how."""
    triangles, vertices, velocity, water = moving_blob((), seed=7)
    apart, speeds = vertices[:, triangles.T], velocity[:, triangles.T]  # each triangle a character of its own
    water = fluid(water[2], OFFSET, batch=(len(triangles),))
    force, size, _, slope = in_double(skinned(np.array([[0, 1, 2]]), mode=mode), apart, speeds, *water)
    share = [meshes.wet_part(water[2][k] - apart[1, :, k]) for k in range(len(triangles))]
    u = -np.stack([w @ speeds[:, :, k].T for k, (_, w) in enumerate(share)], 1)
    assert (size > 0).sum() > 10
    assert ((force * u).sum(0) >= 0).all()
    assert_close((force * u).sum(0), size * np.linalg.norm(u, axis=0), 1e-5)
    assert_close(slope * np.linalg.norm(u, axis=0), size, 1e-5)


def test_turning_everything_turns_the_result() -> None:
    triangles, vertices, velocity, water = moving_blob((4,), seed=8)
    angle = 0.83
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    run = skinned(triangles)
    force, size, moment, slope = in_single(run, vertices, velocity, *water)
    turned = in_single(run, *(np.einsum("rc,c...->r...", turn, x) for x in (vertices, velocity)), *water)
    expected = np.einsum("rc,cn->rn", turn, force), size, np.einsum("rc,cn->rn", turn, moment), slope
    assert_close(turned, expected, 1e-5)


def test_refining_a_translating_body_changes_nothing() -> None:
    """Every triangle in four: force, torque about the origin and centre of pressure to 1e-4, at any depth."""
    body = meshes.blob(3)
    velocity = np.random.default_rng(2).normal(size=(3, 4))
    surface = np.array([-0.2, 0.0, 0.15, 5.0])
    coarse, fine = (total(b, velocity, surface=surface, offset=OFFSET) for b in (body, meshes.split(*body)))
    assert (coarse[1] > 10).all()
    for a, b in zip(coarse, fine, strict=True):
        assert (np.abs(a - b) <= 1e-4 * np.abs(a).max(0)).all()
    pressure = coarse[2] / coarse[1], fine[2] / fine[1]
    assert_close(pressure[1], pressure[0], 1e-4)
    torque = (np.cross(p, r[0], axis=0) for p, r in zip(pressure, (coarse, fine), strict=True))
    a, b = torque
    assert_close(b, a, 1e-4)


def test_refining_a_turning_body_converges() -> None:
    """Each halving of the triangles brings the force nearer: second order."""
    body = meshes.sphere(0)
    spin = np.array([0.4, 1.5, -0.8])
    forces = []
    for _ in range(4):
        vertices, triangles = body
        velocity = np.cross(spin, vertices) + np.array([1.0, 0.2, 0.5])
        run = skinned(triangles)
        forces.append(in_double(run, vertices.T[..., None], velocity.T[..., None], *fluid(batch=(1,)))[0])
        body = meshes.split(*body)
    steps = [np.linalg.norm(b - a) for a, b in pairwise(forces)]
    assert steps[1] < 0.45 * steps[0]
    assert steps[2] < 0.45 * steps[1]


def test_force_is_continuous_and_grows_as_the_body_sinks() -> None:
    surface = np.linspace(-1.0, 1.0, 801)
    _, size, _, _ = total(meshes.blob(4), np.tile([[0.0], [0.0], [1.0]], 801), surface=surface)
    assert size[0] == 0
    assert (np.diff(size) >= -1e-9).all()
    assert np.diff(size).max() < 0.01 * size[-1]
