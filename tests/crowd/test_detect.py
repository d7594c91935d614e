"""Detection by geometry and motion on creatures built in code; their joints have telling names only for the test."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crowd import posing
from crowd.analysis.gait import analyse
from crowd.characters import load
from crowd.characters.inspect import inspect
from crowd.errors import InputError
from crowd.types import Archetype, Style
from tests.crowd.glb_writer import (
    SAMPLES,
    Rig,
    biped,
    build,
    crawler,
    gait_tracks,
    mesh_arrays,
    product,
    quadruped,
    side_tracks,
    turn,
)


def loaded(rig: Rig, folder: Path, description: dict | None = None, **how: float) -> Archetype:
    build(rig, **how).write(folder / "a.glb")  # type: ignore[arg-type]
    return load("a.glb", folder, description)


def legs(archetype: Archetype) -> dict[str, tuple[str, str, str, str]]:
    names = archetype.skeleton.names
    return {leg.name: (names[leg.hip], names[leg.knee], names[leg.ankle], names[leg.ball]) for leg in archetype.legs}


def roles(archetype: Archetype) -> dict[str, str]:
    """Roles of the file's own clips; a rig without an idle gets one made."""
    return {clip.name: clip.role for clip in archetype.clips if not clip.name.endswith("(made)")}


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
            both = product(a, b)
            at = (
                _turned(a, places[knee] - places[hip]) + _turned(both, places[ankle] - places[knee]) + places[hip]
            ) - places[0]
            translations[ankle] = at
            rotations[ankle] = product(both, rotations[ankle])
        rig.clips[name] = (duration, rotations, translations)
    assert walk is not None
    archetype = loaded(rig, tmp_path)
    assert legs(archetype) == legs(whole)
    knee = archetype.skeleton.names.index("b1")
    assert archetype.skeleton.parents[archetype.skeleton.names.index("c1")] == knee
    np.testing.assert_allclose(contacts(archetype, "one"), contacts(whole, "one"), atol=5e-3)


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
    assert roles(archetype) == {"two": "idle", "one": "walk", "three": "run", "retreat": "step", "leap": "other"}
    by_name = {clip.name: clip for clip in archetype.clips}
    assert analyse(archetype, by_name["retreat"]).direction == pytest.approx([0.0, -1.0], abs=0.05)
    assert analyse(archetype, by_name["retreat"]).speed == pytest.approx(0.36 / (0.6 * 1.1), rel=0.05)


def leg_joints(rig: Rig) -> list[tuple[int, int, int]]:
    """Hip, knee and ankle of the biped's legs."""
    find = rig.names.index
    return [(find(f"a{side}"), find(f"b{side}"), find(f"c{side}")) for side in (1, -1)]


def clips_off_forward(angle: float) -> Rig:
    """The biped with a walk along `angle` (0 forward, positive to the left) beside its own clips."""
    rig = biped()
    legs = leg_joints(rig)
    rig.clips["aside"] = (1.0, side_tracks(rig, legs, [0.0, 0.5], 0.36, 0.12, 0.6, angle), {})
    return rig


@pytest.mark.parametrize(
    ("degrees", "role", "way"),
    [
        (0, "walk", ""),
        (20, "walk", ""),
        (55, "step", "forward left"),
        (90, "step", "left"),
        (-90, "step", "right"),
        (130, "step", "back left"),
        (180, "step", "backwards"),
        (-120, "step", "back right"),
    ],
)
def test_walks_that_do_not_go_forward_are_steps(degrees: float, role: str, way: str, tmp_path: Path) -> None:
    build(clips_off_forward(np.radians(degrees))).write(tmp_path / "a.glb")
    found = inspect(tmp_path / "a.glb")
    clip = next(clip for clip in found.archetype.clips if clip.name == "aside")
    assert clip.role == role
    gait = analyse(found.archetype, clip)
    told = np.degrees(np.arctan2(*gait.direction))
    assert abs((told - degrees + 180) % 360 - 180) < 4
    line = next(line for line in found.lines if line.startswith("clip 'aside'"))
    assert role + (f" {way}" if way else "") in line
    ahead = np.cos(np.radians(degrees)) if role == "walk" else 1.0  # of walks only the speed ahead is told
    assert float(line.split(" m/s")[0].split()[-1]) == pytest.approx(ahead * 0.36 / 0.6, rel=0.06)


def test_turning_on_the_spot_is_no_step(tmp_path: Path) -> None:
    """Feet on the ground that go forward on one side and backward on the other."""
    rig = biped()
    legs = leg_joints(rig)
    left = gait_tracks(rig, legs[:1], [0.0], 0.36, 0.12, 0.6)
    right = side_tracks(rig, legs[1:], [0.5], 0.36, 0.12, 0.6, np.pi)
    rig.clips["spin"] = (1.0, left | right, {})
    assert roles(loaded(rig, tmp_path))["spin"] == "other"


