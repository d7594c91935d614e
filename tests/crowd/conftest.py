"""A man made of boxes: small enough to reason about, complete enough for pictures, recordings and metrics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from crowd.scenario import Scenario
from crowd.types import Archetype, Clip, Leg, Mesh, Skeleton

FACES = np.array(
    [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3],
    np.int32,
).reshape(12, 3)
# joint, parent, offset to the parent, box low and high in the joint's frame
PARTS = (
    ("pelvis", -1, (0.0, 0.90, 0.0), (-0.15, -0.08, -0.09), (0.15, 0.10, 0.09)),
    ("chest", 0, (0.0, 0.12, 0.0), (-0.18, 0.0, -0.10), (0.18, 0.42, 0.10)),
    ("head", 1, (0.0, 0.46, 0.0), (-0.09, 0.0, -0.10), (0.09, 0.24, 0.10)),
    ("hip_l", 0, (0.09, -0.05, 0.0), (-0.07, -0.40, -0.07), (0.07, 0.0, 0.07)),
    ("knee_l", 3, (0.0, -0.41, 0.0), (-0.055, -0.36, -0.06), (0.055, 0.0, 0.06)),
    ("ankle_l", 4, (0.0, -0.37, 0.0), (-0.05, -0.07, -0.06), (0.05, 0.0, 0.20)),
    ("hip_r", 0, (-0.09, -0.05, 0.0), (-0.07, -0.40, -0.07), (0.07, 0.0, 0.07)),
    ("knee_r", 6, (0.0, -0.41, 0.0), (-0.055, -0.36, -0.06), (0.055, 0.0, 0.06)),
    ("ankle_r", 7, (0.0, -0.37, 0.0), (-0.05, -0.07, -0.06), (0.05, 0.0, 0.20)),
    ("arm_l", 1, (0.22, 0.38, 0.0), (-0.04, -0.60, -0.05), (0.04, 0.0, 0.05)),
    ("arm_r", 1, (-0.22, 0.38, 0.0), (-0.04, -0.60, -0.05), (0.04, 0.0, 0.05)),
)


def _about_x(angle: np.ndarray) -> np.ndarray:
    """Quaternions [..., 4] that swing a limb forward (toward +z) by `angle`."""
    zero = np.zeros_like(angle)
    return np.stack([np.cos(angle / 2), -np.sin(angle / 2), zero, zero], -1)


def make_box_man() -> Archetype:
    names = tuple(part[0] for part in PARTS)
    parents = tuple(part[1] for part in PARTS)
    translation = np.array([part[2] for part in PARTS])
    count = len(PARTS)
    skeleton = Skeleton(names, parents, np.tile([1.0, 0, 0, 0], (count, 1)), translation)
    world = np.zeros((count, 3))
    for joint, parent in enumerate(parents):
        world[joint] = translation[joint] + (world[parent] if parent >= 0 else 0.0)
    vertices, triangles, joints = [], [], []
    for joint, (*_, low, high) in enumerate(PARTS):
        corner = np.array([[(low, high)[(k >> b) & 1][b] for b in range(3)] for k in range(8)])
        vertices.append(corner + world[joint])
        triangles.append(FACES[:, ::-1] + 8 * joint)
        joints += [[joint, 0, 0, 0]] * 8
    weights = np.tile([1.0, 0, 0, 0], (8 * count, 1))
    inverse_bind = np.tile(np.eye(4), (count, 1, 1))
    inverse_bind[:, :3, 3] = -world
    mesh = Mesh(
        np.concatenate(vertices),
        np.concatenate(triangles).astype(np.int32),
        np.array(joints, np.int32),
        weights,
        inverse_bind,
    )
    cycle = 2 * np.pi * np.arange(30) / 30
    rotation = np.tile(skeleton.rest_rotation, (30, 1, 1))
    for side, shift in (("l", 0.0), ("r", np.pi)):
        rotation[:, names.index(f"hip_{side}")] = _about_x(0.45 * np.sin(cycle + shift))
        rotation[:, names.index(f"knee_{side}")] = _about_x(-0.5 * (1 + np.cos(cycle + shift)) / 2)
        rotation[:, names.index(f"arm_{side}")] = _about_x(-0.5 * np.sin(cycle + shift))
    walk = Clip("walk", "walk", 1.0, rotation, np.tile(translation, (30, 1, 1)), speed=1.2)
    legs = tuple(
        Leg(side, names.index(f"hip_{s}"), names.index(f"knee_{s}"), names.index(f"ankle_{s}"),
            names.index(f"ankle_{s}"), (0.0, -0.07, 0.14), sign)
        for side, s, sign in (("left", "l", 1), ("right", "r", -1))
    )  # fmt: skip
    return Archetype("box man", skeleton, mesh, legs, (), (walk,), 0, 1.72, 70.0)


@pytest.fixture(scope="session")
def box_man() -> Archetype:
    return make_box_man()


@dataclass(frozen=True, eq=False)
class MadeHerd:
    name: str
    archetype: Archetype
    count: int
    scale: np.ndarray
    mass: np.ndarray
    reference_speed: np.ndarray
    moving: tuple[int, ...] = (0, 3)


@dataclass(frozen=True, eq=False)
class MadeScene:
    """Stands for a scene: the same fields, no simulation."""

    herds: tuple[MadeHerd, ...]
    scenario: Scenario

    def ground(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        return -0.1 * np.clip(np.asarray(z) - 1.0, 0.0, 6.0) + 0.0 * np.asarray(x)

    def surface(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        return np.full(np.broadcast_shapes(np.shape(x), np.shape(z)), -0.05)


@dataclass(frozen=True, eq=False)
class MadeChunk:
    first_frame: int
    time: np.ndarray
    herds: dict[str, dict[str, np.ndarray]]


@dataclass(frozen=True, eq=False)
class MadeResult:
    scene: MadeScene
    time: np.ndarray
    herds: dict[str, dict[str, np.ndarray]]

    def chunks(self, length: int) -> list[MadeChunk]:
        """The result cut along time."""
        return [
            MadeChunk(
                2 * first,
                self.time[first : first + length],
                {n: {k: v[first : first + length] for k, v in herd.items()} for n, herd in self.herds.items()},
            )
            for first in range(0, len(self.time), length)
        ]


def made_walk(scene: MadeScene, herd: MadeHerd, time: np.ndarray, first_x: float) -> dict[str, np.ndarray]:
    """Walking straight along +z at 1.2 m/s, a step of 0.6 m every 0.5 s, each foot planted for 0.6 s of every second.

    While planted, the sole creeps forward by 4 mm and the ankle by 1 mm over the stance, at a steady rate; the foot
    stands half a step ahead of the body at mid-swing of the other leg.
    """
    legs, clip = len(herd.archetype.legs), herd.archetype.clips[0]
    x = first_x + 0.8 * np.arange(herd.count)
    z = 1.2 * time[:, None] + np.zeros(herd.count)
    shape = z.shape
    position = np.stack([x + 0 * z, scene.ground(x, z), z], -1)
    phase = time % 1.0
    out = {name: np.zeros((*shape, 3)) for name in ("desired_velocity", "drag_force", "drag_torque", "velocity")}
    out["velocity"][..., 2], out["desired_velocity"][..., 2] = 1.2, 1.5
    depth = np.maximum(scene.surface(x, z) - position[..., 1], 0.0)
    out["drag_force"][..., 2] = -90.0 * depth
    wet = np.where(depth[..., None] > 0, position + np.array([0, 0.3, 0]), np.nan)
    zero = np.zeros(shape)
    out |= {
        "position": position, "yaw": zero, "pitch": zero + 0.05, "phase": zero + phase[:, None], "depth": depth,
        "drag_power": 108.0 * depth, "center_of_pressure": wet, "fault": np.zeros(shape, np.int32),
    }  # fmt: skip
    contact, feet = (
        np.zeros((*shape, legs), bool),
        {n: np.zeros((*shape, legs, 3)) for n in ("handle", "ball", "ankle")},
    )
    for leg in range(legs):
        since = (phase - 0.5 * leg) % 1.0
        planted = since < 0.6 - 1e-9
        cycle = np.floor(time - 0.5 * leg + 1e-9) + 0.5 * leg
        swing = np.clip((since - 0.6) / 0.4, 0.0, 1.0)
        at = 1.2 * (cycle + 0.3) + 1.2 * swing
        contact[..., leg] = planted[:, None]
        for name, creep, lift in (("handle", 0.0, 0.0), ("ball", 0.004, 0.0), ("ankle", 0.001, 0.08)):
            foot = feet[name][..., leg, :]
            foot[..., 0] = x + 0.09 * (1 - 2 * leg)
            foot[..., 2] = (at + creep * np.where(planted, since / 0.6, 0.0))[:, None]
            foot[..., 1] = lift + 0.1 * np.sin(np.pi * swing)[:, None]
    frame = (phase * len(clip.rotation)).astype(int) % len(clip.rotation)
    joints = (*shape, herd.archetype.skeleton.count)
    translation = np.broadcast_to(clip.translation[frame][:, None], (*joints, 3)).copy()
    translation[..., herd.moving, :] += 0.01 * np.sin(time[:, None, None, None])
    return out | feet | {
        "contact": contact,
        "over_reach": np.where(contact & (np.arange(herd.count)[:, None] == 0), 0.002, 0.0),
        "pose_position": position,
        "pose_orientation": np.broadcast_to([1.0, 0, 0, 0], (*shape, 4)),
        "joint_rotation": np.broadcast_to(clip.rotation[frame][:, None], (*joints, 4)),
        "joint_translation": translation,
        "moving_translation": translation[..., herd.moving, :],
    }  # fmt: skip


@pytest.fixture(scope="session")
def made_result(box_man: Archetype) -> MadeResult:
    """Two herds of box men on their way into water, 4 s at 20 Hz, every number known."""
    scenario = Scenario.model_validate(
        {
            "name": "made",
            "seed": 11,
            "duration_s": 4.0,
            "world": {"fluids": [{"fluid": "water", "surface_m": -0.05}]},
            "herds": [made_herd("ones", 3), made_herd("twos", 2)],
            "record": {"rate_hz": 20},
            "pictures": {"at_s": [1.0, 3.0], "width_px": 320, "height_px": 160},
        }
    )
    herds = tuple(
        MadeHerd(name, box_man, count, np.ones(count), 70.0 + np.arange(count), np.full(count, 1.2))
        for name, count in (("ones", 3), ("twos", 2))
    )
    scene = MadeScene(herds, scenario)
    time = np.arange(80) / 20.0
    walks = {herd.name: made_walk(scene, herd, time, 3.0 * number) for number, herd in enumerate(herds)}
    return MadeResult(scene, time, walks)


def made_herd(name: str, count: int) -> dict:
    return {"name": name, "archetype": "human", "count": count, "place": {"kind": "grid", "spacing_m": 1.0},
            "speed_m_s": 1.5}  # fmt: skip
