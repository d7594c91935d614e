"""Gait analysis against synthetic legs whose lift-off, duty and speed are known."""

from __future__ import annotations

import numpy as np
import pytest

from crowd.analysis import gait
from crowd.errors import InputError
from crowd.types import Archetype, Clip, Leg, Mesh, Skeleton

LEG = 0.9


def legged(hips: list[tuple[float, float]]) -> Archetype:
    """A pelvis with straight three-joint legs below the given (x, z) places; the ankle joint touches the ground."""
    names, parents, offsets = ["pelvis"], [-1], [(0.0, LEG, 0.0)]
    legs = []
    for index, (x, z) in enumerate(hips):
        first = len(names)
        names += [f"hip{index}", f"knee{index}", f"ankle{index}"]
        parents += [0, first, first + 1]
        offsets += [(x, 0.0, z), (0.0, -LEG / 2, 0.0), (0.0, -LEG / 2, 0.0)]
        legs.append(Leg(f"leg{index}", first, first + 1, first + 2, first + 2, (0.0, 0.0, 0.0), int(np.sign(x))))
    count = len(names)
    identity = np.tile([1.0, 0, 0, 0], (count, 1))
    skeleton = Skeleton(tuple(names), tuple(parents), identity, np.array(offsets))
    mesh = Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.int32), np.zeros((0, 4), np.int32), np.zeros((0, 4)), np.eye(4))
    return Archetype("synthetic", skeleton, mesh, tuple(legs), (), (), 0, 1.7, 70.0, "synthetic.glb")


def stepping(
    body: Archetype,
    lift: list[float],
    duty: list[float],
    stride: float,
    period: float = 1.0,
    frames: int = 96,
    turn: float = 0.0,
    hover: float = 0.0,
    strides: int = 1,
    noise: float = 0.0,
) -> Clip:
    """Ankles move backward on the ground in stance, on a raised cosine forward in swing (translation-animated)."""
    phase = np.arange(frames * strides) / frames
    translation = np.tile(body.skeleton.rest_translation, (len(phase), 1, 1))
    generator = np.random.default_rng(3)
    for index, leg in enumerate(body.legs):
        t = np.mod(phase - lift[index], 1.0)
        swing = 1.0 - duty[index]
        s = np.clip(t / swing, 0, 1)
        reach = stride * duty[index] / 2
        ahead = np.where(t < swing, -reach * np.cos(np.pi * s), reach - stride * (t - swing))
        up = np.where(t < swing, 0.06 * (1 - np.cos(2 * np.pi * s)), 0.0) + hover
        up = up + noise * generator.standard_normal(len(phase))
        move = np.stack([ahead * np.sin(turn), up, ahead * np.cos(turn)], -1)
        translation[:, leg.ankle] += move
    rotation = np.tile([1.0, 0, 0, 0], (len(phase), body.skeleton.count, 1))
    return Clip("step", "walk", period * strides, rotation, translation)


BIPED = [(0.1, 0.0), (-0.1, 0.0)]
QUADRUPED = [(0.1, 0.4), (-0.1, 0.4), (0.1, -0.4), (-0.1, -0.4)]
CASES = {
    "walk": (BIPED, [0.1, 0.6], [0.6, 0.6], 1.3, 1.0),
    "run": (BIPED, [0.3, 0.8], [0.35, 0.35], 2.4, 0.7),
    "stalking": (BIPED, [0.0, 0.75], [0.8, 0.8], 1.0, 2.4),
    "limp": (BIPED, [0.05, 0.5], [0.7, 0.5], 0.8, 1.2),
    "amble": (QUADRUPED, [0.0, 0.5, 0.75, 0.25], [0.55] * 4, 1.2, 1.1),
    "gallop": (QUADRUPED, [0.0, 0.2, 0.5, 0.65], [0.2] * 4, 5.0, 0.5),
}


@pytest.mark.parametrize("case", CASES, ids=str)
def test_lift_duty_speed_rest(case: str) -> None:
    places, lift, duty, stride, period = CASES[case]
    body = legged(places)
    found = gait.analyse(body, stepping(body, lift, duty, stride, period))
    difference = np.mod(found.lift - np.mod(np.array(lift) - lift[0], 1) + 0.5, 1) - 0.5
    assert np.abs(difference).max() < 0.03
    # a foot is low for a little while before landing and after lift-off: raised cosine under 15 % of its height
    assert np.abs(found.duty - duty).max() < 0.06
    assert found.speed == pytest.approx(stride / period, rel=0.03)
    assert found.period == pytest.approx(period)
    assert found.direction == pytest.approx([0, 1])
    assert np.abs(found.rest - np.array(places)).max() < 0.04 * stride
    assert not found.notes


