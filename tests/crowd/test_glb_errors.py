"""Bad glTF files and rig descriptions: one clear message that names the file and the place, never a traceback."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crowd.characters import load
from crowd.characters.description import parse
from crowd.errors import InputError
from tests.crowd.glb_writer import SAMPLES, File, biped, breathing, build, turn

GOOD = build(biped())


def fresh() -> File:
    """A good file to spoil."""
    return File(json.loads(json.dumps(GOOD.tree)), bytearray(GOOD.data))


def patched(change: Callable[[File], Any]) -> bytes:
    file = fresh()
    change(file)
    return file.glb()


def primitive(file: File) -> dict[str, Any]:
    return file.tree["meshes"][0]["primitives"][0]


def accessor_of(file: File, key: str) -> dict[str, Any]:
    return file.tree["accessors"][primitive(file)["attributes"][key]]


def overwrite(file: File, accessor: dict[str, Any], values: np.ndarray) -> None:
    start = file.tree["bufferViews"][accessor["bufferView"]]["byteOffset"]
    file.data[start : start + values.nbytes] = values.tobytes()


def nan_position(file: File) -> None:
    overwrite(file, accessor_of(file, "POSITION"), np.full(3, np.nan, np.float32))


def zero_weights(file: File) -> None:
    overwrite(file, accessor_of(file, "WEIGHTS_0"), np.zeros((accessor_of(file, "WEIGHTS_0")["count"], 4), np.float32))


def far_joint(file: File) -> None:
    overwrite(file, accessor_of(file, "JOINTS_0"), np.array([99, 0, 0, 0], np.uint16))


def far_index(file: File) -> None:
    overwrite(file, file.tree["accessors"][primitive(file)["indices"]], np.array([60000], np.uint16))


def one_frame(file: File) -> None:
    for animation in file.tree["animations"]:
        for sampler in animation["samplers"]:
            for key in ("input", "output"):
                file.tree["accessors"][sampler[key]]["count"] = 1


def backwards_times(file: File) -> None:
    sampler = file.tree["animations"][0]["samplers"][0]
    overwrite(file, file.tree["accessors"][sampler["input"]], np.linspace(1, 0, SAMPLES).astype(np.float32))


def singular_bind(file: File) -> None:
    index = file.tree["skins"][0]["inverseBindMatrices"]
    overwrite(file, file.tree["accessors"][index], np.zeros(16, np.float32))


def short_bone(file: File) -> None:
    """The knee lies in the hip."""
    names = [node.get("name") for node in file.tree["nodes"]]
    file.tree["nodes"][names.index("b1")]["translation"] = [0, 0, 0]
    file.tree["nodes"][names.index("c1")]["translation"] = [0, -0.76, 0]


def no_skin(file: File) -> None:
    file.tree.pop("skins")
    for node in file.tree["nodes"]:
        node.pop("skin", None)


def joint_cycle(file: File) -> None:
    """The head holds the root of the skeleton."""
    next(node for node in file.tree["nodes"] if node.get("name") == "Armature")["children"] = []
    file.tree["nodes"][2]["children"] = [0]


def flat_mesh(file: File) -> None:
    overwrite(file, accessor_of(file, "POSITION"), np.ones((accessor_of(file, "POSITION")["count"], 3), np.float32))


def only_idle() -> bytes:
    rig = biped()
    rig.clips = {"calm": breathing(rig, 1)}
    return build(rig).glb()


def no_legs() -> bytes:
    rig = biped()
    still = [rig.joint(f"extra{k}", 0, (0, 1.0 + 0.01 * k, 0)) for k in range(2)]
    rig.boxes = []
    rig.box((-0.1, 0.0, -0.1), (0.1, 0.2, 0.1), still[0])
    rig.box((-0.1, 1.0, -0.1), (0.1, 1.7, 0.1), still[1])
    rig.clips["wag"] = (1.0, {still[0]: turn((0, 1, 0), 0.3 * np.sin(np.linspace(0, 2 * np.pi, SAMPLES)))}, {})
    return build(rig).glb()


def setter(*path: Any, value: Any) -> Callable[[File], None]:
    """Sets one place of the JSON tree."""

    def change(file: File) -> None:
        here: Any = file.tree
        for key in path[:-1]:
            here = here[key]
        here[path[-1]] = value

    return change


CASES: dict[str, tuple[Callable[[], bytes], list[str]]] = {
    "empty file": (lambda: b"", ["empty"]),
    "only a header": (lambda: GOOD.glb()[:12], ["truncated GLB"]),
    "half a file": (lambda: GOOD.glb()[: len(GOOD.glb()) // 2], ["truncated GLB", "bytes"]),
    "wrong magic": (lambda: b"GLTF" + GOOD.glb()[4:], ["not a GLB file", "glTF"]),
    "version 1": (lambda: GOOD.glb()[:4] + b"\x01\0\0\0" + GOOD.glb()[8:], ["version 1"]),
    "not JSON": (lambda: GOOD.glb().replace(b'{"asset"', b'{"asset\0', 1), ["JSON", "cannot be parsed"]),
    "no asset": (lambda: patched(lambda f: f.tree.pop("asset")), ["no 'asset'"]),
    "glTF 1.0": (lambda: patched(setter("asset", "version", value="1.0")), ["asset.version", "1.0"]),
    "nodes no array": (lambda: patched(setter("nodes", value={"a": 1})), ["nodes must be an array"]),
    "no nodes": (lambda: patched(setter("nodes", value=[])), ["no nodes"]),
    "too many nodes": (lambda: patched(setter("nodes", value=[{}] * 5000)), ["5000 nodes", "at most"]),
    "Draco": (
        lambda: patched(setter("extensionsRequired", value=["KHR_draco_mesh_compression"])),
        ["KHR_draco_mesh_compression", "not supported"],
    ),
    "accessor out of range": (
        lambda: patched(lambda f: primitive(f)["attributes"].update(POSITION=9999)),
        ["mesh 0 primitive 0 POSITION", "9999"],
    ),
    "accessor past its view": (
        lambda: patched(lambda f: accessor_of(f, "POSITION").update(count=10_000)),
        ["accessor 0", "bufferView"],
    ),
    "accessor of 10**9": (
        lambda: patched(lambda f: accessor_of(f, "POSITION").update(count=10**9)),
        ["accessor 0", "count 1000000000"],
    ),
    "accessor negative offset": (
        lambda: patched(lambda f: accessor_of(f, "POSITION").update(byteOffset=-4)),
        ["accessor 0", "byteOffset is -4"],
    ),
    "accessor odd type": (lambda: patched(lambda f: accessor_of(f, "POSITION").update(type="VEC9")), ["VEC9"]),
    "accessor odd component": (
        lambda: patched(lambda f: accessor_of(f, "POSITION").update(componentType=7)),
        ["componentType 7"],
    ),
    "view past the buffer": (
        lambda: patched(setter("bufferViews", 0, "byteLength", value=10**7)),
        ["bufferView 0", "outside buffer 0"],
    ),
    "view missing": (lambda: patched(lambda f: accessor_of(f, "POSITION").update(bufferView=77)), ["accessor 0", "77"]),
    "buffer too short": (lambda: patched(setter("buffers", 0, "byteLength", value=10**8)), ["buffer 0", "only"]),
    "buffer outside": (
        lambda: patched(setter("buffers", 0, "uri", value="../../secret.bin")),
        ["buffer 0", "outside the asset's folder"],
    ),
    "buffer absolute": (lambda: patched(setter("buffers", 0, "uri", value="/etc/passwd")), ["outside the asset's"]),
    "buffer encoded escape": (
        lambda: patched(setter("buffers", 0, "uri", value="%2e%2e/x.bin")),
        ["outside the asset"],
    ),
    "buffer remote": (lambda: patched(setter("buffers", 0, "uri", value="http://a/b.bin")), ["not fetched"]),
    "buffer not there": (lambda: patched(setter("buffers", 0, "uri", value="gone.bin")), ["gone.bin", "not found"]),
    "buffer bad base64": (
        lambda: patched(setter("buffers", 0, "uri", value="data:x;base64,###")),
        ["cannot be decoded"],
    ),
    "node is its own child": (lambda: patched(setter("nodes", 3, "children", value=[3])), ["cycle", "node 3"]),
    "joint cycle": (lambda: patched(joint_cycle), ["cycle in the node tree", "j0"]),
    "child out of range": (lambda: patched(setter("nodes", 3, "children", value=[999])), ["node 3 children", "999"]),
    "child of two": (lambda: patched(setter("nodes", 3, "children", value=[1])), ["already a child"]),
    "zero quaternion": (lambda: patched(setter("nodes", 3, "rotation", value=[0, 0, 0, 0])), ["node 3", "zero quat"]),
    "translation of text": (
        lambda: patched(setter("nodes", 3, "translation", value=["a", 0, 0])),
        ["3 finite numbers"],
    ),
    "no skin": (lambda: patched(no_skin), ["no skin"]),
    "skin without joints": (lambda: patched(setter("skins", 0, "joints", value=[])), ["skin 0", "no joints"]),
    "skin joint missing": (lambda: patched(setter("skins", 0, "joints", 0, value=500)), ["skin 0 joint 0", "500"]),
    "skin joint twice": (lambda: patched(setter("skins", 0, "joints", 0, value=1)), ["listed twice"]),
    "skin of a node missing": (lambda: patched(setter("nodes", -1, "skin", value=8)), ["skin", "8"]),
    "singular bind matrix": (lambda: patched(singular_bind), ["cannot be inverted", "j0"]),
    "weights all zero": (lambda: patched(zero_weights), ["weights", "zero"]),
    "weights missing": (lambda: patched(lambda f: primitive(f)["attributes"].pop("WEIGHTS_0")), ["no WEIGHTS_0"]),
    "positions missing": (lambda: patched(lambda f: primitive(f)["attributes"].pop("POSITION")), ["no POSITION"]),
    "joint index too high": (lambda: patched(far_joint), ["bound to joint 99"]),
    "vertex index too high": (lambda: patched(far_index), ["vertex 60000 is out of range"]),
    "NaN position": (lambda: patched(nan_position), ["accessor 0", "not finite"]),
    "all vertices in one place": (lambda: patched(flat_mesh), ["bad.glb"]),
    "primitive mode": (lambda: patched(lambda f: primitive(f).update(mode=12)), ["mode 12"]),
    "no animation": (lambda: patched(lambda f: f.tree.pop("animations")), ["no animation"]),
    "clips of one frame": (lambda: patched(one_frame), ["one frame", "two"]),
    "key times fall": (lambda: patched(backwards_times), ["animation 0 channel 0", "do not increase"]),
    "odd interpolation": (
        lambda: patched(setter("animations", 0, "samplers", 0, "interpolation", value="BOUNCE")),
        ["BOUNCE"],
    ),
    "sampler missing": (
        lambda: patched(setter("animations", 0, "channels", 0, "sampler", value=44)),
        ["animation 0 channel 0", "44"],
    ),
    "target missing": (
        lambda: patched(setter("animations", 0, "channels", 0, "target", "node", value=444)),
        ["animation 0 channel 0", "444"],
    ),
    "zero-length bone": (lambda: patched(short_bone), ["no legs found", "'b1'", "a bone of no length"]),
    "stands only": (only_idle, ["no clip walks or runs", "calm"]),
    "nothing to stand on": (no_legs, ["no legs found", "legs"]),
}


@pytest.mark.parametrize("name", CASES)
def test_bad_glb(name: str, tmp_path: Path) -> None:
    make, expected = CASES[name]
    (tmp_path / "bad.glb").write_bytes(make())
    with pytest.raises(InputError) as caught:
        load("bad.glb", tmp_path)
    message = str(caught.value)
    assert "bad.glb" in message
    for part in expected:
        assert part in message, message
    assert len(caught.value.problems) <= 2


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone\.glb: file not found"):
        load("gone.glb", tmp_path)


def test_folder_for_a_file(tmp_path: Path) -> None:
    (tmp_path / "folder.glb").mkdir()
    with pytest.raises(InputError, match="is not a file"):
        load("folder.glb", tmp_path)


@pytest.mark.parametrize(("reference", "hint"), [("humen", "did you mean 'human'"), ("horse.obj", r"\.glb")])
def test_unknown_reference(reference: str, hint: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=hint):
        load(reference, tmp_path)


def test_text_gltf_with_data_uri_loads(tmp_path: Path) -> None:
    file = fresh()
    file.tree["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(file.data).decode()
    (tmp_path / "ok.gltf").write_text(json.dumps(file.tree))
    assert len(load("ok.gltf", tmp_path).legs) == 2


def test_text_gltf_with_buffer_beside_it_loads(tmp_path: Path) -> None:
    file = fresh()
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "a b.bin").write_bytes(bytes(file.data))
    file.tree["buffers"][0]["uri"] = "parts/a%20b.bin"
    (tmp_path / "ok.gltf").write_text(json.dumps(file.tree))
    assert len(load("ok.gltf", tmp_path).legs) == 2


LEG = {"hip": "a1", "knee": "b1", "ankle": "c1"}
DESCRIPTIONS: dict[str, tuple[dict[str, Any], list[str]]] = {
    "unknown key": ({"legz": []}, ["did you mean 'legs'"]),
    "unknown key in a leg": ({"legs": [{**LEG, "anle": "c1"}]}, ["legs[0].anle", "did you mean 'ankle'"]),
    "joint misspelt": ({"pelvis": "j00"}, ["pelvis", "no joint 'j00'", "did you mean 'j0'"]),
    "joints misspelt in two legs": (
        {"legs": [{**LEG, "hip": "a11"}, {**LEG, "knee": "bb-1"}]},
        ["legs[0].hip", "legs[1].knee"],
    ),
    "leg upside down": ({"legs": [{"hip": "c1", "knee": "b1", "ankle": "a1"}]}, ["does not hang below"]),
    "leg without a bone": ({"legs": [{"hip": "a1", "knee": "a1", "ankle": "c1"}]}, ["legs[0].knee"]),
    "no legs listed": ({"legs": []}, ["empty"]),
    "arm in disorder": ({"arms": [{"shoulder": "g1", "elbow": "f1", "hand": "e1"}]}, ["arms[0]", "below each other"]),
    "unknown clip": ({"clips": {"walk": "onne"}}, ["no clip 'onne'", "did you mean 'one'"]),
    "negative height": ({"height_m": -1}, ["height_m", "-1"]),
    "NaN unit": ({"metres_per_unit": float("nan")}, ["metres_per_unit"]),
    "unknown axis": ({"up": "y"}, ["up", "+y"]),
    "forward along up": ({"up": "+y", "forward": "-y"}, ["forward"]),
    "attached to itself": ({"attach": {"a1": "d1"}}, ["attach.a1", "hangs from"]),
    "attached to nothing": ({"attach": {"a1": "nothing"}}, ["no joint 'nothing'"]),
}


@pytest.mark.parametrize("name", DESCRIPTIONS)
def test_bad_description(name: str, tmp_path: Path) -> None:
    data, expected = DESCRIPTIONS[name]
    GOOD.write(tmp_path / "good.glb")
    with pytest.raises(InputError) as caught:
        load("good.glb", tmp_path, data)
    message = str(caught.value)
    assert "good.glb" in message
    for part in expected:
        assert part in message, message


def test_description_file_names_line(tmp_path: Path) -> None:
    GOOD.write(tmp_path / "good.glb")
    (tmp_path / "rig.yaml").write_text("asset: good.glb\n\nheight: 1.8\n")
    with pytest.raises(InputError, match=r"rig\.yaml:3 height: unknown key 'height' \(did you mean 'height_m'"):
        load("rig.yaml", tmp_path)


def test_description_without_asset(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text("height_m: 1.8\n")
    with pytest.raises(InputError, match=r"rig\.yaml asset"):
        load("rig.yaml", tmp_path)


def test_description_of_a_description(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text("asset: rig.yaml\n")
    with pytest.raises(InputError, match="no character file"):
        load("rig.yaml", tmp_path)


def test_parse_keeps_a_good_description() -> None:
    assert parse({"clips": {"walk": "one"}}, "x").clips.walk == ["one"]


def test_described_bone_of_no_length(tmp_path: Path) -> None:
    (tmp_path / "bad.glb").write_bytes(patched(short_bone))
    legs = [LEG, {"hip": "a-1", "knee": "b-1", "ankle": "c-1"}]
    with pytest.raises(InputError, match="the bone from hip 'a1' to knee 'b1' has length 0"):
        load("bad.glb", tmp_path, {"legs": legs})


JUNK: list[Any] = [None, -1, 0, 3, 10**6, 10**12, "x", [], {}, [1], True, 1.5, float("nan"), [0, 0, 0], [[1]], "../x"]


def _spoil(tree: Any, rng: np.random.Generator) -> None:
    """Replaces or removes one value somewhere in a JSON tree."""
    here = tree
    while True:
        keys = list(here) if isinstance(here, dict) else list(range(len(here)))
        key = keys[rng.integers(len(keys))]
        if isinstance(here[key], dict | list) and here[key] and rng.random() < 0.85:
            here = here[key]
        elif rng.random() < 0.2:
            here.pop(key)
            return
        else:
            here[key] = JUNK[rng.integers(len(JUNK))]
            return


@pytest.mark.parametrize("seed", range(40))
def test_spoiled_files_load_or_tell(seed: int, tmp_path: Path) -> None:
    """Whatever is wrong, it is told as an InputError, or it did not matter."""
    rng = np.random.default_rng(seed)
    file = fresh()
    if seed % 4:
        _spoil(file.tree, rng)
    else:
        for start in rng.integers(0, len(file.data) - 4, 20):
            file.data[start : start + 4] = rng.bytes(4)
    (tmp_path / "bad.glb").write_bytes(file.glb())
    try:
        load("bad.glb", tmp_path)
    except InputError as error:
        assert "bad.glb" in str(error)
