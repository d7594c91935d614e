"""The built-in characters: bodies, ideal feet, published gait numbers."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from crowd import posing
from crowd.characters.builtin import NAMES, build
from crowd.errors import InputError
from crowd.types import Archetype, Clip, Leg

GAITS = [
    ("human", "walk"),
    ("human", "jog"),
    ("human", "walk_backwards"),
    ("human", "side_left"),
    ("human", "side_right"),
    ("human", "crouch_walk"),
    ("dog", "walk"),
    ("dog", "trot"),
    ("dog", "gallop"),
    ("dog", "walk_backwards"),
    ("hexapod", "walk"),
    ("hexapod", "run"),
    ("spider", "walk"),
    ("spider", "run"),
]
WAY = {"walk_backwards": (0.0, -1.0), "side_left": (1.0, 0.0), "side_right": (-1.0, 0.0)}  # (x, z); others (0, 1)
# Touchdown as a fraction of the cycle, legs in the archetype's order (front left, front right, ...).
TOUCHDOWN = {
    ("human", "walk"): (0.0, 0.5),
    ("human", "jog"): (0.0, 0.5),
    ("human", "walk_backwards"): (0.0, 0.5),
    ("human", "side_left"): (0.0, 0.5),
    ("human", "side_right"): (0.0, 0.5),
    ("human", "crouch_walk"): (0.0, 0.5),
    ("dog", "walk"): (0.25, 0.75, 0.0, 0.5),
    ("dog", "trot"): (0.5, 0.0, 0.0, 0.5),
    ("dog", "gallop"): (0.5, 0.6, 0.0, 0.1),
    ("dog", "walk_backwards"): (0.25, 0.75, 0.0, 0.5),
    ("hexapod", "walk"): (0.0, 0.5, 0.5, 0.0, 0.0, 0.5),
    ("hexapod", "run"): (0.0, 0.5, 0.5, 0.0, 0.0, 0.5),
    ("spider", "walk"): (0.5, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 0.5),
    ("spider", "run"): (0.5, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 0.5),
}
DUTY = {  # the least and the most that is usual
    ("human", "walk"): (0.58, 0.64),
    ("human", "jog"): (0.33, 0.42),
    ("human", "walk_backwards"): (0.58, 0.66),
    ("human", "side_left"): (0.55, 0.65),
    ("human", "side_right"): (0.55, 0.65),
    ("human", "crouch_walk"): (0.60, 0.70),
    ("dog", "walk"): (0.60, 0.75),
    ("dog", "trot"): (0.35, 0.50),
    ("dog", "gallop"): (0.20, 0.30),
    ("dog", "walk_backwards"): (0.60, 0.75),
    ("hexapod", "walk"): (0.55, 0.65),
    ("hexapod", "run"): (0.40, 0.50),
    ("spider", "walk"): (0.55, 0.65),
    ("spider", "run"): (0.40, 0.50),
}


def clip_of(archetype: Archetype, name: str) -> Clip:
    return next(clip for clip in archetype.clips if clip.name == name)


def posed(archetype: Archetype, clip: Clip) -> tuple[np.ndarray, np.ndarray]:
    return posing.world_transforms(archetype.skeleton, posing.clip_motion(clip))


def contact(leg: Leg, rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    offset = np.broadcast_to(np.array(leg.ball_offset), position[:, leg.ball].shape)
    return position[:, leg.ball] + posing.rotate(rotation[:, leg.ball], offset)


def along(path: np.ndarray, clip: Clip) -> tuple[np.ndarray, np.ndarray]:
    """[F] m, contact point along the clip's way and to the left of it."""
    x, z = WAY.get(clip.name, (0.0, 1.0))
    return path[:, 0] * x + path[:, 2] * z, path[:, 0] * z - path[:, 2] * x


def on_ground(path: np.ndarray, clip: Clip) -> np.ndarray:
    """[F] samples at which the contact point is at y = 0 and moves with the ground until the next sample."""
    assert clip.speed is not None
    ahead, _ = along(path, clip)
    step = np.roll(ahead, -1) - ahead
    carried = np.abs(step + clip.speed * clip.duration / len(path)) < 1e-5
    return (np.abs(path[:, 1]) < 1e-6) & (carried | np.roll(carried, 1))


