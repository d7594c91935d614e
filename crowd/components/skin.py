"""Skin: the mesh of this frame, and the drag on it that the next frame's body feels (section 5.1)."""

from __future__ import annotations

import dataclasses
import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.ad_checkpoint import checkpoint_name

from crowd.assets import HerdAssets
from crowd.components import buoyancy, currents
from crowd.components.sense import Surroundings
from crowd.layout import HerdLayout, Layout
from crowd.params import Character, Fluids
from crowd.state import FAULT_DRAG, State
from kernels import drag, drag_rigid, drag_skinned, quat, skinning
from kernels.drag import Fluid
from kernels.rows import picked
from kernels.trig import sin_cos
from kernels.vec import cross
from kernels.wall import Wall

TOTALS = "drag"  # name of what a backward pass keeps of a frame, beside its state: the totals over the mesh


class Load(NamedTuple):
    """What the fluid does to a character, for the recording."""

    force: Array  # [3, n] N
    torque: Array  # [3, n] N m, (C_P - C_M) x F (Eq. 7)
    center_of_pressure: Array  # [3, n] m, relative to the position; NaN when dry
    apparent_weight: Array | None = None  # [n] share of the weight on the feet


def dry(state: State) -> Load:
    """No fluid anywhere."""
    zero = jnp.zeros_like(state.force)
    return Load(zero, zero, jnp.full_like(state.force, jnp.nan))


def mesh(
    layout: Layout, herd: HerdLayout, assets: HerdAssets, character: Character, transforms: Array, wall: Wall
) -> Array:
    """What moves in the fluid: vertices [V, 3, n], or the transforms themselves when triangles ride on bones."""
    if layout.mesh == "rigid":
        return transforms
    columns = wall(skinning.bone_columns, transforms, character.scale)
    bones = herd.vertex_bones.values
    return wall.linear(
        functools.partial(skinning.skin, bones),
        lambda local, on: skinning.unskinned(bones, local, herd.joints, on),
        assets.skin_local,
        columns,
    )


def fluid_drag(
    layout: Layout,
    fluids: Fluids,
    herd: HerdLayout,
    assets: HerdAssets,
    character: Character,
    state: State,
    previous: Array,
    place: Surroundings,
    way: Array,
    transforms: Array,
    moved: Array,
    wall: Wall,
) -> tuple[State, Load]:
    """The state with this frame's drag. moved, previous: the mesh now and in the frame before, relative to the
    character's position then; way [3, n]: of that position, m.

    The first frame has no frame before it, hence no limb velocities, and no drag.
    """
    fluid = place.fluid._replace(surface=jnp.maximum(place.fluid.surface - state.position[1], -1e3))
    if place.here is not None:
        points = moved[4:] if layout.mesh == "rigid" else moved.swapaxes(0, 1)
        fluid = _uneven(layout, fluids, place, state, points, wall)
    under = [
        layer._replace(surface=jnp.minimum(layer.surface - state.position[1], fluid.surface)) for layer in place.under
    ]
    total, floor = None, None
    for here in (*reversed(under), fluid):  # from the bottom up: the surface of each is the floor of the next
        part = _drag(layout, herd, assets, character, previous, here, floor, way, moved, wall)
        total = part if total is None else drag.Drag(*(a + b for a, b in zip(total, part, strict=True)))
        floor = here.surface
    total = jax.tree.map(lambda x: checkpoint_name(x, TOTALS), total)
    weight = None
    if place.densities:
        surfaces = tuple(each.surface for each in (fluid, *under))
        weight = buoyancy.apparent_weight(layout, herd, assets, character, place, surfaces, moved, wall)
    hips = picked(transforms[4:], np.array(herd.hips), wall)
    force, arm, slope, center, fault = wall(_applied, state, total, hips)
    torque, yaw_pitch, slopes = wall(_torques, state.yaw, force, arm, slope)
    state = dataclasses.replace(state, force=force, torque=yaw_pitch, drag_slope=slopes, fault=fault)
    return state, Load(force, torque, center, weight)


