"""One frame of one tile of one herd: the table of contents of the simulation."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import jax

from crowd.assets import HerdAssets, World
from crowd.components import (
    alignment,
    arms,
    body,
    effort,
    feet,
    footsteps,
    forces,
    limbs,
    load,
    pose,
    record,
    sense,
    skin,
    steer,
    strides,
    water_surface,
)
from crowd.layout import Gait, Layout
from crowd.params import Character, Params
from crowd.state import Frame, State
from kernels.wall import Wall

# what moves the feet, and what bends the legs to them
GAITS: dict[Gait, tuple[Callable[..., Any], Callable[..., Any]]] = {
    "semi_procedural": (strides.gait, alignment.feet),
    "footsteps": (footsteps.gait, feet.feet),
    "clip": (footsteps.gait, feet.feet),
}


def step(
    layout: Layout,
    which: int,
    assets: HerdAssets,
    world: World,
    params: Params,
    character: Character,
    state: State,
    wall: Wall,
    felt: water_surface.Felt | None = None,
) -> tuple[State, Frame]:
    """State and derived frame of a tile of herd number `which` after one frame.

    sense -> (effort) -> steer -> forces -> body -> gait -> pose -> feet -> arms -> skin; every arrow is a wall.
    felt: a water surface whose waves are in the fluid.
    """
    layout, herd = layout.of(which), layout.herds[which]
    before, previous = state.position, state.previous
    # the mesh of the frame before is large and only the drag reads it: it does not travel through the walls
    state = dataclasses.replace(state, previous=())
    if "load" in herd.responses:
        character = wall(lambda c, s: load.laden(layout.frame_s, params.events, c, s.frame), character, state)
    with jax.named_scope("sense"):
        place = wall(
            lambda c, s: sense.sense(layout, world, params.fluids, s.position, s.yaw, assets.spread * c.scale, s.frame),
            character,
            state,
        )
        if felt is not None:
            place = wall(lambda p, s, f: water_surface.sensed(p, s.position, f, wall), place, state, felt)
    if "transitions" in herd.responses:
        with jax.named_scope("effort"):
            state = wall(lambda c, s, p: effort.responded(layout.dt, assets, c, s, p), character, state, place)
    with jax.named_scope("steer"):
        state, course = steer.steer(layout, herd, assets, params, character, state, wall)
    with jax.named_scope("forces"):
        wrench = wall(lambda c, s, p: forces.total(layout, params, c, s, p), character, state, place)
    with jax.named_scope("body"):
        state = body.body(layout, params, character, state, course, wrench, place, wall)
    stepped, placed = GAITS[layout.gait]
    with jax.named_scope("gait"):
        climb = (state.position[1] - before[1]) / layout.dt
        surface = place.fluid.surface - state.position[1]
        state, plan, poses = stepped(layout, which, assets, world, params, character, state, climb, surface, wall)
    with jax.named_scope("pose"):
        hung = pose.pose(herd, assets, character, state, poses, wall)
    with jax.named_scope("feet"):
        legs = placed(layout, which, assets, world, params, character, state, plan, hung, surface, wall)
    with jax.named_scope("arms"):
        hands = None
        if layout.regions and layout.arms_up[which] and herd.arms:
            state, hands = arms.arms(layout.dt, herd, assets, params, character, state, hung, legs.shift, surface, wall)
        transforms = limbs.bend(herd, hung.transforms, limbs.joined(legs.segments, hands), legs.shift, wall)
    dragged = skin.dry(state)
    if layout.regions:
        with jax.named_scope("skin"):
            moved = skin.mesh(layout, herd, assets, character, transforms, wall)
        with jax.named_scope("drag"):
            state, dragged = skin.fluid_drag(
                layout,
                params.fluids,
                herd,
                assets,
                character,
                state,
                previous,
                place,
                state.position - before,
                transforms,
                moved,
                wall,
            )
            previous = moved
    with jax.named_scope("record"):
        rotation = record.joint_rotations(layout, herd, hung, transforms, wall)
        strided = record.strides(state, plan, legs, wall) if layout.gait == "semi_procedural" else None
        frame = record.frame(layout, state, place, hung, legs, rotation, dragged, strided, wall)
    return dataclasses.replace(state, frame=state.frame + 1, previous=previous), frame


def as_function(layout: Layout, wall: Wall, stage: Callable[..., Any], *arguments: Any) -> Any:
    """A stage, `step` for one, that a CPU runs as one function, unless the layout wants kernel by kernel."""
    return wall.as_function(stage, *arguments) if layout.as_functions else stage(*arguments)


def remembered(frame: Callable[..., Any]) -> Callable[..., Any]:
    """A frame of which a backward pass keeps its arguments and the totals of the drag, and steps the rest again."""
    return jax.checkpoint(frame, policy=jax.checkpoint_policies.save_only_these_names(skin.TOTALS))
