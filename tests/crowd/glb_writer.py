"""Small glTF files built in memory: walking box-limbed creatures of any number of legs, and ways to spoil them."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from crowd import posing

SAMPLES = 33  # keys of a clip, the last one repeats the first


@dataclass
class Rig:
    """A creature in a frame of y up, +z forward, metres."""

    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    places: list[tuple[float, float, float]] = field(default_factory=list)  # global, rest
    boxes: list[tuple[np.ndarray, np.ndarray, int]] = field(default_factory=list)  # corners and joint
    clips: dict[str, tuple[float, dict[int, np.ndarray], dict[int, np.ndarray]]] = field(default_factory=dict)

    def joint(self, name: str, parent: int, place: tuple[float, float, float]) -> int:
        self.names.append(name)
        self.parents.append(parent)
        self.places.append(place)
        return len(self.names) - 1

    def bone(self, joint: int, end: tuple[float, float, float], width: float) -> None:
        """A box round the bone from `joint` to `end`."""
        a, b = np.array(self.places[joint]), np.array(end)
        low, high = np.minimum(a, b) - width / 2, np.maximum(a, b) + width / 2
        self.box(low, high, joint)

    def box(self, low: Any, high: Any, joint: int) -> None:
        self.boxes.append((np.array(low, float), np.array(high, float), joint))


CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def turn(axis: tuple[float, float, float], angle: np.ndarray) -> np.ndarray:
    """Quaternions xyzw [F, 4]."""
    half = np.asarray(angle)[:, None] / 2
    return np.concatenate([np.array(axis) * np.sin(half), np.cos(half)], 1)


def mesh_arrays(rig: Rig) -> dict[str, np.ndarray]:
    """Positions, joints, weights and indices of the creature's boxes."""
    positions = [np.array(low) + CORNERS * (np.array(high) - np.array(low)) for low, high, _ in rig.boxes]
    joints = np.zeros((8 * len(rig.boxes), 4), np.uint16)
    joints[:, 0] = np.repeat([joint for _, _, joint in rig.boxes], 8)
    weights = np.zeros((8 * len(rig.boxes), 4), np.float32)
    weights[:, 0] = 1.0
    indices = np.concatenate([FACES + 8 * k for k in range(len(rig.boxes))]).reshape(-1).astype(np.uint16)
    return {"POSITION": np.concatenate(positions).astype(np.float32), "JOINTS_0": joints, "WEIGHTS_0": weights,
            "indices": indices}  # fmt: skip


_KINDS = {np.dtype("u1"): 5121, np.dtype("u2"): 5123, np.dtype("u4"): 5125, np.dtype("f4"): 5126}
_SHAPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


@dataclass
class File:
    """A glTF document under construction."""

    tree: dict[str, Any] = field(default_factory=lambda: {"asset": {"version": "2.0"}})
    data: bytearray = field(default_factory=bytearray)

    def accessor(self, values: np.ndarray) -> int:
        values = np.ascontiguousarray(values if values.ndim > 1 else values[:, None])
        self.data.extend(b"\0" * (-len(self.data) % 4))
        views = self.tree.setdefault("bufferViews", [])
        views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": values.nbytes})
        self.data.extend(values.tobytes())
        accessors = self.tree.setdefault("accessors", [])
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": _KINDS[values.dtype], "count": len(values),
             "type": _SHAPES[values.shape[1]]}
        )  # fmt: skip
        self.tree["buffers"] = [{"byteLength": len(self.data)}]
        return len(accessors) - 1

    def glb(self) -> bytes:
        text = json.dumps(self.tree).encode()
        text += b" " * (-len(text) % 4)
        binary = bytes(self.data) + b"\0" * (-len(self.data) % 4)
        size = 12 + 8 + len(text) + 8 + len(binary)
        head = struct.pack("<4sII", b"glTF", 2, size) + struct.pack("<I4s", len(text), b"JSON")
        return head + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary

    def write(self, path: Path) -> Path:
        path.write_bytes(self.glb())
        return path


