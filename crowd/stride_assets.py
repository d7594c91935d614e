"""The semi-procedural system's tables of a herd: analysed motions as arrays, and its first state."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from crowd import ground, posing
from crowd.analysis.motion import Motion as AnalysedMotion
from crowd.assets import StrideAssets
from crowd.layout import Motion
from crowd.params import StrideControl
from crowd.scenario_herd import Locomotion
from crowd.scene import HerdScene, Scene
from crowd.types import Archetype, Clip, Leg
from kernels.body_tilt import UPRIGHT, Tilt
from kernels.foot_alignment import STRAIGHT

FLIGHT_SAMPLES = 33
BEND_SAMPLES = 16
LEAST_BEND = np.radians(12.0)  # a joint that never bends further is a twist joint
SHORT_BONE = 0.06  # of the leg
PERSON_LEG = 0.80  # m: the lengths among the constants are a person's; other legs scale them
TILTS = {1: (0.0, 0.0), 2: (0.0, 0.0), 3: (0.0, 1.0), 4: (0.0, 1.0)}  # hug across and along, by legs; (1, 1) for more


def motion_layout(herd: HerdScene) -> tuple[Motion, ...]:
    """Analysed motions in the order of the tables."""
    return tuple(
        Motion(motion.name, style, motion.kind == "walk")
        for motion, style in zip(herd.motions, herd.groups, strict=True)
    )


def chains(herd: HerdScene) -> tuple[tuple[int, ...], ...]:
    """Joints of each leg that inverse kinematics bends, from hip to ankle, all of one length: shorter repeat the hip.

    Of joints between hip, knee and ankle those count that bend in some motion; twist joints ride on the bone above.
    The footstep controller bends hip and knee alone.
    """
    legs = herd.archetype.legs
    if not herd.motions:
        return tuple((leg.hip, leg.knee, leg.ankle) for leg in legs)
    poses = [motion.pose(BEND_SAMPLES) for motion in herd.motions]
    rotation, translation = (np.concatenate(parts) for parts in zip(*poses, strict=True))
    still = posing.clip_motion(Clip("", "other", 1.0, rotation, translation))
    _, at = posing.world_transforms(herd.archetype.skeleton, still)
    found = [_bending(herd.archetype, leg, at) for leg in legs]
    longest = max(len(chain) for chain in found)
    return tuple((chain[0],) * (longest - len(chain)) + chain for chain in found)


def _bending(rig: Archetype, leg: Leg, at: np.ndarray) -> tuple[int, ...]:
    """Hip, every joint below it that bends in the poses `at` [S, J, 3], and ankle; at least the knee."""
    between = [leg.ankle]
    while between[-1] != leg.hip and rig.skeleton.parents[between[-1]] >= 0:
        between.append(rig.skeleton.parents[between[-1]])
    path = between[::-1] if between[-1] == leg.hip else [leg.hip, leg.knee, leg.ankle]
    whole = _reach(at[0], tuple(path))
    kept = [path[0]]
    for joint, below in itertools.pairwise(path[1:]):
        above, under = at[:, joint] - at[:, kept[-1]], at[:, below] - at[:, joint]
        short = min(np.linalg.norm(above[0]), np.linalg.norm(under[0])) < SHORT_BONE * whole
        sine = np.linalg.norm(posing.cross(above, under), axis=-1)
        bend = np.arctan2(sine, np.sum(above * under, -1))
        if joint == leg.knee or (not short and bend.max() > LEAST_BEND):
            kept.append(joint)
    return (*kept, path[-1])


def stride_assets(herd: HerdScene) -> StrideAssets:
    """Device tables of a herd's motions."""
    motions, rig = herd.motions, herd.archetype
    phase = 2.0 * np.pi * np.stack([motion.stance_time for motion in motions])[..., None]
    walks = np.array([motion.kind == "walk" for motion in motions])
    duration = np.array([motion.duration for motion in motions])
    _, at_rest = posing.world_transforms(rig.skeleton, posing.rest_motion(rig.skeleton))
    return StrideAssets(
        velocity=_array(np.stack([motion.velocity[[0, 2]] for motion in motions], 1)),
        speed=_array(np.array([np.linalg.norm(motion.velocity) for motion in motions])),
        frequency=_array(walks / duration),
        rate=_array(~walks / duration),
        keys=_array(np.stack([motion.keytimes.T for motion in motions], 1)[..., None]),
        stance_cos=_array(np.cos(phase)),
        stance_sin=_array(np.sin(phase)),
        stance=_array(np.stack([motion.stance_position.T for motion in motions], 1)[..., None]),
        foot=_array(np.stack([motion.foot_vector.T for motion in motions], 1)[..., None]),
        flight=_array(np.stack([_flight(motion) for motion in motions]).reshape(-1, 3)),
        heel=_array(np.array([foot.heel for foot in herd.feet]).T[..., None]),
        toe=_array(np.array([foot.toe_tip for foot in herd.feet]).T[..., None]),
        length=_array(np.array([foot.length for foot in herd.feet])[:, None]),
        reach=_array(np.array([_reach(at_rest, chain) for chain in chains(herd)])[:, None]),
        nearest=_array(np.array([_folded(at_rest, chain) for chain in chains(herd)])[:, None]),
        pivot=_array(at_rest[[leg.hip for leg in rig.legs]].mean(0)[:, None]),
        extra_rate=_array(np.array([1.0 / clip.duration for clip in herd.extras])),
    )


