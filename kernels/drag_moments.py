"""Moments of the drag on blocks of triangles that each ride on one bone: what `drag_rigid` is made of.

The totals are linear in one number per triangle, F / (f u), with constants of the mesh: matrix products. So is, the
other way round, what a derivative needs of a bone: the flow through a triangle, the square of its speed and the depths
of its corners are products of constants and a few numbers of the bone (`_numbers`). Backwards it takes one array of
triangles for each of these five, instead of one for every use of every number of the bone.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array

from kernels.drag import OffsetMode, Submersion, factor_of, instantiated, wet_share
from kernels.vec import TINY, cross
from kernels.wall import Wall


class RigidMesh(NamedTuple):
    """Triangles in blocks of equal size, every block on one bone, in that bone's bind frame (unscaled)."""

    corners: Array  # [3 corners, 3, blocks, size, 1]
    area: Array  # [3, blocks, size, 1] area vector; zero for padding
    moments: Array  # [blocks, 4, size]: rows 1, x, y, z of the centroids
    bounds: Array  # [4, blocks, 1]: a sphere around each block, centre and radius


class Ride(NamedTuple):
    """Everything that the drag of bones, or of the blocks that ride on them, depends on; lengths in the bone's unit."""

    bone: Array  # [joints or blocks, 10 or 11, *b] velocity (3), spin (3), up (3), depth of the origin under each level
    scale: Array  # [*b]
    density_drag: Array  # [*b], or alike for all
    offset_force: Array


@functools.partial(jax.custom_jvp, nondiff_argnums=(0, 1))
def moments(submersion: Submersion, mode: OffsetMode, wall: Wall, mesh: RigidMesh, ride: Ride) -> tuple[Array, Array]:
    """[4, blocks, *b] each: sums of F / (f u), and of |F|, times 1 and the centroid."""
    return _moments_and_arrays(submersion, mode, wall, mesh, ride)[0]


def _moments_and_arrays(
    submersion: Submersion, mode: OffsetMode, wall: Wall, mesh: RigidMesh, ride: Ride
) -> tuple[tuple[Array, Array], Array]:
    """The moments, and the wet share of each triangle."""
    wet = wall(functools.partial(_shares, submersion, mesh), ride.bone)
    factor = wall(functools.partial(_factors, mode, mesh), ride, wet)
    magnitude = wall(functools.partial(_magnitudes, mesh), factor, ride.bone)
    return (_sums(wall, mesh, factor), _sums(wall, mesh, magnitude)), wet


def _shares(submersion: Submersion, mesh: RigidMesh, bone: Array) -> Array:
    return _share(submersion, *_depths(mesh, bone))


def _depths(mesh: RigidMesh, bone: Array) -> list[Array]:
    """Of the three corners under each level."""
    ux, uy, uz, *levels = jnp.unstack(bone[:, 6:, None], axis=1)
    return [level - ux * x - uy * y - uz * z for level in levels for x, y, z in mesh.corners]


def _share(submersion: Submersion, *depths: Array) -> Array:
    """Wet share of each triangle, by the depths of its corners under the surface (and those under the floor)."""

    def below(a: Array, b: Array, c: Array) -> Array:
        return wet_share(a, b, c) if submersion == "clipped" else jnp.where(a + b + c > 0, 1.0, 0.0)

    share = below(*depths[:3])
    return jnp.maximum(share - below(*depths[3:]), 0.0) if depths[3:] else share


def _slip(mesh: RigidMesh, bone: Array) -> tuple[Array, Array, Array]:
    """Velocity of each centroid through the fluid: -u."""
    vx, vy, vz, wx, wy, wz = jnp.unstack(bone[:, :6, None], axis=1)
    x, y, z = ((mesh.corners[0, k] + mesh.corners[1, k] + mesh.corners[2, k]) * (1.0 / 3.0) for k in range(3))
    return vx + wy * z - wz * y, vy + wz * x - wx * z, vz + wx * y - wy * x


def _through(mesh: RigidMesh, bone: Array) -> tuple[Array, Array]:
    """How fast the fluid comes through each triangle, N.(-u), and |u|^2."""
    sx, sy, sz = _slip(mesh, bone)
    nx, ny, nz = mesh.area
    return nx * sx + ny * sy + nz * sz, sx * sx + sy * sy + sz * sz


def _factor(
    mode: OffsetMode, through: Array, square: Array, wet: Array, density_drag: Array, offset_force: Array, scale: Array
) -> Array:
    one, size = jnp.ones_like(wet), scale * scale
    return factor_of(through * wet, one, square * size, density_drag, offset_force, mode, size * scale)


def _factors(mode: OffsetMode, mesh: RigidMesh, ride: Ride, wet: Array) -> Array:
    return _factor(mode, *_through(mesh, ride.bone), wet, ride.density_drag, ride.offset_force, ride.scale)


def _magnitudes(mesh: RigidMesh, factor: Array, bone: Array) -> Array:
    return factor * jnp.sqrt(_through(mesh, bone)[1] + TINY)