def mirrored(archetype: Archetype) -> np.ndarray:
    names = archetype.skeleton.names
    swap = {"left": "right", "right": "left"}
    other = []
    for name in names:
        head, _, tail = name.partition("_")
        other.append(names.index(f"{swap[head]}_{tail}") if head in swap else names.index(name))
    return np.array(other)


@pytest.mark.parametrize("name", NAMES)
def test_invariants_of_archetypes(name: str) -> None:
    character = build(name)
    skeleton, mesh = character.skeleton, character.mesh
    assert skeleton.parents[0] == -1
    assert all(0 <= parent < joint for joint, parent in enumerate(skeleton.parents) if joint)
    assert len(set(skeleton.names)) == skeleton.count
    assert np.allclose(np.linalg.norm(skeleton.rest_rotation, axis=-1), 1.0)
    assert mesh.joints.max() < skeleton.count and mesh.joints.min() >= 0
    assert np.allclose(mesh.weights.sum(1), 1.0, atol=1e-12) and mesh.weights.min() >= 0.0
    assert not mesh.joints[mesh.weights == 0.0].any()
    rotation, position = posing.world_transforms(skeleton, posing.rest_motion(skeleton))
    hips = position[[leg.hip for leg in character.legs]].mean(0)
    assert np.allclose(hips[[0, 2]], 0.0, atol=0.01), "the origin is under the hips"
    for leg in character.legs:
        offset = posing.rotate(rotation[leg.ball], np.array(leg.ball_offset))
        assert abs((position[leg.ball] + offset)[1]) < 1e-6
        assert np.sign(position[leg.ankle, 0]) == leg.side
    sides = [leg.side for leg in character.legs]
    assert sides == [1, -1] * (len(sides) // 2), "left before right"
    front = [position[leg.hip, 2] for leg in character.legs]
    assert all(a >= b - 0.05 for a, b in zip(front[:-2], front[2:], strict=True)), "front before hind"


@pytest.mark.parametrize(
    ("name", "least", "most"), [("human", 20, 25), ("dog", 25, 32), ("hexapod", 24, 36), ("spider", 32, 44)]
)
def test_sizes(name: str, least: int, most: int) -> None:
    character = build(name)
    assert least <= character.skeleton.count <= most
    assert 300 <= len(character.mesh.triangles) <= 1000
    roles = {clip.role for clip in character.clips}
    assert {"idle", "walk", "run"} <= roles


@pytest.mark.parametrize("name", NAMES)
def test_meshes_are_closed_and_outward(name: str) -> None:
    mesh = build(name).mesh
    body = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    assert body.is_watertight and body.is_winding_consistent
    assert body.volume > 0.0
    assert body.body_count == 1, "one skin: no parts inside another"
    used = np.unique(mesh.triangles)
    assert len(used) == len(mesh.vertices)
    assert (body.area_faces > 1e-8).all()


@pytest.mark.parametrize("name", NAMES)
def test_meshes_are_symmetric(name: str) -> None:
    vertices = build(name).mesh.vertices
    other = vertices * np.array([-1.0, 1.0, 1.0])
    gap = np.linalg.norm(vertices[:, None] - other[None], axis=-1).min(1)
    assert gap.max() < 1e-9


def test_person_has_the_size_of_a_person() -> None:
    person = build("human")
    assert person.mass == 70.0
    rotation, position = posing.world_transforms(person.skeleton, posing.rest_motion(person.skeleton))
    vertices = posing.skin(person.mesh, rotation, position)
    assert vertices[:, 1].min() == pytest.approx(0.0, abs=0.005)
    assert vertices[:, 1].max() == pytest.approx(1.70, abs=0.02)
    body = trimesh.Trimesh(vertices, person.mesh.triangles, process=False)
    assert body.volume == pytest.approx(0.067, rel=0.1)  # 70 kg at about 1.05 kg/l
    bones = {
        "shank": np.linalg.norm(position[person.legs[0].ankle] - position[person.legs[0].knee]),
        "thigh": np.linalg.norm(position[person.legs[0].knee] - position[person.legs[0].hip]),
        "upper_arm": np.linalg.norm(position[person.arms[0].elbow] - position[person.arms[0].shoulder]),
        "forearm": np.linalg.norm(position[person.arms[0].hand] - position[person.arms[0].elbow]),
    }
    drillis = {"shank": 0.246, "thigh": 0.245, "upper_arm": 0.186, "forearm": 0.146}  # of height
    for name, length in bones.items():
        assert length == pytest.approx(drillis[name] * 1.70, rel=0.01), name


def test_frontal_area_of_the_legs() -> None:
    """A prototype body of this height had 0.197 m2 for both; girths vary by 15 %."""
    person = build("human")
    mesh, names = person.mesh, person.skeleton.names
    rotation, position = posing.world_transforms(person.skeleton, posing.rest_motion(person.skeleton))
    corners = posing.skin(mesh, rotation, position)[mesh.triangles]
    forward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] / 2.0
    leg = np.array([name.split("_")[-1] in ("thigh", "shank", "foot", "toes") for name in names])
    share = (mesh.weights * leg[mesh.joints]).sum(1)[mesh.triangles].mean(1)
    area = float((np.clip(forward, 0.0, None) * share).sum())
    assert area == pytest.approx(0.197, rel=0.15)


