"""Drag on the submerged, flow-facing triangles of a character's mesh (Eq. 6 to 8).

Per triangle with area vector N (outward, length = area), wet share f of its area, and velocity u of the fluid relative
to the centroid of its wet part:  projected wet area times |u| is p = f max(-N.u, 0);  F = p (C_D0 rho + B') u  with
B' = (B / A_ref) / (|u|^2 + u_0^2)  in `area` mode, and Eq. 8 as printed, B per triangle, in `paper` mode.

Two ways to move the mesh: `skinned` (every vertex, exact) and `rigid` (each triangle rides on one bone; its wet area is
exact, its velocity and centre are those of the whole triangle). Both return the same `Drag`. Positions are relative to
any point; velocities are absolute minus the flow.

These are the longest loops of a frame, hence written by component: an array `[3, ...]` taken apart inside a fused loop
costs three times as much. Comparisons feed selects of numbers, never other comparisons: those do not vectorise.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from kernels import quat
from kernels.fluid import FADE_SPEED, REFERENCE_AREA, STILL_SPEED
from kernels.totals import total_of
from kernels.vec import TINY, cross
from kernels.wall import Wall, no_wall

Submersion = Literal["clipped", "centroid"]
OffsetMode = Literal["area", "paper"]

DRY = -1e6  # m: stands for a surface at -inf, of which differences and shares would be NaN


class Fluid(NamedTuple):
    """What surrounds a character; every field has the batch shape (`flow` `[3, *b]`)."""

    density_drag: Array  # C_D0 rho, kg/m3
    offset_force: Array  # B, N (per A_ref in `area` mode, per triangle in `paper` mode)
    surface: Array  # height of the surface in the frame of the positions, m; -inf when dry; [V, *b] where not level
    flow: Array  # m/s


class Drag(NamedTuple):
    """Totals over the mesh."""

    force: Array  # [3, *b] N
    magnitude: Array  # [*b] N, sum of |F_i|
    moment: Array  # [3, *b] N m, sum of |F_i| c_i: centre of pressure times magnitude
    slope: Array  # [*b] N s/m, sum of F_i / u_i: how the force falls as the whole body yields to the flow


def wet_corner(own: Array, one: Array, other: Array) -> Array:
    """Integral of a corner's barycentric coordinate over the wet part of a triangle, per unit of the triangle's area.

    own, one, other: depths of the corner and of the two others, positive under water. Over the three corners the values
    sum to the wet share of the area and are the weights of its centroid. Continuous in depth, 1/3 or 0 away from the
    surface. A dry corner is the complement of a wet one at mirrored depths; a wet corner has either the other two dry
    (a small triangle with shares t and r of the two edges) or the lower of them (all but a small triangle there).
    """
    third = 1.0 / 3.0
    sign = jnp.where(own > 0, 1.0, -1.0)
    own, one, other = own * sign + 1e-12, one * sign, other * sign
    ordered = one < other
    low, high = jnp.where(ordered, one, other), jnp.where(ordered, other, one)
    low = jnp.where(low < 0, low, 0.0)
    alone = high <= 0
    t = own / (own - low)
    r = jnp.where(alone, own, -low) / jnp.where(alone, own - high, high - low)
    dry = 1.0 - t
    share = jnp.where(alone, t * r * (1.0 - (t + r) * third), (1.0 - dry * dry * r) * third)
    return 0.5 * third + sign * (share - 0.5 * third)


def wet_share(a: Array, b: Array, c: Array) -> Array:
    """Share of a triangle's area under water; a, b, c: depths of its corners, positive under water."""
    high, low = jnp.maximum(jnp.maximum(a, b), c), jnp.minimum(jnp.minimum(a, b), c)
    middle = a + b + c - high - low
    deep = middle > 0
    tip = jnp.where(deep, low, high)  # the corner alone on its side of the surface
    out = jnp.where(deep, jnp.minimum(low, 0.0), jnp.maximum(high, 0.0))
    # 1e-18: its inverse square, which the gradient holds, still fits float32
    cut = out * out / ((high - low) * jnp.abs(middle - tip) + 1e-18)
    return jnp.where(deep, 1.0 - cut, cut)


