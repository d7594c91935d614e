"""Drag against polygons clipped one by one in NumPy, and against bodies whose drag is known."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from crowd import posing
from kernels import drag
from kernels.wall import no_wall, through
from tests.kernels import meshes
from tests.kernels.checks import (
    BATCHES,
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    in_double,
    in_single,
    unit_vectors,
)

MODES = [(s, m) for s in ("clipped", "centroid") for m in ("area", "paper")]
DENSITY_DRAG, OFFSET = 1080.0, 50.0
UP = np.array([0.0, 1.0, 0.0])


def fluid(surface: Any = 1e3, offset: float = 0.0, flow: Any = (0.0, 0.0, 0.0), batch: tuple[int, ...] = ()) -> tuple:
    """Arguments of `drag.Fluid` for a batch."""
    flow = np.asarray(flow, float).reshape(3, *(1,) * len(batch))
    return (
        np.full(batch, DENSITY_DRAG),
        np.full(batch, offset),
        np.broadcast_to(np.asarray(surface, float), batch).copy(),
        np.broadcast_to(flow, (3, *batch)).copy(),
    )


def skinned(triangles: np.ndarray, submersion: Any = "clipped", mode: Any = "area", flag: Any = None):
    def run(vertices, velocity, *fluid):
        wall = no_wall if flag is None else through(jnp.asarray(flag))
        return tuple(drag.skinned(triangles, vertices, velocity, drag.Fluid(*fluid), submersion, mode, wall))

    return run


def batched_reference(triangles, vertices, velocity, fluid, submersion, mode, whole=False) -> tuple[np.ndarray, ...]:
    """The reference for every character of a batch; vertices [3, V, *b]."""
    batch = vertices.shape[2:]
    results = []
    for at in np.ndindex(batch):
        here = (slice(None), slice(None), *at)
        constants = float(fluid[0][at]), float(fluid[1][at])
        results.append(
            meshes.reference(
                triangles, vertices[here].T, velocity[here].T, constants, float(fluid[2][at]), submersion, mode, whole
            )
        )
    force, size, moment, slope = (np.array(x) for x in zip(*results, strict=True))
    return force.T.reshape(3, *batch), size.reshape(batch), moment.T.reshape(3, *batch), slope.reshape(batch)


def moving_blob(batch: tuple[int, ...], seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, tuple]:
    """triangles, vertices [3, V, *b], their velocities, and a fluid that covers some of the body."""
    rng = np.random.default_rng(seed)
    vertices, triangles = meshes.blob(seed)
    wide = vertices.T.reshape(3, -1, *(1,) * len(batch))
    placed = wide + 0.03 * rng.normal(size=(3, len(vertices), *batch)) + 0.1 * rng.normal(size=(3, 1, *batch))
    velocity = rng.normal(size=(3, 1, *batch)) + 0.5 * rng.normal(size=placed.shape)
    return triangles, placed, velocity, fluid(rng.uniform(-0.3, 0.4, batch), OFFSET, batch=batch)


def total(body, velocity, surface=1e3, offset=0.0, **options) -> tuple[np.ndarray, ...]:
    """Drag in x64 on one body [V, 3] for each velocity [3, n] through the fluid (the same at all its vertices)."""
    vertices, triangles = body
    velocity = np.asarray(velocity, float).reshape(3, -1)
    batch = velocity.shape[1:]
    at = (np.broadcast_to(x, (3, len(vertices), *batch)) for x in (vertices.T[..., None], velocity[:, None]))
    return in_double(skinned(triangles, **options), *at, *fluid(surface, offset, batch=batch))


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


# --- against the reference -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize(("submersion", "mode"), MODES)
def test_skinned(submersion: str, mode: str, batch: tuple[int, ...]) -> None:
    if batch != BATCHES[-1] and (submersion, mode) != MODES[0]:
        pytest.skip("other batch shapes are shown with the default modes")
    triangles, *at, water = moving_blob(batch)
    expected = batched_reference(triangles, *at, water, submersion, mode)
    assert np.abs(expected[0]).max() > 10
    assert_close(in_double(skinned(triangles, submersion, mode), *at, *water), expected, 1e-6)
    assert_close(in_single(skinned(triangles, submersion, mode, flag=True), *at, *water), expected, 1e-4)


def test_walls_in_several_groups() -> None:
    """More triangles than one group holds, and not a multiple of it: the padding adds nothing."""
    vertices, triangles = meshes.split(*meshes.blob())
    triangles = triangles[:197]
    assert len(triangles) > 2 * drag.GROUP
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

BONES = 3


def rigid_blob(batch: tuple[int, ...], seed: int = 0, still: bool = False) -> tuple[Any, ...]:
    """bones, mesh, (transforms, velocity, scale), and the same body in the world: triangles, vertices, velocities."""
    rng = np.random.default_rng(seed)
    vertices, faces = meshes.blob(seed)
    size, blocks = 8, len(faces) // 8
    bones = rng.integers(0, BONES, blocks)
    corners = vertices[faces].reshape(blocks, size, 3, 3)  # block, triangle, corner, component
    corners[-1, -1] = corners[-1, -1, :1]  # padding: no area
    area = 0.5 * np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    rows = np.concatenate([np.ones((blocks, size, 1)), corners.mean(2)], 2)
    tail = (1,) * len(batch)  # the kernel's layout has one axis of characters: [..., 1]
    mesh = (
        corners.transpose(2, 3, 0, 1).reshape(3, 3, blocks, size, *tail),
        area.transpose(2, 0, 1).reshape(3, blocks, size, *tail),
        rows.transpose(0, 2, 1),
    )
    transforms = np.concatenate([unit_vectors(rng, 4, BONES, *batch), 0.2 * rng.normal(size=(3, BONES, *batch))])
    velocity = rng.normal(size=(6, BONES, *batch)) * (np.arange(6) < 3 if still else np.ones(6)).reshape(
        6, 1, *(1,) * len(batch)
    )
    scale = rng.uniform(0.6, 1.6, batch)
    world, moving = in_world(corners, bones, transforms, velocity, scale)
    triangles = np.arange(world.shape[1], dtype=np.int32).reshape(-1, 3)
    return bones, mesh, (transforms, velocity, scale), (triangles, world, moving)


def in_world(corners, bones, transforms, velocity, scale) -> tuple[np.ndarray, np.ndarray]:
    """Every corner of every triangle carried by its bone: positions and velocities [3, 3 T, *b]."""
    batch = scale.shape
    of = np.repeat(bones, corners.shape[1] * 3)
    local = corners.reshape(-1, 3)
    world, moving = np.zeros((2, 3, len(local), *batch))
    for at in np.ndindex(batch):
        here = (slice(None), slice(None), *at)
        t, v = transforms[here][:, of].T, velocity[here][:, of].T
        arm = local * scale[at]
        world[here] = (t[:, 4:] + posing.rotate(t[:, :4], arm)).T
        moving[here] = (v[:, :3] + posing.rotate(t[:, :4], np.cross(v[:, 3:], arm))).T
    return world, moving


def rigid(bones, submersion: Any = "clipped", mode: Any = "area", flag: Any = None):
    def run(mesh, transforms, velocity, scale, *fluid):
        wall = no_wall if flag is None else through(jnp.asarray(flag))
        return tuple(
            drag.rigid(
                bones, drag.RigidMesh(*mesh), transforms, velocity, scale, drag.Fluid(*fluid), submersion, mode, wall
            )
        )

    return run


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize(("submersion", "mode"), MODES)
def test_rigid(submersion: str, mode: str, batch: tuple[int, ...]) -> None:
    """Bones that turn and move, each body of its own size: wet area exact, the rest of whole triangles."""
    if batch != BATCHES[-1] and (submersion, mode) != MODES[0]:
        pytest.skip("other batch shapes are shown with the default modes")
    bones, mesh, at, body = rigid_blob(batch)
    water = fluid(np.random.default_rng(1).uniform(-0.3, 0.4, batch), OFFSET, batch=batch)
    expected = batched_reference(*body, water, submersion, mode, whole=True)
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


def test_rigid_gradients() -> None:
    bones, mesh, at, _ = rigid_blob((2,), seed=6)
    water = fluid(0.05, OFFSET, batch=(2,))
    run = rigid(bones, flag=True)
    with jax.enable_x64(True):
        mesh = tuple(jnp.asarray(x) for x in mesh)
    assert_gradients_agree(lambda *at: run(mesh, *at), *at, *water, tolerance=1e-4)


# --- bodies whose drag is known --------------------------------------------------------------------------------------


def test_tilted_plate() -> None:
    """C_D rho A u^2 exactly; tilted by phi: A cos phi along the flow; the back face feels nothing."""
    phi = np.radians([0.0, 20.0, 60.0, 89.0, 91.0, 150.0, 180.0])
    velocity = 2.0 * np.stack([np.sin(phi), 0 * phi, np.cos(phi)])
    side = 0.7
    force, size, _, slope = total(meshes.plate(side=side), velocity)
    expected = DENSITY_DRAG * side**2 * np.maximum(np.cos(phi), 0.0) * 4.0
    assert_close(size, expected, 1e-9)
    assert_close(force, -velocity / 2.0 * expected, 1e-9)
    assert_close(slope, expected / 2.0, 1e-9)


def test_offset_force_of_a_plate() -> None:
    """`area`: B per 0.2 m2 whatever the mesh; `paper`: B per triangle; faded as |u|^2 / (|u|^2 + u_0^2)."""
    speed = np.array([1e-3, 0.01, 1.0])
    velocity = np.stack([0 * speed, 0 * speed, speed])
    fade = speed**2 / (speed**2 + 0.01**2)
    shape = DENSITY_DRAG * speed**2
    for cells in (1, 3):
        body = meshes.plate(cells)
        assert_close(total(body, velocity, offset=OFFSET)[1], shape + OFFSET * fade / 0.2, 1e-8)
        per_triangle = total(body, velocity, offset=OFFSET, mode="paper")[1]
        assert_close(per_triangle, shape + OFFSET * fade * 2 * cells**2, 2e-5)


@pytest.mark.parametrize("cells", [1, 2, 3, 7])
def test_half_a_plate_under_water(cells: int) -> None:
    """One half, centred in the lower half, however the plate is cut into triangles."""
    force, size, moment, _ = total(meshes.plate(cells), [0.0, 0.0, 1.0], surface=0.0)
    assert_close(force[:, 0], np.array([0.0, 0.0, -0.5 * DENSITY_DRAG]), 1e-9)
    assert_close(moment[:, 0] / size[0], np.array([0.0, -0.25, 0.0]), 1e-6)


def test_centroid_submersion_counts_whole_triangles() -> None:
    """Two triangles whose centroids lie at +1/6 and -1/6: one, none or both count."""
    for surface, expected in ((0.0, 0.5), (-0.2, 0.0), (0.2, 1.0)):
        _, size, _, _ = total(meshes.plate(), [0.0, 0.0, 1.0], surface=surface, submersion="centroid")
        assert_close(size[0], expected * DENSITY_DRAG, 1e-9)


@pytest.mark.parametrize("submersion", ["clipped", "centroid"])
def test_dry(submersion: str) -> None:
    """Surface at -inf, or far below: nothing, and gradients that say so."""
    vertices, triangles = meshes.blob()
    shape = (3, len(vertices), 2)
    at = np.broadcast_to(vertices.T[..., None], shape), np.random.default_rng(0).normal(size=shape)
    water = fluid(np.array([-np.inf, -5.0]), OFFSET, batch=(2,))
    run = skinned(triangles, submersion)
    assert all((result == 0).all() for result in in_single(run, *at, *water))
    bones, mesh, placed, _ = rigid_blob((2,))
    ride = rigid(bones, submersion)
    assert all((result == 0).all() for result in in_single(ride, mesh, *placed, *water))
    if submersion == "clipped":
        assert_gradient_finite(run, *at, *water)
        assert_gradient_finite(ride, mesh, *placed, *water)


@pytest.mark.parametrize("mode", ["area", "paper"])
def test_gradient_finite_at_every_degeneracy(mode: str) -> None:
    """At rest, without area, with corners on the surface, level with it; in both forms."""
    vertices, triangles = meshes.plate(2)
    vertices = np.concatenate([vertices, vertices[:, [0, 2, 1]], vertices[:1]])
    corners = len(vertices) - 1
    triangles = np.concatenate([triangles, triangles + 9, [[corners, corners, corners], [0, 0, 1]]]).astype(np.int32)
    shape = (3, len(vertices), 3)
    speed = np.array([0.0, 1e-4, 1.0])
    at = np.broadcast_to(vertices.T[..., None], shape), np.broadcast_to(speed, shape)
    assert_gradient_finite(skinned(triangles, mode=mode), *at, *fluid(0.0, OFFSET, batch=(3,)))
    if mode == "paper":
        return
    flat = vertices[triangles][None]  # one block
    area = 0.5 * np.cross(flat[:, :, 1] - flat[:, :, 0], flat[:, :, 2] - flat[:, :, 0])
    rows = np.concatenate([np.ones((*flat.shape[:2], 1)), flat.mean(2)], 2).transpose(0, 2, 1)
    mesh = flat.transpose(2, 3, 0, 1)[..., None], area.transpose(2, 0, 1)[..., None], rows
    transforms = np.zeros((7, 1, 3))
    transforms[0] = 1.0
    velocity = np.zeros((6, 1, 3))
    velocity[:3] = speed
    still = transforms, velocity, np.ones(3)
    assert_gradient_finite(rigid(np.zeros(1, int), mode=mode), mesh, *still, *fluid(0.0, OFFSET, batch=(3,)))


def test_drifting_body_feels_nothing() -> None:
    """Velocity equal to the flow, or to within the stillness threshold."""
    for speed in (0.0, 5e-5):
        result = total(meshes.blob(), [speed, 0.0, 0.0], offset=OFFSET, mode="paper")
        assert all((x == 0).all() for x in result)


def test_closed_convex_body_shows_its_silhouette() -> None:
    """A box: the sum of facing areas is its shadow, from any side; reversing the flow reverses the force."""
    box = meshes.box((0.4, 0.9, 0.6))
    direction = unit_vectors(np.random.default_rng(1), 3, 40)
    shadow = (np.abs(direction) * np.array([[0.9 * 0.6], [0.4 * 0.6], [0.4 * 0.9]])).sum(0)
    force, size, _, _ = total(box, direction)
    assert_close(size / DENSITY_DRAG, shadow, 1e-9)
    assert_close(total(box, -direction)[0], -force, 1e-9)


def test_sphere_shows_a_disc_to_second_order() -> None:
    error = []
    for refinement in (1, 2, 3):
        _, size, _, _ = total(meshes.sphere(refinement), [0.3, -0.5, np.sqrt(1 - 0.34)])
        error.append(abs(size[0] / DENSITY_DRAG - np.pi))
    order = np.log2(np.array(error[:-1]) / error[1:])
    assert ((order > 1.7) & (order < 2.4)).all()
    assert error[-1] < 0.02 * np.pi


@pytest.mark.parametrize("mode", ["area", "paper"])
def test_force_resists(mode: str) -> None:
    """F_i . u_i >= 0 for every triangle, whatever moves how."""
    triangles, vertices, velocity, water = moving_blob((), seed=7)
    apart, speeds = vertices[:, triangles.T], velocity[:, triangles.T]  # each triangle a character of its own
    water = fluid(water[2], OFFSET, batch=(len(triangles),))
    force, size, _, slope = in_double(skinned(np.array([[0, 1, 2]]), mode=mode), apart, speeds, *water)
    share = [meshes.wet_part(water[2][k] - apart[1, :, k]) for k in range(len(triangles))]
    u = -np.stack([w @ speeds[:, :, k].T for k, (_, w) in enumerate(share)], 1)
    assert (size > 0).sum() > 10
    assert ((force * u).sum(0) >= 0).all()
    assert_close((force * u).sum(0), size * np.linalg.norm(u, axis=0), 1e-5)
    assert_close(slope * np.linalg.norm(u, axis=0), size, 1e-5)


def test_turning_everything_turns_the_result() -> None:
    triangles, vertices, velocity, water = moving_blob((4,), seed=8)
    angle = 0.83
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    run = skinned(triangles)
    force, size, moment, slope = in_single(run, vertices, velocity, *water)
    turned = in_single(run, *(np.einsum("rc,c...->r...", turn, x) for x in (vertices, velocity)), *water)
    expected = np.einsum("rc,cn->rn", turn, force), size, np.einsum("rc,cn->rn", turn, moment), slope
    assert_close(turned, expected, 1e-5)


def test_refining_a_translating_body_changes_nothing() -> None:
    """Every triangle in four: force, torque about the origin and centre of pressure to 1e-4, at any depth."""
    body = meshes.blob(3)
    velocity = np.random.default_rng(2).normal(size=(3, 4))
    surface = np.array([-0.2, 0.0, 0.15, 5.0])
    coarse, fine = (total(b, velocity, surface=surface, offset=OFFSET) for b in (body, meshes.split(*body)))
    assert (coarse[1] > 10).all()
    for a, b in zip(coarse, fine, strict=True):
        assert (np.abs(a - b) <= 1e-4 * np.abs(a).max(0)).all()
    pressure = coarse[2] / coarse[1], fine[2] / fine[1]
    assert_close(pressure[1], pressure[0], 1e-4)
    torque = (np.cross(p, r[0], axis=0) for p, r in zip(pressure, (coarse, fine), strict=True))
    a, b = torque
    assert_close(b, a, 1e-4)


def test_refining_a_turning_body_converges() -> None:
    """Each halving of the triangles brings the force nearer: second order."""
    body = meshes.sphere(0)
    spin = np.array([0.4, 1.5, -0.8])
    forces = []
    for _ in range(4):
        vertices, triangles = body
        velocity = np.cross(spin, vertices) + np.array([1.0, 0.2, 0.5])
        run = skinned(triangles)
        forces.append(in_double(run, vertices.T[..., None], velocity.T[..., None], *fluid(batch=(1,)))[0])
        body = meshes.split(*body)
    steps = [np.linalg.norm(b - a) for a, b in pairwise(forces)]
    assert steps[1] < 0.45 * steps[0]
    assert steps[2] < 0.45 * steps[1]


def test_force_is_continuous_and_grows_as_the_body_sinks() -> None:
    surface = np.linspace(-1.0, 1.0, 801)
    _, size, _, _ = total(meshes.blob(4), np.tile([[0.0], [0.0], [1.0]], 801), surface=surface)
    assert size[0] == 0
    assert (np.diff(size) >= -1e-9).all()
    assert np.diff(size).max() < 0.01 * size[-1]