def _flight(motion: AnalysedMotion) -> np.ndarray:
    """[L, samples, 3] normalised footbase from each leg's liftoff to its strike (2.12): phase-warped beforehand."""
    count = len(motion.flight)
    if motion.kind != "walk":
        share = np.linspace(0.0, 1.0, FLIGHT_SAMPLES)
        step = np.stack([0 * share, 0 * share, 0.5 - 0.5 * np.cos(np.pi * share)], -1)
        return np.tile(step, (motion.flight.shape[1], 1, 1))
    table = np.concatenate([motion.flight, motion.flight[:1] + np.array([0.0, 0.0, 1.0])])
    rows = []
    for leg, keys in enumerate(motion.keytimes):
        at = np.linspace(keys[1], keys[4], FLIGHT_SAMPLES) * count
        curve = np.stack([np.interp(at, np.arange(count + 1), table[:, leg, k]) for k in range(3)], -1)
        curve[0], curve[-1] = [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]
        rows.append(curve)
    return np.stack(rows)


def _folded(at: np.ndarray, chain: tuple[int, ...]) -> float:
    """m: where one bone is longer than all others together they cannot bring the ankle back to the hip."""
    whole = _reach(at, chain)
    longest = max(np.linalg.norm(at[a] - at[b]) for a, b in itertools.pairwise(chain))
    return float(max(2.0 * longest - whole, 0.0) + (1.0 - STRAIGHT) * 2.0 * whole)


def _reach(at: np.ndarray, chain: tuple[int, ...]) -> float:
    return float(sum(np.linalg.norm(at[a] - at[b]) for a, b in itertools.pairwise(chain)))


def stride_control(herd: HerdScene, compat: bool) -> StrideControl:
    """Constants of a herd; lengths left out follow from the length of its legs."""
    given: Locomotion = herd.model.locomotion
    rig = herd.archetype
    _, at_rest = posing.world_transforms(rig.skeleton, posing.rest_motion(rig.skeleton))
    size = float(np.mean([_reach(at_rest, chain) for chain in chains(herd)])) / PERSON_LEG
    hug_x, hug_z = TILTS.get(len(rig.legs), (1.0, 1.0))
    two = len(rig.legs) <= 2

    def chosen(value: float | None, usual: float) -> Any:
        return _array(np.array(usual if value is None else value))

    return StrideControl(
        most_foot_turn=_array(np.array(np.radians(given.max_foot_turn_deg))),
        # a foot that stands while a wide body turns above it is soon far from where the clip has it
        most_adjustment=chosen(given.max_adjustment_m, max(0.5 * max(size, 1.0), 1.6 * _width(herd))),
        least_step=chosen(given.min_step_m, 0.2 * size),
        longest_cycle=_array(np.array(given.max_step_s)),
        most_turn=_array(np.array(np.radians(given.max_step_turn_deg))),
        most_acceleration=chosen(given.max_step_acceleration_m_s2, 5.0 * size),
        blend_time=_array(np.array(given.blend_s)),
        upright=_array(np.array(UPRIGHT if compat else UPRIGHT * size**2)),
        tilt=Tilt(
            chosen(given.hug_across, hug_x),
            chosen(given.hug_along, hug_z),
            chosen(given.climb_tilt, 0.2 if two else 0.0),
            chosen(given.climb_sensitivity_s_m, 3.0),
            chosen(given.accelerate_tilt, 0.02 if two else 0.0),
            chosen(given.accelerate_sensitivity_s_m, 1.0),
        ),
    )


def _width(herd: HerdScene) -> float:
    """m, how far the feet stand from the middle."""
    return max(float(np.hypot(*motion.stance_position[:, [0, 2]].T).max()) for motion in herd.motions)