def _factor(facing: Array, wet: Array, speed2: Array, fluid: Fluid, mode: OffsetMode, per_area: Array | float) -> Array:
    """F / (f u) of a triangle. facing: -N.(f u); wet: f; speed2: |u|^2; per_area: SI units per unit of `facing`."""
    fade = 1.0 / (speed2 + FADE_SPEED**2)
    if mode == "area":
        factor = facing * (fluid.density_drag + fluid.offset_force * (1.0 / REFERENCE_AREA) * fade)
    else:
        factor = facing * fluid.density_drag + fluid.offset_force * jnp.sqrt(speed2 + TINY) * fade / per_area
    still = jnp.where(speed2 > STILL_SPEED**2, factor, 0.0)
    return jnp.where(facing > 0, still, 0.0) / jnp.maximum(wet, 1e-6)


def skinned(
    triangles: np.ndarray,
    vertices: Float[Array, "3 vertices *b"],
    velocity: Float[Array, "3 vertices *b"],
    fluid: Fluid,
    submersion: Submersion = "clipped",
    mode: OffsetMode = "area",
    wall: Wall = no_wall,
    floor: Float[Array, "*c"] | None = None,
) -> Drag:
    """Drag on moving vertices; `velocity` is that of the vertices less the flow, m/s. triangles [T, 3] are static.

    `fluid.surface` may differ over the vertices, [V, *b]: each triangle is then cut by the plane through its three.
    floor: height below which another fluid lies, m; only what is between it and the surface counts.
    Triangles go through in groups whose arrays stay in a core's cache (`no_wall`: all at once, as a GPU likes it).
    """

    def weights(corner: Array, vertices: Array, *levels: Array) -> tuple[Array, ...]:
        above, *below = (_corner_weights(_depths(level, corner, vertices), submersion) for level in levels)
        return tuple(jnp.maximum(a - b, 0.0) for a, b in zip(above, *below, strict=True)) if below else above

    def mean(corner: Array, weight: tuple[Array, ...], field: Array) -> tuple[Array, ...]:
        """f times the field at the wet centroid."""
        a, b, c = weight
        return tuple(a * field[k, corner[0]] + b * field[k, corner[1]] + c * field[k, corner[2]] for k in range(3))

    def factors(corner: Array, weight: tuple[Array, ...], slip: tuple[Array, ...], vertices: Array, fluid: Fluid):
        ax, ay, az = (vertices[k, corner[0]] for k in range(3))
        bx, by, bz = (vertices[k, corner[1]] for k in range(3))
        cx, cy, cz = (vertices[k, corner[2]] for k in range(3))
        bx, by, bz, cx, cy, cz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
        sx, sy, sz = slip  # f times the velocity of the wet centroid through the fluid: -f u
        facing = 0.5 * ((by * cz - bz * cy) * sx + (bz * cx - bx * cz) * sy + (bx * cy - by * cx) * sz)
        wet = weight[0] + weight[1] + weight[2]
        inverse = 1.0 / jnp.maximum(wet, 1e-6)
        speed2 = (sx * sx + sy * sy + sz * sz) * (inverse * inverse)
        return _factor(facing, wet, speed2, fluid, mode, 1.0)

    def magnitudes(factor: Array, weight: tuple[Array, ...], slip: tuple[Array, ...]) -> Array:
        sx, sy, sz = slip
        speed = jnp.sqrt(sx * sx + sy * sy + sz * sz + TINY)
        return factor * speed / jnp.maximum(weight[0] + weight[1] + weight[2], 1e-6)

    def sums(factor: Array, magnitude: Array, slip: tuple, centre: tuple, weight: tuple) -> Array:
        wet = weight[0] + weight[1] + weight[2]
        force = [-factor * s for s in slip]
        return total_of(0, [*force, magnitude * wet, *(magnitude * c for c in centre), factor * wet], wall)

    def group(total: Array, corner: Array) -> tuple[Array, None]:
        weight = wall(weights, corner, vertices, *levels)
        slip = wall(mean, corner, weight, velocity)
        centre = wall(mean, corner, weight, vertices)
        factor = wall(factors, corner, weight, slip, vertices, fluid)
        magnitude = wall(magnitudes, factor, weight, slip)
        return total + wall(sums, factor, magnitude, slip, centre, weight), None

    fluid = fluid._replace(surface=jnp.maximum(fluid.surface, DRY))
    levels = _levels(fluid.surface, floor)
    zero = jnp.zeros((8, *vertices.shape[2:]), vertices.dtype)
    if wall is no_wall:
        total, _ = group(zero, jnp.asarray(triangles.T))
    else:
        total, _ = jax.lax.scan(group, zero, jnp.asarray(grouped(triangles)))
    return Drag(total[:3], total[3], total[4:7], total[7])


