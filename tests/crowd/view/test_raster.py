"""Pictures: what covers which pixel, what hides what, and that nothing depends on chance."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from crowd.view import zbuffer
from crowd.view.camera import Camera, framing
from crowd.view.geometry import vertex_normals
from crowd.view.raster import Body, Geometry, Level, contact_sheet, draw
from crowd.view.strip import clip_strip

SIZE = (96, 64)
FRONT = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), 40.0)


def square(z: float, half: float, color: tuple[float, float, float]) -> Body:
    corners = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]])
    return Body(corners[None], np.array([[0, 1, 2], [0, 2, 3]]), np.array([color]))


def flat(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    return np.zeros_like(x)


def test_triangle_covers_exactly_its_pixels():
    xy = np.array([[[2.0, 1.0], [10.0, 1.0], [2.0, 9.0]]])
    seen = zbuffer.rasterize(xy, np.ones((1, 3)), (12, 10))
    x, y = np.meshgrid(np.arange(12) + 0.5, np.arange(10) + 0.5)
    inside = (x >= 2) & (y >= 1) & ((x - 2) + (y - 1) <= 8)
    assert np.array_equal(seen.triangle == 0, inside)
    assert not seen.nearness[~inside].any()


def test_neighbours_leave_no_gap_and_batches_do_not_matter(monkeypatch: pytest.MonkeyPatch):
    rng = np.random.default_rng(1)
    cloud = rng.uniform(0, 40, (60, 3, 2))
    near = rng.uniform(0.2, 3.0, (60, 3))
    grid = np.stack(np.meshgrid(np.linspace(0, 40, 8), np.linspace(0, 40, 8)), -1) + rng.uniform(-2, 2, (8, 8, 2))
    a, b, c, d = (grid[i : 7 + i, j : 7 + j].reshape(-1, 2) for i, j in ((0, 0), (0, 1), (1, 1), (1, 0)))
    sheet = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    seen = zbuffer.rasterize(sheet, np.ones((len(sheet), 3)), (40, 40))
    assert (seen.triangle[4:36, 4:36] >= 0).all()
    whole = zbuffer.rasterize(cloud, near, (40, 40))
    monkeypatch.setattr(zbuffer, "BATCH", 50)
    parts = zbuffer.rasterize(cloud, near, (40, 40))
    assert np.array_equal(whole.triangle, parts.triangle)
    assert np.array_equal(whole.nearness, parts.nearness)


def test_rasterizer_agrees_with_brute_force():
    rng = np.random.default_rng(2)
    xy, near = rng.uniform(-10, 40, (40, 3, 2)), rng.uniform(0.5, 2.0, (40, 3))
    seen = zbuffer.rasterize(xy, near, (30, 24))
    y, x = np.mgrid[0:24, 0:30] + 0.5
    best = np.zeros((24, 30))
    for corners, depth in zip(xy, near, strict=True):
        system = np.vstack([corners.T, np.ones(3)])
        share = np.linalg.solve(system, np.stack([x.ravel(), y.ravel(), np.ones(x.size)]))
        value = np.where((share >= 0).all(0), depth @ share, 0.0).reshape(best.shape)
        best = np.maximum(best, value)
    assert np.allclose(seen.nearness, best, rtol=1e-5)


def test_nearer_body_hides_the_farther_whatever_the_order():
    near, far = square(1.0, 0.4, (1.0, 0.0, 0.0)), square(-1.0, 1.2, (0.0, 0.0, 1.0))
    pictures = [np.asarray(draw(Geometry(order), FRONT, SIZE)).astype(int) for order in ((near, far), (far, near))]
    for picture in pictures:
        middle, beside = picture[32, 48], picture[32, 60]
        assert middle[0] > middle[2] + 80
        assert beside[2] > beside[0] + 80
    assert np.array_equal(pictures[0], pictures[1])


def test_unusable_triangles_are_skipped():
    broken = square(0.0, 0.5, (1.0, 0.0, 0.0))
    vertices = np.concatenate([broken.vertices, broken.vertices])
    vertices[1, 2] = np.nan
    colors = np.repeat(broken.color, 2, 0)
    behind = square(9.0, 0.5, (0.0, 1.0, 0.0))
    picture = draw(Geometry([Body(vertices, broken.triangles, colors), behind]), FRONT, SIZE)
    alone = draw(Geometry([broken]), FRONT, SIZE)
    assert np.abs(np.asarray(picture).astype(int)[32, 48] - np.asarray(alone).astype(int)[32, 48]).max() < 4
    assert np.asarray(draw(Geometry(), FRONT, SIZE)).std() > 0  # sky alone


def test_triangles_seen_edge_on_are_skipped():
    line = np.array([[1.0, 1.0], [9.0, 9.0], [5.0, 5.0]])
    behind = np.array([[0.0, 0.0], [12.0, 0.0], [0.0, 12.0]])
    seen = zbuffer.rasterize(np.stack([behind, line]), np.array([[1.0] * 3, [2.0] * 3]), (12, 12))
    assert np.isfinite(seen.nearness).all() and set(np.unique(seen.triangle)) == {-1, 0}


def test_water_tints_what_is_below_it_and_only_there():
    pole = Body(
        np.array([[[-0.2, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 2.0, 0.0], [-0.2, 2.0, 0.0]]]),
        np.array([[0, 1, 2], [0, 2, 3]]),
        np.array([[0.8, 0.05, 0.05]]),
    )
    camera = Camera((0.0, 1.6, 6.0), (0.0, 1.0, 0.0), 28.0)
    dry = np.asarray(draw(Geometry([pole], flat), camera, SIZE)).astype(int)
    wet = np.asarray(draw(Geometry([pole], flat, [Level(1.0)]), camera, SIZE)).astype(int)
    xy, _ = camera.project(np.array([[0.0, 0.3, 0.0], [0.0, 1.7, 0.0]]), SIZE)
    below, above = np.floor(xy).astype(int)
    assert np.array_equal(dry[above[1], above[0]], wet[above[1], above[0]])
    assert wet[below[1], below[0], 0] < dry[below[1], below[0], 0] - 30
    beside = np.asarray(draw(Geometry([pole], flat, [Level(1.0, x=(3.0, 4.0))]), camera, SIZE)).astype(int)
    assert np.array_equal(dry[:, 48], beside[:, 48])


def test_bodies_cast_shadows_on_the_ground():
    lid = Body(
        np.array([[[-1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]]]),
        np.array([[0, 2, 1], [0, 3, 2]]),
        np.array([[0.5, 0.5, 0.5]]),
    )
    camera = Camera((0.0, 4.0, 9.0), (0.0, 0.0, 0.0), 40.0)
    picture = np.asarray(draw(Geometry([lid], flat), camera, (192, 128))).astype(int).sum(-1)
    # The sun stands at (0.52, 0.74, 0.43): the middle of the lid's shadow falls here.
    shaded, free = (np.array([[-0.703 + dx, 0.0, -0.581 + 0.3]]) for dx in (-0.6, 5.0))
    rows = [np.floor(camera.project(point, (192, 128))[0][0]).astype(int) for point in (shaded, free)]
    assert picture[rows[0][1], rows[0][0]] < 0.85 * picture[rows[1][1], rows[1][0]]


def test_framing_fits_the_points_and_drawing_repeats(box_man):
    rng = np.random.default_rng(3)
    cloud = rng.normal(size=(200, 3)) * [6, 1, 3] + [3, 0, -8]
    for azimuth, elevation in ((0.0, 5.0), (40.0, 20.0), (200.0, 60.0), (90.0, 90.0)):
        camera = framing(cloud, SIZE, azimuth, elevation, margin=0.05)
        xy, _ = camera.project(cloud, SIZE)
        share = xy / SIZE
        assert share.min() > 0.045
        assert share.max() < 0.955
        assert max(np.ptp(share[:, 0]), np.ptp(share[:, 1])) > 0.85
    body = Body(box_man.mesh.vertices[None], box_man.mesh.triangles, np.array([[0.7, 0.2, 0.1]]))
    camera = framing(body.vertices, SIZE)
    first, second = (draw(Geometry([body], flat), camera, SIZE).tobytes() for _ in range(2))
    assert first == second


def test_vertex_normals_point_outward_and_join_split_vertices(box_man):
    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    split, index = corner[faces].reshape(1, -1, 3), np.arange(12).reshape(4, 3)
    whole = vertex_normals(corner[None], faces)[0]
    assert np.allclose(vertex_normals(split, index)[0], whole[faces].reshape(-1, 3))
    assert np.allclose(whole[0], -np.ones(3) / np.sqrt(3))
    centre = box_man.mesh.vertices.reshape(-1, 8, 3).mean(1, keepdims=True)
    outward = box_man.mesh.vertices.reshape(-1, 8, 3) - centre
    normal = vertex_normals(box_man.mesh.vertices[None], box_man.mesh.triangles).reshape(-1, 8, 3)
    assert (np.sum(outward * normal, -1) > 0).all()


def test_clip_strip_and_sheet(tmp_path, box_man):
    path = clip_strip(box_man, "walk", tmp_path / "strip.png", views=("side",), phases=3, cell=(60, 80), bones=True)
    with Image.open(path) as image:
        assert image.size == (3 * 60 + 2 * 3, 80 + 28)
        cells = [np.asarray(image.crop((k * 63, 52, k * 63 + 60, 108))).astype(int) for k in range(3)]
    assert np.abs(cells[0] - cells[1]).max() > 60
    rest = clip_strip(box_man, None, tmp_path / "rest.png", views=("front", "side"), cell=(40, 60))
    with Image.open(rest) as image:
        assert image.size == (40, 123 + 28)
    with pytest.raises(ValueError, match="not among"):
        clip_strip(box_man, "fly", tmp_path / "none.png")
    sheet = contact_sheet([Image.new("RGB", (20, 10), "red")] * 3, ["a"], columns=2, gap_px=4)
    assert sheet.size == (44, 24)