def initial_strides(scene: Scene, herd: HerdScene, yaw: np.ndarray, desired: np.ndarray) -> dict[str, np.ndarray]:
    """Fields of `Strides`, not yet in tiles: mid-stride at the velocity asked for, or standing with parked legs."""
    count, legs = herd.count, len(herd.archetype.legs)
    speed = np.hypot(*desired)
    moving = speed > 1e-3
    own = motion_layout(herd)
    sin, cos = np.sin(yaw), np.cos(yaw)
    local = np.stack([desired[0] * cos - desired[1] * sin, desired[0] * sin + desired[1] * cos]) / herd.scale
    nearest = _nearest(herd, local)
    blend = (np.arange(len(own))[:, None] == nearest).astype(float)
    for style in {motion.style for motion in own}:  # every style knows what it would play
        members = [m for m, motion in enumerate(own) if motion.style == style]
        if not blend[members].sum(0).all():
            idle = [m for m in members if not own[m].walks] or members
            blend[idle[0]] = np.where(blend[members].sum(0) > 0, blend[idle[0]], 1.0)
    styles = 1 + max(motion.style for motion in own)
    channel = np.zeros((styles + len(herd.extras), count))
    channel[herd.style] = 1.0
    motion = [herd.motions[m] for m in nearest]
    stance = np.stack([m.stance_position for m in motion], -1).transpose(1, 0, 2) * herd.scale  # [3, L, n]
    foot = np.stack([m.foot_vector for m in motion], -1).transpose(1, 0, 2) * herd.scale
    phase = np.stack([m.stance_time for m in motion], -1)
    walking = np.array([m.kind == "walk" for m in motion]) & moving
    designated = np.mod(herd.phase - phase, 1.0)
    distance = np.array([np.linalg.norm(m.velocity) * m.duration for m in motion]) * herd.scale
    cycle = np.minimum(distance / np.maximum(speed, 1e-9), herd.model.locomotion.max_step_s)
    time = np.where(walking, designated, 0.0)
    behind = _print(scene, herd, yaw, stance, foot, -desired[:, None] * cycle * time)
    ahead = _print(scene, herd, yaw, stance, foot, desired[:, None] * cycle * np.where(walking, 1.0 - time, 0.0))
    foot_yaw = np.tile(yaw, (legs, 1))
    zero, velocity = np.zeros(count), np.stack([desired[0], 0 * speed, desired[1]])
    up = np.stack([zero, zero + 1.0, zero])
    return dict(
        before=velocity, velocity=velocity, acceleration=np.zeros((3, count)), turn=zero, facing=yaw,
        facing_rate=zero,
        blend=blend, channel=channel, channel_goal=np.full(count, herd.style, np.int32), channel_rate=zero + 1e3,
        channel_until=np.full(count, np.inf), channel_return=np.full(count, herd.style, np.int32), extra_time=zero,
        designated=designated, time=time, parked=np.tile(~walking, (legs, 1)),
        phase=_foot_phase(motion, time), steps=np.zeros((legs, count), np.int32),
        from_position=behind[0], from_yaw=foot_yaw, from_normal=behind[1], from_foot=foot[::2],
        to_position=ahead[0], to_yaw=foot_yaw, to_normal=ahead[1], to_foot=foot[::2], goal=ahead[0],
        ground_up=up, leaning=np.zeros((2, count)),
    )  # fmt: skip


def _nearest(herd: HerdScene, local: np.ndarray) -> np.ndarray:
    """[n] the motion of the first style whose velocity is nearest to the one asked for, (x, z) at scale 1."""
    velocity = np.stack([motion.velocity[[0, 2]] for motion in herd.motions])
    away = np.linalg.norm(velocity[:, :, None] - local, axis=1)
    other = np.array([style != herd.style for style in herd.groups])
    return np.argmin(away + 1e6 * other[:, None], axis=0)


def _print(
    scene: Scene, herd: HerdScene, yaw: np.ndarray, stance: np.ndarray, foot: np.ndarray, way: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Heel ends [3, L, n] on the ground and normals, of feet at their stance places moved by `way` [2, L, n]."""
    sin, cos = np.sin(yaw), np.cos(yaw)

    def turned(v: np.ndarray) -> np.ndarray:
        return np.stack([v[0] * cos + v[2] * sin, v[2] * cos - v[0] * sin])

    x, z = herd.points.T[:, None] + turned(stance) + way
    h = turned(foot)
    heel, toe = ground.height(scene.terrain, x, z), ground.height(scene.terrain, x + h[0], z + h[1])
    length = np.maximum(np.hypot(*h), 1e-6)
    rise = np.where(np.abs(toe - heel) < 0.5 * length, (toe - heel) / length, 0.0)
    normal = np.stack([-rise * h[0] / length, np.ones_like(rise), -rise * h[1] / length])
    return np.stack([x, heel, z]), normal / np.linalg.norm(normal, axis=0)


def _foot_phase(motions: list[AnalysedMotion], time: np.ndarray) -> np.ndarray:
    """[L, n] int32 phase of each foot at its cycle time."""
    keys = np.stack([motion.keytimes for motion in motions], -1)  # [L, 6, n]
    lift, liftoff, strike, land = keys[:, 0], keys[:, 1], keys[:, 4], keys[:, 5]
    inside = (time >= lift) & (time < land)
    return np.where(inside, np.where(time < liftoff, 1, np.where(time < strike, 2, 3)), 0).astype(np.int32)


def _array(values: np.ndarray) -> Any:
    """On the host: `build` sends everything to the device at once."""
    return np.asarray(values, np.float32)
