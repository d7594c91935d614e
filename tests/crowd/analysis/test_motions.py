"""Motions of synthetic clips whose stances and speed are known; backwards twins; sets; what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crowd.analysis import Motion, analyse_clip, analyse_samples, backwards_twin, default_clips, feet_of
from crowd.analysis.foot import FootShape
from crowd.analysis.motion_set import motion_set
from crowd.analysis.stride import resampled, transforms
from crowd.errors import InputError
from crowd.posing import matrix
from crowd.types import Archetype, Clip
from tests.crowd.test_gait import BIPED, CASES, legged, stepping

WALK = dict(lift=[0.1, 0.6], duty=[0.6, 0.6], stride=1.3)


def signed(phase: np.ndarray) -> np.ndarray:
    return np.mod(phase + 0.5, 1.0) - 0.5


def walker(turn: float = 0.0, name: str = "step", role: str = "walk", period: float = 1.0, **change: object) -> Clip:
    options = {**WALK, **change}
    return replace(stepping(legged(BIPED), turn=turn, period=period, **options), name=name, role=role)


def check_tables(motion: Motion) -> None:
    """What holds for every walk motion of the default mode (property 5, 8.2 g and h)."""
    lift, liftoff, postlift, preland, strike, land = motion.keytimes.T
    assert (lift >= 0).all() and (lift <= liftoff).all() and (liftoff <= postlift).all()
    assert (postlift <= preland).all() and (preland <= strike).all() and (strike <= land).all() and (land <= 1).all()
    assert (strike - liftoff >= 0.05).all() and (liftoff > 0).all() and (strike < 1).all()
    for leg in range(len(motion.keytimes)):
        table = motion.flight[:, leg]
        times = np.arange(50) / 50
        assert not table[times <= liftoff[leg] + 1e-9].any()
        assert np.all(table[times >= strike[leg] - 1e-9] == [0.0, 0.0, 1.0])
        assert (table[:, 1] >= 0).all()
        for phase, value in ((0, [0, 0, 0]), (2, [0, 0, 1])):
            assert motion.flight_at(leg, phase, np.linspace(0, 1, 7)) == pytest.approx(
                np.tile(value, (7, 1)), abs=1e-12
            )
        flight = motion.flight_at(leg, 1, np.linspace(0, 1, 400))
        assert flight[0] == pytest.approx([0, 0, 0], abs=1e-12) and flight[-1] == pytest.approx([0, 0, 1], abs=1e-12)
        reach = np.maximum(np.ptp(flight, axis=0), 1e-3)
        assert (np.abs(np.diff(flight, axis=0)).max(0) < 0.1 * reach).all()  # no jumps


@pytest.mark.parametrize("case", CASES, ids=str)
def test_stances_and_speed(case: str) -> None:
    places, lift, duty, stride, period = CASES[case]
    body = legged(places)
    motion = analyse_clip(body, stepping(body, lift, duty, stride, period))
    check_tables(motion)
    off, on = motion.stance_time + motion.keytimes[:, 1], motion.stance_time + motion.keytimes[:, 4]
    assert np.abs(signed(off - lift)).max() < 0.05
    assert np.abs(signed(on - (np.array(lift) + 1 - np.array(duty)))).max() < 0.05
    assert motion.distance == pytest.approx(stride, rel=0.03)
    assert motion.velocity == pytest.approx([0, 0, stride / period], rel=0.03)
    # the moment of stance is within the stance, and the foot is under its place of the rest pose then
    share = np.mod(motion.stance_time - on, 1.0) / np.mod(off - on, 1.0)
    assert (np.abs(share - 0.5) < 0.26).all()
    reach = 0.3 * stride * np.array(duty)
    assert (np.abs(motion.stance_position[:, [0, 2]] - places).max(1) < reach).all()
    assert motion.flight[:, :, 1].max() == pytest.approx(0.12, rel=0.2)


TILT = np.radians(8)  # more than the sway of the feet explains


@pytest.mark.parametrize(
    ("turn", "direction"),
    [(np.pi, (0, -1)), (np.pi / 2, (1, 0)), (np.pi / 4, (0.7071, 0.7071)), (TILT, (np.sin(TILT), np.cos(TILT)))],
)
def test_backward_strafe_and_diagonal(turn: float, direction: tuple[float, float]) -> None:
    motion = analyse_clip(legged(BIPED), walker(turn))
    check_tables(motion)
    assert motion.velocity == pytest.approx([1.3 * direction[0], 0, 1.3 * direction[1]], rel=0.03, abs=0.01)
    assert np.linalg.norm(motion.direction) == pytest.approx(1)
    assert np.abs(motion.flight[:, :, 0]).max() < 0.02  # the swing is straight along the travel


@pytest.mark.parametrize("seed", range(8))
def test_tables_of_rough_clips(seed: int) -> None:
    """Noise, hovering and sinking feet, very long and very short stances: tables keep their form."""
    generator = np.random.default_rng(seed)
    duty = generator.uniform(0.06, 0.94, 2).tolist()
    lift = generator.uniform(0, 1, 2).tolist()
    clip = walker(
        generator.uniform(0, 6), lift=lift, duty=duty, stride=generator.uniform(0.05, 3), hover=0.05, noise=0.01
    )
    check_tables(analyse_clip(legged(BIPED), clip))


def test_known_speed_wins_and_compat_measures() -> None:
    body = legged(BIPED)
    clip = replace(walker(), speed=1.25)
    assert analyse_clip(body, clip).distance == pytest.approx(1.25)
    assert analyse_clip(body, clip, compat=True).distance == pytest.approx(1.3, rel=0.02)


def test_compat_is_the_reference_analysis() -> None:
    body = legged(BIPED)
    clip = walker(0.3, noise=0.002)
    feet = feet_of(body, {leg.name: FootShape(length=0.2) for leg in body.legs})
    q, p = resampled(clip, 50)
    q, p = transforms(body.skeleton, q, p, [leg.ankle for leg in body.legs])
    ankle = np.zeros((2, 51, 4, 4))
    ankle[..., 3, 3] = 1.0
    ankle[:, :50, :3, :3], ankle[:, :50, :3, 3] = np.moveaxis(matrix(q), 1, 0), np.moveaxis(p, 1, 0)
    ankle[:, 50] = ankle[:, 0]
    heel, tip = np.array([f.heel for f in feet]), np.array([f.toe_tip for f in feet])
    wanted = analyse_samples(ankle, ankle, heel, tip, 0.2, 0.0, 1.0)
    motion = analyse_clip(body, clip, feet, compat=True)
    assert motion.velocity == pytest.approx(wanted.velocity)
    for leg, reference in enumerate(wanted.legs):
        assert motion.keytimes[leg] == pytest.approx(reference.keytimes)
        assert motion.flight[:, leg] == pytest.approx(reference.normalised_footbase)
        assert motion.stance_time[leg] == reference.stance_time
        held = motion.flight_at(leg, 2, np.array([0.999, 1.0]))
        assert held == pytest.approx(np.tile(reference.normalised_footbase[-1], (2, 1)))  # 8.2 g


def test_several_strides_become_one() -> None:
    motion = analyse_clip(legged(BIPED), walker(period=1.1, strides=3))
    assert motion.duration == pytest.approx(1.1) and motion.distance == pytest.approx(1.3, rel=0.03)
    assert "3 strides" in motion.notes[0]
    check_tables(motion)


def test_stepping_on_the_spot() -> None:
    motion = analyse_clip(legged(BIPED), walker(stride=0.0))
    check_tables(motion)
    assert motion.speed == pytest.approx(0, abs=1e-9) and np.isfinite(motion.flight).all()


def test_poses_follow_the_common_clock() -> None:
    clip = walker(frames=100)
    motion = replace(analyse_clip(legged(BIPED), clip), cycle_offset=0.25)
    rotation, translation = motion.pose(50)
    assert translation == pytest.approx(clip.translation[(np.arange(50) * 2 - 25) % 100])
    assert rotation.shape == (50, 7, 4)
    _, back = replace(motion, backwards=True).pose(50)
    assert back == pytest.approx(clip.translation[(25 - np.arange(50) * 2) % 100])


@pytest.mark.parametrize("compat", [False, True])
def test_backwards_twin(compat: bool) -> None:
    """2.13 and property 6, at random times of all phases."""
    body = legged(BIPED)
    motion = replace(analyse_clip(body, walker(noise=0.002), compat=compat), cycle_offset=0.13)
    twin, again = backwards_twin(motion), backwards_twin(backwards_twin(motion))
    assert (twin.velocity == -motion.velocity).all() and (again.velocity == motion.velocity).all()
    assert twin.keytimes == pytest.approx(1 - motion.keytimes[:, ::-1]) and again.keytimes == pytest.approx(
        motion.keytimes
    )
    assert again.flight == pytest.approx(motion.flight) and again.stance_time == pytest.approx(motion.stance_time)
    assert again.name == motion.name != twin.name and not again.backwards
    progress = np.random.default_rng(1).uniform(size=60)
    for leg in range(2):
        for phase in range(3):
            x, y, z = motion.flight_at(leg, 2 - phase, 1 - progress).T
            assert twin.flight_at(leg, phase, progress) == pytest.approx(np.stack([-x, y, 1 - z], -1), abs=1e-9)
            assert again.flight_at(leg, phase, progress) == pytest.approx(
                motion.flight_at(leg, phase, progress), abs=1e-9
            )
    # the twin shows the clip's stance pose at its own stance time
    shown = twin.clip_phase(twin.stance_time)
    assert signed(shown - (motion.stance_time - motion.cycle_offset)) == pytest.approx([0, 0], abs=1e-9)
    if not compat:
        check_tables(twin)


def test_grounded_motions() -> None:
    body = legged(BIPED)
    still = replace(walker(), name="idle", role="idle", translation=np.tile(body.skeleton.rest_translation, (96, 1, 1)))
    motion = analyse_clip(body, still, grounded=True)
    assert motion.kind == "grounded" and motion.speed == 0
    assert motion.stance_position[:, 1] == pytest.approx([0, 0])
    assert motion.flight_at(0, 1, 0.5) == pytest.approx([0, 0, 0.5])
    with pytest.raises(InputError, match="only walks"):
        backwards_twin(motion)


def with_clips(*clips: Clip) -> Archetype:
    return replace(legged(BIPED), clips=clips)


def test_sets_are_aligned_and_completed() -> None:
    body = with_clips(walker(name="a"), walker(name="b", lift=[0.4, 0.9], stride=2.0), walker(name="c", stride=1.35))
    found = motion_set(body)
    assert found.names == ("a", "a (backwards)", "b")
    assert any("'c' is left out: it travels as 'a' does" in note for note in found.notes)
    phases = found.stacked("stance_time")
    assert np.abs(signed(phases - phases[0])).max() < 0.05
    assert sum(motion.cycle_offset for motion in found.motions) == pytest.approx(0, abs=1e-9)
    assert default_clips(body) == [(body.clips[0], "locomotion", True), (body.clips[1], "locomotion", False)]
    again = motion_set(body, default_clips(body))
    assert again.names == found.names and again.stacked("flight") == pytest.approx(found.stacked("flight"))


def test_no_twin_where_a_clip_goes_backwards() -> None:
    body = with_clips(walker(name="a"), walker(np.pi, "back", "step", stride=0.8), walker(np.pi / 2, "left", "step"))
    found = motion_set(body)
    assert found.names == ("a", "back", "left") and set(found.groups) == {"locomotion"}


def test_equal_velocities_are_refused() -> None:
    body = with_clips(walker(name="a"), walker(name="b"))
    a, b = body.clips
    with pytest.raises(InputError, match=r"group 'locomotion': clips 'a' and 'b' both travel at 1.3"):
        motion_set(body, [(a, "locomotion", False), (b, "locomotion", False)])
    assert len(motion_set(body, [(a, "one", False), (b, "two", False)]).motions) == 2
    assert len(motion_set(body, [(a, "", False), (b, "", False)]).motions) == 2


def test_bad_clips_are_told() -> None:
    body = legged(BIPED)
    clip = walker(name="stroll")
    still = replace(clip, translation=clip.translation[:1].repeat(9, 0), rotation=clip.rotation[:9])
    stilt = replace(body, legs=(replace(body.legs[0], knee=body.legs[0].hip), body.legs[1]))
    torn = replace(clip, translation=clip.translation[:40], rotation=clip.rotation[:40])
    cases = [
        (body, torn, "clip 'stroll': does not loop: foot 'leg.' jumps by .* cut the clip to whole strides"),
        (body, replace(clip, cyclic=False), "clip 'stroll': does not loop"),
        (body, walker(name="stroll", hover=0.5), "clip 'stroll': never touches the ground"),
        (body, still, "no foot moves"),
        (stilt, clip, "leg 'leg0': has one bone"),
        (replace(body, legs=()), clip, "has no legs"),
    ]  # fmt: skip
    for rig, bad, message in cases:
        with pytest.raises(InputError, match=message):
            analyse_clip(rig, bad, feet_of(body))
    floating, sunk = (analyse_clip(body, walker(hover=hover)) for hover in (0.08, -0.2))
    assert "stays 0.08 m above the ground" in floating.notes[0] and "sinks" in sunk.notes[0]
    with pytest.raises(InputError, match="no clip walks"):
        motion_set(with_clips(replace(clip, cyclic=False)))


@pytest.mark.parametrize("count", [1, 12])
def test_any_number_of_legs(count: int) -> None:
    places = [(0.1 * (-1) ** leg, 0.2 * (leg // 2)) for leg in range(count)]
    body = legged(places)
    lift = (np.arange(count) / count).tolist()
    motion = analyse_clip(body, stepping(body, lift, [0.6] * count, 1.0))
    check_tables(motion)
    assert motion.flight.shape == (50, count, 3)
    off = motion.stance_time + motion.keytimes[:, 1]
    assert np.abs(signed(off - lift)).max() < 0.05