def test_clips_that_end_elsewhere_play_once_and_stay_in_place(tmp_path: Path) -> None:
    """A bow that slides 1.5 m ahead: last sample kept, way taken out, ground and first place as the idle's."""
    rig = biped()
    root = np.tile(np.array(rig.places[0]), (SAMPLES, 1))
    ramp = np.linspace(0.0, 1.0, SAMPLES)
    root[:, 2] += 1.5 * ramp
    bow = {1: turn((1, 0, 0), 0.8 * ramp)}
    rig.clips["bow"] = (1.2, bow, {0: root})
    archetype = loaded(rig, tmp_path)
    by_name = {clip.name: clip for clip in archetype.clips}
    clip = by_name["bow"]
    assert clip.role == "other" and not clip.cyclic
    joint = archetype.skeleton.names.index(rig.names[1])
    turned = 2 * np.arccos(np.abs(np.sum(clip.rotation[0, joint] * clip.rotation[-1, joint])))
    assert turned == pytest.approx(0.8, abs=1e-6)
    feet = contacts(archetype, "bow")
    assert np.ptp(feet[..., 2], axis=0).max() < 1e-6
    assert feet[..., 1].min() == pytest.approx(contacts(archetype, "two")[..., 1].min(), abs=1e-6)
    assert feet[0].mean(0)[[0, 2]] == pytest.approx(contacts(archetype, "two")[0].mean(0)[[0, 2]], abs=0.02)


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
    assert roles(archetype) == {"go": "walk"}
    clip = next(clip for clip in archetype.clips if clip.name == "go")
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
            if clip.role not in ("idle", "other"):
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
    assert roles(archetype) == {"three": "walk", "two": "idle", "one": "step"}  # backwards now


def test_styles_in_the_description(tmp_path: Path) -> None:
    """Gaits of other styles are none of style normal, are prepared as gaits, and names may be single ones."""
    clips = {"styles": {"hurry": {"idle": "two", "run": "three"}}, "also_backwards": ["one", "three"]}
    archetype = loaded(biped(), tmp_path, {"clips": clips})
    assert roles(archetype) == {"two": "idle", "one": "walk", "three": "other"}
    assert archetype.styles == (Style("hurry", (("two", "idle"), ("three", "run"))),)
    assert archetype.also_backwards == ("one", "three")
    assert abs(contacts(archetype, "three")[..., 1].min()) < 1e-6
    assert all(clip.cyclic for clip in archetype.clips)
    shared = loaded(biped(), tmp_path, {"clips": {"styles": {"all": {"walk": "one", "run": "three"}}}})
    assert roles(shared) == {"two": "idle", "one": "walk", "three": "run"}  # or style normal would have no gait
    both = loaded(biped(), tmp_path, {"clips": {"run": "three", "idle": "two", **clips}})
    assert roles(both) == {"two": "idle", "one": "walk", "three": "run"}
    found = inspect(tmp_path / "a.glb", {"clips": {"run": "three", "idle": "two", **clips}})
    (tmp_path / "rig.yaml").write_text(found.yaml)
    again = load("rig.yaml", tmp_path)
    assert (again.styles, again.also_backwards, roles(again)) == (both.styles, both.also_backwards, roles(both))
    assert "style 'hurry': idle 'two', run 'three'" in found.yaml


