"""An archetype as arrays: its static layout and its device tables."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from crowd import posing
from crowd.analysis.gait import Gait, feet
from crowd.assets import HerdAssets
from crowd.clip_tables import SAMPLES, poses, sampled
from crowd.herd_responses import chosen_responses
from crowd.layout import Faces, HerdLayout, Pace
from crowd.leg_responses import near_legs, partners
from crowd.mesh_assets import blocks, influences, upwards
from crowd.scenario_control import Facing, turn_rate
from crowd.scenario_detail import Detail
from crowd.scene import HerdScene
from crowd.stride_assets import FLIGHT_SAMPLES, chains, motion_layout, stride_assets
from crowd.tree import StaticArray
from crowd.types import Archetype, Clip

CROUCH = 0.85  # of the hips' rest height: how low the body comes for a long stride
STEP = 0.4  # of the height of the hips: half a common step


def herd_layout(herd: HerdScene) -> HerdLayout:
    """Topology and capacities of a herd."""
    rig = herd.archetype
    mesh = herd.drag_mesh
    strides = bool(herd.motions)
    waypoints, detail = herd.model.waypoints, herd.model.detail
    return HerdLayout(
        name=herd.name,
        parents=tuple(int(parent) for parent in rig.skeleton.parents),
        hips=tuple(leg.hip for leg in rig.legs),
        knees=tuple(leg.knee for leg in rig.legs),
        ankles=tuple(leg.ankle for leg in rig.legs),
        balls=tuple(leg.ball for leg in rig.legs),
        partners=partners(rig),
        sides=tuple(leg.side for leg in rig.legs),
        shoulders=tuple(arm.shoulder for arm in rig.arms),
        elbows=tuple(arm.elbow for arm in rig.arms),
        hands=tuple(arm.hand for arm in rig.arms),
        moving=herd.moving,
        gaits=len(herd.gaits),
        motions=motion_layout(herd),
        extras=tuple(clip.cyclic for clip in herd.extras) if strides else (),
        chain=chains(herd),
        flight_samples=FLIGHT_SAMPLES,
        samples=SAMPLES,
        swing_samples=len(herd.gaits[0].swing_height),
        triangles=StaticArray(mesh.triangles[upwards(herd)].astype(np.int32)),
        vertex_bones=StaticArray(influences(mesh)[0].astype(np.int32)),
        block_bones=StaticArray(blocks(herd)[0].astype(np.int32)),
        waypoints=len(waypoints.points_m) if waypoints else 0,
        loop=bool(waypoints and waypoints.loop),
        path=herd.curve is not None,
        closed=herd.curve is not None and herd.curve.closed,
        track=herd.track is not None,
        limits=herd.model.limits.acceleration_m_s2 is not None or herd.model.limits.deceleration_m_s2 is not None,
        faces=_faces(herd),
        near=near_legs(herd) if herd.model.responses.leg_clearance else (),
        responses=chosen_responses(herd),
        mesh=None if detail is None else detail.mesh,
        pace=None if detail is None or detail.every == 1 else _pace(detail),
    )


def _pace(detail: Detail) -> Pace:
    return Pace(detail.every, detail.far_m is not None, detail.calm_m_s2 is not None)


def _spread(stand: np.ndarray, height: float) -> float:
    """m, how far from the middle feet [S, L, 3] stand, and at least as far as a step takes them under such hips."""
    return max(float(np.hypot(*stand.mean(0)[:, [0, 2]].T).max()), STEP * height)


def herd_assets(herd: HerdScene) -> HerdAssets:
    """Device tables of a herd; shapes are those of `herd_layout`."""
    rig, gaits = herd.archetype, herd.gaits
    idle_rotation, idle_translation = sampled(herd.idle)
    tables = poses(herd)
    _, at_rest = posing.world_transforms(rig.skeleton, posing.rest_motion(rig.skeleton))
    stand, _ = feet(rig, idle_rotation, idle_translation)
    pivot_height = max(float(at_rest[[leg.hip for leg in rig.legs], 1].mean()), 0.05)
    arm_length = max([_length(at_rest, arm.shoulder, arm.elbow, arm.hand) for arm in rig.arms], default=1.0)
    outward = np.array([[arm.side, 0.0, 0.35] for arm in rig.arms]).reshape(-1, 3)
    outward = outward / np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    offsets = np.array([leg.ball_offset for leg in rig.legs])
    waypoints = herd.model.waypoints.points_m if herd.model.waypoints else np.zeros((0, 2))
    return HerdAssets(
        rest_translation=_array(rig.skeleton.rest_translation.T[..., None]),
        rotation_table=_array(np.concatenate(_one_hemisphere([q for q, _ in tables])).swapaxes(1, 2)),
        translation_table=_array(np.concatenate([t for _, t in tables])[:, list(herd.moving)].swapaxes(1, 2)),
        idle_rate=_array(np.array(1.0 / herd.idle.duration)),
        period=_array(np.array([gait.period for gait in gaits])),
        speed=_array(np.array([gait.speed for gait in gaits])),
        lift=_array(_unwrapped([gait.lift for gait in gaits])[..., None]),
        duty=_array(np.stack([gait.duty for gait in gaits])[..., None]),
        rest=_array(np.stack([gait.rest.T for gait in gaits])[..., None]),
        idle_rest=_array(stand.mean(0)[:, [0, 2]].T[..., None]),
        most_stride=_array(np.array([most_stride(rig, gait) for gait in gaits])),
        swing_height=_array(np.stack([gait.swing_height.T for gait in gaits], 1).reshape(-1)),
        ball_offset=_array(offsets.T[..., None]),
        bend=_array(_bend(rig, gaits).T[..., None]),
        arm_length=_array(np.array(arm_length)),
        arm_outward=_array(outward.T[..., None]),
        spread=_array(np.array(_spread(stand, pivot_height))),
        pivot_height=_array(np.array(pivot_height)),
        skin_local=_array(influences(herd.drag_mesh)[1]),
        rigid_mesh=blocks(herd)[1],
        waypoints=_array(np.asarray(waypoints, float).reshape(-1, 2).T[..., None]),
        path=_array(_path(herd)),
        path_length=_array(np.array(herd.curve.length if herd.curve else 0.0)),
        track_rate=_array(np.array(herd.track.rate if herd.track else 1.0)),
        look_at=_array(np.array(_point(herd) or (0.0, 0.0))),
        strides=stride_assets(herd) if herd.motions else None,
    )


def _path(herd: HerdScene) -> np.ndarray:
    """[3, M, 1] see `HerdAssets.path`."""
    curve = herd.curve
    if curve is None:
        return np.zeros((3, 0, 1))
    return np.concatenate([curve.points.T, curve.speed(turn_rate(herd.model.limits))[None]])[..., None]


def _point(herd: HerdScene) -> tuple[float, float] | None:
    facing = herd.model.facing
    return facing.point_m if isinstance(facing, Facing) else None


def _faces(herd: HerdScene) -> Faces:
    if isinstance(herd.model.facing, Facing):
        return "heading" if _point(herd) is None else "point"
    return "along" if herd.track is None else "track"


def _array(values: np.ndarray) -> Any:
    """On the host: `build` sends everything to the device at once."""
    return np.asarray(values, np.float32)


def _one_hemisphere(tables: list[np.ndarray]) -> list[np.ndarray]:
    """Quaternion tables [S, J, 4] with every sample on the side of the first clip's mean, so that sums blend."""
    first = tables[0] * np.where(np.sum(tables[0] * tables[0][:1], -1, keepdims=True) < 0, -1, 1)
    mean = first.sum(0)
    return [table * np.where(np.sum(table * mean, -1, keepdims=True) < 0, -1, 1) for table in tables]