def test_slow_walk_is_always_supported() -> None:
    """Soft feet touch down for a third of a slow cycle; some foot is planted at every moment all the same."""
    body = legged(BIPED)
    found = gait.analyse(body, stepping(body, [0.1, 0.6], [0.33, 0.33], 1.0, 1.6))
    at = np.linspace(0, 1, 200, endpoint=False)[:, None]
    planted = np.mod(at - found.touchdown, 1.0) < found.duty + 0.01
    assert planted.any(1).all()
    assert found.duty.min() > 0.48 and found.duty.max() < 0.6
    assert any("unsupported" in note for note in found.notes)
    running = gait.analyse(body, stepping(body, [0.1, 0.6], [0.33, 0.33], 2.4, 0.7))
    assert running.duty.max() < 0.42


def test_tables_start_at_lift_off_and_swing_height_is_zero_at_its_ends() -> None:
    body = legged(BIPED)
    found = gait.analyse(body, stepping(body, [0.37, 0.87], [0.6, 0.6], 1.3), samples=100)
    assert found.rotation.shape == (100, 7, 4) and found.contact_point.shape == (100, 2, 3)
    assert found.lift[0] == 0
    height = found.contact_point[:, 0, 1]
    assert np.argmax(height) == pytest.approx(20, abs=3)  # the middle of a swing of 0.4
    assert found.swing_height.shape == (gait.SWING_SAMPLES, 2)
    assert np.allclose(found.swing_height[[0, -1]], 0)
    assert found.swing_height.max() == pytest.approx(0.12, rel=0.15)
    assert np.allclose(found.contact_point, found.ankle)


@pytest.mark.parametrize(("turn", "direction"), [(np.pi, (0, -1)), (np.pi / 2, (1, 0)), (np.pi / 4, (0.7071, 0.7071))])
def test_backward_strafe_and_diagonal(turn: float, direction: tuple[float, float]) -> None:
    body = legged(BIPED)
    found = gait.analyse(body, stepping(body, [0, 0.5], [0.6, 0.6], 0.9, turn=turn))
    assert found.direction == pytest.approx(direction, abs=1e-3)
    assert found.speed == pytest.approx(0.9, rel=0.03)


def test_hovering_feet_and_noise() -> None:
    body = legged(BIPED)
    clip = stepping(body, [0, 0.5], [0.6, 0.6], 1.3, hover=0.2, noise=0.002)
    found = gait.analyse(body, clip)
    assert np.abs(found.duty - 0.6).max() < 0.08
    assert found.speed == pytest.approx(1.3, rel=0.04)


def test_several_strides_become_one() -> None:
    body = legged(BIPED)
    found = gait.analyse(body, stepping(body, [0, 0.5], [0.6, 0.6], 1.3, period=1.1, strides=3))
    assert found.period == pytest.approx(1.1)
    assert found.speed == pytest.approx(1.3 / 1.1, rel=0.03)
    assert "3 strides" in found.notes[0]


def test_given_speed_wins() -> None:
    body = legged(BIPED)
    clip = stepping(body, [0, 0.5], [0.6, 0.6], 1.3)
    given = Clip(clip.name, clip.role, clip.duration, clip.rotation, clip.translation, True, 1.25)
    assert gait.analyse(body, given).speed == 1.25


def test_stepping_on_the_spot_has_no_speed() -> None:
    body = legged(BIPED)
    found = gait.analyse(body, stepping(body, [0, 0.5], [0.6, 0.6], 0.0))
    assert found.speed == pytest.approx(0, abs=1e-9)
    assert np.abs(found.duty - 0.6).max() < 0.12


def test_a_dragged_leg_is_planted_and_noted() -> None:
    body = legged([*BIPED, (0.0, -0.3)])
    clip = stepping(body, [0, 0.5, 0.0], [0.6, 0.6, 0.6], 1.3)
    translation = clip.translation.copy()
    translation[:, body.legs[2].ankle] = body.skeleton.rest_translation[body.legs[2].ankle]
    found = gait.analyse(body, Clip("step", "walk", 1.0, clip.rotation, translation))
    assert found.duty[2] == pytest.approx(0.95)
    assert any("leg2" in note for note in found.notes)


def test_still_clip_is_refused() -> None:
    body = legged(BIPED)
    clip = stepping(body, [0, 0.5], [0.6, 0.6], 0.0)
    still = Clip("wave", "other", 1.0, clip.rotation, np.tile(body.skeleton.rest_translation, (96, 1, 1)))
    with pytest.raises(InputError, match="clip 'wave': no foot moves"):
        gait.analyse(body, still)


def test_a_body_that_pauses_over_its_feet() -> None:
    """Step, step, wait: both feet rest for half of the cycle, so the mean speed is half of the stepping speed."""
    body = legged(BIPED)
    clip = stepping(body, [0, 0.5], [0.5, 0.5], 1.0, period=1.0, frames=60)
    wait = np.tile(clip.translation[:1], (60, 1, 1))
    longer = Clip("stalk", "walk", 2.0, np.tile(clip.rotation, (2, 1, 1)), np.concatenate([clip.translation, wait]))
    found = gait.analyse(body, longer)
    assert found.period == pytest.approx(2.0)
    assert np.abs(found.duty - 0.75).max() < 0.06
    assert found.speed == pytest.approx(0.5, rel=0.1)
