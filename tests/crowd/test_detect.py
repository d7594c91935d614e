"""Detection by geometry and motion on creatures built in code; their joints have telling names only for the test."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crowd import posing
from crowd.characters import load
from crowd.characters.inspect import inspect
from crowd.types import Archetype
from tests.crowd.glb_writer import SAMPLES, Rig, biped, build, crawler, quadruped, turn


def loaded(rig: Rig, folder: Path, description: dict | None = None, **how: float) -> Archetype:
    build(rig, **how).write(folder / "a.glb")  # type: ignore[arg-type]
    return load("a.glb", folder, description)


def legs(archetype: Archetype) -> dict[str, tuple[str, str, str, str]]:
    names = archetype.skeleton.names
    return {leg.name: (names[leg.hip], names[leg.knee], names[leg.ankle], names[leg.ball]) for leg in archetype.legs}


def roles(archetype: Archetype) -> dict[str, str]:
    return {clip.name: clip.role for clip in archetype.clips}


def contacts(archetype: Archetype, name: str) -> np.ndarray:
    """Contact points [F, L, 3] of a clip in the character frame."""
    clip = next(clip for clip in archetype.clips if clip.name == name)
    rotation, position = posing.world_transforms(archetype.skeleton, posing.clip_motion(clip))
    points = [position[:, g.ball] + posing.rotate(rotation[:, g.ball], np.array(g.ball_offset)) for g in archetype.legs]
    return np.stack(points, 1)


def scrambled(rig: Rig) -> Rig:
    """The same creature with names that say nothing."""
    rig.names = [f"n{(37 * k + 11) % 101}" for k in range(len(rig.names))]
    return rig


def test_biped(tmp_path: Path) -> None:
    archetype = loaded(biped(), tmp_path)
    assert legs(archetype) == {"left": ("a1", "b1", "c1", "d1"), "right": ("a-1", "b-1", "c-1", "d-1")}
    assert [archetype.skeleton.names[arm.hand] for arm in archetype.arms] == ["g1", "g-1"]
    assert [archetype.skeleton.names[arm.shoulder] for arm in archetype.arms] == ["e1", "e-1"]
    assert roles(archetype) == {"two": "idle", "one": "walk", "three": "run"}
    assert archetype.skeleton.names[archetype.pelvis] == "j0"
    assert archetype.height == pytest.approx(1.7, abs=1e-3)
    assert 50 < archetype.mass < 120


def test_names_do_not_matter(tmp_path: Path) -> None:
    for make in (biped, quadruped, lambda: crawler(3)):
        plain, blind = loaded(make(), tmp_path), loaded(scrambled(make()), tmp_path)
        assert plain.legs == blind.legs
        assert plain.arms == blind.arms
        assert [clip.role for clip in plain.clips] == [clip.role for clip in blind.clips]


@pytest.mark.parametrize("yaw", [0.0, 1.5707963, 3.1415927, -1.2])
def test_facing_follows_the_feet(tmp_path: Path, yaw: float) -> None:
    archetype = loaded(biped(), tmp_path, yaw=yaw)
    assert list(legs(archetype)) == ["left", "right"]
    assert legs(archetype)["left"][0] == "a1"
    foot = contacts(archetype, "one")
    low = foot[..., 1] < 0.005
    steps = np.diff(foot, axis=0)[low[1:] & low[:-1]]
    assert np.median(steps[:, 2]) < 0  # planted feet go backwards
    assert np.abs(np.median(steps[:, 0])) < 0.05 * np.abs(np.median(steps[:, 2]))


@pytest.mark.parametrize(("scale", "height"), [(1.0, 1.7), (100.0, 1.7), (1000.0, 1.7), (2.0, 3.4)])
def test_size(tmp_path: Path, scale: float, height: float) -> None:
    """Metres are kept while plausible; centimetres and millimetres are recognised and told."""
    archetype = loaded(biped(), tmp_path, scale=scale)
    assert archetype.height == pytest.approx(height, rel=1e-3)
    assert any("size" in note for note in archetype.notes) == (scale > 10)


def test_size_from_the_description(tmp_path: Path) -> None:
    assert loaded(biped(), tmp_path, {"height_m": 1.2}, scale=100).height == pytest.approx(1.2)
    assert loaded(biped(), tmp_path, {"metres_per_unit": 0.5}).height == pytest.approx(0.85, rel=1e-3)
    assert loaded(biped(), tmp_path, {"mass_kg": 77}).mass == 77


@pytest.mark.parametrize("pairs", [3, 4])
@pytest.mark.parametrize("tarsus", [True, False])
def test_many_legs(tmp_path: Path, pairs: int, tarsus: bool) -> None:
    archetype = loaded(crawler(pairs, tarsus), tmp_path)
    expected = {}
    for row in range(pairs):
        for side, word in ((1, "left"), (-1, "right")):
            end = f"tarsus{row}{side}" if tarsus else f"tibia{row}{side}.tip"
            expected[f"{row + 1} {word}"] = (f"coxa{row}{side}", f"tibia{row}{side}", end, end)
    assert legs(archetype) == expected
    assert roles(archetype) == {"walk": "walk", "rest": "idle"}
    foot = contacts(archetype, "walk")
    assert abs(foot[..., 1].min()) < 1e-6
    # two sets of legs land half a cycle apart
    landing = {clip.name: clip for clip in inspect(tmp_path / "a.glb").archetype.clips}
    assert "walk" in landing


def test_digitigrade_long_neck_and_tail(tmp_path: Path) -> None:
    """The hock is no ankle, the neck no leg, and the tail that hangs to the ground no fifth one."""
    archetype = loaded(quadruped(), tmp_path)
    assert legs(archetype) == {
        "front left": ("p01", "q01", "s01", "s01"),
        "front right": ("p0-1", "q0-1", "s0-1", "s0-1"),
        "hind left": ("p11", "q11", "s11", "s11"),
        "hind right": ("p1-1", "q1-1", "s1-1", "s1-1"),
    }
    assert archetype.arms == ()
    assert any("tail3" in note for note in archetype.notes)
    assert roles(archetype) == {"amble": "walk", "still": "idle"}


def test_speed_and_phases_as_authored(tmp_path: Path) -> None:
    build(quadruped()).write(tmp_path / "a.glb")
    found = inspect(tmp_path / "a.glb")
    line = next(line for line in found.lines if "'amble'" in line)
    assert "0.6" in line.split(" m/s")[0]  # stride 0.4 m in 0.62 of a second
    for name, phase in (("front left", 0.25), ("front right", 0.75), ("hind left", 0.0), ("hind right", 0.5)):
        told = float(line.split(f"{name} ")[1].split(",")[0])
        assert min(abs(told - phase), 1 - abs(told - phase)) < 0.04


def test_feet_left_under_the_root_join_their_legs(tmp_path: Path) -> None:
    """Inverse kinematics rigs keep feet beside the body; bending a knee must take them along."""
    rig = biped()
    walk = rig.clips["one"]
    detached = {}
    places = np.array(rig.places)
    for side in (1, -1):
        hip, knee, ankle = (rig.names.index(f"{part}{side}") for part in "abc")
        detached[ankle] = (hip, knee)
    build(rig).write(tmp_path / "whole.glb")
    whole = load("whole.glb", tmp_path)
    for ankle in detached:
        rig.parents[ankle] = 0
    for name in ("one", "three"):
        duration, rotations, translations = rig.clips[name]
        for ankle, (hip, knee) in detached.items():
            a, b = rotations[hip], rotations[knee]
            both = _product(a, b)
            at = (
                _turned(a, places[knee] - places[hip]) + _turned(both, places[ankle] - places[knee]) + places[hip]
            ) - places[0]
            translations[ankle] = at
            rotations[ankle] = _product(both, rotations[ankle])
        rig.clips[name] = (duration, rotations, translations)
    assert walk is not None
    archetype = loaded(rig, tmp_path)
    assert legs(archetype) == legs(whole)
    knee = archetype.skeleton.names.index("b1")
    assert archetype.skeleton.parents[archetype.skeleton.names.index("c1")] == knee
    np.testing.assert_allclose(contacts(archetype, "one"), contacts(whole, "one"), atol=5e-3)


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a after b, quaternions xyzw."""
    return np.roll(posing.multiply(np.roll(a, 1, -1), np.roll(b, 1, -1)), -1, -1)


