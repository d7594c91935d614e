"""Reading glTF: what the file means, checked against direct evaluation of its nodes, skins and animations."""

from __future__ import annotations

import copy
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crowd import posing
from crowd.characters import load
from crowd.characters.glb import read_document
from crowd.characters.gltf_clips import Track, sample
from crowd.characters.gltf_scene import read_rig
from crowd.types import Archetype
from tests.crowd.glb_writer import SAMPLES, File, biped, build, turn


def _numbers(tree: dict[str, Any], data: bytes, index: int) -> np.ndarray:
    entry = tree["accessors"][index]
    view = tree["bufferViews"][entry["bufferView"]]
    kind = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}[entry["componentType"]]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[entry["type"]]
    start = view.get("byteOffset", 0) + entry.get("byteOffset", 0)
    size = np.dtype(kind).itemsize * width
    stride = view.get("byteStride", size)
    rows = [np.frombuffer(data, kind, width, start + k * stride) for k in range(entry["count"])]
    return np.array(rows, float)


def _local(node: dict[str, Any]) -> np.ndarray:
    if "matrix" in node:
        return np.array(node["matrix"]).reshape(4, 4).T
    out = np.eye(4)
    out[:3, :3] = posing.matrix(np.roll(np.array(node.get("rotation", [0, 0, 0, 1.0])), 1)) * node.get("scale", [1] * 3)
    out[:3, 3] = node.get("translation", [0] * 3)
    return out


def evaluate(path: Path, clip: str, time: float) -> np.ndarray:
    """Vertices [V, 3] of all meshes in the file frame at `time` s, as the specification says."""
    content = path.read_bytes()
    size = struct.unpack_from("<I", content, 12)[0]
    tree = json.loads(content[20 : 20 + size])
    data = content[28 + size :]
    nodes = copy.deepcopy(tree["nodes"])
    animation = next(a for n, a in enumerate(tree["animations"]) if a.get("name", f"clip {n}") == clip)
    for channel in animation["channels"]:
        sampler, path_name = animation["samplers"][channel["sampler"]], channel["target"]["path"]
        if path_name == "weights":
            continue
        keys = _numbers(tree, data, sampler["input"])[:, 0]
        values = _numbers(tree, data, sampler["output"])
        after = int(np.clip(np.searchsorted(keys, time, side="right"), 1, max(len(keys) - 1, 1)))
        if len(keys) == 1:
            value = values[0]
        else:
            u = np.clip((time - keys[after - 1]) / (keys[after] - keys[after - 1]), 0, 1)
            end = values[after]
            if path_name == "rotation" and values[after - 1] @ end < 0:
                end = -end
            value = (1 - u) * values[after - 1] + u * end
        nodes[channel["target"]["node"]][path_name] = (
            value / np.linalg.norm(value) if path_name == "rotation" else value
        )
    world: dict[int, np.ndarray] = {}

    def walk(index: int, above: np.ndarray) -> None:
        world[index] = above @ _local(nodes[index])
        for child in nodes[index].get("children", []):
            walk(child, world[index])

    for root in tree["scenes"][tree.get("scene", 0)]["nodes"]:
        walk(root, np.eye(4))
    out = []
    for index, node in enumerate(nodes):
        if "mesh" not in node or index not in world:
            continue
        for primitive in tree["meshes"][node["mesh"]]["primitives"]:
            attributes = primitive["attributes"]
            place = np.c_[_numbers(tree, data, attributes["POSITION"]), np.ones(1)[[0] * 1].repeat(
                tree["accessors"][attributes["POSITION"]]["count"])]  # fmt: skip
            if "skin" not in node:
                out.append((place @ world[index].T)[:, :3])
                continue
            skin = tree["skins"][node["skin"]]
            bind = _numbers(tree, data, skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
            matrices = np.stack([world[j] for j in skin["joints"]]) @ bind[: len(skin["joints"])]
            joints = _numbers(tree, data, attributes["JOINTS_0"]).astype(int)
            weights = _numbers(tree, data, attributes["WEIGHTS_0"])
            blended = np.einsum("vk,vkrc->vrc", weights / weights.sum(1, keepdims=True), matrices[joints])
            out.append(np.einsum("vrc,vc->vr", blended, place)[:, :3])
    return np.concatenate(out)


def posed(archetype: Archetype, clip_name: str, frame: int) -> tuple[np.ndarray, float]:
    """Vertices of a clip's frame in the character frame, and the frame's time in s."""
    clip = next(c for c in archetype.clips if c.name == clip_name)
    rotation, position = posing.world_transforms(archetype.skeleton, posing.clip_motion(clip))
    return posing.skin(archetype.mesh, rotation[frame], position[frame]), frame / len(clip.rotation) * clip.duration


def farthest(a: np.ndarray, b: np.ndarray) -> float:
    """Greatest distance from a point of `a` to `b`, both moved to a common corner."""
    from scipy.spatial import KDTree

    return float(KDTree(b - b.min(0)).query(a - a.min(0))[0].max())


@pytest.mark.parametrize("skins", [1, 3])
@pytest.mark.parametrize("indexed", [True, False])
@pytest.mark.parametrize(("scale", "yaw"), [(1.0, 0.0), (0.01, 0.0), (100.0, 1.2)])
def test_pose_as_the_specification_says(tmp_path: Path, skins: int, indexed: bool, scale: float, yaw: float) -> None:
    path = build(biped(), skins, scale, yaw, indexed).write(tmp_path / "a.glb")
    archetype = load("a.glb", tmp_path, {"height_m": 1.7})
    for frame in (0, 5, 17):
        ours, time = posed(archetype, "one", frame)
        theirs = evaluate(path, "one", time) / scale
        c, s = np.cos(yaw), np.sin(yaw)
        theirs = theirs @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]).T  # the creature walks along its own +z
        assert farthest(ours, theirs) < 2e-3
        assert farthest(theirs, ours) < 2e-3


