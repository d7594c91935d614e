"""The derivative of rigid drag, transposed: from the totals of blocks of triangles back to what their bones do.

Written out instead of left to JAX, so that one array of triangles stands for each of the five numbers a triangle takes
from its bone (how fast the fluid comes through it, the square of its speed, the depths of its corners), and so that
groups of triangles that are dry are left out: JAX cannot go back through a loop whose length depends on the depth.
"""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Array

from kernels.drag import OffsetMode, Submersion
from kernels.drag_moments import (
    Ride,
    RigidMesh,
    assembled,
    depths_of,
    factor,
    moments_and_arrays,
    share,
    term_by_term,
    through_of,
)
from kernels.totals import added
from kernels.vec import TINY, cross
from kernels.wall import Wall

Rows = list[tuple[int, Array]]


def readings(mesh: RigidMesh, levels: int) -> Rows:
    """Where in `_numbers` to start, and the constants [blocks, k, size] of each array of triangles."""

    def flat(vector: Array) -> Array:
        return vector.reshape(3, *mesh.moments.shape[::2])

    corners, area = [flat(corner) for corner in mesh.corners], flat(mesh.area)
    one, centre = jnp.ones_like(area[:1]), (corners[0] + corners[1] + corners[2]) * (1.0 / 3.0)
    x, y, z = centre
    square = [*one, x, y, z, x * x, y * y, z * z, 2.0 * x * y, 2.0 * x * z, 2.0 * y * z]
    rows = [(0, jnp.concatenate([area, cross(centre, area)])), (6, jnp.stack(square))]
    for level in range(levels):
        rows += [(16 + 4 * level, jnp.concatenate([one, corner])) for corner in corners]
    return [(first, jnp.moveaxis(each, 0, 1)) for first, each in rows]


def pulled(
    submersion: Submersion,
    mode: OffsetMode,
    wall: Wall,
    mesh: RigidMesh,
    rows: Rows,
    ride: Ride,
    at: Array,
    cotangent: Array,
) -> tuple[Ride, Array]:
    """Cotangents of `ride` and of `at` [blocks, 7, *b], its bones' transforms, from that of the totals [8, *b].

    ride: of the blocks. rows: `readings` of the mesh. Of the scale and the fluid's numbers they are [*b].
    """
    (s, m), wet = moments_and_arrays(submersion, mode, wall, mesh, ride)
    size = jnp.broadcast_to(ride.scale, s.shape[1:])

    def whole(s: Array, m: Array, bone: Array, at: Array, size: Array, cotangent: Array) -> tuple[Array, ...]:
        total, pull = jax.vjp(assembled, s, m, bone, at, size)
        return pull(jnp.broadcast_to(cotangent[:, None], total.shape))

    on_s, on_m, on_bone, on_at, on_size = wall(whole, s, m, ride.bone, at, size, cotangent)
    on_factor, on_magnitude = (wall(_read, mesh.moments, x) for x in (on_s, on_m))
    loads = wall(functools.partial(_loads, mode, mesh), ride, wet, on_factor, on_magnitude)
    corners = wall(functools.partial(_corners, submersion, mesh), ride.bone, loads[2])
    each = zip(rows, (*loads[:2], *corners), strict=True)
    numbers = [(first, wall(term_by_term, constants, values)) for (first, constants), values in each]
    on_bone = wall(_on_bone, ride.bone, on_bone, *_joined(numbers))
    on_density, on_offset, on_scale = (wall(lambda x: added(0, added(1, x)), x) for x in loads[3:])
    return Ride(on_bone, on_scale + wall(functools.partial(added, 0), on_size), on_density, on_offset), on_at


def _loads(
    mode: OffsetMode, mesh: RigidMesh, ride: Ride, wet: Array, on_factor: Array, on_magnitude: Array
) -> tuple[Array, ...]:
    """[blocks, size, *b] cotangents of: flow through, square of the speed, wet share, density, offset, scale."""

    def both(through: Array, square: Array, *rest: Array) -> tuple[Array, Array]:
        f = factor(mode, through, square, *rest)
        return f, f * jnp.sqrt(square + TINY)

    fluid = (jnp.broadcast_to(x, wet.shape) for x in (ride.density_drag, ride.offset_force, ride.scale))
    return jax.vjp(both, *through_of(mesh, ride.bone), wet, *fluid)[1]((on_factor, on_magnitude))


def _corners(submersion: Submersion, mesh: RigidMesh, bone: Array, on_wet: Array) -> tuple[Array, ...]:
    """[blocks, size, *b] cotangents of the depths of the corners, under each level."""
    return jax.vjp(functools.partial(share, submersion), *depths_of(mesh, bone))[1](on_wet)


def _joined(numbers: list[tuple[int, Array]]) -> list[Array]:
    """Cotangents of `_numbers`, in its order: parts that start at the same place add up."""
    starts = sorted({first for first, _ in numbers})
    return [sum((part for first, part in numbers if first == start), jnp.zeros(())) for start in starts]


def _on_bone(bone: Array, direct: Array, *numbers: Array) -> Array:
    return direct + jax.vjp(_numbers, bone)[1](jnp.concatenate(numbers))[0]


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


def _read(rows: Array, numbers: Array) -> Array:
    """[blocks, size, *b]: rows [blocks, k, size] times numbers [k, blocks, *b]. k is small: no matrix product."""
    trailing = (1,) * (numbers.ndim - 2)
    terms = (rows[:, k].reshape(len(rows), -1, *trailing) * numbers[k][:, None] for k in range(rows.shape[1]))
    return functools.reduce(jnp.add, terms)