def _unwrapped(lifts: list[np.ndarray]) -> np.ndarray:
    """Lift-off phases [K, L] so that neighbouring gaits differ by at most half a cycle."""
    out = [lifts[0]]
    for lift in lifts[1:]:
        out.append(lift + np.round(out[-1] - lift))
    return np.stack(out)


def most_stride(rig: Archetype, gait: Gait) -> float:
    """m, longest stride whose stances every leg reaches from hips at CROUCH of their height; at least the clip's own.

    A foot travels duty x stride under its hip; half of that, the hip's height above the ankle and the leg's two bones
    make a triangle.
    """
    _, at_rest = posing.world_transforms(rig.skeleton, posing.rest_motion(rig.skeleton))
    longest = []
    for number, leg in enumerate(rig.legs):
        bones = _length(at_rest, leg.hip, leg.knee, leg.ankle)
        upright = CROUCH * at_rest[leg.hip, 1] - max(at_rest[leg.ankle, 1], 0.0)
        reach = 2.0 * np.sqrt(max(bones**2 - max(upright, 0.0) ** 2, 0.0))
        lands = gait.contact_point[_sample(gait.touchdown[number], gait), number, 2]
        lifts = gait.contact_point[_sample(gait.lift[number], gait), number, 2]
        longest.append(max(reach, 1.05 * (lands - lifts)) / gait.duty[number])
    return float(max(min(longest), 1e-3))


def _sample(phase: float, gait: Gait) -> int:
    return round(phase * len(gait.contact_point)) % len(gait.contact_point)


def _bend(rig: Archetype, gaits: tuple[Gait, ...]) -> np.ndarray:
    """[L, 3] unit mean direction of the knee off the line from hip to ankle, over all gaits; forward when straight."""
    total = np.zeros((len(rig.legs), 3))
    hip, knee, ankle = ([getattr(leg, part) for leg in rig.legs] for part in ("hip", "knee", "ankle"))
    for gait in gaits:
        still = posing.clip_motion(Clip("", "other", 1.0, gait.rotation, gait.translation))
        _, at = posing.world_transforms(rig.skeleton, still)
        leg, upper = at[:, ankle] - at[:, hip], at[:, knee] - at[:, hip]
        along = np.sum(upper * leg, -1, keepdims=True) / np.maximum(np.sum(leg * leg, -1, keepdims=True), 1e-12)
        total += (upper - along * leg).mean(0)
    size = np.linalg.norm(total, axis=1, keepdims=True)
    return np.where(size > 1e-4, total / np.maximum(size, 1e-9), [0.0, 0.0, 1.0])


def _length(at: np.ndarray, *joints: int) -> float:
    return float(sum(np.linalg.norm(at[a] - at[b]) for a, b in itertools.pairwise(joints)))


def extent(herd: HerdScene) -> float:
    """m, the longest side of the archetype's body: what its inertia goes with."""
    return float(np.ptp(herd.archetype.mesh.vertices[:, 1:], axis=0).max())