def _levels(surface: Array, floor: Array | None) -> tuple[Array, ...]:
    """The surface and, where there is one, the floor below it."""
    return (surface,) if floor is None else (surface, jnp.minimum(jnp.maximum(floor, DRY), surface))


def _depths(level: Array, corner: Array, vertices: Array) -> tuple[Array, Array, Array]:
    """Depths of the corners of triangles under a level [*b], or one that differs over the vertices [V, *b]."""
    own = level.ndim == vertices.ndim - 1
    a, b, c = ((level[corner[k]] if own else level) - vertices[1, corner[k]] for k in range(3))
    return a, b, c


def _corner_weights(depths: tuple[Array, Array, Array], submersion: Submersion) -> tuple[Array, Array, Array]:
    """Integrals of the barycentric coordinates over the part below a level, per unit of area."""
    a, b, c = depths
    if submersion == "centroid":
        share = jnp.where(a + b + c > 0, 1.0 / 3.0, 0.0)
        return share, share, share
    return wet_corner(a, b, c), wet_corner(b, c, a), wet_corner(c, a, b)


GROUP = 80  # triangles whose arrays for 128 characters fit a 1 MiB cache


def grouped(triangles: np.ndarray) -> np.ndarray:
    """[groups, 3, GROUP]; the padding repeats one vertex three times: no area, no force."""
    groups = max(1, -(-len(triangles) // GROUP))
    size = -(-len(triangles) // groups)
    padded = np.zeros((groups * size, 3), np.int32)
    padded[: len(triangles)] = triangles
    return padded.reshape(groups, size, 3).transpose(0, 2, 1)


class RigidMesh(NamedTuple):
    """Triangles in blocks of equal size, every block on one bone, in that bone's bind frame (unscaled)."""

    corners: Array  # [3 corners, 3, blocks, size, 1]
    area: Array  # [3, blocks, size, 1] area vector; zero for padding
    moments: Array  # [blocks, 4, size]: rows 1, x, y, z of the centroids


def rigid(
    bones: np.ndarray,
    mesh: RigidMesh,
    transforms: Float[Array, "7 joints *b"],
    velocity: Float[Array, "6 joints *b"],
    scale: Float[Array, "*b"],
    fluid: Fluid,
    submersion: Submersion = "clipped",
    mode: OffsetMode = "area",
    wall: Wall = no_wall,
    floor: Float[Array, "*c"] | None = None,
) -> Drag:
    """Drag on triangles that ride on bones. bones [blocks] (static): the bone of each block.

    transforms: rotation and position of each bone. velocity: of each bone's origin less the flow (world axes, m/s), and
    its angular velocity in its own frame (rad/s). floor: as in `skinned`. `fluid.surface` may differ over the bones,
    [J, *b]. Linear in the masked factor, so totals are products with constants.
    """

    def carried(transforms: Array, velocity: Array, scale: Array, *levels: Array) -> Array:
        """Into the bone's frame and its length unit: velocity (3), spin (3), up (3), depths of the origin."""
        back = quat.conjugate(transforms[:4])
        up = quat.rotate(back, jnp.zeros_like(transforms[4:]).at[1].set(1.0))
        depths = [(level - transforms[5]) / scale for level in levels]
        return jnp.concatenate([quat.rotate(back, velocity[:3]) / scale, velocity[3:], up, *(d[None] for d in depths)])

    def shares(bone: Array) -> Array:
        ux, uy, uz, *depths = bone[6:, :, None]
        above, *below = (share(ux, uy, uz, depth) for depth in depths)
        return jnp.maximum(above - below[0], 0.0) if below else above

    def share(ux: Array, uy: Array, uz: Array, depth: Array) -> Array:
        a, b, c = (depth - ux * x - uy * y - uz * z for x, y, z in mesh.corners)
        if submersion == "centroid":
            return jnp.where(a + b + c > 0, 1.0, 0.0)
        return wet_share(a, b, c)

    def slip(bone: Array) -> tuple[Array, Array, Array]:
        """Velocity of each centroid through the fluid: -u."""
        vx, vy, vz, wx, wy, wz = bone[:6, :, None]
        x, y, z = ((mesh.corners[0, k] + mesh.corners[1, k] + mesh.corners[2, k]) * (1.0 / 3.0) for k in range(3))
        return vx + wy * z - wz * y, vy + wz * x - wx * z, vz + wx * y - wy * x

    def factors(bone: Array, wet: Array, fluid: Fluid, scale: Array) -> Array:
        sx, sy, sz = slip(bone)
        nx, ny, nz = mesh.area
        speed2 = (sx * sx + sy * sy + sz * sz) * (scale * scale)
        facing = (nx * sx + ny * sy + nz * sz) * wet
        return _factor(facing, jnp.ones_like(wet), speed2, fluid, mode, scale * scale * scale)

    def magnitudes(factor: Array, bone: Array) -> Array:
        sx, sy, sz = slip(bone)
        return factor * jnp.sqrt(sx * sx + sy * sy + sz * sz + TINY)

    def moments(factor: Array) -> Array:
        flat = factor.reshape(*factor.shape[:2], -1)
        product = jax.lax.dot_general(mesh.moments, flat, (((2,), (1,)), ((0,), (0,))))
        return jnp.moveaxis(product, 1, 0).reshape(4, factor.shape[0], *factor.shape[2:])

    def assembled(s: Array, m: Array, bone: Array, transforms: Array, scale: Array) -> Array:
        square = scale * scale
        force = -(bone[:3] * s[0] + cross(bone[3:6], s[1:])) * (square * square)
        magnitude = m[0] * (square * square)
        moment = magnitude * transforms[4:] + quat.rotate(transforms[:4], m[1:]) * (square * square * scale)
        slope = s[0] * (square * scale)
        return jnp.concatenate([quat.rotate(transforms[:4], force), magnitude[None], moment, slope[None]])

    fluid = fluid._replace(surface=jnp.maximum(fluid.surface, DRY))
    carried_bones = wall(carried, transforms, velocity, scale, *_levels(fluid.surface, floor))
    bone = wall(lambda carried: carried[:, bones], carried_bones)
    wet = wall(shares, bone)
    factor = wall(factors, bone, wet, fluid, scale)
    magnitude = wall(magnitudes, factor, bone)
    s, m = wall(moments, factor), wall(moments, magnitude)
    blocks = wall(assembled, s, m, bone, transforms[:, bones], scale)
    total = wall(lambda blocks: blocks.sum(1), blocks)
    return Drag(total[:3], total[3], total[4:7], total[7])