def _turned(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return posing.rotate(np.roll(q, 1, -1), np.broadcast_to(v, (len(q), 3)))


def test_helper_and_unused_joints_are_left_out(tmp_path: Path) -> None:
    rig = biped()
    pole = rig.joint("pole", 0, (0.1, 0.5, 0.6))
    rig.joint("finger", rig.names.index("g1"), (0.9, 1.42, 0))
    archetype = loaded(rig, tmp_path)
    assert rig.names[pole] not in archetype.skeleton.names
    assert "finger" not in archetype.skeleton.names
    assert legs(archetype)["left"] == ("a1", "b1", "c1", "d1")


def test_strafes_jumps_and_backward_walks_are_no_gaits(tmp_path: Path) -> None:
    rig = biped()
    duration, rotations, _ = rig.clips["one"]
    rig.clips["retreat"] = (duration, {joint: track[::-1] for joint, track in rotations.items()}, {})
    root = np.tile(np.array(rig.places[0]), (SAMPLES, 1))
    hop = 0.5 * np.maximum(0, np.sin(np.linspace(0, 2 * np.pi, SAMPLES)))
    root[:, 1] += hop
    bend = {rig.names.index(f"a{side}"): turn((1, 0, 0), -hop) for side in (1, -1)}
    rig.clips["leap"] = (0.8, bend, {0: root})
    archetype = loaded(rig, tmp_path)
    assert roles(archetype) == {"two": "idle", "one": "walk", "three": "run"}


def test_root_motion_becomes_in_place_with_its_speed(tmp_path: Path) -> None:
    rig = biped()
    duration, rotations, _ = rig.clips["one"]
    strides = 4
    many = {j: np.concatenate([np.tile(t[:-1], (strides, 1)), t[:1]]) for j, t in rotations.items()}
    speed = 0.36 / (0.6 * 1.1)
    way = np.tile(np.array(rig.places[0]), (len(many[next(iter(many))]), 1))
    way[:, 2] += np.linspace(0, speed * duration * strides, len(way))
    rig.clips = {"go": (duration * strides, many, {0: way})}
    archetype = loaded(rig, tmp_path)
    (clip,) = archetype.clips
    assert clip.role == "walk"
    assert clip.speed == pytest.approx(speed, rel=0.03)
    assert clip.duration == pytest.approx(duration, rel=0.05)
    assert np.abs(clip.translation[-1, 0, 2] - clip.translation[0, 0, 2]) < 0.05


def test_conventions(tmp_path: Path) -> None:
    for rig in (biped(), quadruped(), crawler(4, tarsus=False)):
        archetype = loaded(rig, tmp_path, scale=100.0, yaw=0.7)
        skeleton = archetype.skeleton
        assert skeleton.parents[0] == -1
        assert all(0 <= parent < joint for joint, parent in enumerate(skeleton.parents) if joint)
        rotation, position = posing.world_transforms(skeleton, posing.rest_motion(skeleton))
        hips = position[[leg.hip for leg in archetype.legs]].mean(0)
        np.testing.assert_allclose(hips[[0, 2]], 0, atol=1e-6)
        for leg in archetype.legs:
            foot = position[leg.ball] + posing.rotate(rotation[leg.ball], np.array(leg.ball_offset))
            assert abs(foot[1]) < 1e-3 * archetype.height + 1e-6
            assert np.sign(foot[0]) == leg.side
        np.testing.assert_allclose(archetype.mesh.weights.sum(1), 1, atol=1e-6)
        assert abs(posing.skin(archetype.mesh, rotation, position)[:, 1].min()) < 0.01 * archetype.height
        for clip in archetype.clips:
            assert len(clip.rotation) >= 8
            assert 29 <= len(clip.rotation) / clip.duration <= 61
            np.testing.assert_allclose(np.linalg.norm(clip.rotation, axis=-1), 1, atol=1e-9)
            assert np.all(np.sum(clip.rotation[1:] * clip.rotation[:-1], -1) >= 0)
            if clip.role != "idle":
                assert abs(contacts(archetype, clip.name)[..., 1].min()) < 1e-6


def test_proposed_description_loads_to_the_same(tmp_path: Path) -> None:
    for rig in (biped(), quadruped(), crawler(3), crawler(4, tarsus=False)):
        path = build(rig, scale=100.0, yaw=1.5707963).write(tmp_path / "a.glb")
        found = inspect(path)
        (tmp_path / "rig.yaml").write_text(found.yaml)
        again = load("rig.yaml", tmp_path)
        assert legs(again) == legs(found.archetype)
        assert roles(again) == roles(found.archetype)
        assert again.pelvis == found.archetype.pelvis
        assert again.height == pytest.approx(found.archetype.height, rel=1e-3)
        for ours, theirs in zip(again.legs, found.archetype.legs, strict=True):
            np.testing.assert_allclose(ours.ball_offset, theirs.ball_offset, atol=2e-3)


def test_description_overrides_detection(tmp_path: Path) -> None:
    description = {
        "name": "walker",
        "forward": "-z",
        "legs": [
            {"name": "stilt", "hip": "a1", "knee": "b1", "ankle": "c1"},
            {"name": "peg", "hip": "a-1", "knee": "b-1", "ankle": "c-1"},
        ],
        "arms": [],
        "clips": {"walk": "three", "run": [], "idle": "two"},
    }
    archetype = loaded(biped(), tmp_path, description)
    assert archetype.name == "walker"
    assert {leg.name for leg in archetype.legs} == {"stilt", "peg"}
    assert {leg.name: leg.side for leg in archetype.legs} == {"stilt": -1, "peg": 1}
    assert archetype.arms == ()
    assert roles(archetype) == {"three": "walk", "two": "idle"}