@pytest.mark.parametrize(
    ("clips", "says"),
    [
        (
            {"styles": {"sad": {"walk": "on"}}},
            "a.glb clips.styles.sad.walk: no clip 'on' (did you mean 'one'?); clips",
        ),
        ({"styles": {"sad": {"idle": "two"}}}, "clips.styles.sad: style 'sad' has no walk"),
        ({"styles": {"sad": {"walk": "one", "step": "one"}}}, "clip 'one' is named both walk and step"),
        ({"styles": {"normal": {"walk": "one"}}}, "clips.styles.normal: 'normal' is the style of the clips' own roles"),
        ({"styles": {"sad": {"wlak": "one"}}}, "clips.styles.sad.wlak: unknown key 'wlak' (did you mean 'walk'?)"),
        ({"styles": {"sad one": {"walk": "one"}}}, "clips.styles"),
        ({"also_backwards": "two"}, "a.glb clips.also_backwards: clip 'two' is no walk, run or step"),
        ({"step": "onn"}, "a.glb clips.step: no clip 'onn' (did you mean 'one'?)"),
    ],
)
def test_bad_styles_in_the_description(clips: dict, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        loaded(biped(), tmp_path, {"clips": clips})
    assert says in str(caught.value)


def bird() -> Rig:
    """A digitigrade biped with four toes a foot, wings, a neck and a tail."""
    rig = Rig()
    root = rig.joint("trunk", -1, (0, 0.5, 0))
    rig.box((-0.1, 0.4, -0.25), (0.1, 0.6, 0.2), root)
    neck = rig.joint("neck", root, (0, 0.6, 0.18))
    rig.bone(neck, (0, 0.9, 0.25), 0.05)
    head = rig.joint("head", neck, (0, 0.9, 0.25))
    rig.box((-0.05, 0.86, 0.2), (0.05, 0.96, 0.4), head)
    legs = []
    for side in (1, -1):
        x = 0.08 * side
        hip = rig.joint(f"hip{side}", root, (x, 0.45, 0))
        knee = rig.joint(f"knee{side}", hip, (x, 0.33, 0.08))
        hock = rig.joint(f"hock{side}", knee, (x, 0.16, -0.04))
        foot = rig.joint(f"foot{side}", hock, (x, 0.02, 0.02))
        for joint, end in ((hip, knee), (knee, hock), (hock, foot)):
            rig.bone(joint, rig.places[end], 0.02)
        for number, (dx, dz) in enumerate(((-0.05, 0.08), (0, 0.1), (0.05, 0.08), (0, -0.05))):
            toe = rig.joint(f"toe{number}{side}", foot, (x + 0.2 * dx, 0.01, 0.02 + 0.3 * dz))
            rig.bone(toe, (x + dx, 0.01, 0.02 + dz), 0.015)
        wing = rig.joint(f"wing{side}", root, (0.1 * side, 0.58, 0.1))
        rig.bone(wing, (0.14 * side, 0.5, -0.2), 0.03)
        legs.append((hip, hock, foot))
    rig.clips["strut"] = (0.7, gait_tracks(rig, legs, [0.0, 0.5], 0.2, 0.06, 0.6), {})
    return rig


def test_many_toes_are_one_foot(tmp_path: Path) -> None:
    archetype = loaded(bird(), tmp_path)
    assert legs(archetype) == {
        "left": ("hip1", "hock1", "foot1", "foot1"),
        "right": ("hip-1", "hock-1", "foot-1", "foot-1"),
    }
    rotation, position = posing.world_transforms(archetype.skeleton, posing.rest_motion(archetype.skeleton))
    for leg in archetype.legs:
        contact = position[leg.ball] + posing.rotate(rotation[leg.ball], np.array(leg.ball_offset))
        assert abs(contact[0] - 0.08 * leg.side) < 0.02  # between the toes
    assert roles(archetype) == {"strut": "walk"}


def test_a_cape_and_twist_joints_change_nothing(tmp_path: Path) -> None:
    rig = biped()
    cape = rig.joint("cape", 1, (0, 1.4, -0.12))
    hem = rig.joint("hem", cape, (0, 0.7, -0.2))
    rig.box((-0.35, 0.02, -0.25), (0.35, 0.7, -0.2), hem)
    for side in (1, -1):
        hip, knee = rig.names.index(f"a{side}"), rig.names.index(f"b{side}")
        middle = (np.array(rig.places[hip]) + np.array(rig.places[knee])) / 2
        twist = rig.joint(f"twist{side}", hip, tuple(middle))
        rig.box(middle - 0.04, middle + 0.04, twist)
        rig.parents[knee] = twist
    archetype = loaded(rig, tmp_path)
    assert legs(archetype) == {"left": ("a1", "b1", "c1", "d1"), "right": ("a-1", "b-1", "c-1", "d-1")}
    assert any("hem" in note for note in archetype.notes)


def test_rigid_parts_without_any_skin(tmp_path: Path) -> None:
    """Boxes hung on animated nodes, as robots are often built."""
    rig = biped()
    file = build(rig)
    del file.tree["skins"]
    file.tree["nodes"] = [node for node in file.tree["nodes"] if "skin" not in node]
    file.tree["meshes"] = []
    for low, high, joint in rig.boxes:
        place = np.array(rig.places[joint])
        arrays = mesh_arrays(Rig(rig.names, rig.parents, rig.places, [(low - place, high - place, joint)]))
        primitive = {"attributes": {"POSITION": file.accessor(arrays["POSITION"])}}
        file.tree["meshes"].append({"primitives": [primitive | {"indices": file.accessor(arrays["indices"])}]})
        file.tree["nodes"][joint]["children"].append(len(file.tree["nodes"]))
        file.tree["nodes"].append({"name": f"box {joint}", "mesh": len(file.tree["meshes"]) - 1})
    file.tree["scenes"] = [{"nodes": [len(rig.names)]}]
    file.write(tmp_path / "a.glb")
    archetype = load("a.glb", tmp_path)
    assert {name: parts[:3] for name, parts in legs(archetype).items()} == {
        "left": ("a1", "b1", "c1"),
        "right": ("a-1", "b-1", "c-1"),
    }
    assert archetype.height == pytest.approx(1.7, abs=1e-3)
    assert len(archetype.mesh.triangles) == 12 * len(rig.boxes)