def _sums(wall: Wall, mesh: RigidMesh, values: Array) -> Array:
    return wall.linear(_summed, _read, mesh.moments, values)


def _summed(rows: Array, values: Array) -> Array:
    """[k, blocks, *b]: values [blocks, size, *b] times rows [blocks, k, size], summed over each block."""
    flat = values.reshape(*values.shape[:2], -1)
    product = jax.lax.dot_general(rows, flat, (((2,), (1,)), ((0,), (0,))))
    return jnp.moveaxis(product, 1, 0).reshape(rows.shape[1], values.shape[0], *values.shape[2:])


def _moments_jvp(submersion: Submersion, mode: OffsetMode, primals: Any, tangents: Any) -> Any:
    wall, mesh, ride = primals
    if not all(isinstance(tangent, SymbolicZero) for tangent in tangents[1]):  # no part of a simulation moves the mesh
        changes = jax.tree.map(instantiated, tangents[1:], (mesh, ride))
        return jax.jvp(lambda *at: _moments_and_arrays(submersion, mode, wall, *at)[0], (mesh, ride), changes)
    change = jax.tree.map(instantiated, tangents[2], ride)
    out, wet = _moments_and_arrays(submersion, mode, wall, mesh, ride)
    numbers = wall(lambda at, by: jax.jvp(_numbers, (at,), (by,))[1], ride.bone, change.bone)
    through, square, *depths = (
        wall.linear(_read, _summed, rows, numbers[first : first + rows.shape[1]])
        for first, rows in _readings(mesh, ride.bone)
    )

    def share(bone: Array, *depths: Array) -> Array:
        return jax.jvp(functools.partial(_share, submersion), tuple(_depths(mesh, bone)), depths)[1]

    def loads(ride: Ride, wet: Array, change: Ride, *by: Array) -> tuple[Array, Array]:
        def each(through: Array, square: Array, wet: Array, *rest: Array) -> tuple[Array, Array]:
            factor = _factor(mode, through, square, wet, *rest)
            return factor, factor * jnp.sqrt(square + TINY)

        at = (*_through(mesh, ride.bone), wet, ride.density_drag, ride.offset_force, ride.scale)
        return jax.jvp(each, at, (*by, change.density_drag, change.offset_force, change.scale))[1]

    changed = wall(loads, ride, wet, change, through, square, wall(share, ride.bone, *depths))
    return out, tuple(_sums(wall, mesh, x) for x in changed)


moments.defjvp(_moments_jvp, symbolic_zeros=True)


def _numbers(bone: Array) -> Array:
    """[k, blocks, *b]: numbers of a bone of which everything its triangles need is a product with constants.

    N.(v + w x c) = N.v + (c x N).w;  |v + w x c|^2 = v.v + 2 (v x w).c + c.(w.w I - w w).c;  depth: d - up.x
    """
    vx, vy, vz, wx, wy, wz, ux, uy, uz, *levels = jnp.unstack(bone, axis=1)
    xx, yy, zz = wx * wx, wy * wy, wz * wz
    linear = [2.0 * (vy * wz - vz * wy), 2.0 * (vz * wx - vx * wz), 2.0 * (vx * wy - vy * wx)]
    square = [vx * vx + vy * vy + vz * vz, *linear, yy + zz, xx + zz, xx + yy, -wx * wy, -wx * wz, -wy * wz]
    depths = [row for level in levels for row in (level, -ux, -uy, -uz)]
    return jnp.stack([vx, vy, vz, wx, wy, wz, *square, *depths])


def _readings(mesh: RigidMesh, bone: Array) -> list[tuple[int, Array]]:
    """Where in `_numbers` to start, and the constants [blocks, k, size] of each array that they give."""

    def flat(vector: Array) -> Array:
        return vector.reshape(3, *mesh.moments.shape[::2])

    corners, area = [flat(corner) for corner in mesh.corners], flat(mesh.area)
    one, centre = jnp.ones_like(area[:1]), (corners[0] + corners[1] + corners[2]) * (1.0 / 3.0)
    x, y, z = centre
    square = [*one, x, y, z, x * x, y * y, z * z, 2.0 * x * y, 2.0 * x * z, 2.0 * y * z]
    through = jnp.concatenate([area, cross(centre, area)])
    rows = [(0, through), (6, jnp.stack(square))]
    for level in range(bone.shape[1] - 9):
        rows += [(16 + 4 * level, jnp.concatenate([one, corner])) for corner in corners]
    return [(first, jnp.moveaxis(each, 0, 1)) for first, each in rows]


def _read(rows: Array, numbers: Array) -> Array:
    """[blocks, size, *b]: rows [blocks, k, size] times numbers [k, blocks, *b]."""
    flat = numbers.reshape(*numbers.shape[:2], -1)
    product = jax.lax.dot_general(rows, flat, (((1,), (0,)), ((0,), (1,))))
    return product.reshape(rows.shape[0], rows.shape[2], *numbers.shape[2:])
