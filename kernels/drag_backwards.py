"""The derivative of rigid drag, transposed: from the totals of blocks of triangles back to what their bones do.

Written out instead of left to JAX, so that one array of triangles stands for each of the five numbers a triangle takes
from its bone (how fast the fluid comes through it, the square of its speed, the depths of its corners), and so that
groups of triangles that are dry are left out: JAX cannot go back through a loop whose length depends on the depth.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
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
from kernels.vec import TINY
from kernels.wall import Wall

THROUGH, SQUARE = slice(0, 6), slice(6, 16)  # rows of `readings`
CORNERS = tuple(slice(16 + 4 * corner, 20 + 4 * corner) for corner in range(3))


def readings(corners: np.ndarray, area: np.ndarray) -> np.ndarray:
    """[blocks, 28, size]: what `_numbers` are multiplied by in what a triangle takes from its bone.

    That is the flow through it, the square of its speed and the depths of its corners. corners [blocks, size, 3
    corners, 3], area vectors [blocks, size, 3], in the frame of the bone.
    """
    x, y, z = centre = np.moveaxis(corners.mean(2), 2, 0)
    one = np.ones_like(x)
    square = [one, x, y, z, x * x, y * y, z * z, 2.0 * x * y, 2.0 * x * z, 2.0 * y * z]
    through = np.concatenate([area, np.cross(np.moveaxis(centre, 0, 2), area)], 2)
    depths = [part for corner in np.moveaxis(corners, 2, 0) for part in (one, *np.moveaxis(corner, 2, 0))]
    return np.moveaxis(np.concatenate([np.moveaxis(through, 2, 0), square, depths]), 0, 1)


def pulled(
    submersion: Submersion,
    mode: OffsetMode,
    wall: Wall,
    mesh: RigidMesh,
    ride: Ride,
    at: Array,
    cotangent: Array,
) -> tuple[Ride, Array]:
    """Cotangents of `ride` and of `at` [blocks, 7, *b], its bones' transforms, from that of the totals [8, *b].

    ride: of the blocks. Of the scale and the fluid's numbers they are [*b].
    """
    (s, m), wet = moments_and_shares(submersion, mode, wall, mesh, ride)
    size = jnp.broadcast_to(ride.scale, (len(s), *s.shape[2:]))

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
    on_through, on_wet = (wall(jnp.multiply, on_facing, x) for x in (wet, through))

    def back(rows: slice, values: Array) -> Array:
        return wall(lambda readings, values: term_by_term(readings[:, rows], values), mesh.readings, values)

    on_numbers = [back(THROUGH, on_through), back(SQUARE, on_square)]
    if submersion == "clipped":
        for level in range(ride.bone.shape[1] - 9):
            corners = (wall(functools.partial(_corner, level, k, mesh), ride.bone, wet, on_wet) for k in range(3))
            on_depths = (back(rows, corner) for rows, corner in zip(CORNERS, corners, strict=True))
            on_numbers.append(functools.reduce(jnp.add, on_depths))
    on_bone = wall(_on_bone, ride.bone, on_bone, *on_numbers)
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


def _corner(level: int, corner: int, mesh: RigidMesh, bone: Array, wet: Array, on_wet: Array) -> Array:
    """[blocks, size, *b] cotangent of the depth of a corner under one of the levels.

    Between two levels what is wet is the difference of two shares, where positive.
    """
    depths = depths_of(mesh, bone)[3 * level : 3 * level + 3]
    slope = wet_share_slope(*depths[corner:], *depths[:corner]) * on_wet
    if bone.shape[1] == 10:
        return slope
    return jnp.where(wet > 0, slope if level == 0 else -slope, 0.0)


def _on_bone(bone: Array, direct: Array, *numbers: Array) -> Array:
    """`direct`, and what goes back through the first of the `_numbers`."""
    on = jnp.concatenate(numbers, 1)
    return direct + jax.vjp(lambda bone: _numbers(bone)[:, : on.shape[1]], bone)[1](on)[0]


def _numbers(bone: Array) -> Array:
    """[blocks, k, *b]: numbers of a bone of which everything its triangles need is a product with constants.

    N.(v + w x c) = N.v + (c x N).w;  |v + w x c|^2 = v.v + 2 (v x w).c + c.(w.w I - w w).c;  depth: d - up.x
    """
    vx, vy, vz, wx, wy, wz, ux, uy, uz, *levels = jnp.unstack(bone, axis=1)
    xx, yy, zz = wx * wx, wy * wy, wz * wz
    linear = [2.0 * (vy * wz - vz * wy), 2.0 * (vz * wx - vx * wz), 2.0 * (vx * wy - vy * wx)]
    square = [vx * vx + vy * vy + vz * vz, *linear, yy + zz, xx + zz, xx + yy, -wx * wy, -wx * wz, -wy * wz]
    depths = [row for level in levels for row in (level, -ux, -uy, -uz)]
    return jnp.stack([vx, vy, vz, wx, wy, wz, *square, *depths], 1)


def _read(rows: Array, numbers: Array) -> Array:
    """[blocks, size, *b]: rows [blocks, k, size] times numbers [blocks, k, *b]. k is small: no matrix product."""
    trailing = (1,) * (numbers.ndim - 2)
    terms = (rows[:, k].reshape(len(rows), -1, *trailing) * numbers[:, k, None] for k in range(rows.shape[1]))
    return functools.reduce(jnp.add, terms)