def build(rig: Rig, skins: int = 1, scale: float = 1.0, yaw: float = 0.0, indexed: bool = True) -> File:
    """The glTF document of a creature.

    skins: the boxes are spread over so many meshes with a skin each. scale, yaw (rad): of the armature above the root.
    """
    file = File()
    places = np.array(rig.places)
    nodes: list[dict[str, Any]] = []
    for joint, name in enumerate(rig.names):
        parent = rig.parents[joint]
        offset = places[joint] - (places[parent] if parent >= 0 else 0.0)
        children = [child for child, above in enumerate(rig.parents) if above == joint]
        nodes.append({"name": name, "translation": offset.tolist(), "children": children})
    armature = len(nodes)
    roots = [j for j, p in enumerate(rig.parents) if p < 0]
    nodes.append({"name": "Armature", "scale": [scale] * 3, "children": roots,
                  "rotation": [0.0, float(np.sin(yaw / 2)), 0.0, float(np.cos(yaw / 2))]})  # fmt: skip
    inverse = np.tile(np.eye(4), (len(places), 1, 1))
    inverse[:, :3, 3] = -places
    meshes, skin_list = [], []
    for part in range(skins):
        share = Rig(rig.names, rig.parents, rig.places, rig.boxes[part::skins])
        arrays = mesh_arrays(share)
        indices = arrays.pop("indices")
        if not indexed:
            arrays = {key: values[indices] for key, values in arrays.items()}
        primitive: dict[str, Any] = {"attributes": {key: file.accessor(values) for key, values in arrays.items()}}
        if indexed:
            primitive["indices"] = file.accessor(indices)
        meshes.append({"name": f"part {part}", "primitives": [primitive]})
        matrices = file.accessor(inverse.transpose(0, 2, 1).reshape(-1, 16).astype(np.float32))
        skin_list.append({"joints": list(range(len(places))), "inverseBindMatrices": matrices})
        nodes.append({"name": f"mesh {part}", "mesh": part, "skin": part})
    file.tree |= {"nodes": nodes, "meshes": meshes, "skins": skin_list, "scene": 0}
    file.tree["scenes"] = [{"nodes": [armature, *range(armature + 1, len(nodes))]}]
    file.tree["animations"] = [_animation(file, rig, name) for name in rig.clips]
    return file


def _animation(file: File, rig: Rig, name: str) -> dict[str, Any]:
    duration, rotations, translations = rig.clips[name]
    samplers, channels = [], []
    for path, tracks in (("rotation", rotations), ("translation", translations)):
        for joint, values in tracks.items():
            times = file.accessor(np.linspace(0, duration, len(values)).astype(np.float32))
            samplers.append({"input": times, "output": file.accessor(values.astype(np.float32))})
            channels.append({"sampler": len(samplers) - 1, "target": {"node": joint, "path": path}})
    return {"name": name, "samplers": samplers, "channels": channels}


