"""The first state: characters in the middle of their stride at the velocity asked for, or standing."""

from __future__ import annotations

from typing import Any

import numpy as np

from crowd import ground
from crowd.analysis.gait import feet
from crowd.herd_assets import most_stride
from crowd.layout import Layout
from crowd.scenario_control import Facing
from crowd.scene import HerdScene, Scene
from crowd.stride_assets import initial_strides


def initial_state(scene: Scene, herd: HerdScene, layout: Layout) -> dict[str, Any]:
    """Fields of a herd's `State`, not yet in tiles: trailing axis n; `gait` holds those of its gait.

    layout: as this herd sees it (`Layout.of`).
    """
    count = herd.count
    zero = np.zeros(count)
    desired, follows = _desired(herd)
    yaw = _yaw(herd)
    if layout.gait == "semi_procedural":
        gait = initial_strides(scene, herd, yaw, desired)
    else:
        gait = _footsteps(herd, yaw, desired)
    x, z = herd.points.T
    mesh = herd.drag_mesh
    previous = np.zeros((len(mesh.vertices), 3, count), np.float32)
    if layout.mesh == "rigid":
        previous = np.zeros((7, herd.archetype.skeleton.count, count), np.float32)
        previous[0] = 1.0
    if not layout.regions:
        previous = np.zeros((0, count), np.float32)
    return dict(
        frame=np.zeros(count, np.int32),
        position=np.stack([x, ground.height(scene.terrain, x, z), z]),
        velocity=desired,
        desired=desired,
        command=desired,
        waypoint=np.full(count, 0 if _guided(herd) else -1, np.int32),
        along=zero if herd.along is None else herd.along,
        facing=yaw,
        heading=yaw,
        follows=np.full(count, follows),
        looks=np.full(count, herd.track is not None or isinstance(herd.model.facing, Facing)),
        yaw=yaw,
        yaw_rate=zero,
        pitch=zero,
        pitch_rate=zero,
        idle_phase=herd.phase,
        phase=herd.phase,
        gait=gait,
        force=np.zeros((3, count)),
        torque=np.zeros((2, count)),
        drag_slope=np.zeros((3, count)),
        previous=previous,
        fault=np.zeros(count, np.int32),
    )


def _footsteps(herd: HerdScene, yaw: np.ndarray, desired: np.ndarray) -> dict[str, np.ndarray]:
    """Fields of `Footsteps`."""
    legs, count = len(herd.archetype.legs), herd.count
    speed = np.hypot(*desired)
    gait = _nearest_gait(herd, speed)
    moving = speed > 0.115 * np.array([g.speed for g in herd.gaits])[gait] * np.sqrt(herd.scale)
    progress, handle, target = _feet(herd, yaw, desired, gait, moving)
    return dict(
        smoothed=desired,
        gait_speed=speed,
        idle=np.where(moving, 0.0, 1.0),
        progress=progress.reshape(legs, count),
        handle=handle,
        target=target,
        foot_yaw=np.tile(yaw, (legs, 1)),
    )


def _desired(herd: HerdScene) -> tuple[np.ndarray, bool]:
    """[2, n] m/s asked for at the start, and whether headings follow it."""
    model, count = herd.model, herd.count
    free = model.facing == "along"
    sin, cos = np.sin(herd.headings), np.cos(herd.headings)
    if herd.track is not None:
        return herd.track.velocity[0].T, False
    way = model.waypoints or model.path
    if way is not None:
        return np.stack([sin, cos]) * (way.speed_m_s * herd.speed), free
    if model.velocity_m_s is not None:
        return np.array(model.velocity_m_s).reshape(2, 1) * herd.speed, free
    return np.stack([sin, cos]) * ((model.speed_m_s or 0.0) * herd.speed * np.ones(count)), False


def _nearest_gait(herd: HerdScene, speed: np.ndarray) -> np.ndarray:
    """[n] the gait each speed is walked in: boundaries half-way (geometric) between the clips' own speeds."""
    own = np.array([gait.speed for gait in herd.gaits])
    middle = np.sqrt(own[1:] * own[:-1])
    return (speed[:, None] / np.sqrt(herd.scale)[:, None] > middle).sum(1)


def _guided(herd: HerdScene) -> bool:
    """Whether way-points, a path or trajectories say where to go."""
    return herd.model.waypoints is not None or herd.curve is not None or herd.track is not None


def _yaw(herd: HerdScene) -> np.ndarray:
    """[n] rad, where characters look at the start: where they go, unless the herd faces something."""
    facing = herd.model.facing
    if not isinstance(facing, Facing):
        return herd.headings
    if facing.point_m is None:
        return np.full(herd.count, np.radians(facing.heading_deg or 0.0))
    x, z = (np.array(facing.point_m) - herd.points).T
    return np.where(np.hypot(x, z) > 1e-6, np.arctan2(x, z), herd.headings)


def _feet(
    herd: HerdScene, yaw: np.ndarray, desired: np.ndarray, gait: np.ndarray, moving: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Progress [L, n], handle and target [2, L, n] of feet that have walked steadily for ever, or stand at rest."""
    own = np.array([g.speed for g in herd.gaits])[gait] * np.sqrt(herd.scale)
    period = np.array([g.period for g in herd.gaits])[gait] * np.sqrt(herd.scale)
    lift = np.stack([g.lift for g in herd.gaits])[gait].T
    duty = np.stack([g.duty for g in herd.gaits])[gait].T
    rest = np.stack([g.rest for g in herd.gaits])[gait].transpose(2, 1, 0) * herd.scale
    ratio = np.clip(np.hypot(*desired) / own, 0.1, 2.0)
    stride = desired * period / ratio**0.25
    most = np.array([most_stride(herd.archetype, g) for g in herd.gaits])[gait] * herd.scale
    stride = stride * np.minimum(1.0, most / np.maximum(np.hypot(*stride), 1e-9))
    stand = _standing_feet(herd)[..., None] * herd.scale
    rest = np.where(moving, rest, stand)
    sin, cos = np.sin(yaw), np.cos(yaw)
    rest = np.stack([rest[0] * cos + rest[1] * sin, rest[1] * cos - rest[0] * sin])
    since = np.mod(herd.phase - lift, 1.0)
    swing = 1.0 - duty
    progress = np.where((since < swing) & moving, since / swing, 1.0)
    root = herd.points.T[:, None]
    planted = root + rest + stride[:, None] * np.where(moving, 0.5 * duty - (since - swing), 0.0)
    target = root + rest + stride[:, None] * ((1.0 - progress) * swing + 0.5 * duty)
    source = target - stride[:, None]
    share = np.where(progress < 0.5, 2 * progress**2, 1 - 2 * (1 - progress) ** 2)
    handle = np.where(progress < 1.0, source + (target - source) * share, planted)
    return progress, handle, np.where(progress < 1.0, target, handle)


def _standing_feet(herd: HerdScene) -> np.ndarray:
    """[2, L] m (x, z) of the contact points in the idle clip."""
    contact, _ = feet(herd.archetype, herd.idle.rotation, herd.idle.translation)
    return contact.mean(0)[:, [0, 2]].T
