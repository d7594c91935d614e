"""Drag against polygons clipped one by one in NumPy, and against bodies whose drag is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from kernels import drag, drag_skinned
from kernels.drag_rigid import _nearest, groups_of, rigid_mesh
from tests.kernels import meshes
from tests.kernels.checks import (
    BATCHES,
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    in_double,
    in_single,
)
from tests.kernels.drag_cases import (
    OFFSET,
    batched_reference,
    fluid,
    moving_blob,
    rigid,
    rigid_blob,
    skinned,
)

MODES = [(s, m) for s in ("clipped", "centroid") for m in ("area", "paper")]
# every mode for one batch shape, every batch shape for one mode
CASES = [(*mode, BATCHES[-1]) for mode in MODES] + [(*MODES[0], batch) for batch in BATCHES[:-1]]
# --- wet parts -------------------------------------------------------------------------------------------------------

DEPTHS = {
    "random": np.random.default_rng(0).normal(size=(3, 300)),
    "at the surface": np.array([[a, b, c] for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1)], float).T,
    "two equal": np.array([[1, 1, -1], [-1, 1, 1], [-1, -1, 2], [2, -1, -1], [0.5, -0.5, 0.5]]).T,
    "nearly level": 1e-6 * np.random.default_rng(1).normal(size=(3, 50)),
    "deep and dry": np.array([[1e3, 1e3, 1e3], [-1e3, -1e3, -1e3], [1e3, 1e3 + 1, 1e3 + 2]]).T,
}


@pytest.mark.parametrize("case", DEPTHS)
def test_wet_part(case: str) -> None:
    """Both forms of the wet share, and the centroid, against clipped polygons."""
    depth = DEPTHS[case]
    expected = [meshes.wet_part(d) for d in depth.T]
    share = np.array([s for s, _ in expected])
    weights = np.stack([s * w for s, w in expected], 1)

    def corners(a, b, c):
        return drag.wet_corner(a, b, c), drag.wet_corner(b, c, a), drag.wet_corner(c, a, b)

    tolerance = 1e-5 if case == "nearly level" else 1e-9
    assert_close(np.stack(in_double(corners, *depth)), weights, tolerance)
    assert_close(in_double(drag.wet_share, *depth), share, tolerance)
    if case != "nearly level":
        assert_close(np.stack(in_single(corners, *depth)), weights, 1e-5)
        assert_close(in_single(drag.wet_share, *depth), share, 1e-5)
    assert_gradient_finite(corners, *depth)
    assert_gradient_finite(drag.wet_share, *depth)


@pytest.mark.parametrize("case", ["random", "deep and dry"])
def test_slope_of_the_wet_share(case: str) -> None:
    """In closed form, against the derivative of the share."""

    def slopes(a, b, c):
        return drag.wet_share_slope(a, b, c), drag.wet_share_slope(b, c, a), drag.wet_share_slope(c, a, b)

    depth = DEPTHS[case]
    expected = in_double(jax.grad(lambda *each: drag.wet_share(*each).sum(), (0, 1, 2)), *depth)
    assert_close(np.stack(in_double(slopes, *depth)), np.stack(expected), 1e-9)
    assert_close(np.stack(in_single(slopes, *depth)), np.stack(expected), 1e-4 * np.abs(expected).max() + 1e-6)


# --- against the reference -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("submersion", "mode", "batch"), CASES)
def test_skinned(submersion: str, mode: str, batch: tuple[int, ...]) -> None:
    triangles, *at, water = moving_blob(batch)
    expected = batched_reference(triangles, *at, fluid=water, submersion=submersion, mode=mode)
    assert np.abs(expected[0]).max() > 10
    assert_close(in_double(skinned(triangles, submersion, mode), *at, *water), expected, 1e-6)
    assert_close(in_single(skinned(triangles, submersion, mode, flag=True), *at, *water), expected, 1e-4)


def test_walls_in_several_groups() -> None:
    """More triangles than one group holds, and not a multiple of it: the padding adds nothing."""
    vertices, triangles = meshes.split(*meshes.blob())
    triangles = triangles[:197]
    assert len(triangles) > 2 * drag_skinned.GROUP
    rng = np.random.default_rng(1)
    at = vertices.T[..., None], rng.normal(size=(3, len(vertices), 1))
    water = fluid(0.1, OFFSET, batch=(1,))
    plain = in_single(skinned(triangles, mode="paper"), *at, *water)
    assert_close(in_single(skinned(triangles, mode="paper", flag=True), *at, *water), plain, 1e-5)


def test_flow_is_in_the_velocity() -> None:
    """`velocity` is already less the flow: the field of the fluid does not count twice."""
    triangles, *at, water = moving_blob((2,))
    flowing = (*water[:3], water[3] + 3.0)
    run = skinned(triangles)
    assert_close(in_double(run, *at, *flowing), in_double(run, *at, *water), 0)


@pytest.mark.parametrize(("mode", "walled"), [("area", True), ("paper", None)], ids=["area, walls", "paper"])
def test_skinned_gradients(mode: str, walled: bool | None) -> None:
    triangles, *at, water = moving_blob((2,), seed=2)
    few = triangles[::4]
    assert_gradients_agree(skinned(few, "clipped", mode, walled), *at, *water[:3], water[3], tolerance=1e-4, seed=3)


# --- rigid -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("submersion", "mode", "batch"), CASES)
def test_rigid(submersion: str, mode: str, batch: tuple[int, ...]) -> None:
    """Bones that turn and move, each body of its own size: wet area exact, the rest of whole triangles."""
    bones, mesh, at, body = rigid_blob(batch)
    water = fluid(np.random.default_rng(1).uniform(-0.3, 0.4, batch), OFFSET, batch=batch)
    expected = batched_reference(*body, fluid=water, submersion=submersion, mode=mode, whole=True)
    assert np.abs(expected[0]).max() > 10
    assert_close(in_double(rigid(bones, submersion, mode), mesh, *at, *water), expected, 1e-6)
    assert_close(in_single(rigid(bones, submersion, mode, flag=True), mesh, *at, *water), expected, 1e-4)


@pytest.mark.parametrize("mode", ["area", "paper"])
def test_rigid_is_skinned_under_water(mode: str) -> None:
    """Fully submerged, the wet centroid is the whole one: scaled bones and their world geometry agree."""
    bones, mesh, at, (triangles, *body) = rigid_blob((3,), seed=4)
    water = fluid(50.0, OFFSET, batch=(3,))
    expected = in_double(skinned(triangles, mode=mode), *body, *water)
    assert_close(in_double(rigid(bones, mode=mode), mesh, *at, *water), expected, 1e-6)


def test_rigid_is_nearly_skinned_at_the_surface() -> None:
    """Without spin only the centre of the cut triangles differs: force equal, centre of pressure close."""
    bones, mesh, at, (triangles, *body) = rigid_blob((3,), seed=5, still=True)
    water = fluid(0.1, 0.0, batch=(3,))
    force, size, moment, slope = in_double(skinned(triangles), *body, *water)
    rode = in_double(rigid(bones), mesh, *at, *water)
    assert_close(rode[0], force, 1e-5)
    assert_close(rode[1], size, 1e-5)
    assert_close(rode[3], slope, 1e-5)
    apart = np.abs(rode[2] / rode[1] - moment / size).max()
    assert 1e-6 < apart < 0.1


@pytest.mark.parametrize(("submersion", "mode"), MODES)
def test_rigid_gradients(submersion: str, mode: str) -> None:
    bones, mesh, at, _ = rigid_blob((2,), seed=6)
    water = fluid(0.05, OFFSET, batch=(2,))
    run = rigid(bones, submersion, mode, flag=True)
    with jax.enable_x64(True):
        mesh = tuple(jnp.asarray(x) for x in mesh)
    assert_gradients_agree(lambda *at: run(mesh, *at), *at, *water, tolerance=1e-4)


@pytest.mark.parametrize("shape", [(), (1,)])
def test_rigid_gradients_of_a_fluid_alike_for_all(shape: tuple[int, ...]) -> None:
    bones, mesh, at, _ = rigid_blob((2,), seed=6)
    density, offset, *rest = fluid(0.05, OFFSET, batch=(2,))
    with jax.enable_x64(True):
        mesh, at, rest = (tuple(jnp.asarray(x) for x in group) for group in (mesh, at, rest))

    def run(density, offset):
        return rigid(bones, flag=True)(mesh, *at, density, offset, *rest)

    assert_gradients_agree(run, np.full(shape, density[0]), np.full(shape, offset[0]), tolerance=1e-4)


def test_rigid_gradients_of_the_mesh() -> None:
    """No scenario asks for them; they are there all the same, and right."""
    bones, mesh, at, _ = rigid_blob((2,), seed=6)
    water = fluid(0.05, OFFSET, batch=(2,))
    corners, area, moments, bounds, readings = mesh  # the area of padding is 0, where its drag has a kink

    def run(corners, moments, *at):
        with jax.enable_x64(True):
            return rigid(bones, flag=True)(
                (corners, jnp.asarray(area), moments, jnp.asarray(bounds), jnp.asarray(readings)), *at
            )

    assert_gradients_agree(run, corners, moments, *at, *water, tolerance=1e-4)


# --- dry parts -------------------------------------------------------------------------------------------------------


def tall_body(kind: str) -> tuple[Callable[..., Any], tuple[Any, ...], np.ndarray]:
    """A column of 320 triangles from -1 to 1 m in several groups from the bottom upwards, for three characters."""
    vertices, triangles = meshes.split(*meshes.blob())
    vertices = vertices * np.array([0.3, 1.0, 0.3]) / np.abs(vertices[:, 1]).max()
    triangles = triangles[np.argsort(vertices[triangles, 1].mean(1), kind="stable")]
    rng = np.random.default_rng(3)
    if kind == "skinned":
        at = np.repeat(vertices.T[..., None], 3, 2), rng.normal(size=(3, len(vertices), 3))
        return skinned(triangles, mode="paper", flag=True), at, vertices[:, 1]
    corners = vertices[triangles].reshape(40, 8, 3, 3)
    mesh = rigid_mesh(corners)
    assert groups_of(len(mesh.moments)) > 1
    transforms = np.repeat(np.array([1.0, 0, 0, 0, 0, 0, 0])[:, None, None], 3, 2)
    at = transforms, rng.normal(size=(6, 1, 3)), np.array([1.0, 1.0, 1.0])
    ride = rigid(np.zeros(40, int), mode="paper", flag=True)
    return (lambda *at: ride(tuple(jnp.asarray(x) for x in mesh), *at)), at, vertices[:, 1]


def test_boxes_reach_as_low_as_their_blocks() -> None:
    """For blocks of any shape, turned in any way: never higher, and hardly lower for flat ones that lie level."""
    rng = np.random.default_rng(8)
    corners = rng.normal(size=(50, 8, 3, 3)) * rng.uniform(0.01, 2.0, (50, 1, 1, 3)) + rng.normal(size=(50, 1, 1, 3))
    corners[:, 5:] = 0.0  # padding, which must not count
    corners[-1] = 0.0
    up = rng.normal(size=(50, 3, 200))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    surface = np.concatenate([up, np.full((50, 1, 200), 0.3)], 1)
    bounds = rigid_mesh(corners).bounds.astype(np.float32)
    found = np.asarray(_nearest(jnp.asarray(bounds), jnp.asarray(surface, jnp.float32)))
    lowest = 0.3 - np.einsum("btkc,bcn->btkn", corners[:, :5], up).min((1, 2))
    assert (found[:-1] > lowest[:-1]).all()
    assert (found[-1] < -1e5).all()
    level = np.tile(np.array([0.0, 1.0, 0.0, 0.3], np.float32)[:, None], (50, 1, 1))
    found = np.asarray(_nearest(jnp.asarray(bounds), jnp.asarray(level)))[:-1, 0]
    np.testing.assert_allclose(found, 0.3 - corners[:-1, :5, :, 1].min((1, 2)), atol=2e-3)


@pytest.mark.parametrize("kind", ["skinned", "rigid"])
def test_dry_groups_change_no_bits(kind: str) -> None:
    """A character's drag is the same whether a neighbour wets the groups above it or not; dry is exactly nothing."""
    run, at, height = tall_body(kind)
    surface = np.array([-0.6, -2.0, -2.0])
    alone = in_single(run, *at, *fluid(surface, OFFSET, batch=(3,)))
    deep = in_single(run, *at, *fluid(np.array([-0.6, -2.0, 2.0]), OFFSET, batch=(3,)))
    assert height.min() < surface[0] < height.max()
    assert abs(alone[1][0]) > 1
    for few, all_ in zip(alone, deep, strict=True):
        np.testing.assert_array_equal(few[..., :2], all_[..., :2])
        assert (few[..., 1:] == 0).all()
        assert (all_[..., 2] != 0).all()


@pytest.mark.parametrize("kind", ["skinned", "rigid"])
def test_gradients_with_dry_groups(kind: str) -> None:
    run, at, _ = tall_body(kind)
    assert_gradients_agree(run, *at, *fluid(np.array([-0.61, -2.0, -0.83]), OFFSET, batch=(3,)), tolerance=1e-4)


@pytest.mark.parametrize("kind", ["skinned", "rigid"])
def test_what_is_not_finite_stays_so_and_alone(kind: str) -> None:
    run, at, _ = tall_body(kind)
    surface = np.array([-0.6, 0.3, -2.0])
    whole = in_single(run, *at, *fluid(surface, OFFSET, batch=(3,)))
    broken = [x.copy() for x in at]
    broken[0][..., 2] = np.nan
    found = in_single(run, *broken, *fluid(surface, OFFSET, batch=(3,)))
    for before, after in zip(whole, found, strict=True):
        np.testing.assert_array_equal(before[..., :2], after[..., :2])
    assert np.isnan(found[0][..., 2]).all()
