"""A belt: where it lies on any body, what it leaves alone, and how bad ones are refused."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from crowd import characters, posing, scene
from crowd import scenario as scenarios
from crowd.characters.belt import AREA, HIP, TOP, with_belt
from crowd.errors import InputError
from crowd.types import Archetype
from tests.crowd.scenes import herd, scenario


def at_rest(archetype: Archetype) -> np.ndarray:
    """Skin [V, 3] in the rest pose."""
    turn, at = posing.world_transforms(archetype.skeleton, posing.rest_motion(archetype.skeleton))
    return posing.skin(archetype.mesh, turn, at, np.ones(()))


def hips(archetype: Archetype) -> float:
    _, at = posing.world_transforms(archetype.skeleton, posing.rest_motion(archetype.skeleton))
    return float(at[[leg.hip for leg in archetype.legs], 1].mean())


@pytest.mark.parametrize("name", characters.BUILT_IN)
def test_a_patch_in_front_of_the_trunk_under_the_hips(name: str) -> None:
    plain = characters.load(name)
    worn = with_belt(plain)
    old, new = len(plain.mesh.vertices), at_rest(worn)
    np.testing.assert_array_equal(worn.mesh.vertices[:old], plain.mesh.vertices)
    np.testing.assert_array_equal(worn.mesh.triangles[: len(plain.mesh.triangles)], plain.mesh.triangles)
    belt = worn.mesh.triangles[len(plain.mesh.triangles) :]
    assert len(belt) == 2000
    a, b, c = np.moveaxis(new[belt], 1, 0)
    area = 0.5 * np.cross(b - a, c - a)
    np.testing.assert_allclose(area.sum(0), [0.0, 0.0, AREA * (hips(plain) / HIP) ** 2], rtol=1e-6, atol=1e-9)
    assert (area[:, 2] > 0).all()
    patch = new[old:]
    np.testing.assert_allclose(patch[:, 1].max(), TOP * hips(plain), rtol=1e-6)
    assert np.ptp(patch[:, 0]) < np.ptp(patch[:, 1])
    assert np.ptp(patch[:, 2]) < 1e-9


def test_it_lies_a_hair_outside_the_skin_and_moves_with_the_pelvis() -> None:
    plain = characters.load("human")
    worn, old = with_belt(plain), len(plain.mesh.vertices)
    patch, skin = at_rest(worn)[old:], at_rest(plain)
    # the trunk's front in the middle, between its lowest ring of vertices and the crotch
    front = skin[(np.abs(skin[:, 0]) < 0.05) & (skin[:, 1] > 0.79) & (skin[:, 1] < 0.95), 2].max()
    assert -0.03 < patch[0, 2] - front < 0.01
    assert (worn.mesh.joints[old:, 0] == worn.pelvis).all()
    assert (worn.mesh.weights[old:, 0] == 1.0).all()
    # no skin lies in front of the patch
    inside = (np.abs(skin[:, 0]) < 0.02) & (skin[:, 1] > patch[:, 1].min()) & (skin[:, 1] < patch[:, 1].max())
    assert (skin[inside, 2] < patch[0, 2]).all()


def test_area_and_number_are_as_asked() -> None:
    plain = characters.load("human")
    worn = with_belt(plain, 128, 0.003)
    a, b, c = np.moveaxis(at_rest(worn)[worn.mesh.triangles[-128:]], 1, 0)
    np.testing.assert_allclose(np.cross(b - a, c - a)[:, 2] / 2, 0.003 / 128, rtol=1e-6)


def test_a_body_without_a_trunk_there_is_refused() -> None:
    plain = characters.load("human")
    legs = np.isin(plain.mesh.joints[np.arange(len(plain.mesh.joints)), plain.mesh.weights.argmax(1)], _legs(plain))
    bare = dataclasses.replace(plain.mesh, triangles=plain.mesh.triangles[legs[plain.mesh.triangles].all(1)][:4])
    with pytest.raises(InputError, match=r"herds\[0\]\.belt: 'human' has no trunk at 0\.\d+ to 0\.\d+ m"):
        with_belt(dataclasses.replace(plain, mesh=bare), where="herds[0].belt")


def _legs(archetype: Archetype) -> list[int]:
    return [joint for leg in archetype.legs for joint in (leg.knee, leg.ankle, leg.ball)]


def test_one_herd_wears_it_and_the_other_does_not() -> None:
    loaded = scene.load(scenario([herd("a", "human", 1, belt=True), herd("b", "human", 1)]))
    one, other = (len(each.archetype.mesh.triangles) for each in loaded.herds)
    assert one == other + 2000


@pytest.mark.parametrize(
    ("belt", "message"),
    [
        ({"triangles": 7}, r"herds\[0\]\.belt.triangles: 7: must be a multiple of 2"),
        ({"triangle": 8}, r"belt\.triangle: unknown key 'triangle' \(did you mean 'triangles'\?\)"),
        ({"area_m2": 1.0}, r"herds\[0\]\.belt.*0\.1"),
        (3, r"herds\[0\]\.belt.*3"),
    ],
)
def test_bad_belts(belt: object, message: str) -> None:
    with pytest.raises(InputError, match=message) as found:
        scenarios.load(scenario([herd("a", "human", 1, belt=belt)]))
    assert len(found.value.problems) == 1