@pytest.mark.parametrize(
    ("file", "clip"),
    [
        ("CesiumMan.glb", "clip 0"),  # a turned root
        ("Fox.glb", "Walk"),  # not indexed
        ("RobotExpressive.glb", "Running"),  # two skins, rigid parts, feet outside the legs' chains
        ("Quaternius_Horse.glb", "AnimalArmature|Gallop"),
        ("Quaternius_Stag.glb", "AnimalArmature|Walk"),  # a rigid part on a joint
    ],
)
def test_real_pose_as_the_specification_says(shared_data: Path, file: str, clip: str) -> None:
    path = shared_data / "characters" / file
    archetype = load(file, path.parent)
    start = 1 / 24 if file == "CesiumMan.glb" else 0.0  # its first key
    for frame in (0, 7):
        ours, time = posed(archetype, clip, frame)
        theirs = evaluate(path, clip, time + start)
        theirs *= archetype.height / (rest_height(path))
        assert farthest(theirs, ours) < 0.006 * archetype.height


def rest_height(path: Path) -> float:
    rig = read_rig(path)
    from crowd.characters.subject import prepare

    return prepare(rig).height


def test_sampling() -> None:
    keys, at = np.array([0.0, 1.0, 3.0]), np.array([-1.0, 0.0, 0.5, 1.0, 2.5, 9.0])
    values = np.array([[0.0, 0, 0], [2, 0, 0], [6, 4, 0]])
    linear = sample(Track(0, "translation", keys, values, "LINEAR"), at)
    np.testing.assert_allclose(linear[:, 0], [0, 0, 1, 2, 5, 6])
    step = sample(Track(0, "translation", keys, values, "STEP"), at)
    np.testing.assert_allclose(step[:, 0], [0, 0, 0, 2, 2, 6])
    # A cubic is reproduced from its values and slopes: x = t^3.
    cubic = np.stack([np.stack([3 * keys**2, keys**3, 3 * keys**2], 1)] * 3, -1)
    spline = sample(Track(0, "translation", keys, cubic, "CUBICSPLINE"), np.array([0.5, 2.0, 2.9]))
    np.testing.assert_allclose(spline[:, 1], np.array([0.5, 2.0, 2.9]) ** 3, atol=1e-12)


