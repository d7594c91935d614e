"""Moments of the drag on blocks of triangles that each ride on one bone: what `drag_rigid` is made of.

The totals are linear in one number per triangle, F / (f u), with constants of the mesh: matrix products.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from kernels import quat
from kernels.drag import OffsetMode, Submersion, factor_of, wet_share
from kernels.vec import TINY
from kernels.wall import Wall


class RigidMesh(NamedTuple):
    """Triangles in blocks of equal size, every block on one bone, in that bone's bind frame (unscaled)."""

    corners: Array  # [3 corners, 3, blocks, size, 1]
    area: Array  # [3, blocks, size, 1] area vector; zero for padding
    moments: Array  # [blocks, 4, size]: rows 1, x, y, z of the centroids
    bounds: Array  # [6, blocks, 1]: a box around each block, along its bone's axes: middle and half sides
    readings: Array  # [blocks, 28, size]: what triangles take from the numbers of their bone, see `drag_backwards`


class Ride(NamedTuple):
    """Everything that the drag of bones, or of the blocks that ride on them, depends on; lengths in the bone's unit."""

    bone: Array  # [joints or blocks, 10 or 11, *b] velocity (3), spin (3), up (3), depth of the origin under each level
    scale: Array  # [*b]
    density_drag: Array  # [*b], or alike for all
    offset_force: Array


def moments(submersion: Submersion, mode: OffsetMode, wall: Wall, mesh: RigidMesh, ride: Ride) -> tuple[Array, Array]:
    """[blocks, 4, *b] each: sums of F / (f u), and of |F|, times 1 and the centroid."""
    return moments_and_shares(submersion, mode, wall, mesh, ride)[0]


def moments_and_shares(
    submersion: Submersion, mode: OffsetMode, wall: Wall, mesh: RigidMesh, ride: Ride
) -> tuple[tuple[Array, Array], Array]:
    """The moments, and the wet share of each triangle."""
    wet = wall(functools.partial(_shares, submersion, mesh), ride.bone)
    factors = wall(functools.partial(_factors, mode, mesh), ride, wet)
    magnitude = wall(functools.partial(_magnitudes, mesh), factors, ride.bone)
    total = summed if wall.flag is None else term_by_term
    return (wall(total, mesh.moments, factors), wall(total, mesh.moments, magnitude)), wet


def _shares(submersion: Submersion, mesh: RigidMesh, bone: Array) -> Array:
    return share(submersion, *depths_of(mesh, bone))


def depths_of(mesh: RigidMesh, bone: Array) -> list[Array]:
    """Of the three corners under each level."""
    ux, uy, uz, *levels = jnp.unstack(bone[:, 6:, None], axis=1)
    return [level - ux * x - uy * y - uz * z for level in levels for x, y, z in mesh.corners]


def share(submersion: Submersion, *depths: Array) -> Array:
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


def through_of(mesh: RigidMesh, bone: Array) -> tuple[Array, Array]:
    """How fast the fluid comes through each triangle, N.(-u), and |u|^2."""
    sx, sy, sz = _slip(mesh, bone)
    nx, ny, nz = mesh.area
    return nx * sx + ny * sy + nz * sz, sx * sx + sy * sy + sz * sz


def factor(
    mode: OffsetMode, facing: Array, square: Array, density_drag: Array, offset_force: Array, scale: Array
) -> Array:
    """F / (f u) of each triangle. facing: how fast the fluid comes through its wet part, lengths in the bone's unit."""
    one, size = jnp.ones_like(facing), scale * scale
    return factor_of(facing, one, square * size, density_drag, offset_force, mode, size * scale)


def _factors(mode: OffsetMode, mesh: RigidMesh, ride: Ride, wet: Array) -> Array:
    through, square = through_of(mesh, ride.bone)
    return factor(mode, through * wet, square, ride.density_drag, ride.offset_force, ride.scale)


def _magnitudes(mesh: RigidMesh, factors: Array, bone: Array) -> Array:
    return factors * jnp.sqrt(through_of(mesh, bone)[1] + TINY)


def summed(rows: Array, values: Array) -> Array:
    """[blocks, k, *b]: values [blocks, size, *b] times rows [blocks, k, size], summed over each block."""
    flat = values.reshape(*values.shape[:2], -1)
    product = jax.lax.dot_general(rows, flat, (((2,), (1,)), ((0,), (0,))))
    return product.reshape(*rows.shape[:2], *values.shape[2:])


@jax.custom_jvp
def term_by_term(rows: Array, values: Array) -> Array:
    """`summed`, written out (see `totals.added`). Block after block: its values are read once from far away."""
    weights = rows.reshape(*rows.shape, *(1,) * (values.ndim - 2))
    return functools.reduce(jnp.add, (weights[:, :, i] * values[:, None, i] for i in range(rows.shape[2])))


@term_by_term.defjvp
def _term_by_term_jvp(given: tuple[Array, Array], change: tuple[Array, Array]) -> tuple[Array, Array]:
    (rows, values), (rows_change, change_of) = given, change
    return term_by_term(rows, values), summed(rows_change, values) + summed(rows, change_of)


def assembled(s: Array, m: Array, bone: Array, transforms: Array, scale: Array) -> Array:
    """[8, blocks, *b] in the world: force, magnitude, moment and slope of each block.

    By component: backwards, a number that multiplies a vector gets a sum over it, for which XLA makes another loop.
    """
    vx, vy, vz, wx, wy, wz, *_ = jnp.unstack(bone, axis=1)
    *turned, px, py, pz = jnp.unstack(transforms, axis=1)
    s0, sx, sy, sz = jnp.unstack(s, axis=1)
    area = scale * scale
    square, cube = area * area, area * scale
    back = -square  # the force is against the velocity
    force = [
        (vx * s0 + wy * sz - wz * sy) * back,
        (vy * s0 + wz * sx - wx * sz) * back,
        (vz * s0 + wx * sy - wy * sx) * back,
    ]
    magnitude, *first = (each * square for each in jnp.unstack(m, axis=1))
    turn = jnp.stack(turned)
    fx, fy, fz = jnp.unstack(quat.rotate(turn, jnp.stack(force)))
    mx, my, mz = jnp.unstack(quat.rotate(turn, jnp.stack([each * scale for each in first])))
    moment = [magnitude * px + mx, magnitude * py + my, magnitude * pz + mz]
    return jnp.stack([fx, fy, fz, magnitude, *moment, s0 * cube])
