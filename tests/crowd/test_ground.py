"""Ground on the host: heights of every kind against their formulas and the kernels, and files good and bad."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from pydantic import TypeAdapter

from crowd.errors import InputError
from crowd.ground import Ground, build_ground, height, refuse_missing
from crowd.ground_files import read_heights
from crowd.scenario_ground import Ground as GroundModel


def ground(folder: Path = Path(), **model: Any) -> Ground:
    return build_ground(TypeAdapter(GroundModel).validate_python(model), folder)


def grid(here: Ground) -> np.ndarray:
    found = here.layers[0].grid
    assert found is not None
    return found


def at(kind: Ground, *points: tuple[float, float]) -> list[float]:
    return height(kind, *np.array(points).T).tolist()


def test_flat_and_slope() -> None:
    assert at(ground(kind="flat", height_m=0.5), (3, 4)) == [0.5]
    up = ground(kind="slope", angle_deg=10.0, toward_deg=90.0)  # rises toward +x
    assert height(up, 0.0, 5.0).shape == ()
    np.testing.assert_allclose(at(up, (2, 7), (-1, 0)), [2 * math.tan(math.radians(10)), -math.tan(math.radians(10))])


def test_ramp_and_steps() -> None:
    ramp = ground(kind="ramp", start_m=2.0, end_m=6.0, drop_m=1.0)
    np.testing.assert_allclose(at(ramp, (0, 0), (5, 2), (0, 3), (0, 6), (0, 99)), [0, 0, -0.25, -1, -1])
    steps = ground(kind="steps", rise_m=0.2, tread_m=0.3, count=3, start_m=1.0)
    np.testing.assert_allclose(at(steps, (0, 0.99), (0, 1.01), (0, 1.31), (0, 1.61), (0, 50)), [0, 0.2, 0.4, 0.6, 0.6])


STAIRS = {"kind": "stairs", "count": 3, "rise_m": 0.2, "tread_m": 0.3, "start_m": 1.0}


def test_stairs_go_up_and_down() -> None:
    """Risers at 1.0, 1.3 and 1.6, a landing of 2 m, and the way down from 3.6."""
    walk = ground(**STAIRS, landing_m=2.0, height_m=1.0)
    points = [(0, z) for z in (0.99, 1.01, 1.31, 1.61, 3.59, 3.61, 3.91, 4.21, 50)]
    np.testing.assert_allclose(at(walk, *points), [1, 1.2, 1.4, 1.6, 1.6, 1.4, 1.2, 1, 1])
    np.testing.assert_allclose(at(ground(**STAIRS), (0, 0), (0, 99)), [0, 0.6])


@pytest.mark.parametrize(("toward", "axis"), [(0, (0, 1)), (90, (1, 0)), (180, (0, -1)), (-90, (-1, 0)), (450, (1, 0))])
def test_stairs_toward_any_side(toward: float, axis: tuple[int, int]) -> None:
    walk = ground(**STAIRS, toward_deg=toward)
    steps = [(s * axis[0] + 7 * axis[1], s * axis[1] - 7 * axis[0]) for s in (0.99, 1.0, 1.31, 1.61)]
    np.testing.assert_allclose(at(walk, *steps), [0, 0.2, 0.4, 0.6])


def test_slopes_are_continuous_and_level_at_both_ends() -> None:
    stretches = [{"length_m": 2, "angle_deg": 45}, {"length_m": 1, "angle_deg": 0}, {"length_m": 4, "angle_deg": -30}]
    walk = ground(kind="slopes", stretches=stretches, start_m=1.0, toward_deg=90.0, height_m=0.5)
    low = 2.5 - 4 * math.tan(math.radians(30))
    points = [(x, 3) for x in (-5, 1, 2, 3, 4, 8, 50)]
    np.testing.assert_allclose(at(walk, *points), [0.5, 0.5, 1.5, 2.5, 2.5, low, low])


def test_sines_add_up() -> None:
    waves = [{"amplitude_m": 1, "wavelength_m": 4}, {"amplitude_m": 0.5, "wavelength_m": 8, "toward_deg": 90}]
    rolling = ground(kind="sines", waves=[*waves, {"amplitude_m": 2, "wavelength_m": 3, "phase_deg": 90}])
    np.testing.assert_allclose(at(rolling, (0, 0), (2, 0), (0, 3)), [2, 2.5, 1], atol=1e-12)


def test_rubble_follows_from_the_seed() -> None:
    def made(seed: int, number: int = 0) -> np.ndarray:
        models = [{"kind": "flat", "height_m": -9}] * number + [{"kind": "rubble", "extent_m": [8, 4], "height_m": 1}]
        model = TypeAdapter(GroundModel).validate_python({"kind": "layers", "layers": models})
        found = build_ground(model, Path(), seed).layers[-1 if number else 0].grid
        assert found is not None
        return found

    first = made(4)
    assert first.shape == (11, 21)
    assert (first == made(4)).all()
    assert not (first == made(5)).all()
    assert not (first == made(4, 1)).all()  # a second layer of rubble is another one
    inner = first[1:-1, 1:-1] - 1
    assert 0.09 < np.abs(inner).max() <= 0.1
    assert abs(inner.mean()) < 0.02
    assert (np.concatenate([first[0], first[-1], first[:, 0], first[:, -1]]) == 1).all()


def test_levels_by_altitude() -> None:
    deck = {"kind": "flat", "height_m": 3.0, "area_m": {"x": [-1, 1], "z": [-2, 2]}}
    both = ground(kind="layers", layers=[deck, {"kind": "flat", "height_m": 0.2}])
    for altitude, found in ((None, 3.0), (0.2, 0.2), (1.9, 0.2), (2.0, 3.0), (9.0, 3.0), (-5.0, 0.2)):
        assert height(both, 0.0, 0.0, altitude) == found
        assert height(both, 1.5, 0.0, altitude) == 0.2
    far = build_ground(TypeAdapter(GroundModel).validate_python(model(both)), Path(), max_step_height=2.5)
    assert height(far, 0.0, 0.0, 0.6) == 3.0
    np.testing.assert_allclose(height(both, np.zeros(3), 0.0, np.array([0.0, 2.5, 0.0])), [0.2, 3.0, 0.2])


def model(ground: Ground) -> dict[str, Any]:
    """The layers of `test_levels_by_altitude` again."""
    low, high = next(layer.area for layer in ground.layers if layer.area is not None)
    area = {"x": [low[0], high[0]], "z": [low[1], high[1]]}
    return {
        "kind": "layers",
        "layers": [{"kind": "flat", "height_m": 0.2}, {"kind": "flat", "height_m": 3.0, "area_m": area}],
    }


def test_steep_ground_is_told() -> None:
    assert ground(kind="sines", waves=[{"amplitude_m": 0.2, "wavelength_m": 2}]).notes == ()
    (note,) = ground(kind="sines", waves=[{"amplitude_m": 1, "wavelength_m": 2}]).notes
    assert "up to 72 deg steep" in note


def test_height_map_is_not_mirrored(tmp_path: Path) -> None:
    """The first row is far (+z), columns run from the left (+x) to the right."""
    np.save(tmp_path / "map.npy", np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
    here = ground(tmp_path, kind="heightmap", file="map.npy", cell_m=2.0, center_m=[10.0, 20.0])
    np.testing.assert_allclose(at(here, (12, 21), (10, 21), (8, 21), (12, 19), (8, 19)), [1, 2, 3, 4, 6])
    np.testing.assert_allclose(at(here, (10, 20), (11, 21)), [3.5, 1.5])  # bilinear
    np.testing.assert_allclose(at(here, (99, 99), (-99, 20)), [1, 4.5])  # level beyond the border


def test_cells_that_are_not_square(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
    here = ground(tmp_path, kind="heightmap", file="map.npy", cell_m=[2.0, 10.0])
    np.testing.assert_allclose(at(here, (2, 5), (0, 5), (-2, -5), (0, 0)), [1, 2, 6, 3.5])


DEGREES = {"dx": 0.001, "dy": 0.002, "xmin": 8.0, "xmax": 8.004, "ymin": 60.006, "ymax": 60.0}


@pytest.mark.parametrize(
    ("said", "cell"),
    [
        (DEGREES, (55.5937, 222.39)),  # a degree of longitude is half as long at 60 degrees
        (DEGREES | {"xmax": 8.005, "ymax": 59.998}, (55.5941, 222.39)),  # borders half a cell outside the samples
        ({"dx": 30.0, "dy": 25.0}, (30, 25)),
        ({"dx": 30.0, "dy": -25.0, "xmin": 5e5, "xmax": 5e5 + 120, "ymin": 4e6, "ymax": 4e6 + 75}, (30, 25)),
    ],
)
def test_archive_says_its_cell(said: dict[str, Any], cell: tuple[float, float], tmp_path: Path) -> None:
    np.savez(tmp_path / "dem.npz", elevation=np.zeros((4, 5)), **said)
    here = ground(tmp_path, kind="heightmap", file="dem.npz")
    np.testing.assert_allclose(-here.layers[0].cell, cell, rtol=1e-4)
    assert "dem.npz: cells of" in here.notes[0]
    assert not ground(tmp_path, kind="heightmap", file="dem.npz", cell_m=3.0).notes


@pytest.mark.parametrize(
    ("said", "says"),
    [
        ({}, "does not say how far its samples are apart; cell_m is needed"),
        ({"dx": 30.0}, "does not say how far its samples are apart"),
        ({"dx": 0.001, "dy": 0.002}, "dx 0.001 and dy 0.002 could be metres or degrees; cell_m is needed"),
        ({"dx": 1, "dy": 1, "xmin": 0, "xmax": 4, "ymin": 0, "ymax": 3}, "could be metres or degrees"),
        (DEGREES | {"xmax": 9.0}, "do not fit its borders and 5 x 4 cells"),
        ({"dx": 0.0, "dy": 1.0}, "no size of a cell"),
    ],
)
def test_archive_whose_cell_is_not_clear(said: dict[str, Any], says: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "dem.npz", elevation=np.zeros((4, 5)), **said)
    with pytest.raises(InputError, match=says):
        ground(tmp_path, kind="heightmap", file="dem.npz")


def test_elevation_model_of_a_package() -> None:
    file = "package:matplotlib/mpl-data/sample_data/jacksboro_fault_dem.npz"
    here = ground(kind="heightmap", file=file, datum_m="center")
    assert grid(here).shape == (344, 403)
    np.testing.assert_allclose(-here.layers[0].cell, (74.4, 92.7), atol=0.1)
    assert at(here, (0, 0)) == [pytest.approx(0)]


def test_datum_and_scale(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.array([[100, 102], [104, 106]], np.int16))
    raised = ground(tmp_path, kind="heightmap", file="map.npy", cell_m=1, datum_m=100.0, height_scale_m=0.5)
    assert at(raised, (0, 0)) == [pytest.approx(51.5 - 100)]
    centred = ground(tmp_path, kind="heightmap", file="map.npy", cell_m=1, datum_m="center")
    assert at(centred, (0, 0)) == [pytest.approx(0)]


@pytest.mark.parametrize(("mode", "white"), [("L", 255), ("RGB", (255, 255, 255)), ("I;16", 65535), ("1", 1)])
def test_png_of_any_depth(mode: str, white: Any, tmp_path: Path) -> None:
    image = Image.new(mode, (4, 3), 0)
    image.putpixel((0, 0), white)  # far left
    image.save(tmp_path / "map.png")
    here = ground(tmp_path, kind="heightmap", file="map.png", cell_m=1.0, height_scale_m=8.0)
    np.testing.assert_allclose(at(here, (1.5, 1.0), (-1.5, -1.0)), [8.0, 0.0])


def test_ascii_grid_with_gaps(tmp_path: Path) -> None:
    text = "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 5\nNODATA_value -1\n7 8 -1\n1 2 3\n"
    (tmp_path / "map.asc").write_text(text)
    here = ground(tmp_path, kind="heightmap", file="map.asc")
    np.testing.assert_allclose(at(here, (5, 2.5), (-5, -2.5)), [7, 3])
    assert at(here, (-5, 2.5))[0] in (8.0, 3.0)  # filled with a neighbour
    assert "1 of 6 cells have no height" in here.notes[0]
    refuse_missing(here, np.array([[5.0, 2.5]]), "x")
    with pytest.raises(InputError, match=r"herds\[0\].place: 1 characters start where the height map has no height"):
        refuse_missing(here, np.array([[5.0, 2.5], [-5.0, 2.5]]), "herds[0].place")


def test_real_terrain(shared_data: Path) -> None:
    folder = shared_data / "terrain"
    png = grid(ground(folder, kind="heightmap", file="raylib_heightmap.png", cell_m=0.5, height_scale_m=10.0))
    assert png.shape == (128, 128)
    assert (png.min(), png.max()) == (0.0, 10.0)
    hugo = ground(folder, kind="heightmap", file="landlab_hugo_site_filled.asc", datum_m="center")
    assert grid(hugo).shape == (55, 76)
    assert np.ptp(grid(hugo)) == pytest.approx(51.0, abs=1.0)  # 1660 to 1711 m
    assert hugo.layers[0].missing is not None
    assert 0.4 < hugo.layers[0].missing.mean() < 0.6
    dem = grid(ground(folder, kind="heightmap", file="jacksboro_fault_dem.npz"))
    assert dem.shape == (344, 403)
    assert (dem.min(), dem.max()) == (236, 1076)


def text(content: str) -> Callable[[Path], object]:
    return lambda path: path.write_text(content)


HEADER = "ncols 2\nnrows 2\ncellsize 1\n"
BAD_FILES: list[tuple[str, Callable[[Path], object], str]] = [
    ("gone.png", lambda path: None, "no such file"),
    ("words.png", text("hello"), "is not an image"),
    ("cut.png", lambda path: path.write_bytes(_png_bytes()[:60]), "is not a readable PNG"),
    ("map.tif", text("x"), "must be .png, .npy, .asc, .npz"),
    ("words.npy", text("hello"), "is not a readable NPY array"),
    ("empty.npy", text(""), "is not a readable NPY array"),
    ("objects.npy", lambda path: np.save(path, np.array([[{}]]), allow_pickle=True), "is not a readable NPY array"),
    ("line.npy", lambda path: np.save(path, np.arange(5.0)), "shape (5,): must be rows x columns"),
    ("text.npy", lambda path: np.save(path, np.array([["a", "b"]] * 2)), "heights must be real numbers"),
    ("complex.npy", lambda path: np.save(path, np.ones((3, 3), complex)), "heights must be real numbers"),
    ("nan.npy", lambda path: np.save(path, np.full((3, 3), np.nan)), "no cell has a height"),
    ("words.npz", text("hello"), "is not a readable NPZ archive"),
    ("other.npz", lambda path: np.savez(path, elevatoin=np.ones((3, 3))), "did you mean 'elevatoin'?"),
    ("binary.asc", lambda path: path.write_bytes(b"\xff\xfe" * 9), "is not a text file"),
    ("nohead.asc", text("1 2\n3 4\n"), "header has no positive 'ncols'"),
    ("key.asc", text("ncolumns 2\n" + HEADER + "1 2\n3 4\n"), "key.asc:1: 'ncolumns 2': must be one of"),
    ("number.asc", text("ncols two\n"), "number.asc:1: 'two' is not a number"),
    ("short.asc", text(HEADER + "1 2\n3\n"), "3 heights; 2 rows of 2 need 4"),
    ("letters.asc", text(HEADER + "1 2\n3 x\n"), "a height is not a number"),
    ("huge.asc", text("ncols 99999\nnrows 99999\ncellsize 1\n1\n"), "9,999,800,001 cells; at most"),
]


def _png_bytes() -> bytes:
    import io

    buffer = io.BytesIO()
    Image.effect_noise((64, 64), 50).save(buffer, "PNG")
    return buffer.getvalue()


@pytest.mark.parametrize(("name", "make", "says"), BAD_FILES, ids=[row[0] for row in BAD_FILES])
def test_bad_file(name: str, make: Callable[[Path], object], says: str, tmp_path: Path) -> None:
    make(tmp_path / name)
    with pytest.raises(InputError) as caught:
        read_heights(tmp_path / name)
    assert says in str(caught.value)
    assert name in str(caught.value)