@pytest.mark.parametrize(("name", "gait"), GAITS)
def test_planted_feet_move_with_the_ground(name: str, gait: str) -> None:
    character = build(name)
    clip = clip_of(character, gait)
    assert clip.speed is not None and clip.cyclic
    rotation, position = posed(character, clip)
    duration = clip.duration
    for leg in character.legs:
        path = contact(leg, rotation, position)
        down = on_ground(path, clip)
        least, most = DUTY[name, gait]
        assert least - 0.02 <= down.mean() <= most + 0.02, leg.name
        start = np.flatnonzero(down & ~np.roll(down, 1))
        assert len(start) == 1, "one stance per cycle"
        stance = (start[0] + np.arange(down.sum())) % len(path)
        time = duration * np.arange(down.sum()) / len(path)
        ahead, aside = along(path, clip)
        expected = ahead[stance[0]] - clip.speed * time
        assert np.abs(ahead[stance] - expected).max() < 1e-4
        assert np.abs(path[stance, 1]).max() < 1e-6
        assert np.ptp(aside[stance]) < 1e-6, "straight"
        assert path[:, 1].min() > -1e-6


@pytest.mark.parametrize(("name", "gait"), GAITS)
def test_touchdowns_follow_the_published_order(name: str, gait: str) -> None:
    character = build(name)
    clip = clip_of(character, gait)
    rotation, position = posed(character, clip)
    starts = []
    for leg in character.legs:
        down = on_ground(contact(leg, rotation, position), clip)
        starts.append(np.flatnonzero(down & ~np.roll(down, 1))[0] / len(down))
    offset = (np.array(starts) - np.array(TOUCHDOWN[name, gait]) + 0.5) % 1.0 - 0.5
    assert np.abs(offset).max() <= 0.02


@pytest.mark.parametrize(("name", "gait"), GAITS)
def test_bones_keep_their_length_and_legs_do_not_lock(name: str, gait: str) -> None:
    character = build(name)
    _, position = posed(character, clip_of(character, gait))
    rest = character.skeleton.rest_translation
    for leg in character.legs:
        upper = np.linalg.norm(position[:, leg.knee] - position[:, leg.hip], axis=-1)
        lower = np.linalg.norm(position[:, leg.ankle] - position[:, leg.knee], axis=-1)
        assert np.allclose(upper, np.linalg.norm(rest[leg.knee]), atol=1e-6)
        assert np.allclose(lower, np.linalg.norm(rest[leg.ankle]), atol=1e-6)
        reach = np.linalg.norm(position[:, leg.ankle] - position[:, leg.hip], axis=-1) / (upper + lower)
        assert reach.max() < 0.9994, "within reach, so the foot is where it should be"


