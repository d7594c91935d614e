"""Drag on triangles that each ride on one bone (Eq. 6 to 8; see `drag`): what a bone does to them is constant."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from kernels import drag_backwards as backwards
from kernels import quat
from kernels.drag import Drag, Fluid, OffsetMode, Submersion, instantiated, levels_of
from kernels.drag_moments import Ride, RigidMesh, assembled, moments
from kernels.totals import added, spread
from kernels.vec import axis
from kernels.wall import Wall, apart, no_wall

AXES = (2, 1, 0, 1, 0)  # of the blocks in the fields of a mesh
GROUPS = (10, 9, 8)  # blocks that go through together: enough to be worth the start, few enough to leave dry parts out


def groups_of(blocks: int) -> int:
    """Number of groups of equal size."""
    return next((blocks // size for size in GROUPS if blocks % size == 0), 1)


def padded_blocks(blocks: int) -> int:
    """The least number of blocks, so many or more, that makes groups of equal size."""
    return min(-(-blocks // size) * size for size in GROUPS)


def rigid_mesh(corners: np.ndarray) -> RigidMesh:
    """The constants of blocks of triangles, corners [blocks, size, 3 corners, 3] in the frame of each block's bone.

    Triangles of no area (padding) have no drag.
    """
    area = 0.5 * np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
    rows = np.concatenate([np.ones((*corners.shape[:2], 1)), corners.mean(2)], 2)
    fields: tuple[Any, ...] = (
        corners.transpose(2, 3, 0, 1)[..., None],
        area.transpose(2, 0, 1)[..., None],
        rows.transpose(0, 2, 1),
        _boxes(corners, (area != 0).any(-1)).T[..., None],
        backwards.readings(corners, area),
    )
    return RigidMesh(*fields)


def _boxes(corners: np.ndarray, real: np.ndarray) -> np.ndarray:
    """[blocks, 6] middle and half sides of a box around the triangles of each block that are `real` [blocks, size].

    A sphere would be cheaper by three products and reach far below triangles that lie around a trunk.
    """
    out = np.tile([0.0, 0.0, 0.0, -1e6, -1e6, -1e6], (len(corners), 1))  # a block of padding is never wet
    for block in np.flatnonzero(real.any(1)):
        points = corners[block][real[block]].reshape(-1, 3)
        low, high = points.min(0), points.max(0)
        spare = 1e-4 * np.abs(points).max()  # more than rounding takes
        out[block] = [*(0.5 * (low + high)), *(0.50005 * (high - low) + spare)]
    return out


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
    its angular velocity in its own frame (rad/s). floor: as in `drag_skinned.skinned`. `fluid.surface` may differ over
    the bones, [J, *b].
    """
    joints = transforms.shape[1]
    levels = (x if x.ndim > scale.ndim else spread(joints, x, wall) for x in levels_of(fluid.surface, floor))
    carried = wall(_carried, transforms, velocity, spread(joints, scale, wall), *levels)
    ride = Ride(wall(_rows_last, carried), scale, fluid.density_drag, fluid.offset_force)
    total = _total(bones, submersion, mode, wall, mesh, ride, wall(_rows_last, transforms))
    return Drag(total[:3], total[3], total[4:7], total[7])


@functools.partial(jax.custom_jvp, nondiff_argnums=(0, 1, 2))
def _total(
    bones: np.ndarray,
    submersion: Submersion,
    mode: OffsetMode,
    wall: Wall,
    mesh: RigidMesh,
    ride: Ride,
    transforms: Array,
) -> Array:
    """[8, *b]: the totals of `Drag`, group of blocks after group of blocks, up to the last that any character wets.

    Those beyond it would add zeros, so that no character's numbers depend on the others.
    """
    if wall.flag is None:
        return _of_blocks(submersion, mode, wall, mesh, ride, bones, transforms)

    def group(own: _Own, total: Array) -> Array:
        return total + _of_blocks(submersion, mode, wall, own.mesh(mesh), ride, own(jnp.asarray(bones)), transforms)

    return _over_wet(bones, wall, mesh, ride, group, jnp.zeros((8, *ride.scale.shape), transforms.dtype))