def _drag(
    layout: Layout,
    herd: HerdLayout,
    assets: HerdAssets,
    character: Character,
    previous: Array,
    fluid: Fluid,
    floor: Array | None,
    way: Array,
    moved: Array,
    wall: Wall,
) -> drag.Drag:
    """Drag of one fluid, down to its floor (to the ground: None)."""
    rate = 1.0 / layout.dt
    if layout.mesh == "rigid":
        velocity = wall(functools.partial(_bone_velocity, rate), moved, previous, way, fluid.flow)
        return drag_rigid.rigid(
            herd.block_bones.values,
            assets.rigid_mesh,
            moved,
            velocity,
            character.scale,
            fluid,
            layout.submersion,
            layout.offset_mode,
            wall,
            floor,
        )
    velocity = wall(
        lambda now, before, way, flow: (now - before + way) * rate - (flow if flow.ndim < 3 else flow.swapaxes(0, 1)),
        moved,
        previous,
        way,
        fluid.flow,
    )
    return drag_skinned.skinned(
        herd.triangles.values, moved, velocity, fluid, layout.submersion, layout.offset_mode, wall, floor
    )


def _spread(flow: Array, over: Array) -> Array:
    """[3, 1 or p, n]: one flow for a character, or one at each point."""
    return flow if flow.ndim == over.ndim else flow[:, None]


def _uneven(layout: Layout, fluids: Fluids, place: Surroundings, state: State, points: Array, wall: Wall) -> Fluid:
    """The fluid with a surface [p, n] and a flow [3, p, n] of its own at each of the points [3, p, n] of the mesh."""
    assert place.here is not None
    time = currents.seconds(layout, state.frame)
    surface, flow = currents.field(layout, fluids, place.here, state.position, time, points, wall)
    return place.fluid._replace(
        surface=surface, flow=wall(lambda flow, own: flow[:, None] + own, place.fluid.flow, flow)
    )


def _bone_velocity(rate: float | Array, now: Array, before: Array, way: Array, flow: Array) -> Array:
    """[6, J, n]: velocity of each bone's origin less the flow, and its spin in its own frame."""
    linear = (now[4:] - before[4:] + way[:, None]) * rate - _spread(flow, now)
    w, *turned = jnp.unstack(quat.multiply(quat.conjugate(before[:4]), now[:4]))
    per = 2.0 * rate * jnp.sign(w)
    return jnp.concatenate([linear, jnp.stack([x * per for x in turned])])


def _applied(state: State, total: drag.Drag, hips: Array) -> tuple[Array, Array, Array, Array, Array]:
    """(force, arm of the centre of pressure about C_M, slope, C_P or NaN, fault bits) for characters that feel it."""
    center_of_mass = hips.sum(1) / hips.shape[1]
    felt = (state.frame > 0) & (state.fault == 0)
    finite = jnp.isfinite(total.force.sum(0) + total.moment.sum(0) + total.magnitude + total.slope)
    use = felt & finite
    wet = use & (total.magnitude > 1e-6)
    center = jnp.where(wet, total.moment / jnp.where(wet, total.magnitude, 1.0), center_of_mass)
    # F goes with |u| u: it falls by 2 F / |u| per metre per second that the whole body yields
    slope = 2.0 * jnp.where(use, total.slope, 0.0)
    fault = state.fault | jnp.where(finite, 0, FAULT_DRAG)
    return (
        jnp.where(use, total.force, 0.0),
        center - center_of_mass,
        slope,
        jnp.where(wet, center, jnp.nan),
        fault,
    )


def _torques(yaw: Array, force: Array, arm: Array, slope: Array) -> tuple[Array, Array, Array]:
    """(C_P - C_M) x F [3, n], its yaw and pitch components [2, n], and the slopes of force and both torques [3, n]."""
    torque = cross(arm, force)
    sin, cos = sin_cos(yaw)
    pitch = torque[0] * cos - torque[2] * sin
    x, y, z = arm[0] * arm[0], arm[1] * arm[1], arm[2] * arm[2]
    return torque, jnp.stack([torque[1], pitch]), jnp.stack([slope, slope * (x + z), slope * (x + y + z)])
