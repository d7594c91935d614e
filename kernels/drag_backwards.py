"""The derivative of rigid drag, transposed: from the totals of blocks of triangles back to what their bones do.

Written out instead of left to JAX, so that one array of triangles stands for each of the five numbers a triangle takes
from its bone (how fast the fluid comes through it, the square of its speed, the depths of its corners), and so that
groups of triangles that are dry are left out: JAX cannot go back through a loop whose length depends on the depth.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array

from kernels.drag import OffsetMode, Submersion, wet_share_slope
from kernels.drag_moments import (
    Ride,
    RigidMesh,
    assembled,
    depths_of,
    factor,
    moments_and_shares,
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
    (s, m), wet = moments_and_shares(submersion, mode, wall, mesh, ride)
    size = jnp.broadcast_to(ride.scale, s.shape[1:])

    def whole(s: Array, m: Array, bone: Array, at: Array, size: Array, cotangent: Array) -> tuple[Array, ...]:
        total, pull = jax.vjp(assembled, s, m, bone, at, size)
        return pull(jnp.broadcast_to(cotangent[:, None], total.shape))

    on_s, on_m, on_bone, on_at, on_size = wall(whole, s, m, ride.bone, at, size, cotangent)
    on_moments = [wall(_read, mesh.moments, x) for x in (on_s, on_m)]
    through, square = (wall(functools.partial(_of, i, through_of), mesh, ride.bone) for i in range(2))
    fluid = (ride.density_drag, ride.offset_force, ride.scale)
    on_facing, on_square, *on_fluid = (
        wall(functools.partial(_of, i, functools.partial(_loads, mode)), through, square, wet, *fluid, *on_moments)
        for i in range(5)
    )
    on_through = wall(jnp.multiply, on_facing, wet)
    on_wet = wall(jnp.multiply, on_facing, through)
    corners = _corners(submersion, wall, mesh, ride.bone, wet, on_wet)
    each = zip(rows, (on_through, on_square, *corners), strict=True)
    numbers = [(first, wall(term_by_term, constants, values)) for (first, constants), values in each]
    on_bone = wall(_on_bone, ride.bone, on_bone, *_joined(numbers))
    on_density, on_offset, on_scale = (wall(lambda x: added(0, added(1, x)), x) for x in on_fluid)
    return Ride(on_bone, on_scale + wall(functools.partial(added, 0), on_size), on_density, on_offset), on_at


def _of(which: int, stage: Callable[..., Sequence[Array]], *given: Any) -> Array:
    """One of the arrays that a stage makes: each behind a wall of its own, XLA makes no others on the way."""
    return stage(*given)[which]


def _loads(
    mode: OffsetMode,
    through: Array,
    square: Array,
    wet: Array,
    density_drag: Array,
    offset_force: Array,
    scale: Array,
    on_factor: Array,
    on_magnitude: Array,
) -> tuple[Array, ...]:
    """[blocks, size, *b] cotangents of: flow through the wet part, square of the speed, density, offset, scale."""

    def both(*given: Array) -> tuple[Array, Array]:
        f = factor(mode, *given)
        return f, f * jnp.sqrt(given[1] + TINY)

    fluid = (jnp.broadcast_to(x, wet.shape) for x in (density_drag, offset_force, scale))
    return jax.vjp(both, through * wet, square, *fluid)[1]((on_factor, on_magnitude))


def _corners(
    submersion: Submersion, wall: Wall, mesh: RigidMesh, bone: Array, wet: Array, on_wet: Array
) -> Iterator[Array]:
    """[blocks, size, *b] cotangents of the depths of the corners, under each level."""
    for level in range(bone.shape[1] - 9):
        for corner in range(3):
            if submersion == "centroid":
                yield jnp.zeros_like(on_wet)
            else:
                yield wall(functools.partial(_corner, level, corner, mesh), bone, wet, on_wet)


def _corner(level: int, corner: int, mesh: RigidMesh, bone: Array, wet: Array, on_wet: Array) -> Array:
    """Of one corner. Between two levels what is wet is the difference of two shares, where positive."""
    depths = depths_of(mesh, bone)[3 * level : 3 * level + 3]
    slope = wet_share_slope(*depths[corner:], *depths[:corner]) * on_wet
    if bone.shape[1] == 10:
        return slope
    return jnp.where(wet > 0, slope if level == 0 else -slope, 0.0)


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
