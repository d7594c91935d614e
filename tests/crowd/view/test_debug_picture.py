"""Debug pictures: plates where the footprints are, a ghost that is the clips' own pose, and the file of a report."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest
from PIL import Image

from crowd import posing
from crowd.report import write_report
from crowd.types import Motion
from crowd.view.debug_picture import beside, bodies
from crowd.view.footprints import crosses, footprint_bodies, outlines, plates
from crowd.view.ghost import ghost_bodies, unadjusted_pose
from crowd.view.palette import leg_color, linear, srgb
from tests.crowd.made_strides import striding

FRAME = 47


@dataclass(frozen=True, eq=False)
class PosedMotion:
    """Stands for an analysed motion with its clip."""

    name: str
    kind: str
    duration: float
    velocity: np.ndarray
    keytimes: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray

    def clip_phase(self, clock: np.ndarray) -> np.ndarray:
        return np.mod(clock, 1.0)


@pytest.fixture(scope="module")
def made(made_result):
    """The made walk with clips: standing in the rest pose, and the box man's walk."""
    run = striding(made_result)
    herd = run.scene.herds[0]
    clip, rest = herd.archetype.clips[0], herd.archetype.skeleton
    stand, walk = herd.motions  # pyright: ignore[reportAttributeAccessIssue]
    poses = ((rest.rest_rotation[None], rest.rest_translation[None]), (clip.rotation, clip.translation))
    motions = tuple(
        PosedMotion(motion.name, kind, 1.0, motion.velocity, motion.keytimes, *pose)
        for motion, kind, pose in zip((stand, walk), ("grounded", "walk"), poses, strict=True)
    )
    herds = (dataclasses.replace(herd, motions=motions), *run.scene.herds[1:])
    return dataclasses.replace(run, scene=dataclasses.replace(run.scene, herds=herds))


def closed(triangles: np.ndarray) -> bool:
    """Whether every edge is met once in each direction."""
    edges = [(int(face[k]), int(face[(k + 1) % 3])) for face in triangles for k in range(3)]
    return len(set(edges)) == len(edges) and set(edges) == {(b, a) for a, b in edges}


def volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6)


def test_bodies_of_prints_are_closed_and_face_outwards():
    heel, along, color = np.array([[1.0, 0.5, 2.0]]), np.array([[0.1, 0.02, 0.2]]), np.ones((1, 3))
    size = np.array([0.2])
    solids = [plates(heel, along, color), outlines(heel, along, color), crosses(heel, size, color)]
    for body in solids:
        assert closed(body.triangles)
    volumes = [volume(body.vertices[0], body.triangles) for body in solids]
    length, thick = np.hypot(0.1, 0.2), 0.024
    assert volumes[0] == pytest.approx(0.36 * length**2 * thick)
    assert 0 < volumes[1] < 0.6 * volumes[0]
    assert volumes[2] == pytest.approx(2 * 0.16 * 0.2**2 * thick)  # both arms whole


def test_prints_of_a_frame(made):
    arrays = made.herds["ones"]
    behind, ahead, goal = footprint_bodies(arrays, FRAME, slice(1, 3))
    assert [len(body.vertices) for body in (behind, ahead, goal)] == [4, 4, 4]
    middle = arrays["footprint_from"][FRAME, 1:3] + 0.5 * arrays["footprint_from_direction"][FRAME, 1:3]
    assert np.allclose(behind.vertices.mean(1), middle.reshape(-1, 3))
    assert np.allclose(goal.vertices.mean(1), arrays["footprint_goal"][FRAME, 1:3].reshape(-1, 3))
    assert np.allclose(behind.color[1], linear(srgb(leg_color(1))))
    assert (ahead.color >= behind.color).all() and (ahead.color > behind.color).any()
    assert footprint_bodies({"heel": arrays["heel"]}, FRAME, slice(0, 1)) == []


def test_ghost_is_the_clips_pose(made):
    herd, arrays = made.scene.herds[0], dict(made.herds["ones"])
    arrays["weights"] = np.broadcast_to([0.0, 1.0], arrays["weights"].shape)
    arrays["yaw"] = np.full_like(arrays["yaw"], 0.5 * np.pi)
    (ghost,) = ghost_bodies(herd, arrays, made.time, FRAME, slice(1, 2), -2.0)
    clip = herd.archetype.clips[0]
    at = arrays["phase"][FRAME, 1] * len(clip.rotation)
    assert at == pytest.approx(10.5)
    rotation = clip.rotation[10] + clip.rotation[11]
    rotation /= np.linalg.norm(rotation, axis=-1, keepdims=True)
    turn = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0])
    # It looks along +x, so its right is +z.
    place = arrays["position"][FRAME, 1] + np.array([0.0, 0.0, 2.0])
    pose = Motion(place, turn, rotation, clip.translation[10], np.array(1.0))
    expected = posing.skin(herd.archetype.mesh, *posing.world_transforms(herd.archetype.skeleton, pose))
    assert np.allclose(ghost.vertices[0], expected, atol=1e-6)


def test_ghost_blends_by_weight_whatever_the_signs(made):
    motions = made.scene.herds[0].motions
    flipped = dataclasses.replace(motions[0], rotation=-motions[0].rotation)
    clock, weights = np.array([0.25, 0.6]), np.array([[0.5, 0.5], [0.0, 0.0]])
    rotation, _ = unadjusted_pose(motions, weights, clock, 0.0)
    again, _ = unadjusted_pose((flipped, motions[1]), weights, clock, 0.0)
    assert np.allclose(np.abs(np.sum(rotation * again, -1)), 1.0)
    assert np.allclose(np.linalg.norm(rotation, axis=-1), 1.0)
    hip = made.scene.herds[0].archetype.legs[0].hip
    half, full = (2 * np.arctan2(-q[1], q[0]) for q in (rotation[0, hip], motions[1].rotation[7, hip]))
    assert half == pytest.approx(0.5 * full, rel=0.05)
    assert np.allclose(rotation[1], motions[0].rotation[0])  # no weight at all: the first motion


def test_no_ghost_without_clips_or_weight(made, made_result):
    arrays = made.herds["ones"]
    recorded = striding(made_result).scene.herds[0]
    assert ghost_bodies(recorded, arrays, made.time, FRAME, slice(0, 1), 1.0) == []
    other = arrays | {"weights": np.zeros_like(arrays["weights"])}
    assert ghost_bodies(made.scene.herds[0], other, made.time, FRAME, slice(0, 1), 1.0) == []
    assert len(bodies(made, made.scene.herds[0], FRAME)) == 5
    assert beside(recorded) > np.ptp(recorded.archetype.mesh.vertices[:, 0])


def test_report_draws_it_when_asked(made, tmp_path):
    pictures = made.scene.scenario.pictures
    assert not pictures.debug
    assert "debug" not in write_report(made, None, tmp_path / "no", pictures)
    asked = pictures.model_copy(update={"debug": True, "height_px": 96, "width_px": 96})
    path = write_report(made, None, tmp_path / "yes", asked)["debug"]
    with Image.open(path) as image:
        assert image.size == (2 * 96 + 6, 96)
        pixels = np.asarray(image.convert("RGB")).astype(int)
    blue = (pixels[..., 2] > pixels[..., 0] + 40).sum()
    orange = (pixels[..., 0] > pixels[..., 2] + 60).sum()
    assert blue > 10 and orange > 10  # the legs' colours
