"""Arrays that are constant in a run: rest poses, clip tables, meshes, terrain."""

from __future__ import annotations

from jax import Array

from crowd.tree import pytree
from kernels.drag import RigidMesh


@pytree
class HerdAssets:
    """One archetype. J joints, L legs, K gaits, S samples, V vertices."""

    rest_translation: Array  # [3, J, 1] m, joint to parent
    rotation_table: Array  # [4, J, (K + 1) S] joint to parent, one hemisphere per joint; the idle clip last
    translation_table: Array  # [3, moving, (K + 1) S] m
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
    pivot_height: Array  # [] m, of the hips: the body pitches about them
    skin_local: Array  # [influences, 4, V]
    rigid_mesh: RigidMesh
    waypoints: Array  # [2, W, 1] m
    path: Array  # [3, M, 1] equal steps along the curve: place (x, z) m, and the most speed m/s for its turns
    path_length: Array  # [] m
    track_rate: Array  # [] samples per second of `Character.track`
    look_at: Array  # [2] m, point (x, z) that characters face


@pytree
class World:
    """Ground. What flows is in `Params`."""

    profile: Array  # [4]
    axis: Array  # [2] unit (x, z): direction along which a profile varies
    grid: Array  # [rows * columns] m
    origin: Array  # [2] m, world (x, z) of the first cell
    cell: Array  # [2] m, signed step in x per column and in z per row


@pytree
class Assets:
    herds: tuple[HerdAssets, ...]
    world: World
