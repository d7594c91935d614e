"""Drag on the submerged, flow-facing triangles of a character's mesh (Eq. 6 to 8).

Per triangle with area vector N (outward, length = area), wet share f of its area, and velocity u of the fluid relative
to the centroid of its wet part:  projected wet area times |u| is p = f max(-N.u, 0);  F = p (C_D0 rho + B') u  with
B' = (B / A_ref) / (|u|^2 + u_0^2)  in `area` mode, and Eq. 8 as printed, B per triangle, in `paper` mode.

Two ways to move the mesh: `drag_skinned` (every vertex, exact) and `drag_rigid` (each triangle rides on one bone; its
wet area is exact, its velocity and centre are those of the whole triangle). Both return the same `Drag`. Positions are
relative to any point; velocities are absolute minus the flow.

These are the longest loops of a frame, hence written by component: an array `[3, ...]` taken apart inside a fused loop
costs three times as much. Comparisons feed selects of numbers, never other comparisons: those do not vectorise.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array

from kernels.fluid import FADE_SPEED, REFERENCE_AREA, STILL_SPEED
from kernels.vec import TINY

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
    cut = _cut(a, b, c)
    share = cut.out * cut.out
    # one use of the quotient: XLA makes a loop of its own for one that is used twice
    return jnp.where(cut.deep, 1.0, 0.0) + jnp.where(cut.deep, -share, share) / cut.product


def wet_share_slope(own: Array, one: Array, other: Array) -> Array:
    """How `wet_share` grows with the depth of the corner `own`, per metre; zero where the surface does not cut."""
    cut = _cut(own, one, other)
    out = jnp.abs(cut.out)
    alone = 2.0 * cut.product - out * (cut.near + cut.far)
    shared = out * jnp.where(own == cut.last, cut.near, cut.far)
    return out * jnp.where(own == cut.tip, alone, shared) / (cut.product * cut.product)


class _Cut(NamedTuple):
    """How the surface cuts a triangle, in depths."""

    deep: Array  # whether two corners are under water
    tip: Array  # the corner alone on its side of the surface
    last: Array  # the corner furthest from it
    out: Array  # of the tip beyond the surface; zero where nothing is cut
    near: Array  # from the tip to the corner between, and to the last
    far: Array
    product: Array  # of the two, never zero


def _cut(a: Array, b: Array, c: Array) -> _Cut:
    high, low = _larger(_larger(a, b), c), _smaller(_smaller(a, b), c)
    middle = a + b + c - high - low
    deep = middle > 0
    tip = jnp.where(deep, low, high)
    out = jnp.where(deep, _smaller(low, 0.0), _larger(high, 0.0))
    near, far = jnp.abs(middle - tip), high - low
    # 1e-18: its inverse square, which the gradient holds, still fits float32
    return _Cut(deep, tip, jnp.where(deep, high, low), out, near, far, far * near + 1e-18)


def _larger(a: Array, b: Array | float) -> Array:
    """One instruction; a maximum that keeps NaN takes four, and `_cut` has NaN in its middle corner anyway."""
    return jnp.where(a > b, a, b)


def _smaller(a: Array, b: Array | float) -> Array:
    return jnp.where(a < b, a, b)


def factor_of(
    facing: Array,
    wet: Array,
    speed2: Array,
    density_drag: Array,
    offset_force: Array,
    mode: OffsetMode,
    per_area: Array | float,
) -> Array:
    """F / (f u) of a triangle. facing: -N.(f u); wet: f; speed2: |u|^2; per_area: SI units per unit of `facing`."""
    fade = 1.0 / (speed2 + FADE_SPEED**2)
    if mode == "area":
        factor = facing * (density_drag + offset_force * (1.0 / REFERENCE_AREA) * fade)
    else:
        factor = facing * density_drag + offset_force * jnp.sqrt(speed2 + TINY) * fade / per_area
    still = jnp.where(speed2 > STILL_SPEED**2, factor, 0.0)
    return jnp.where(facing > 0, still, 0.0) / jnp.maximum(wet, 1e-6)


def levels_of(surface: Array, floor: Array | None) -> tuple[Array, ...]:
    """The surface and, where there is one, the floor below it."""
    surface = jnp.maximum(surface, DRY)
    return (surface,) if floor is None else (surface, jnp.minimum(jnp.maximum(floor, DRY), surface))


def instantiated(tangent: Any, like: Any) -> Array:
    """A tangent as an array, also where it is zero."""
    return jnp.zeros_like(like) if isinstance(tangent, SymbolicZero) else tangent