@pytest.mark.parametrize(("name", "gait"), [(n, g) for n, g in GAITS if g != "gallop" and "side" not in g])
def test_sides_mirror_each_other_half_a_cycle_apart(name: str, gait: str) -> None:
    character = build(name)
    _, position = posed(character, clip_of(character, gait))
    other = np.roll(position, len(position) // 2, axis=0)[:, mirrored(character)] * np.array([-1.0, 1.0, 1.0])
    exact = [leg.ankle for leg in character.legs] + [leg.knee for leg in character.legs]
    if name in ("hexapod", "spider"):  # feelers move on their own
        assert np.abs(position - other)[:, exact].max() < 1e-6
    else:
        assert np.abs(position - other).max() < 1e-6


@pytest.mark.parametrize(("name", "gait"), GAITS)
def test_no_part_sinks_into_the_ground(name: str, gait: str) -> None:
    character = build(name)
    vertices = posing.skin(character.mesh, *posed(character, clip_of(character, gait)))
    assert vertices[..., 1].min() > -0.01


@pytest.mark.parametrize("name", NAMES)
def test_clips_are_smooth_and_cyclic(name: str) -> None:
    for clip in build(name).clips:
        assert np.allclose(np.linalg.norm(clip.rotation, axis=-1), 1.0, atol=1e-9)
        assert np.all(np.sum(clip.rotation[1:] * clip.rotation[:-1], -1) > 0.0)
        cosine = np.abs(np.sum(clip.rotation * np.roll(clip.rotation, 1, axis=0), -1))
        turned = 2.0 * np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        assert turned.max() < 35.0, f"{clip.name}: {turned.max():.0f} degrees in a sample"
        wrap, inside = turned[0].max(), turned[1:].max()
        assert wrap <= inside + 1e-6


@pytest.mark.parametrize("name", NAMES)
def test_feet_stand_still_in_idle_where_they_rest(name: str) -> None:
    character = build(name)
    idle = next(clip for clip in character.clips if clip.role == "idle")
    rotation, position = posed(character, idle)
    skeleton = character.skeleton
    rest_rotation, rest_position = posing.world_transforms(skeleton, posing.rest_motion(skeleton))
    for leg in character.legs:
        path = contact(leg, rotation, position)
        rest = rest_position[leg.ball] + posing.rotate(rest_rotation[leg.ball], np.array(leg.ball_offset))
        assert np.abs(path - rest).max() < 1e-4
    assert np.ptp(position[:, character.pelvis], axis=0).max() > 0.001, "but the body moves"


def test_knee_angles_follow_the_published_curve() -> None:
    """Schwartz, Rozumalski and Trost 2008, free speed, every tenth of a cycle from heel strike."""
    published = np.array([6, 19, 16, 10, 6, 12, 34, 58, 50, 19, 5])
    person = build("human")
    _, position = posed(person, clip_of(person, "walk"))
    leg = person.legs[0]
    thigh, shank = position[:, leg.knee] - position[:, leg.hip], position[:, leg.ankle] - position[:, leg.knee]
    cosine = np.sum(thigh * shank, -1) / np.linalg.norm(thigh, axis=-1) / np.linalg.norm(shank, axis=-1)
    knee = np.degrees(np.arccos(cosine))
    cycle = (np.arange(60) / 60 + 0.03) % 1.0  # the heel strikes about 3 % before the ball is down
    error = knee - np.interp(cycle, np.linspace(0.0, 1.0, 11), published)
    assert np.sqrt(np.mean(error**2)) < 8.0
    assert 50.0 < knee.max() < 70.0
    assert cycle[np.argmax(knee)] == pytest.approx(0.72, abs=0.06)
    bent = np.cross(thigh, shank)[:, 0]
    assert (bent > 0.0).all(), "knees bend forwards"


def test_heel_lies_flat_in_mid_stance_and_the_toes_until_toe_off() -> None:
    person = build("human")
    rotation, position = posed(person, clip_of(person, "walk"))
    leg = person.legs[0]
    relative = position[:, leg.ankle] - position[:, leg.ball]
    middle = slice(1, 21)
    assert np.ptp(relative[middle], axis=0).max() < 1e-6
    toes = rotation[:36, leg.ball]
    assert np.abs(np.abs(toes[:, 0]) - 1.0).max() < 1e-6, "toes stay flat on the ground"


def played_once(name: str) -> tuple[Clip, np.ndarray, np.ndarray]:
    """A clip of the person that does not loop, its contact points [F, L, 3] and joints [F, J, 3]."""
    person = build("human")
    clip = clip_of(person, name)
    assert not clip.cyclic and clip.role == "other"
    rotation, position = posed(person, clip)
    return clip, np.stack([contact(leg, rotation, position) for leg in person.legs], 1), position


@pytest.mark.parametrize("name", ["jump", "wave"])
def test_clips_played_once_begin_and_end_standing(name: str) -> None:
    person = build("human")
    _, _, position = played_once(name)
    _, idle = posed(person, clip_of(person, "idle"))
    for end in (0, -1):
        assert np.abs(position[end] - idle.mean(0)).max() < 0.03
    vertices = posing.skin(person.mesh, *posed(person, clip_of(person, name)))
    assert vertices[..., 1].min() > -0.01


def test_jump_leaves_the_ground_and_falls_freely() -> None:
    person = build("human")
    clip, feet, position = played_once("jump")
    assert clip.duration == 0.8
    flying = (feet[..., 1] > 1e-3).all(1)
    time = np.linspace(0.0, clip.duration, len(feet))
    assert 0.2 < flying.sum() * time[1] < 0.35 and 0.05 < feet[..., 1].max() < 0.2
    assert np.abs(feet[..., [0, 2]] - feet[0][:, [0, 2]]).max() < 1e-6, "on the spot"
    assert np.abs(feet[~flying][..., 1]).max() < 2e-3
    fall = np.polyfit(time[flying], position[flying, person.pelvis, 1], 2)[0]
    assert 2 * fall == pytest.approx(-9.81, rel=0.01)
    assert position[:, person.pelvis, 1].min() < position[0, person.pelvis, 1] - 0.15


def test_wave_raises_the_right_hand_and_keeps_the_feet() -> None:
    person = build("human")
    _, feet, position = played_once("wave")
    assert np.abs(feet - feet[0]).max() < 1e-6
    right, left = (next(arm.hand for arm in person.arms if arm.side == side) for side in (-1, 1))
    head = position[:, person.skeleton.names.index("head"), 1]
    assert position[:, right, 1].max() > head.max()
    assert np.ptp(position[:, left], axis=0).max() < 0.05
    up = position[:, right, 1] > head
    assert np.sum(np.diff(np.sign(np.diff(position[up, right, 0]))) != 0) >= 4, "to and fro"


def test_crouch_is_low_with_bent_knees_and_the_arms_ahead() -> None:
    person = build("human")
    for name, upright in (("crouch_idle", "idle"), ("crouch_walk", "walk")):
        _, low = posed(person, clip_of(person, name))
        _, tall = posed(person, clip_of(person, upright))
        assert low[:, person.pelvis, 1].max() < tall[:, person.pelvis, 1].min() - 0.12
        assert low[:, [arm.hand for arm in person.arms], 2].min() > 0.2
    assert clip_of(person, "crouch_walk").speed < clip_of(person, "walk").speed  # type: ignore[operator]


def test_feet_do_not_cross_in_side_steps() -> None:
    person = build("human")
    for name in ("side_left", "side_right"):
        rotation, position = posed(person, clip_of(person, name))
        left, right = (contact(leg, rotation, position)[:, 0] for leg in person.legs)
        assert (left - right).min() > 0.08


def test_wrong_name_is_told_the_nearest() -> None:
    with pytest.raises(InputError, match=r"humna.*did you mean 'human'.*dog.*hexapod.*spider"):
        build("humna")
