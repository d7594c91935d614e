"""Feet found in the skin: boxes of known size, built-in characters, overrides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from crowd import characters, posing
from crowd.analysis import feet_of
from crowd.analysis.foot import FootShape
from crowd.errors import InputError
from crowd.types import Archetype, Leg, Mesh, Skeleton

LEG = 0.9


def booted(yaw: float, ball: bool, size: tuple[float, float] = (0.28, 0.1), ahead: float = 0.05) -> Archetype:
    """A leg whose foot is a box of the given length and width round a place `ahead` of the ankle, turned by `yaw`."""
    names, parents = ["pelvis", "hip", "knee", "ankle"], [-1, 0, 1, 2]
    offsets = [(0.0, LEG, 0.0), (0.1, 0.0, 0.0), (0.0, -0.4, 0.02), (0.0, -0.42, -0.02)]
    turn = np.array([np.cos(yaw / 2), 0, np.sin(yaw / 2), 0])
    rotation = np.tile([1.0, 0, 0, 0], (len(names) + ball, 1))
    rotation[3] = turn
    if ball:
        names, parents, offsets = [*names, "toes"], [*parents, 3], [*offsets, (0.0, -0.05, 0.12)]
    skeleton = Skeleton(tuple(names), tuple(parents), rotation, np.array(offsets))
    half = np.array([size[1] / 2, 0.0, size[0] / 2])
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (0, 1) for z in (-1, 1)]) * half + [0, 0, ahead]
    corners[:, 1] = np.where(np.arange(8) // 2 % 2, 0.07, 0.0)
    ankle = np.array([0.1, LEG - 0.82, 0.0])
    places = posing.rotate(turn, corners) + ankle * [1, 0, 1]
    q, p = posing.world_transforms(skeleton, posing.rest_motion(skeleton))
    inverse = np.tile(np.eye(4), (len(names), 1, 1))
    inverse[:, :3, :3] = np.swapaxes(posing.matrix(q), -1, -2)
    inverse[:, :3, 3] = -np.einsum("jrc,jc->jr", inverse[:, :3, :3], p)
    joints = np.full((8, 1), 3, np.int32)
    mesh = Mesh(places, np.array([[0, 1, 2]], np.int32), joints, np.ones((8, 1)), inverse)
    tip = 4 if ball else 3
    contact = posing.rotate(posing.conjugate(q[tip]), p[tip] * [1, 0, 1] - p[tip])
    leg = Leg("left", 1, 2, 3, tip, tuple(contact), 1)
    return Archetype("booted", skeleton, mesh, (leg,), (), (), 0, 1.7, 70.0, "booted.glb")


# Without a ball only the long axis tells where a foot points, so that it is taken to point forwards.
@pytest.mark.parametrize(
    ("yaw", "ball"),
    [(0.0, True), (0.4, True), (-1.2, True), (3.0, True), (0.0, False), (0.4, False), (-1.2, False)],
)
def test_a_box_is_measured(yaw: float, ball: bool) -> None:
    body = booted(yaw, ball)
    foot = feet_of(body)[0]
    assert foot.length == pytest.approx(0.28) and foot.width == pytest.approx(0.1)
    q, p = posing.world_transforms(body.skeleton, posing.rest_motion(body.skeleton))
    leg = body.legs[0]
    heel = p[leg.ankle] + posing.rotate(q[leg.ankle], foot.heel)
    tip = p[leg.ball] + posing.rotate(q[leg.ball], foot.toe_tip)
    direction = np.array([np.sin(yaw), 0, np.cos(yaw)])
    middle = np.array([0.1, 0, 0]) + 0.05 * direction
    assert heel == pytest.approx(middle - 0.14 * direction, abs=1e-9)
    assert tip == pytest.approx(middle + 0.14 * direction, abs=1e-9)
    assert not foot.notes


def test_shapes_can_be_given() -> None:
    body = booted(0.3, True)
    foot = feet_of(body, {"left": FootShape(length=0.2, offset=(0.01, -0.02))})[0]
    assert foot.length == 0.2 and foot.offset == (0.01, -0.02) and foot.width == pytest.approx(0.1)
    with pytest.raises(InputError, match=r"no such leg .did you mean 'left'"):
        feet_of(body, {"lefd": FootShape(length=0.2)})
    with pytest.raises(InputError, match="must be > 0 m"):
        feet_of(body, {"left": FootShape(length=-0.2)})


def test_a_point_and_a_skirt_are_bounded_and_noted() -> None:
    body = booted(0.0, False)
    bare = replace(body, mesh=replace(body.mesh, joints=np.zeros((8, 1), np.int32)))
    foot = feet_of(bare)[0]
    assert 0 < foot.length < 0.05 and "no skin below the ankle" in foot.notes[0]
    wide = booted(0.0, False, size=(2.0, 1.0))
    foot = feet_of(wide)[0]
    assert foot.length < LEG and "give its length" in foot.notes[0]


@pytest.mark.parametrize(
    ("name", "share"), [("human", (0.22, 0.32)), ("dog", (0.1, 0.25)), ("hexapod", (0.03, 0.1))], ids=str
)
def test_built_in_feet(name: str, share: tuple[float, float]) -> None:
    """Lengths in shares of the leg; left and right alike; heel and toe tip on the ground; toes ahead."""
    from crowd.analysis.stride import leg_lengths

    body = characters.load(name)
    feet = feet_of(body)
    q, p = posing.world_transforms(body.skeleton, posing.rest_motion(body.skeleton))
    for foot, leg, length in zip(feet, body.legs, leg_lengths(body), strict=True):
        assert share[0] < foot.length / length < share[1]
        heel = p[leg.ankle] + posing.rotate(q[leg.ankle], foot.heel)
        tip = p[leg.ball] + posing.rotate(q[leg.ball], foot.toe_tip)
        assert abs(heel[1]) < 1e-9 and abs(tip[1]) < 1e-9
        assert np.linalg.norm(tip - heel) == pytest.approx(foot.length)
        assert foot.direction[2] > 0.9
    for left, right in zip(feet[::2], feet[1::2], strict=True):
        assert right.length == pytest.approx(left.length, rel=1e-3)