def test_rotations_take_the_short_way() -> None:
    ends = turn((0, 1, 0), np.array([0.2, 0.6]))
    ends[1] *= -1
    out = sample(Track(0, "rotation", np.array([0.0, 1.0]), ends, "LINEAR"), np.array([0.25]))
    expected = turn((0, 1, 0), np.array([0.3]))
    np.testing.assert_allclose(np.abs(out @ expected.T), 1.0, atol=1e-12)


def test_normalised_and_sparse_accessors(tmp_path: Path) -> None:
    file = File()
    plain = file.accessor(np.array([[0, 255, 51], [255, 0, 102]], np.uint8))
    file.tree["accessors"][plain]["normalized"] = True
    base = file.accessor(np.zeros((4, 3), np.float32))
    places = file.accessor(np.array([1, 3], np.uint16))
    fills = file.accessor(np.array([[1, 2, 3], [4, 5, 6]], np.float32))
    view = [file.tree["accessors"][k]["bufferView"] for k in (places, fills)]
    file.tree["accessors"][base]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": view[0], "componentType": 5123},
        "values": {"bufferView": view[1]},
    }
    document = read_document(file.write(tmp_path / "a.glb"))
    np.testing.assert_allclose(document.accessor(plain, "test"), [[0, 1, 0.2], [1, 0, 0.4]])
    np.testing.assert_allclose(document.accessor(base, "test"), [[0, 0, 0], [1, 2, 3], [0, 0, 0], [4, 5, 6]])


def test_strided_vertices(tmp_path: Path) -> None:
    file = File()
    index = file.accessor(np.arange(12, dtype=np.float32).reshape(3, 4))
    file.tree["accessors"][index] |= {"type": "VEC3", "byteOffset": 4}
    file.tree["bufferViews"][0]["byteStride"] = 16
    document = read_document(file.write(tmp_path / "a.glb"))
    np.testing.assert_allclose(document.accessor(index, "test"), [[1, 2, 3], [5, 6, 7], [9, 10, 11]])


def test_mirrored_mesh_faces_outwards(tmp_path: Path) -> None:
    """Triangles wound the wrong way round are turned."""
    file = build(biped())
    entry = file.tree["accessors"][file.tree["meshes"][0]["primitives"][0]["indices"]]
    start = file.tree["bufferViews"][entry["bufferView"]]["byteOffset"]
    indices = np.frombuffer(bytes(file.data), np.uint16, entry["count"], start).reshape(-1, 3)[:, ::-1]
    file.data[start : start + indices.nbytes] = indices.tobytes()
    file.write(tmp_path / "a.glb")
    archetype = load("a.glb", tmp_path)
    rotation, position = posing.world_transforms(archetype.skeleton, posing.rest_motion(archetype.skeleton))
    corners = posing.skin(archetype.mesh, rotation, position)[archetype.mesh.triangles]
    volume = np.einsum("tc,tc->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert volume > 0
    assert any("inwards" in note for note in archetype.notes)


def test_clip_samples_cover_the_cycle_once(tmp_path: Path) -> None:
    build(biped()).write(tmp_path / "a.glb")
    clip = next(c for c in load("a.glb", tmp_path).clips if c.name == "one")
    assert len(clip.rotation) == round(1.1 * 30)
    assert clip.duration == pytest.approx(1.1, rel=1e-6)
    assert SAMPLES > 8 and np.abs(clip.rotation[0] - clip.rotation[-1]).max() > 1e-3