class _Own(NamedTuple):
    """The part of arrays of blocks that belongs to a group."""

    first: Array
    size: int

    def __call__(self, x: Array, axis: int = 0) -> Array:
        return jax.lax.dynamic_slice_in_dim(x, self.first, self.size, axis)

    def put(self, every: Array, part: Array) -> Array:
        """`every` with the group's part in it."""
        return jax.lax.dynamic_update_slice_in_dim(every, part, self.first, 0)

    def mesh(self, mesh: RigidMesh) -> RigidMesh:
        return RigidMesh(*(self(x, axis) for x, axis in zip(mesh, AXES, strict=True)))


def _over_wet(
    bones: np.ndarray, wall: Wall, mesh: RigidMesh, ride: Ride, group: Callable[[_Own, Any], Any], start: Any
) -> Any:
    """What `group` makes of `start`, for every group of blocks up to the last that any character wets."""
    groups = groups_of(len(bones))
    size = len(bones) // groups
    surface = wall(lambda bone: bone[bones, 6:10], ride.bone)
    count = wall(functools.partial(_touched, groups), wall(_nearest, mesh.bounds, surface))
    return jax.lax.fori_loop(0, count, lambda number, total: group(_Own(number * size, size), total), start)


def _total_jvp(bones: np.ndarray, submersion: Submersion, mode: OffsetMode, primals: Any, tangents: Any) -> Any:
    """The derivative goes through the wet groups, too, in both directions."""
    wall, mesh, *given = primals
    still = all(isinstance(tangent, SymbolicZero) for tangent in tangents[1])
    along = jax.tree.map(instantiated, tuple(tangents[2:]), tuple(given))
    out = _total(bones, submersion, mode, *primals)
    if still and wall.flag is not None:
        forth, back = (functools.partial(way, bones, submersion, mode) for way in (_changed, _pulled))
        return out, wall.linear(forth, back, (mesh, *given), along)

    def whole(mesh: RigidMesh, ride: Ride, transforms: Array) -> Array:
        return _of_blocks(submersion, mode, wall, mesh, ride, bones, transforms)

    return out, jax.jvp(whole, (mesh, *given), (jax.tree.map(instantiated, tangents[1], mesh), *along))[1]


def _changed(
    bones: np.ndarray,
    submersion: Submersion,
    mode: OffsetMode,
    given: tuple[RigidMesh, Ride, Array],
    along: tuple[Ride, Array],
) -> Array:
    """[8, *b]: change of the totals with the ride and the transforms."""
    mesh, *at = given

    def group(own: _Own, total: Array) -> Array:
        def part(ride: Ride, transforms: Array) -> Array:
            return _of_blocks(submersion, mode, apart, own.mesh(mesh), ride, own(jnp.asarray(bones)), transforms)

        return total + jax.jvp(part, tuple(at), along)[1]

    return _over_wet(bones, apart, mesh, given[1], group, jnp.zeros((8, *given[1].scale.shape), given[2].dtype))


def _pulled(
    bones: np.ndarray,
    submersion: Submersion,
    mode: OffsetMode,
    given: tuple[RigidMesh, Ride, Array],
    cotangent: Array,
) -> tuple[Ride, Array]:
    """Cotangents of the ride and the transforms from that of the totals: the transpose of `_changed`."""
    mesh, ride, transforms = given

    def group(own: _Own, total: _Found) -> _Found:
        bone = own(jnp.asarray(bones))
        here = ride._replace(bone=apart(lambda x: x[bone], ride.bone))
        moved = apart(lambda x: x[bone], transforms)
        on, on_moved = backwards.pulled(submersion, mode, apart, own.mesh(mesh), here, moved, cotangent)
        return _Found(
            own.put(total.bone, on.bone),
            own.put(total.transforms, on_moved),
            tuple(x + y for x, y in zip(total.numbers, on[1:], strict=True)),
        )

    one = jnp.zeros_like(ride.scale)  # what all characters may have alike is added up for each at first
    dry = [jnp.zeros((len(bones), *x.shape[1:]), x.dtype) for x in (ride.bone, transforms)]
    found = _over_wet(bones, apart, mesh, ride, group, _Found(dry[0], dry[1], (one, one, one)))
    on_bone, on_transforms = (
        apart(functools.partial(_onto_joints, bones, len(x)), blocks)
        for x, blocks in ((ride.bone, found.bone), (transforms, found.transforms))
    )
    narrow = jax.vjp(lambda *numbers: [jnp.broadcast_to(x, ride.scale.shape) for x in numbers], *ride[1:])[1]
    return Ride(on_bone, *narrow([*found.numbers])), on_transforms


