"""Bodies made round skeletons: closed, skinned, in proportion, deterministic."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from crowd.characters.body_mesh import for_skeleton, from_parts, guess_radii
from crowd.characters.simplification import simplify
from crowd.characters.surface import Part, make_well_composed, sample, surface_nets
from crowd.types import Mesh

PERSON = {  # name: (parent, position), a person with arms out
    "hips": (-1, (0.0, 0.95, 0.0)),
    "spine": (0, (0.0, 1.15, 0.0)),
    "chest": (1, (0.0, 1.35, 0.0)),
    "head": (2, (0.0, 1.62, 0.0)),
    "arm_l": (2, (0.18, 1.40, 0.0)),
    "elbow_l": (4, (0.47, 1.40, 0.0)),
    "hand_l": (5, (0.72, 1.40, 0.0)),
    "arm_r": (2, (-0.18, 1.40, 0.0)),
    "elbow_r": (7, (-0.47, 1.40, 0.0)),
    "hand_r": (8, (-0.72, 1.40, 0.0)),
    "hip_l": (0, (0.10, 0.92, 0.0)),
    "knee_l": (10, (0.15, 0.50, 0.0)),
    "foot_l": (11, (0.19, 0.08, 0.0)),
    "toe_l": (12, (0.19, 0.02, 0.15)),
    "hip_r": (0, (-0.10, 0.92, 0.0)),
    "knee_r": (14, (-0.15, 0.50, 0.0)),
    "foot_r": (15, (-0.19, 0.08, 0.0)),
    "toe_r": (16, (-0.19, 0.02, 0.15)),
}
PARENTS = [parent for parent, _ in PERSON.values()]
POSITIONS = np.array([place for _, place in PERSON.values()])


def body(mesh: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)


def test_body_of_a_person_is_one_closed_skin() -> None:
    mesh = for_skeleton(list(PERSON), PARENTS, POSITIONS)
    shape = body(mesh)
    assert shape.is_watertight and shape.is_winding_consistent and shape.body_count == 1
    assert 0.03 < shape.volume < 0.1
    assert 700 <= len(mesh.triangles) <= 800
    assert np.allclose(mesh.weights.sum(1), 1.0) and mesh.weights.min() >= 0.0
    assert not mesh.joints[mesh.weights == 0.0].any()


def test_every_vertex_follows_bones_near_it() -> None:
    mesh = for_skeleton(list(PERSON), PARENTS, POSITIONS)
    names = list(PERSON)
    left = np.array([name.endswith("_l") for name in names])
    right = np.array([name.endswith("_r") for name in names])
    on_left = mesh.vertices[:, 0] > 0.1
    assert (mesh.weights * right[mesh.joints])[on_left].max() == 0.0
    assert (mesh.weights * left[mesh.joints])[mesh.vertices[:, 0] < -0.1].max() == 0.0
    hand = np.linalg.norm(mesh.vertices - POSITIONS[names.index("hand_l")], axis=1) < 0.03
    # The end of a chain is a sphere of its own joint or of the bone that leads there.
    carried = np.isin(mesh.joints, [names.index("hand_l"), names.index("elbow_l")])
    assert (mesh.weights * carried)[hand].sum(1) == pytest.approx(1.0)


def test_inverse_bind_takes_joints_to_their_own_origin() -> None:
    turned = np.tile([0.8, 0.0, 0.6, 0.0], (len(PERSON), 1))
    mesh = for_skeleton(list(PERSON), PARENTS, POSITIONS, rotations=turned)
    homogeneous = np.concatenate([POSITIONS, np.ones((len(PERSON), 1))], 1)
    assert np.allclose(np.einsum("jrc,jc->jr", mesh.inverse_bind, homogeneous)[:, :3], 0.0)
    assert np.allclose(np.linalg.det(mesh.inverse_bind[:, :3, :3]), 1.0)


def test_same_skeleton_same_mesh() -> None:
    first, second = (for_skeleton(list(PERSON), PARENTS, POSITIONS, triangles=400) for _ in range(2))
    assert np.array_equal(first.vertices, second.vertices) and np.array_equal(first.triangles, second.triangles)
    assert 300 <= len(first.triangles) <= 400


def test_radii_are_those_of_a_person() -> None:
    radii = dict(zip(PERSON, guess_radii(PARENTS, POSITIONS), strict=True))
    assert 0.05 < radii["knee_l"] < 0.075
    assert 0.07 < radii["hip_l"] < 0.1
    assert 0.09 < radii["chest"] < 0.14
    assert 0.06 < radii["head"] < 0.1
    assert radii["knee_l"] > radii["elbow_l"] > radii["hand_l"]
    doubled = guess_radii(PARENTS, 2.0 * POSITIONS)
    assert np.allclose(doubled, 2.0 * np.array(list(radii.values())))


def test_thin_chains_and_lone_joints_have_a_body() -> None:
    line = np.array([[0.0, 0.1 * k, 0.0] for k in range(6)])
    assert body(for_skeleton([str(k) for k in range(6)], [-1, 0, 1, 2, 3, 4], line)).is_watertight
    assert body(for_skeleton(["one"], [-1], np.zeros((1, 3)))).is_watertight
    doubled = np.concatenate([line, line[-1:]])  # a bone of no length
    assert body(for_skeleton([str(k) for k in range(7)], [-1, 0, 1, 2, 3, 4, 5], doubled)).is_watertight


@pytest.mark.parametrize("positions", [np.zeros((0, 3)), np.array([[0.0, np.nan, 0.0]])])
def test_impossible_skeletons_are_refused(positions: np.ndarray) -> None:
    with pytest.raises(ValueError, match="finite positions"):
        for_skeleton([str(k) for k in range(len(positions))], [-1] * len(positions), positions)


def test_surface_of_a_sphere() -> None:
    parts = [Part(0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.5, 0.5))]
    field, origin = sample(parts, 0.05, 0.01)
    vertices, triangles = surface_nets(make_well_composed(field, 0.05), origin, 0.05)
    shape = trimesh.Trimesh(vertices, triangles, process=False)
    assert shape.is_watertight
    assert shape.volume == pytest.approx(4.0 / 3.0 * np.pi * 0.5**3, rel=0.02)


def test_random_noise_gives_a_closed_manifold() -> None:
    field = np.random.default_rng(3).normal(size=(14, 14, 14))
    field[[0, -1]] = field[:, [0, -1]] = field[:, :, [0, -1]] = 1.0
    vertices, triangles = surface_nets(make_well_composed(field, 1.0), np.zeros(3), 1.0)
    assert trimesh.Trimesh(vertices, triangles, process=False).is_watertight


def test_simplified_surface_stays_closed_and_keeps_its_volume() -> None:
    sphere = trimesh.creation.icosphere(4)
    none = np.zeros((len(sphere.vertices), 1))
    vertices, triangles = simplify(np.array(sphere.vertices), np.array(sphere.faces), none, 200)
    shape = trimesh.Trimesh(vertices, triangles, process=False)
    assert shape.is_watertight and shape.is_winding_consistent and shape.euler_number == 2
    assert 190 <= len(triangles) <= 200
    assert shape.volume == pytest.approx(sphere.volume, rel=0.03)


def test_frontal_area_has_no_faces_inside_the_body() -> None:
    """Facing area of a closed body without inner faces is at most its silhouette times the times a ray enters it."""
    parts = [
        Part(0, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.2, 0.2)),
        Part(1, (0.0, 0.5, 0.0), (0.8, 0.5, 0.0), (0.1, 0.1)),
    ]
    mesh = from_parts(parts, [-1, 0], np.zeros((2, 3)), triangles=700, cell=0.04)
    corners = mesh.vertices[mesh.triangles]
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2].clip(0.0).sum() / 2.0
    silhouette = 1.0 * 0.4 + np.pi * 0.2**2 + 0.6 * 0.2 + 0.5 * np.pi * 0.1**2
    assert facing == pytest.approx(silhouette, rel=0.06)
