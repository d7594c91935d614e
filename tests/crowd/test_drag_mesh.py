"""Drag meshes of fewer triangles: closed, as large as the skin, and nearer to its drag the more there are."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
import trimesh

from crowd import posing, scene
from crowd.build import build
from crowd.characters.mesh_cleaning import signed_volume
from crowd.drag_error import _corners, _moments, _wrench, detail_notes, detail_rows, drag_error
from crowd.drag_mesh import decimated
from crowd.mesh_assets import blocks
from crowd.scene import HerdScene, Scene
from crowd.types import Clip, Mesh
from kernels.drag import Fluid
from kernels.drag_skinned import skinned
from tests.crowd.scenes import herd, scenario


@pytest.fixture(scope="module")
def wading() -> Scene:
    """People with two hundred rigid triangles, and others with their skins, in water."""
    herds = [
        herd("few", "human", 2, detail={"triangles": 200, "mesh": "rigid"}),
        herd("all", "human", 2),
    ]
    return scene.load(scenario(herds, 0.9, drag={"mesh": "skinned"}))


@pytest.fixture(scope="module")
def people(wading: Scene) -> HerdScene:
    return wading.herds[1]


def shape(mesh: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)


@pytest.mark.parametrize("count", [400, 200, 100])
def test_a_closed_skin_stays_closed_and_as_large(people: HerdScene, count: int) -> None:
    skin = people.archetype.mesh
    mesh = decimated(skin, count)
    found = shape(mesh)
    assert found.is_watertight and found.is_winding_consistent
    assert found.euler_number == shape(skin).euler_number
    assert count - 2 <= len(mesh.triangles) <= count
    assert found.volume == pytest.approx(shape(skin).volume, rel=2e-3)
    assert found.area == pytest.approx(shape(skin).area, rel=0.12)
    reach = np.ptp(mesh.vertices, axis=0) / np.ptp(skin.vertices, axis=0)
    assert (reach > 0.93).all() and (reach < 1.0 + 1e-9).all()


def test_bones_are_those_of_the_nearest_skin(people: HerdScene) -> None:
    skin = people.archetype.mesh
    mesh = decimated(skin, 200)
    np.testing.assert_allclose(mesh.weights.sum(1), 1.0, atol=1e-9)
    assert mesh.joints.shape == mesh.weights.shape == (len(mesh.vertices), 4)
    for one in (np.argmax, np.argmin):  # the highest vertex is the head's, the lowest a foot's
        mine = one(mesh.vertices[:, 1])
        theirs = np.linalg.norm(skin.vertices - mesh.vertices[mine], axis=1).argmin()
        assert mesh.joints[mine, mesh.weights[mine].argmax()] == skin.joints[theirs, skin.weights[theirs].argmax()]


def test_seams_do_not_open(people: HerdScene) -> None:
    """A mesh whose every triangle has vertices of its own, as files have along seams."""
    skin = people.archetype.mesh
    corner = skin.triangles.reshape(-1)
    torn = dataclasses.replace(
        skin,
        vertices=skin.vertices[corner],
        triangles=np.arange(len(corner), dtype=np.int32).reshape(-1, 3),
        joints=skin.joints[corner],
        weights=skin.weights[corner],
    )
    mesh = decimated(torn, 300)
    assert shape(mesh).is_watertight
    assert signed_volume(mesh.vertices, mesh.triangles) == pytest.approx(
        signed_volume(skin.vertices, skin.triangles), rel=2e-3
    )


def test_an_open_skin_keeps_its_border(people: HerdScene) -> None:
    skin = people.archetype.mesh
    low = skin.vertices[skin.triangles, 1].max(1) < 1.3
    mesh = decimated(dataclasses.replace(skin, triangles=skin.triangles[low]), 300)
    assert 290 <= len(mesh.triangles) <= 300
    assert np.isfinite(mesh.vertices).all()


def test_few_triangles_are_left_alone(people: HerdScene) -> None:
    assert decimated(people.archetype.mesh, 5000) is people.archetype.mesh


def test_the_error_falls_with_the_triangles(wading: Scene, people: HerdScene) -> None:
    skin = people.archetype.mesh
    errors = [drag_error(wading, people, decimated(skin, count), rigid=False) for count in (600, 400, 100)]
    forces = [error.rms_force for error in errors]
    assert forces == sorted(forces)
    assert forces[0] < 0.025 and forces[1] < 0.04 and forces[2] < 0.15
    assert errors[0].rms_torque < errors[2].rms_torque
    assert drag_error(wading, people, skin, rigid=False).rms_force < 1e-12
    assert 0.001 < drag_error(wading, people, skin, rigid=True).rms_force < 0.05


def test_the_estimate_has_the_drag_of_the_step(people: HerdScene) -> None:
    mesh = people.archetype.mesh
    moment = _moments(people)[2]
    corner, before = _corners(mesh, False, *moment.now), _corners(mesh, False, *moment.before)
    velocity, slip = np.array([0.3, 0.0, 1.1]), (corner - before) / moment.passed
    found = _wrench(corner, slip, velocity[None], 0.9, False, (998.0, 1.08, 2.0), np.zeros(3))[0]
    vertices, faces = corner.reshape(-1, 3), np.arange(corner.size // 3).reshape(-1, 3)
    moving = slip.reshape(-1, 3) + velocity
    fluid = Fluid(jnp.array([998.0 * 1.08]), jnp.array([2.0]), jnp.array([0.9]), jnp.zeros((3, 1)))
    place, way = (jnp.asarray(x[..., None], jnp.float32) for x in (vertices, moving))
    exact = skinned(faces, place, way, fluid)
    np.testing.assert_allclose(found[0], np.asarray(exact.force)[:, 0], rtol=1e-3, atol=0.05)
    centre = np.asarray(exact.moment)[:, 0] / np.asarray(exact.magnitude)[0]
    np.testing.assert_allclose(found[1], np.cross(centre, found[0]), rtol=2e-3, atol=0.05)


def test_each_herd_has_its_mesh(wading: Scene) -> None:
    layout, assets, _, states = build(wading)
    assert (layout.mesh, layout.of(0).mesh, layout.of(1).mesh) == ("skinned", "rigid", "skinned")
    few, every = wading.herds
    assert layout.herds[0].triangles.values.shape == few.drag_mesh.triangles.shape == (200, 3)
    assert layout.herds[1].triangles.values.shape == every.archetype.mesh.triangles.shape
    assert len(assets.herds[0].skin_local[0, 0]) == len(few.drag_mesh.vertices)
    assert states[0].previous.shape[1] == 7 and states[1].previous.shape[2] == 3
    assert few.archetype.mesh is every.archetype.mesh, "pictures show the skin"


def test_errors_are_told(wading: Scene) -> None:
    (note,) = detail_notes(wading)
    assert note.startswith("few: drag on 200 rigid triangles: force ") and "the skin's 772" in note
    rows = detail_rows(wading)
    names = ["drag_force_error", "drag_force_error_rms", "drag_torque_error", "drag_torque_error_rms"]
    assert [row.quantity for row in rows] == names
    assert all(row.herd == "few" and row.unit == "%" for row in rows)
    assert 1.0 < rows[1].mean < 15.0
    assert rows[0].n > 400


@pytest.mark.parametrize(("kind", "depth"), [("human", 0.5), ("dog", 0.24), ("hexapod", 0.16), ("spider", 0.16)])
def test_blocks_that_get_wet_come_first(kind: str, depth: float) -> None:
    """Up to the last block that comes under a level surface in the walk there are hardly any others."""
    herd_ = scene.load(scenario([herd("one", kind, 1)])).herds[0]
    bones, mesh = blocks(herd_)
    walk = herd_.gaits[0]
    turn, at = posing.world_transforms(
        herd_.archetype.skeleton, posing.clip_motion(Clip("", "other", 1.0, walk.rotation, walk.translation))
    )
    corners = np.asarray(mesh.corners, float)[..., 0].transpose(2, 3, 0, 1)  # [blocks, size, 3 corners, 3]
    real = (np.asarray(mesh.area) != 0).any((0, 3))  # [blocks, size]; the rest is padding
    lowest = np.full(len(bones), np.inf)
    for block in np.flatnonzero(real.any(1)):
        bone, corner = bones[block], corners[block][real[block]]
        height = at[:, None, None, bone, 1] + posing.rotate(turn[:, None, None, bone], corner)[..., 1]
        lowest[block] = height.min()
    wet = lowest < depth
    assert 0 < wet.sum() < 0.6 * len(bones)
    assert np.flatnonzero(wet).max() + 1 <= wet.sum() + 5
