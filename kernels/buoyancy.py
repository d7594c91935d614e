"""Volume of a body below a surface, and the length of its waterline, from the triangles of its mesh.

The water presses on each wet triangle with rho g times the depth; over a closed mesh the vertical parts add up to
rho g times the volume below the surface (Archimedes, by the divergence theorem). The depth is linear over a triangle,
so with the weights w of `drag.wet_corner`, which integrate it over the wet part exactly,
    V = - sum_i N_y,i (w_a d_a + w_b d_b + w_c d_c),    N: area vector, outward.
Exact for closed meshes and a level surface, continuous in depth with its first derivative (the area at the waterline).

A waterline crosses a triangle over the length |N_h| d(share)/d(depth): N_h is the horizontal part of the area vector.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from kernels import quat
from kernels.drag import DRY, wet_corner
from kernels.drag_moments import RigidMesh
from kernels.drag_skinned import grouped
from kernels.vec import axis
from kernels.wall import Wall, no_wall

FLAT = 1e-20  # m4, under the square root of an area squared


def pressed(a: Float[Array, "*b"], b: Float[Array, "*b"], c: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """Integral of the depth over the wet part of a triangle per unit of its area, from the depths of its corners, m."""
    return wet_corner(a, b, c) * a + wet_corner(b, c, a) * b + wet_corner(c, a, b) * c


def cut(a: Float[Array, "*b"], b: Float[Array, "*b"], c: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """How the wet share of a triangle grows with depth, 1/m: 0 where the surface does not cross it."""
    high, low = jnp.maximum(jnp.maximum(a, b), c), jnp.minimum(jnp.minimum(a, b), c)
    middle = a + b + c - high - low
    deep = middle > 0
    tip = jnp.where(deep, low, high)
    out = jnp.where(deep, -jnp.minimum(low, 0.0), jnp.maximum(high, 0.0))
    return 2.0 * out / ((high - low) * jnp.abs(middle - tip) + 1e-18)


def skinned(
    triangles: np.ndarray,
    vertices: Float[Array, "vertices 3 *b"],
    surface: Float[Array, "*c"],
    line: bool = False,
    wall: Wall = no_wall,
) -> tuple[Float[Array, "*b"], Float[Array, "*b"] | None]:
    """Volume below the surface, m3, and length of the waterline, m (only if `line`).

    surface: height in the frame of the vertices, [*b], or [V, *b] where it is not level. triangles [T, 3] are static.
    """

    def corners(corner: Array, vertices: Array, surface: Array) -> tuple[Array, ...]:
        own = surface.ndim == vertices.ndim - 1
        return tuple((surface[corner[k]] if own else surface) - vertices[:, 1][corner[k]] for k in range(3))

    def sides(corner: Array, axis: int, vertices: Array) -> tuple[Array, Array]:
        a, b, c = (vertices[:, axis][corner[k]] for k in range(3))
        return b - a, c - a

    def volumes(depths: tuple[Array, ...], corner: Array, vertices: Array) -> Array:
        (bx, cx), (bz, cz) = sides(corner, 0, vertices), sides(corner, 2, vertices)
        return 0.5 * (bx * cz - bz * cx) * pressed(*depths)

    def lengths(depths: tuple[Array, ...], corner: Array, vertices: Array) -> Array:
        (bx, cx), (by, cy), (bz, cz) = (sides(corner, axis, vertices) for axis in range(3))
        x, z = by * cz - bz * cy, bx * cy - by * cx
        return 0.5 * jnp.sqrt(x * x + z * z + FLAT) * cut(*depths)

    def group(total: Array, corner: Array) -> tuple[Array, None]:
        depths = wall(corners, corner, vertices, surface)
        each = [wall(part, depths, corner, vertices) for part in ((volumes, lengths) if line else (volumes,))]
        return total + jnp.stack([wall(lambda x: x.sum(0), x) for x in each]), None

    surface = jnp.maximum(surface, DRY)
    zero = jnp.zeros((2 if line else 1, *vertices.shape[2:]), vertices.dtype)
    if wall.flag is None:
        total, _ = group(zero, jnp.asarray(triangles.T))
    else:
        total, _ = jax.lax.scan(group, zero, jnp.asarray(grouped(triangles)))
    return total[0], (total[1] if line else None)


def rigid(
    bones: np.ndarray,
    mesh: RigidMesh,
    transforms: Float[Array, "7 joints *b"],
    scale: Float[Array, "*b"],
    surface: Float[Array, "*c"],
    line: bool = False,
    wall: Wall = no_wall,
) -> tuple[Float[Array, "*b"], Float[Array, "*b"] | None]:
    """The same of triangles that ride on bones (see `drag_rigid`); surface: [*b], or [J, *b] over each bone."""

    def carried(transforms: Array, scale: Array, surface: Array) -> Array:
        """Up in each bone's frame (3) and the depth of its origin, in its length unit."""
        up = quat.rotate(quat.conjugate(transforms[:4]), axis(transforms[4:], 1))
        return jnp.concatenate([up, ((surface - transforms[5]) / scale)[None]])[:, bones]

    def depths(bone: Array) -> tuple[Array, ...]:
        ux, uy, uz, depth = bone[:, :, None]
        return tuple(depth - ux * x - uy * y - uz * z for x, y, z in mesh.corners)

    def volumes(bone: Array) -> Array:
        ux, uy, uz = bone[:3, :, None]
        nx, ny, nz = mesh.area
        return -(nx * ux + ny * uy + nz * uz) * pressed(*depths(bone))

    def lengths(bone: Array) -> Array:
        ux, uy, uz = bone[:3, :, None]
        nx, ny, nz = mesh.area
        upward = nx * ux + ny * uy + nz * uz
        level = jnp.maximum(nx * nx + ny * ny + nz * nz - upward * upward, 0.0)
        return jnp.sqrt(level + FLAT) * cut(*depths(bone))

    bone = wall(carried, transforms, scale, jnp.maximum(surface, DRY))
    each = [wall(part, bone) for part in ((volumes, lengths) if line else (volumes,))]
    volume, *length = (wall(lambda x: x.sum((0, 1)), x) for x in each)
    return volume * scale * scale * scale, (length[0] * scale if line else None)
