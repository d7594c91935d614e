"""Ground as it is drawn: where the heights are, upright where it jumps, cut to its rectangle, with a body as a deck."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from crowd.ground_layer import heights
from crowd.view.camera import Camera
from crowd.view.crowd_picture import seen
from crowd.view.geometry import Geometry, collect
from crowd.view.ground_sheets import DECK, Sheet, clipped, ground_sheets
from tests.crowd.grounds import KINDS, made

CAMERA = Camera((6.0, 4.0, 8.0), (0.0, 0.0, 0.0))
POINTS = np.array([[-4.0, 0, -4], [4, 0, 4]])


def sheets(kind: str, folder: Path) -> list[Sheet]:
    return ground_sheets(made(kind, folder), CAMERA, POINTS)


def upright(sheet: Sheet) -> np.ndarray:
    return np.abs(sheet.normals[:, 0, 1]) < 1e-6


@pytest.mark.parametrize("kind", KINDS)
def test_faces_lie_on_the_ground(kind: str, tmp_path: Path) -> None:
    """Points well inside faces near by that are not upright, against the heights of their level."""
    ground = made(kind, tmp_path)
    for layer, sheet in zip(ground.layers, sheets(kind, tmp_path), strict=True):
        faces = sheet.corners[~upright(sheet) & (sheet.normals[:, 0, 1] > 0)]
        middle = faces.mean(1)
        near = (np.abs(middle[:, [0, 2]]) < 6).all(1)
        assert near.any()
        x, y, z = middle[near].T
        np.testing.assert_allclose(y, heights(layer, x, z), atol=0.03 if layer.grid is not None else 0.003)
        np.testing.assert_allclose(np.linalg.norm(sheet.normals, axis=-1), 1.0, atol=1e-6)


@pytest.mark.parametrize(("kind", "risers"), [("stairs", 8), ("stairs askew", 8), ("steps", 10)])
def test_risers_are_upright(kind: str, risers: int, tmp_path: Path) -> None:
    (layer,), (sheet,) = made(kind, tmp_path).layers, sheets(kind, tmp_path)
    faces = sheet.corners[upright(sheet)]
    along = faces[..., [0, 2]] @ layer.axis
    np.testing.assert_allclose(np.ptp(along, axis=1), 0, atol=1e-6)
    assert len(np.unique(np.round(along[:, 0], 4))) == risers
    assert np.abs(faces[..., 1] - faces[..., 1].min()).max() <= abs(layer.parameters[2]) * layer.parameters[3] + 1e-6
    rising = sheet.normals[upright(sheet)][:, 0, [0, 2]] @ layer.axis
    assert set(np.round(rising, 6)) == ({-1.0, 1.0} if kind != "steps" else {1.0})  # they face who comes up


def area(corners: np.ndarray) -> float:
    """m2, seen from above."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return float(np.abs(a[:, 0] * b[:, 2] - a[:, 2] * b[:, 0]).sum() / 2)


def test_triangles_are_cut_to_a_rectangle() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        triangle = rng.uniform(-2, 2, (1, 3, 3))
        plane = np.linalg.solve(np.c_[triangle[0][:, [0, 2]], np.ones(3)], triangle[0][:, 1])
        low, high = np.array([-0.7, -0.9]), np.array([0.8, 0.6])
        part, _ = clipped(triangle, triangle, low, high)
        inside = (part[..., [0, 2]] >= low - 1e-9) & (part[..., [0, 2]] <= high + 1e-9)
        assert inside.all()
        np.testing.assert_allclose(
            part[..., 1], part[..., 0] * plane[0] + part[..., 2] * plane[1] + plane[2], atol=1e-9
        )
        rest = [clipped(triangle, triangle, *box)[0] for box in outside(low, high)]
        assert area(part) + sum(map(area, rest)) == pytest.approx(area(triangle))


def outside(low: np.ndarray, high: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Four rectangles around one, with it the whole plane."""
    far = 9.0
    return [
        (np.array([-far, -far]), np.array([low[0], far])),
        (np.array([high[0], -far]), np.array([far, far])),
        (np.array([low[0], -far]), np.array([high[0], low[1]])),
        (np.array([low[0], high[1]]), np.array([high[0], far])),
    ]


def test_deck_has_an_underside_and_sides(tmp_path: Path) -> None:
    """A box of 2 m by 9 m: its faces' areas, and a closed outline (its faces' normals add up to nothing)."""
    _, deck = sheets("bridge", tmp_path)
    assert deck.deck
    first = deck.corners[:, 0]
    size = np.linalg.norm(np.cross(deck.corners[:, 1] - first, deck.corners[:, 2] - first), axis=1) / 2
    up, down = (size[deck.normals[:, 0, 1] * sign > 0.5].sum() for sign in (1, -1))
    assert (up, down) == (pytest.approx(18), pytest.approx(18))
    assert size[upright(deck)].sum() == pytest.approx(2 * (2 + 9) * DECK)
    np.testing.assert_allclose((size[:, None] * deck.normals[:, 0]).sum(0), 0, atol=1e-9)


def test_order_of_triangles(tmp_path: Path) -> None:
    """Decks come before the ground under everything, whatever their number."""
    ground = made("tower", tmp_path)
    found = collect(Geometry((), lambda x, z: 0 * x, (), ground), CAMERA)
    assert 0 == found.ground < found.lowest < len(found.corners)
    assert np.abs(found.corners[: found.lowest, :, [0, 2]]).max() <= 8.0
    assert np.isfinite(found.normals).all()


def test_ground_hides_what_is_behind_it() -> None:
    class Scene:
        herds = ()

        def ground(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
            return np.where(np.abs(z) < 1, 3.0, 0.0)  # a wall along x

    points = np.array([[0.0, 0.5, -4], [1, 0.5, -4], [0, 0.5, 4], [0, 3.5, 0]])
    assert seen(Scene(), (0.0, 2.0, 9.0), points) == 0.5
    assert seen(Scene(), (0.0, 30.0, 9.0), points) == 1.0
