"""Drag on a mesh whose every vertex moves (Eq. 6 to 8; see `drag`): exact, also where triangles stretch."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from kernels.drag import Drag, Fluid, OffsetMode, Submersion, factor_of, instantiated, levels_of, wet_corner
from kernels.rows import summed
from kernels.totals import PIECES, spread, total_of
from kernels.vec import TINY
from kernels.wall import Wall, apart, no_wall

GROUP = 80  # triangles whose arrays for 128 characters fit a 1 MiB cache

Field = Any  # values at every vertex [V, k, *b], or already at corners of triangles: k tuples of three [size, *b]


class _Mesh(NamedTuple):
    """Everything that the drag of a mesh depends on."""

    vertices: Field  # 3, m
    velocity: Field  # 3, m/s, less the flow
    levels: tuple[Field, ...]  # the surface and the floor, m: 1 where it is not level, otherwise [*b]
    density_drag: Array
    offset_force: Array


def skinned(
    triangles: np.ndarray,
    vertices: Float[Array, "vertices 3 *b"],
    velocity: Float[Array, "vertices 3 *b"],
    fluid: Fluid,
    submersion: Submersion = "clipped",
    mode: OffsetMode = "area",
    wall: Wall = no_wall,
    floor: Float[Array, "*c"] | None = None,
) -> Drag:
    """Drag on moving vertices; `velocity` is that of the vertices less the flow, m/s. triangles [T, 3] are static.

    `fluid.surface` may differ over the vertices, [V, *b]: each triangle is then cut by the plane through its three.
    floor: height below which another fluid lies, m; only what is between it and the surface counts.
    Triangles go through in groups whose arrays stay in a core's cache (without walls: all at once, as a GPU likes it).
    """
    levels = levels_of(fluid.surface, floor)
    levels = tuple(level[:, None] if level.ndim == vertices.ndim - 1 else level for level in levels)
    mesh = _Mesh(vertices, velocity, levels, fluid.density_drag, fluid.offset_force)
    total = _total(triangles, submersion, mode, wall, mesh)
    return Drag(total[:3], total[3], total[4:7], total[7])


def _groups(triangles: np.ndarray, wall: Wall) -> np.ndarray:
    return triangles.T[None] if wall.flag is None else grouped(triangles)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0, 1, 2))
def _total(triangles: np.ndarray, submersion: Submersion, mode: OffsetMode, wall: Wall, mesh: _Mesh) -> Array:
    """[8, *b]: the totals of `Drag`, group of triangles after group, up to the last that any character wets.

    Those beyond it would add zeros, so that no character's numbers depend on the others.
    """
    if wall.flag is None:
        return _group(submersion, mode, wall, jnp.asarray(triangles.T), mesh)
    groups = grouped(triangles)

    def group(number: Array, total: Array) -> Array:
        return total + _group(submersion, mode, wall, jnp.asarray(groups)[number], mesh)

    count = jnp.max(jnp.where(_wet(groups, wall, mesh), jnp.arange(1, len(groups) + 1), 0))
    return jax.lax.fori_loop(0, count, group, jnp.zeros((8, *mesh.vertices.shape[2:]), mesh.vertices.dtype))


def _wet(groups: np.ndarray, wall: Wall, mesh: _Mesh) -> Array:
    """[groups] whether any vertex of each may be under the surface for any character; NaN may be."""

    def under(mesh: _Mesh) -> Array:
        level = mesh.levels[0]
        depth = (level[:, 0] if level.ndim == mesh.vertices.ndim else level) - mesh.vertices[:, 1]
        return jnp.where(depth <= 0, 0.0, 1.0).reshape(len(depth), -1)

    some = wall(lambda under: under.max(1), wall(under, mesh))
    return wall(lambda some: some[groups.reshape(len(groups), -1)].max(1) > 0, some)


def _total_jvp(
    triangles: np.ndarray, submersion: Submersion, mode: OffsetMode, primals: Any, tangents: Any
) -> tuple[Array, Array]:
    """Changes of the corners are read for all groups at once: backwards, that adds to each vertex once.

    Differentiated as it is, the loop would keep every array of every group, and add arrays of all vertices to each
    other in every group. The walls of a group that is dry are closed: then its stages are not run.
    """
    wall, mesh = primals
    changes = jax.tree.map(instantiated, tangents[1], mesh)
    groups = _groups(triangles, wall)

    @functools.partial(jax.checkpoint, prevent_cse=False)
    def group(total: Array, given: tuple[Array, Array, Array]) -> tuple[Array, None]:
        corner, own, change = given
        wet = wall.gate(own)
        near = wet(lambda mesh: jnp.concatenate([x[corner] for x in _fields(mesh)], 2), mesh)

        def here(mesh: _Mesh) -> Array:
            return _group(submersion, mode, wet, None, _spread(corner.shape[1], wet, mesh))

        before, after = (_with(of, _apiece(fields, wet)) for of, fields in ((mesh, near), (changes, change)))
        return total + jax.jvp(here, (before,), (after,))[1], None

    zero = jnp.zeros((8, *mesh.vertices.shape[2:]), mesh.vertices.dtype)
    fields = wall(lambda changes: jnp.concatenate(_fields(changes), 1), changes)
    every = wall.linear(
        lambda _, x: x[groups],
        lambda _, on: summed(groups.reshape(-1), on.reshape(-1, *on.shape[3:]), len(mesh.vertices), wall),
        (),
        fields,
    )
    change = jax.lax.scan(group, zero, (jnp.asarray(groups), _wet(groups, wall, mesh), every))[0]
    return _total(triangles, submersion, mode, wall, mesh), change


_total.defjvp(_total_jvp, symbolic_zeros=True)


def _fields(mesh: _Mesh) -> list[Array]:
    """Everything that has a value at each vertex: [V, k, *b] each, 6 to 8 altogether."""
    return [mesh.vertices, mesh.velocity, *(level for level in mesh.levels if level.ndim == mesh.vertices.ndim)]


def _apiece(fields: Array, wall: Wall) -> list[tuple[Array, ...]]:
    """[component][corner]: fields [3, size, k, *b] at the corners of a group. Backwards, each piece is copied whole."""

    def parted(_: tuple[()], fields: Array) -> list[tuple[Array, ...]]:
        return [tuple(jnp.unstack(field)) for field in jnp.unstack(fields, axis=2)]

    def joined(_: tuple[()], on: list[tuple[Array, ...]]) -> Array:
        corners = zip(*on, strict=True)
        return jnp.stack([apart(lambda *each: jnp.stack(each, 1), *corner) for corner in corners])

    return wall.linear(parted, joined, (), fields)


def _spread(size: int, wall: Wall, mesh: _Mesh) -> _Mesh:
    """What is one number for all triangles of a group as one for each."""
    levels = tuple(level if isinstance(level, tuple) else spread(size, level, wall) for level in mesh.levels)
    density_drag, offset_force = (spread(size, x, wall) for x in (mesh.density_drag, mesh.offset_force))
    return mesh._replace(levels=levels, density_drag=density_drag, offset_force=offset_force)


def _with(mesh: _Mesh, each: list[tuple[Array, ...]]) -> _Mesh:
    """The mesh with values of its fields at the corners of a group, as `_corners` has them."""
    own = iter(each[6:])
    levels = tuple((next(own),) if level.ndim == mesh.vertices.ndim else level for level in mesh.levels)
    return mesh._replace(vertices=tuple(each[:3]), velocity=tuple(each[3:6]), levels=levels)


def _corners(field: Field, corner: Array | None) -> tuple[tuple[Array, ...], ...]:
    """[component][corner]: values of a field at the corners of a group, unless (corner is None) they already are."""
    if corner is None:
        return field
    return tuple(tuple(field[:, k][corner[j]] for j in range(3)) for k in range(field.shape[1]))


def _depths(level: Field, corner: Array | None, vertices: Field) -> tuple[Array, Array, Array]:
    """Depths of the corners of triangles under a level."""
    a, b, c = _corners(vertices, corner)[1]
    uneven = isinstance(level, tuple) or level.ndim > a.ndim
    above: Any = _corners(level, corner)[0] if uneven else (level, level, level)
    return above[0] - a, above[1] - b, above[2] - c


def _group(submersion: Submersion, mode: OffsetMode, wall: Wall, corner: Array | None, mesh: _Mesh) -> Array:
    """[8, *b]: the totals of a group of triangles; corner [3, size]: indices of their vertices."""

    def weights(vertices: Field, *levels: Field | Array) -> tuple[Array, ...]:
        above, *below = (_corner_weights(_depths(level, corner, vertices), submersion) for level in levels)
        return tuple(jnp.maximum(a - b, 0.0) for a, b in zip(above, *below, strict=True)) if below else above

    def mean(weight: tuple[Array, ...], field: Field) -> tuple[Array, ...]:
        """f times the field at the wet centroid."""
        a, b, c = weight
        return tuple(a * at_a + b * at_b + c * at_c for at_a, at_b, at_c in _corners(field, corner))

    def factors(weight: tuple[Array, ...], slip: tuple[Array, ...], vertices: Field, fluid: tuple[Array, Array]):
        (ax, bx, cx), (ay, by, cy), (az, bz, cz) = _corners(vertices, corner)
        bx, by, bz, cx, cy, cz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
        sx, sy, sz = slip  # f times the velocity of the wet centroid through the fluid: -f u
        facing = 0.5 * ((by * cz - bz * cy) * sx + (bz * cx - bx * cz) * sy + (bx * cy - by * cx) * sz)
        wet = weight[0] + weight[1] + weight[2]
        inverse = 1.0 / jnp.maximum(wet, 1e-6)
        speed2 = (sx * sx + sy * sy + sz * sz) * (inverse * inverse)
        return factor_of(facing, wet, speed2, *fluid, mode, 1.0)

    weight = wall(weights, mesh.vertices, *mesh.levels)
    slip = wall(mean, weight, mesh.velocity)
    centre = wall(mean, weight, mesh.vertices)
    factor = wall(factors, weight, slip, mesh.vertices, (mesh.density_drag, mesh.offset_force))
    magnitude = wall(_magnitudes, factor, weight, slip)
    return total_of(_terms, wall, factor, magnitude, slip, centre, weight)


def _magnitudes(factor: Array, weight: tuple[Array, ...], slip: tuple[Array, ...]) -> Array:
    sx, sy, sz = slip
    speed = jnp.sqrt(sx * sx + sy * sy + sz * sz + TINY)
    return factor * speed / jnp.maximum(weight[0] + weight[1] + weight[2], 1e-6)


def _terms(factor: Array, magnitude: Array, slip: tuple, centre: tuple, weight: tuple) -> list[Array]:
    wet = weight[0] + weight[1] + weight[2]
    force = [-factor * s for s in slip]
    return [*force, magnitude * wet, *(magnitude * c for c in centre), factor * wet]


def _corner_weights(depths: tuple[Array, Array, Array], submersion: Submersion) -> tuple[Array, Array, Array]:
    """Integrals of the barycentric coordinates over the part below a level, per unit of area."""
    a, b, c = depths
    if submersion == "centroid":
        share = jnp.where(a + b + c > 0, 1.0 / 3.0, 0.0)
        return share, share, share
    return wet_corner(a, b, c), wet_corner(b, c, a), wet_corner(c, a, b)


def grouped(triangles: np.ndarray) -> np.ndarray:
    """[groups, 3, size], size at most `GROUP` and a multiple of `PIECES`.

    The padding repeats one vertex three times: no area, no force.
    """
    groups = max(1, -(-len(triangles) // GROUP))
    size = PIECES * -(-len(triangles) // (PIECES * groups))
    padded = np.zeros((groups * size, 3), np.int32)
    padded[: len(triangles)] = triangles
    return padded.reshape(groups, size, 3).transpose(0, 2, 1)
