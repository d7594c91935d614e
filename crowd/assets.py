"""Arrays that are constant in a run: rest poses, clip tables, meshes, terrain."""

from __future__ import annotations

from jax import Array

from crowd.tree import pytree
from kernels.drag_moments import RigidMesh


@pytree
class StrideAssets:
    """The analysed motions of one archetype. M motions, L legs; angles in radians, times in cycles since stance."""

    velocity: Array  # [2, M] m/s, (x, z) in the character frame
    speed: Array  # [M] m/s
    frequency: Array  # [M] 1/s of walk cycles, 0 for grounded motions
    rate: Array  # [M] 1/s of grounded motions' own clocks
    keys: Array  # [6, M, L, 1] lift, liftoff, postlift, preland, strike, land
    stance_cos: Array  # [M, L, 1] of 2 pi stance time
    stance_sin: Array  # [M, L, 1]
    stance: Array  # [3, M, L, 1] m, heel end of the footbase at stance
    foot: Array  # [3, M, L, 1] m, heel to toe end at stance, level
    flight: Array  # [M * L * samples, 3] normalised footbase from liftoff to strike (kernels.flight.trajectory)
    heel: Array  # [3, L, 1] m, in the frame of the ankle
    toe: Array  # [3, L, 1] m, in the frame of the ball
    length: Array  # [L, 1] m, of the feet
    reach: Array  # [L, 1] m, of the legs, hip to ankle along the bones
    nearest: Array  # [L, 1] m, the least distance from hip to ankle: of the leg folded
    pivot: Array  # [3, 1] m, mean of the hips in the rest pose
    extra_rate: Array  # [extras] 1/s of the other clips


@pytree
class HerdAssets:
    """One archetype. J joints, L legs, K gaits, S samples, V vertices."""

    rest_translation: Array  # [3, J, 1] m, joint to parent
    rotation_table: Array  # [(K + 1) S, 4, J] joint to parent, one hemisphere per joint; the idle clip last
    translation_table: Array  # [(K + 1) S, 3, moving] m
    idle_rate: Array  # [] cycles/s of the idle clip
    period: Array  # [K] s
    speed: Array  # [K] m/s, the clips' own
    lift: Array  # [K, L, 1] phase of lift-off, unwrapped from gait to gait
    duty: Array  # [K, L, 1]
    rest: Array  # [K, 2, L, 1] m, (x, z) of the contact point at mid-stance
    idle_rest: Array  # [2, L, 1] m, where the feet stand
    most_stride: Array  # [K] m, longest stride that the legs reach; faster walks step quicker instead
    swing_height: Array  # [L * K * samples] m, contact point over swing progress
    ball_offset: Array  # [3, L, 1] m, contact point in the frame of the ball joint
    bend: Array  # [3, L, 1] unit, mean direction in which the knee bends, character frame
    arm_length: Array  # [] m
    arm_outward: Array  # [3, A, 1] unit, away from the body, character frame
    spread: Array  # [] m, about how far from the middle the feet stand while it walks
    pivot_height: Array  # [] m, of the hips: the body pitches about them
    skin_local: Array  # [influences, 4, V]
    rigid_mesh: RigidMesh
    waypoints: Array  # [2, W, 1] m
    path: Array  # [3, M, 1] equal steps along the curve: place (x, z) m, and the most speed m/s for its turns
    path_length: Array  # [] m
    track_rate: Array  # [] samples per second of `Character.track`
    look_at: Array  # [2] m, point (x, z) that characters face
    strides: StrideAssets | None  # semi-procedural only


@pytree
class GroundLayer:
    """One level of the ground; which fields count depends on its kind (`crowd.layout.GroundLayout`)."""

    parameters: Array  # [p] of a profile, [4, w] of waves; see kernels.terrain
    base: Array  # [] m, added to profiles and waves
    axis: Array  # [2] unit (x, z): direction along which a profile varies
    grid: Array  # [rows * columns] m
    gap: Array  # [] m, cells whose posts differ by more are no ground, where the layout says `gaps`
    origin: Array  # [2] m, world (x, z) of the post that the layout names
    cell: Array  # [2] m, signed step in x per column and in z per row
    low: Array  # [2] m, corner (x, z) of the rectangle that the level covers
    high: Array  # [2] m


@pytree
class World:
    """Ground. What flows is in `Params`."""

    layers: tuple[GroundLayer, ...]  # the first one is everywhere
    max_step_height: Array  # [] m
    min_normal_y: Array  # [] cosine of the steepest slope that feet are laid on


@pytree
class WaterBody:
    """An archetype as the water surface sees it at scale 1, character frame: a column per leg, three of the trunk."""

    hips: Array  # [3, L, 1] m
    leg_area: Array  # [] m2, mean cross-section of a leg
    trunk: Array  # [2, 3, 1] m, (x, z) of the thirds of the trunk
    trunk_area: Array  # [] m2, mean cross-section of the whole trunk
    bottom: Array  # [] m, height of the trunk's underside
    top: Array  # [] m


@pytree
class WaterAssets:
    """The grid of a water surface."""

    calm: Array  # [rows, columns] 1/s, loss of waves in the border and on the shore
    origin: Array  # [2] m, (x, z) of the middle of the first cell
    cell: Array  # [] m
    bodies: tuple[WaterBody, ...]  # per herd


@pytree
class Assets:
    herds: tuple[HerdAssets, ...]
    world: World
    water: WaterAssets | None = None
