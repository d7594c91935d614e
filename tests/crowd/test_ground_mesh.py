"""Meshes as ground: what rays from above hit, in levels; and files that are none."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from crowd.errors import InputError
from crowd.ground import Ground, height
from tests.crowd.grounds import bridge, made

SHEET = trimesh.Trimesh([[-4, 0, -4], [-4, 0, 4], [4, 0, 4], [4, 0, -4]], [[0, 1, 2], [0, 2, 3]])


def ground(mesh: trimesh.Trimesh, folder: Path, name: str = "mine.ply", **keys: Any) -> Ground:
    mesh.export(folder / name)
    return made({"kind": "mesh", "file": name, "cell_m": 0.25} | keys, folder)


def joined(*meshes: trimesh.Trimesh) -> trimesh.Trimesh:
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, first, strict=False)]
    return trimesh.Trimesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces), process=False)


@pytest.mark.parametrize("name", ["mine.ply", "mine.obj", "mine.stl", "mine.off", "mine.glb"])
def test_deck_over_a_sheet(name: str, tmp_path: Path) -> None:
    """Above the deck, beside it and under it; its underside is no ground."""
    here = ground(bridge(), tmp_path, name)
    assert len(here.layers) == 2
    assert here.notes == ()
    x, z = np.array([0.1, 2.0, 0.1, 3.9, 0.1, 0.1]), np.array([0.1, -0.9, 0.1, 0.0, 1.4, 1.1])
    altitude = np.array([3.0, 2.5, 0.0, 3.0, 3.0, 0.0])
    np.testing.assert_allclose(height(here, x, z, altitude), [3, 3, 0, 0, 0, 0], atol=1e-6)
    np.testing.assert_allclose(height(here, x[:4], z[:4]), [3, 3, 3, 0], atol=1e-6)


def test_curved_sheet_is_met_exactly_at_the_samples(tmp_path: Path) -> None:
    x, z = (part.ravel() for part in np.meshgrid(np.linspace(-2, 2, 17), np.linspace(-1, 1, 9), indexing="ij"))
    cells = np.arange(17 * 9).reshape(17, 9)
    a, b, c, d = cells[:-1, :-1].ravel(), cells[:-1, 1:].ravel(), cells[1:, :-1].ravel(), cells[1:, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])
    sheet = trimesh.Trimesh(np.stack([x, np.sin(x) * z, z], 1), faces)
    here = ground(sheet, tmp_path, "mine.ply")
    assert len(here.layers) == 1
    np.testing.assert_allclose(height(here, x, z), np.sin(x) * z, atol=1e-6)


@pytest.mark.parametrize("flip", [False, True])
def test_open_sheet_may_face_either_way(flip: bool, tmp_path: Path) -> None:
    faces = SHEET.faces[:, ::-1] if flip else SHEET.faces
    assert height(ground(trimesh.Trimesh(SHEET.vertices, faces), tmp_path), 1.0, 1.0) == 0.0


def test_crate_on_the_ground_is_one_level(tmp_path: Path) -> None:
    """There is no room to walk in it."""
    here = ground(joined(SHEET, trimesh.creation.box(bounds=[[-1, -0.2, -1], [1, 0.6, 1]])), tmp_path)
    assert len(here.layers) == 1
    np.testing.assert_allclose(height(here, np.array([0, 2.0]), 0.1), [0.6, 0], atol=1e-6)


def test_tall_block_has_no_floor_inside_its_underside(tmp_path: Path) -> None:
    """A floating block 3 m thick: its underside faces down and is no ground."""
    here = ground(joined(SHEET, trimesh.creation.box(bounds=[[-1, 2, -1], [1, 5, 1]])), tmp_path)
    np.testing.assert_allclose(height(here, 0.1, 0.1, np.array([0.0, 1.5, 4.0])), [0, 0, 5], atol=1e-6)


def test_ramp_up_to_a_deck_has_no_hole(tmp_path: Path) -> None:
    """Walking up a solid wedge, past the height from where one could walk under it."""
    wedge = trimesh.Trimesh(
        [[-3, 0, -1], [3, 0, -1], [3, 3, -1], [-3, 0, 1], [3, 0, 1], [3, 3, 1]],
        [[0, 2, 1], [3, 4, 5], [0, 1, 4], [0, 4, 3], [0, 3, 5], [0, 5, 2], [1, 2, 5], [1, 5, 4]],
    )
    here = ground(joined(SHEET, wedge), tmp_path, cell_m=0.1)
    x, level = np.linspace(-2.9, 2.8, 400), 0.0
    for place in x:
        level = float(height(here, place, 0.05, level))
        assert level == pytest.approx((place + 3) / 2, abs=1e-5)


def test_axis_scale_and_place(tmp_path: Path) -> None:
    """A sheet in cm with z up, tilted along its y: the file's +y is the world's -z."""
    sheet = trimesh.Trimesh([[0, 0, 100], [400, 0, 100], [400, 400, 300], [0, 400, 300]], [[0, 1, 2], [0, 2, 3]])
    here = ground(sheet, tmp_path, up="z", scale=0.01, offset_m=[-2.0, 0.5, 10.0])
    np.testing.assert_allclose(height(here, 0.0, np.array([10.0, 8.0, 6.0])), [1.5, 2.5, 3.5], atol=1e-6)


def test_holes_are_filled_and_told(tmp_path: Path) -> None:
    triangle = trimesh.Trimesh([[-4, 1, -4], [4, 1, 4], [4, 1, -4]], [[0, 1, 2]])
    here = ground(triangle, tmp_path)
    assert "nothing under 528 of 1,089 rays" in here.notes[0]
    np.testing.assert_allclose(height(here, np.array([-3.9, 3.0]), np.array([3.9, -3.0])), 1.0)


def test_random_soup_against_single_rays(tmp_path: Path) -> None:
    """Highest surface of random triangles at random samples, by intersecting every triangle with every ray."""
    rng = np.random.default_rng(5)
    corner = rng.uniform(-3, 3, (30, 3, 3)) * [1, 0.02, 1]
    here = ground(trimesh.Trimesh(corner.reshape(-1, 3), np.arange(90).reshape(-1, 3)), tmp_path, cell_m=0.5)
    for x, z in np.round(rng.uniform(-2, 2, (40, 2)) * 2) / 2:
        hits = [_ray(triangle, x, z) for triangle in corner]
        hits = [hit for hit in hits if hit is not None]
        if hits:
            assert height(here, x, z) == pytest.approx(max(hits), abs=1e-5)


def _ray(corner: np.ndarray, x: float, z: float) -> float | None:
    weights = np.linalg.solve(np.stack([corner[:, 0], corner[:, 2], np.ones(3)]), [x, z, 1.0])
    return float(weights @ corner[:, 1]) if (weights >= 0).all() else None


def lines(path: Path) -> None:
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 0 1\n")


def wall(path: Path) -> None:
    trimesh.Trimesh([[0, 0, 0], [4, 0, 4], [4, 2, 4]], [[0, 1, 2]]).export(path)


def endless(path: Path) -> None:
    path.write_text("v 0 0 0\nv 1 nan 0\nv 1 0 1\nf 1 3 2\n")


BAD: list[tuple[str, Callable[[Path], object], dict[str, Any], str]] = [
    ("gone.obj", lambda path: None, {}, "gone.obj: no such file"),
    ("words.ply", lambda path: path.write_text("hello"), {}, "words.ply: is not a readable mesh"),
    ("cut.glb", lambda path: path.write_bytes(b"glTF\2\0\0\0"), {}, "cut.glb: is not a readable mesh"),
    ("empty.stl", lambda path: path.write_bytes(b""), {}, "empty.stl: "),
    ("points.obj", lines, {}, "points.obj: has no faces"),
    ("nan.obj", endless, {}, "nan.obj: has a vertex that is not finite"),
    ("wall.obj", wall, {}, "wall.obj: nothing lies under the rays from above"),
    (
        "small.obj",
        lambda path: SHEET.export(path),
        {"scale": 0.01},
        "smaller than two cells of 0.25 m (cell_m, scale",
    ),
    ("large.obj", lambda path: SHEET.export(path), {"scale": 1000.0, "cell_m": 0.01}, "at most 64,000,000 (cell_m)"),
]


@pytest.mark.parametrize(("name", "make", "keys", "says"), BAD, ids=[row[0] for row in BAD])
def test_bad_mesh(name: str, make: Callable[[Path], object], keys: dict[str, Any], says: str, tmp_path: Path) -> None:
    make(tmp_path / name)
    with pytest.raises(InputError) as caught:
        made({"kind": "mesh", "file": name, "cell_m": 0.25} | keys, tmp_path)
    assert says in str(caught.value)
    assert len(caught.value.problems) == 1
