"""Drag on the submerged, flow-facing triangles of a character's mesh (Eq. 6 to 8).

Per triangle with area vector N (outward, length = area), wet share f of its area, and velocity u of the fluid relative to
the centroid of its wet part:  projected wet area times |u| is p = f max(-N.u, 0);  F = p (C_D0 rho + B') u  with
B' = (B / A_ref) / (|u|^2 + u_0^2)  in `area` mode, and Eq. 8 as printed, B per triangle, in `paper` mode.

Two ways to move the mesh: `skinned` (every vertex, exact) and `rigid` (each triangle rides on one bone). Both return the
same `Drag`. Positions are relative to any point; velocities are absolute minus the flow.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from kernels import quat
from kernels.fluid import FADE_SPEED, REFERENCE_AREA, STILL_SPEED
from kernels.vec import TINY, cross, dot
from kernels.wall import Wall, no_wall

Submersion = Literal["clipped", "centroid"]
OffsetMode = Literal["area", "paper"]


class Fluid(NamedTuple):
    """What surrounds a character; every field has the batch shape (`flow` `[3, *b]`)."""

    density_drag: Array  # C_D0 rho, kg/m3
    offset_force: Array  # B, N (per A_ref in `area` mode, per triangle in `paper` mode)
    surface: Array  # height of the surface in the frame of the positions, m; -inf when dry
    flow: Array  # m/s


class Drag(NamedTuple):
    """Totals over the mesh."""

    force: Array  # [3, *b] N
    magnitude: Array  # [*b] N, sum of |F_i|
    moment: Array  # [3, *b] N m, sum of |F_i| c_i: centre of pressure times magnitude
    slope: Array  # [*b] N s/m, sum of F_i / u_i: how the force falls as the whole body yields to the flow


def wet_corners(d0: Array, d1: Array, d2: Array, submersion: Submersion) -> list[Array]:
    """Weights of the three corners whose sum is the wet share of the triangle and whose mean is its wet centroid.

    d: depth of each corner, positive under water. Continuous in depth with `clipped`: at most one corner lies on its own
    side of the surface, and what it cuts off is a triangle similar in no other way than sharing two edges.
    """
    third = 1.0 / 3.0
    if submersion == "centroid":
        weight = jnp.where(d0 + d1 + d2 > 0, third, 0.0)
        return [weight, weight, weight]
    w0, w1, w2 = d0 > 0, d1 > 0, d2 > 0
    odd0, odd1, odd2 = (w0 != w1) & (w0 != w2), (w1 != w0) & (w1 != w2), (w2 != w0) & (w2 != w1)

    def crossing(da: Array, db: Array, wa: Array, wb: Array) -> Array:
        """How far along the edge a -> b the surface lies; 0 where the edge does not cross it."""
        cuts = wa != wb
        return jnp.where(cuts, da / jnp.where(cuts, da - db, 1.0), 0.0)

    t01, t12, t20 = crossing(d0, d1, w0, w1), crossing(d1, d2, w1, w2), crossing(d2, d0, w2, w0)
    ahead = jnp.where(odd0, t01, jnp.where(odd1, t12, t20))  # from the odd corner to the next one
    behind = jnp.where(odd0, 1.0 - t20, jnp.where(odd1, 1.0 - t01, 1.0 - t12))  # and to the previous one
    cut = ahead * behind
    own, following, previous = cut * (1.0 - (ahead + behind) * third), cut * ahead * third, cut * behind * third
    corner = [
        jnp.where(odd0, own, jnp.where(odd1, previous, following)),
        jnp.where(odd0, following, jnp.where(odd1, own, previous)),
        jnp.where(odd0, previous, jnp.where(odd1, following, own)),
    ]
    crossed = odd0 | odd1 | odd2
    odd_is_wet = jnp.where(odd0, w0, jnp.where(odd1, w1, w2))
    whole = jnp.where(w0, third, 0.0)
    return [jnp.where(crossed, jnp.where(odd_is_wet, c, third - c), whole) for c in corner]


def _force_factor(facing: Array, wet: Array, speed2: Array, fluid: Fluid, mode: OffsetMode, scale: Array) -> Array:
    """F / (f u) of a triangle; facing = -N.(f u), wet = f, speed2 = |u|^2. `scale`: metres per length unit of N."""
    relevant = (facing > 0) & (speed2 > STILL_SPEED**2)
    fade = 1.0 / (speed2 + FADE_SPEED**2)
    if mode == "area":
        factor = facing * (fluid.density_drag + fluid.offset_force * (1.0 / REFERENCE_AREA) * fade)
    else:
        speed = jnp.sqrt(speed2 + TINY)
        factor = facing * fluid.density_drag + fluid.offset_force * speed * fade / (scale * scale * scale)
    return jnp.where(relevant, factor / jnp.where(wet > 0, wet, 1.0), 0.0)


def skinned(
    triangles: np.ndarray,
    vertices: Float[Array, "3 vertices *b"],
    velocity: Float[Array, "3 vertices *b"],
    fluid: Fluid,
    submersion: Submersion = "clipped",
    mode: OffsetMode = "area",
    wall: Wall = no_wall,
) -> Drag:
    """Drag on moving vertices; `velocity` is that of the vertices less the flow, m/s. triangles [T, 3] are static."""
    first, second, third = (np.ascontiguousarray(triangles[:, k]) for k in range(3))

    def corners(height: Array, surface: Array) -> Array:
        depth = surface - height
        return jnp.stack(wet_corners(depth[first], depth[second], depth[third], submersion))

    def gathered(weight: Array, field: Array) -> Array:
        return weight[0] * field[:, first] + weight[1] * field[:, second] + weight[2] * field[:, third]

    def factor(weight: Array, flow: Array, vertices: Array, fluid: Fluid) -> Array:
        a = vertices[:, first]
        area = 0.5 * cross(vertices[:, second] - a, vertices[:, third] - a)
        wet = weight[0] + weight[1] + weight[2]
        safe = jnp.where(wet > 0, wet, 1.0)
        speed2 = dot(flow, flow) / (safe * safe)
        return _force_factor(-dot(area, flow), wet, speed2, fluid, mode, jnp.ones(()))

    def magnitudes(factor: Array, flow: Array, weight: Array) -> Array:
        wet = weight[0] + weight[1] + weight[2]
        return factor * jnp.sqrt(dot(flow, flow) + TINY) / jnp.where(wet > 0, wet, 1.0)

    def sums(factor: Array, magnitude: Array, flow: Array, centre: Array, weight: Array) -> Drag:
        wet = weight[0] + weight[1] + weight[2]
        return Drag(
            jnp.stack([(factor * flow[k]).sum(0) for k in range(3)]),
            (magnitude * wet).sum(0),
            jnp.stack([(magnitude * centre[k]).sum(0) for k in range(3)]),
            (factor * wet).sum(0),
        )

    weight = wall(corners, vertices[1], fluid.surface)
    flow = wall(lambda weight, velocity: -gathered(weight, velocity), weight, velocity)  # f u
    centre = wall(gathered, weight, vertices)  # f c
    per_flow = wall(factor, weight, flow, vertices, fluid)
    magnitude = wall(magnitudes, per_flow, flow, weight)  # |F| / f
    return wall(sums, per_flow, magnitude, flow, centre, weight)


class RigidMesh(NamedTuple):
    """Triangles in blocks of equal size, every block on one bone, in that bone's bind frame (unscaled)."""

    corners: Array  # [3 corners, 3, blocks, size, 1]
    area: Array  # [3, blocks, size, 1] area vector; zero for padding
    moments: Array  # [blocks, 4, 3 size]: rows 1, x, y, z of the corners, corner-major


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
) -> Drag:
    """Drag on triangles that ride on bones. bones [blocks] (static): the bone of each block.

    transforms: rotation and position of each bone. velocity: of each bone's origin less the flow (world axes, m/s), and
    its angular velocity in its own frame (rad/s). Linear in the masked factor, so totals are products with constants.
    """

    def carried(transforms: Array, velocity: Array, scale: Array, surface: Array) -> Array:
        """Into the bone's frame and its length unit: velocity (3), spin (3), up (3), depth of the origin."""
        back = quat.conjugate(transforms[:4])
        up = quat.rotate(back, jnp.zeros_like(transforms[4:]).at[1].set(1.0))
        return jnp.concatenate(
            [
                quat.rotate(back, velocity[:3]) / scale,
                velocity[3:],
                up,
                ((surface - transforms[5]) / scale)[None],
            ]
        )

    def weights(bone: Array) -> Array:
        depth = [bone[9] - dot(bone[6:9], mesh.corners[k]) for k in range(3)]
        return jnp.stack(wet_corners(*depth, submersion))

    def flow(bone: Array, weight: Array) -> tuple[Array, Array]:
        wet = weight[0] + weight[1] + weight[2]
        centre = weight[0] * mesh.corners[0] + weight[1] * mesh.corners[1] + weight[2] * mesh.corners[2]
        return -(wet * bone[:3] + cross(bone[3:6], centre)), wet

    def factor(bone: Array, weight: Array, fluid: Fluid, scale: Array) -> Array:
        relative, wet = flow(bone, weight)
        safe = jnp.where(wet > 0, wet, 1.0)
        speed2 = dot(relative, relative) * (scale * scale) / (safe * safe)
        return _force_factor(-dot(mesh.area, relative), wet, speed2, fluid, mode, scale)

    def magnitudes(factor: Array, bone: Array, weight: Array) -> Array:
        relative, wet = flow(bone, weight)
        return factor * jnp.sqrt(dot(relative, relative) + TINY) / jnp.where(wet > 0, wet, 1.0)

    def spread(weight: Array, share: Array) -> Array:
        """[blocks, 3 size, *b], corner-major."""
        return jnp.concatenate([weight[k] * share for k in range(3)], 1)

    def moments(spread: Array) -> Array:
        flat = spread.reshape(*spread.shape[:2], -1)
        product = jax.lax.dot_general(mesh.moments, flat, (((2,), (1,)), ((0,), (0,))))
        return jnp.moveaxis(product, 1, 0).reshape(4, spread.shape[0], *spread.shape[2:])

    def assembled(s: Array, m: Array, bone: Array, transforms: Array, scale: Array) -> Array:
        bone = bone[:, :, 0]
        square = scale * scale
        force = -(bone[:3] * s[0] + cross(bone[3:6], s[1:])) * (square * square)
        magnitude = m[0] * (square * square)
        moment = magnitude * transforms[4:] + quat.rotate(transforms[:4], m[1:]) * (square * square * scale)
        slope = s[0] * (square * scale)
        return jnp.concatenate([quat.rotate(transforms[:4], force), magnitude[None], moment, slope[None]])

    bone = wall(carried, transforms, velocity, scale, fluid.surface)[:, bones][:, :, None]
    weight = wall(weights, bone)
    share = wall(factor, bone, weight, fluid, scale)
    magnitude = wall(magnitudes, share, bone, weight)
    s = wall(moments, wall(spread, weight, share))
    m = wall(moments, wall(spread, weight, magnitude))
    total = wall(lambda blocks: blocks.sum(1), wall(assembled, s, m, bone, transforms[:, bones], scale))
    return Drag(total[:3], total[3], total[4:7], total[7])