def _reach(hip: np.ndarray, knee: np.ndarray, ankle: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Turns about x (rad) of hip and knee that bring the ankle to `target` [F, 3], in the plane x = const."""

    def flat(v: np.ndarray) -> np.ndarray:
        return v[..., 2] + 1j * v[..., 1]

    thigh, shank, way = flat(knee - hip), flat(ankle - knee), flat(target - hip)
    a, b = abs(thigh), abs(shank)
    length = np.clip(np.abs(way), abs(a - b) + 1e-6, (a + b) * 0.9999)
    bend = np.arccos((length**2 - a * a - b * b) / (2 * a * b))  # outer angle at the knee
    rest_bend = np.angle(shank / thigh)
    bend = np.sign(rest_bend) * bend
    # thigh * e^(i h) + shank * e^(i (h + k)) = way, with k = bend - rest_bend
    turned = thigh + shank * np.exp(1j * (bend - rest_bend))
    hip_turn = np.angle(way / turned)
    return -hip_turn, -(bend - rest_bend)  # z + iy turns against x


def gait_tracks(
    rig: Rig, legs: list[tuple[int, int, int]], phases: list[float], stride: float, lift: float, duty: float
) -> dict[int, np.ndarray]:
    """Rotations of hips, knees and ankles that walk the ankles in place: back on the ground, forward in the air."""
    places = np.array(rig.places)
    out: dict[int, np.ndarray] = {}
    for (hip, knee, ankle), phase in zip(legs, phases, strict=True):
        t = np.mod(np.linspace(0, 1, SAMPLES) - phase, 1.0)  # 0: touchdown
        swing = np.clip((t - duty) / (1 - duty), 0, 1)
        ahead = np.where(t < duty, 0.5 - t / duty, -0.5 + (1 - np.cos(np.pi * swing)) / 2)
        target = places[ankle] + np.stack([0 * t, lift * np.sin(np.pi * swing), stride * ahead], 1)
        hip_turn, knee_turn = _reach(places[hip], places[knee], places[ankle], target)
        out[hip], out[knee] = turn((1, 0, 0), hip_turn), turn((1, 0, 0), knee_turn)
        out[ankle] = turn((1, 0, 0), -hip_turn - knee_turn)
    return out


def side_tracks(
    rig: Rig, legs: list[tuple[int, int, int]], phases: list[float], stride: float, lift: float, duty: float, way: float
) -> dict[int, np.ndarray]:
    """As `gait_tracks`, along the angle `way` (rad, to the left of forward), for legs with hips over ankles."""
    places = np.array(rig.places)
    out: dict[int, np.ndarray] = {}
    for (hip, knee, ankle), phase in zip(legs, phases, strict=True):
        t = np.mod(np.linspace(0, 1, SAMPLES) - phase, 1.0)  # 0: touchdown
        swing = np.clip((t - duty) / (1 - duty), 0, 1)
        ahead = stride * np.where(t < duty, 0.5 - t / duty, -0.5 + (1 - np.cos(np.pi * swing)) / 2)
        span = places[ankle] - places[hip] + np.stack([ahead * np.sin(way), lift * np.sin(np.pi * swing),
                                                       ahead * np.cos(way)], 1)  # fmt: skip
        length = np.linalg.norm(span, axis=1, keepdims=True)
        below = places[hip] + length * np.array([0.0, -1.0, 0.0])
        hip_turn, knee_turn = _reach(places[hip], places[knee], places[ankle], below)
        # the leg bent in its own plane, then turned as a whole from straight down to the target
        x, y, z = (span / length).T
        whole = np.stack([-z, 0 * x, x, 1 - y], 1) / np.sqrt(2 * (1 - y))[:, None]
        out[hip] = product(whole, turn((1, 0, 0), hip_turn))
        out[knee] = turn((1, 0, 0), knee_turn)
        out[ankle] = product(out[hip], out[knee]) * np.array([-1.0, -1.0, -1.0, 1.0])
    return out


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a after b, quaternions xyzw."""
    return np.roll(posing.multiply(np.roll(a, 1, -1), np.roll(b, 1, -1)), -1, -1)


def breathing(rig: Rig, joint: int) -> tuple[float, dict[int, np.ndarray], dict[int, np.ndarray]]:
    """An idle clip: one joint of the trunk nods."""
    return 2.0, {joint: turn((1, 0, 0), 0.03 * np.sin(np.linspace(0, 2 * np.pi, SAMPLES)))}, {}


def biped() -> Rig:
    """A person of 1.7 m with feet, arms and a head; clips walk, run and idle."""
    rig = Rig()
    root = rig.joint("j0", -1, (0, 0.9, 0))
    chest = rig.joint("j1", root, (0, 1.2, 0))
    head = rig.joint("j2", chest, (0, 1.5, 0))
    rig.box((-0.15, 0.85, -0.1), (0.15, 1.2, 0.1), root)
    rig.box((-0.2, 1.2, -0.1), (0.2, 1.5, 0.1), chest)
    rig.box((-0.08, 1.5, -0.08), (0.08, 1.7, 0.1), head)
    legs = []
    for side in (1, -1):
        x = 0.1 * side
        hip = rig.joint(f"a{side}", root, (x, 0.84, 0))
        knee = rig.joint(f"b{side}", hip, (x, 0.47, 0.1))
        ankle = rig.joint(f"c{side}", knee, (x, 0.08, 0))
        ball = rig.joint(f"d{side}", ankle, (x, 0.02, 0.13))
        rig.bone(hip, rig.places[knee], 0.1)
        rig.bone(knee, rig.places[ankle], 0.08)
        rig.box((x - 0.04, 0, -0.06), (x + 0.04, 0.1, 0.12), ankle)
        rig.box((x - 0.04, 0, 0.12), (x + 0.04, 0.05, 0.2), ball)
        shoulder = rig.joint(f"e{side}", chest, (0.2 * side, 1.42, 0))
        elbow = rig.joint(f"f{side}", shoulder, (0.48 * side, 1.42, -0.01))
        hand = rig.joint(f"g{side}", elbow, (0.74 * side, 1.42, 0))
        rig.bone(shoulder, rig.places[elbow], 0.07)
        rig.bone(elbow, rig.places[hand], 0.06)
        rig.bone(hand, (0.85 * side, 1.42, 0), 0.05)
        legs.append((hip, knee, ankle))
    rig.clips["two"] = breathing(rig, chest)
    rig.clips["one"] = (1.1, gait_tracks(rig, legs, [0.0, 0.5], 0.36, 0.12, 0.6), {})
    bob = np.tile(np.array(rig.places[root]), (SAMPLES, 1))
    bob[:, 1] -= 0.02 * (1 - np.cos(np.linspace(0, 4 * np.pi, SAMPLES)))
    rig.clips["three"] = (0.5, gait_tracks(rig, legs, [0.0, 0.5], 0.36, 0.2, 0.3), {root: bob})
    return rig


def crawler(pairs: int, tarsus: bool = True) -> Rig:
    """An insect or spider with `pairs` pairs of legs (coxa, femur, tibia, maybe tarsus) that step in two sets."""
    rig = Rig()
    root = rig.joint("body", -1, (0, 0.25, 0))
    rig.box((-0.12, 0.2, -0.15 * pairs), (0.12, 0.32, 0.15 * pairs), root)
    head = rig.joint("head", root, (0, 0.27, 0.15 * pairs))
    rig.box((-0.08, 0.22, 0.15 * pairs), (0.08, 0.32, 0.15 * pairs + 0.15), head)
    tracks: dict[int, np.ndarray] = {}
    for row in range(pairs):
        z = 0.15 * (pairs - 1) - 0.3 * row
        for side in (1, -1):
            coxa = rig.joint(f"coxa{row}{side}", root, (0.12 * side, 0.25, z))
            femur = rig.joint(f"femur{row}{side}", coxa, (0.17 * side, 0.27, z))
            tibia = rig.joint(f"tibia{row}{side}", femur, (0.4 * side, 0.42, z))
            end = (0.62 * side, 0.0, z)
            rig.bone(coxa, rig.places[femur], 0.04)
            rig.bone(femur, rig.places[tibia], 0.03)
            if tarsus:
                ankle = rig.joint(f"tarsus{row}{side}", tibia, (0.6 * side, 0.04, z))
                rig.bone(tibia, rig.places[ankle], 0.02)
                rig.box((0.6 * side - 0.02, 0, z - 0.01), (0.6 * side + 0.02, 0.05, z + 0.01), ankle)
            else:
                margin = np.array([0.01, 0, 0.01])
                low, high = np.minimum(rig.places[tibia], end), np.maximum(rig.places[tibia], end)
                rig.box(low - margin, high + margin, tibia)
            t = np.mod(np.linspace(0, 1, SAMPLES) - 0.5 * ((row + (side > 0)) % 2), 1.0)
            swing = np.clip((t - 0.55) / 0.45, 0, 1)
            ahead = np.where(t < 0.55, 0.5 - t / 0.55, -0.5 + swing)
            tracks[coxa] = turn((0, 1, 0), -0.5 * side * ahead)
            tracks[femur] = turn((0, 0, 1), 0.35 * side * np.sin(np.pi * swing))
    rig.clips["walk"] = (0.8, tracks, {})
    rig.clips["rest"] = breathing(rig, head)
    return rig


def quadruped(neck: float = 0.9) -> Rig:
    """A digitigrade animal with a long neck and a tail that hangs to the ground; clips 'amble' and 'still'."""
    rig = Rig()
    root = rig.joint("hips", -1, (0, 1.0, -0.5))
    rig.box((-0.15, 0.85, -0.7), (0.15, 1.15, 0.0), root)
    chest = rig.joint("chest", root, (0, 1.05, 0.1))
    rig.box((-0.15, 0.85, 0.0), (0.15, 1.2, 0.6), chest)
    joint, place = chest, np.array([0, 1.15, 0.5])
    for number in range(4):
        joint = rig.joint(f"neck{number}", joint, tuple(place))
        step = np.array([0, neck / 4, 0.05])
        rig.bone(joint, tuple(place + step), 0.1)
        place = place + step
    head = rig.joint("skull", joint, tuple(place))
    rig.box(place - np.array([0.08, 0.05, 0.05]), place + np.array([0.08, 0.1, 0.3]), head)
    joint, place = root, np.array([0, 0.95, -0.72])
    for number in range(4):
        joint = rig.joint(f"tail{number}", joint, tuple(place))
        step = np.array([0, -0.235, -0.03])
        rig.bone(joint, tuple(place + step), 0.03)
        place = place + step
    legs = []
    for row, (parent, z) in enumerate(((chest, 0.4), (root, -0.5))):
        for side in (1, -1):
            x = 0.12 * side
            hip = rig.joint(f"p{row}{side}", parent, (x, 0.9, z))
            knee = rig.joint(f"q{row}{side}", hip, (x, 0.58, z + (0.08 if row else -0.06)))
            hock = rig.joint(f"r{row}{side}", knee, (x, 0.3, z - (0.1 if row else 0.0)))
            paw = rig.joint(f"s{row}{side}", hock, (x, 0.06, z - (0.04 if row else 0.0)))
            for joint, end in ((hip, knee), (knee, hock), (hock, paw)):
                rig.bone(joint, rig.places[end], 0.06)
            rig.box((x - 0.04, 0, rig.places[paw][2] - 0.03), (x + 0.04, 0.07, rig.places[paw][2] + 0.09), paw)
            legs.append((hip, knee, paw))
    walk = gait_tracks(rig, legs, [0.25, 0.75, 0.0, 0.5], 0.4, 0.1, 0.62)
    walk[head] = turn((1, 0, 0), 0.05 * np.sin(np.linspace(0, 2 * np.pi, SAMPLES)))
    rig.clips["amble"] = (1.0, walk, {})
    rig.clips["still"] = breathing(rig, head)
    return rig