class _Found(NamedTuple):
    """Cotangents of what blocks take from their bones, and of the numbers of a `Ride`."""

    bone: Array  # [blocks, 10 or 11, *b]
    transforms: Array  # [blocks, 7, *b]
    numbers: tuple[Array, ...]  # scale, density and offset force, [*b] each


def _onto_joints(bones: np.ndarray, joints: int, blocks: Array) -> Array:
    """[joints, k, *b] sums of blocks [blocks, k, *b] on the bones that they ride on."""
    each, none = jnp.unstack(blocks), jnp.zeros_like(blocks[0])
    riders = ([each[block] for block in np.flatnonzero(bones == joint)] for joint in range(joints))
    return jnp.stack([functools.reduce(jnp.add, own) if own else none for own in riders])


_total.defjvp(_total_jvp, symbolic_zeros=True)


def _of_blocks(
    submersion: Submersion,
    mode: OffsetMode,
    wall: Wall,
    mesh: RigidMesh,
    ride: Ride,
    joints: Array | np.ndarray,
    transforms: Array,
) -> Array:
    """[8, *b]: the totals over blocks; ride, transforms: of all joints; joints [blocks]: the bone of each block."""
    ride = ride._replace(bone=wall(lambda bone: bone[joints], ride.bone))
    s, m = moments(submersion, mode, wall, mesh, ride)
    at = wall(lambda transforms: transforms[joints], transforms)
    blocks = wall(assembled, s, m, ride.bone, at, ride.scale)
    if wall.flag is None:  # written out, a GPU would make every block's terms anew: half as long again (an H200)
        return blocks.sum(1)
    return wall(functools.partial(added, 1), blocks)


def _nearest(bounds: Array, surface: Array) -> Array:
    """[blocks, *b] depth of the lowest point that a triangle of the block may have, in the bone's unit."""
    x, y, z, along, across, aside = bounds
    ux, uy, uz, depth = jnp.unstack(surface, axis=1)
    middle = depth - ux * x - uy * y - uz * z
    return middle + jnp.abs(ux) * along + jnp.abs(uy) * across + jnp.abs(uz) * aside


def _touched(groups: int, depth: Array) -> Array:
    """How many groups there are up to the last that may be under the surface for any character; NaN may be."""
    dry = jnp.max(jnp.where(depth <= 0, 0.0, 1.0).reshape(groups, -1), 1) == 0
    return jnp.max(jnp.where(dry, 0, jnp.arange(1, groups + 1)))


def _rows_last(vectors: Array) -> Array:
    """[joints, k, *b] of [k, joints, *b]: what belongs to a joint lies together, and blocks copy it in one piece."""
    return jnp.moveaxis(vectors, 0, 1)


def _carried(transforms: Array, velocity: Array, scale: Array, *levels: Array) -> Array:
    """Into the bone's frame and its length unit: velocity (3), spin (3), up (3), depths of the origin."""
    back = quat.conjugate(transforms[:4])
    up = quat.rotate(back, axis(transforms[4:], 1))
    depths = [(level - transforms[5]) / scale for level in levels]
    own = jnp.stack([x / scale for x in jnp.unstack(quat.rotate(back, velocity[:3]))])
    return jnp.concatenate([own, velocity[3:], up, *(d[None] for d in depths)])
