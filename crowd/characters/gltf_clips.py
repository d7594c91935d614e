"""Animations of a glTF file as uniform samples of every node: step, linear and cubic spline interpolation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowd.characters.glb import Document, objects
from crowd.characters.gltf_nodes import NodeTree, global_transforms
from crowd.errors import fail
from crowd.posing import matrix

MIN_RATE_HZ, MAX_RATE_HZ = 30.0, 60.0
MIN_INTERVALS, MAX_INTERVALS = 16, 6000
_WIDTHS = {"translation": 3, "rotation": 4, "scale": 3}


@dataclass(frozen=True, eq=False)
class Track:
    """Keys of one property of one node."""

    node: int
    path: str  # translation | rotation (xyzw) | scale
    times: np.ndarray  # [K] s, strictly increasing
    values: np.ndarray  # [K, C]; CUBICSPLINE: [K, 3, C] in-tangent, value, out-tangent
    interpolation: str


@dataclass(frozen=True, eq=False)
class Animation:
    name: str
    tracks: tuple[Track, ...]

    @property
    def span(self) -> tuple[float, float]:
        """First and last key time in s."""
        return min(float(t.times[0]) for t in self.tracks), max(float(t.times[-1]) for t in self.tracks)


def read_animations(document: Document, tree: NodeTree) -> tuple[list[Animation], list[str]]:
    """Animations that move at least one node, and notes on what was left out (morph targets)."""
    animations: list[Animation] = []
    notes: list[str] = []
    taken: set[str] = set()
    for index, entry in enumerate(document.items("animations")):
        name = str(entry.get("name") or f"clip {index}")
        while name in taken:
            name = f"{name} ({index})"
        taken.add(name)
        tracks = _tracks(document, tree, entry, index)
        if any(c.get("target", {}).get("path") == "weights" for c in entry["channels"] if isinstance(c, dict)):
            notes.append(f"clip '{name}': morph target weights are ignored")
        if tracks:
            animations.append(Animation(name, tuple(tracks)))
    return animations, notes


def _tracks(document: Document, tree: NodeTree, entry: dict, index: int) -> list[Track]:
    place = f"animation {index}"
    samplers = objects(document, entry, "samplers", place)
    tracks: list[Track] = []
    entry.setdefault("channels", [])
    for number, channel in enumerate(objects(document, entry, "channels", place)):
        here = f"{place} channel {number}"
        target = channel.get("target")
        if not isinstance(target, dict):
            raise fail(document.where(here), "has no target")
        path = target.get("path")
        if path == "weights" or "node" not in target:
            continue
        if not isinstance(path, str) or path not in _WIDTHS:
            raise fail(document.where(here), f"path {path!r}; allowed: {', '.join(_WIDTHS)}, weights")
        document.item("nodes", target["node"], here)
        sampler = channel.get("sampler")
        if not isinstance(sampler, int) or not 0 <= sampler < len(samplers):
            raise fail(document.where(here), f"sampler {sampler!r} out of range; the animation has {len(samplers)}")
        tracks.append(_track(document, samplers[sampler], target["node"], path, here))
    return tracks


def _track(document: Document, sampler: dict, node: int, path: str, place: str) -> Track:
    where = document.where(place)
    interpolation = sampler.get("interpolation", "LINEAR")
    if interpolation not in ("LINEAR", "STEP", "CUBICSPLINE"):
        raise fail(where, f"interpolation {interpolation!r}; allowed: LINEAR, STEP, CUBICSPLINE")
    times = document.accessor(sampler.get("input"), f"{place} input", "SCALAR")[:, 0].astype(np.float64)
    shape = "VEC4" if path == "rotation" else "VEC3"
    values = document.accessor(sampler.get("output"), f"{place} output", shape).astype(np.float64)
    if len(times) > 1 and np.any(np.diff(times) <= 0):
        raise fail(where, f"key times do not increase at key {int(np.argmax(np.diff(times) <= 0)) + 1}")
    expected = len(times) * (3 if interpolation == "CUBICSPLINE" else 1)
    if len(values) != expected:
        raise fail(where, f"{len(values)} output values for {len(times)} key times; must be {expected}")
    if interpolation == "CUBICSPLINE":
        values = values.reshape(len(times), 3, -1)
    return Track(node, path, times, values, interpolation)


def sample(track: Track, times: np.ndarray) -> np.ndarray:
    """Values [F, C] at `times`, held before the first and after the last key; rotations unit, xyzw."""
    keys = track.times
    if len(keys) == 1:
        values = np.repeat(track.values if track.interpolation != "CUBICSPLINE" else track.values[:, 1], len(times), 0)
    else:
        after = np.clip(np.searchsorted(keys, times, side="right"), 1, len(keys) - 1)
        before = after - 1
        step = keys[after] - keys[before]
        u = np.clip((times - keys[before]) / step, 0.0, 1.0)[:, None]
        if track.interpolation == "STEP":
            values = np.where(u >= 1.0, track.values[after], track.values[before])
        elif track.interpolation == "CUBICSPLINE":
            values = _hermite(track.values[before], track.values[after], u, step[:, None])
        elif track.path == "rotation":
            values = _slerp(track.values[before], track.values[after], u)
        else:
            values = (1 - u) * track.values[before] + u * track.values[after]
    if track.path == "rotation":
        size = np.linalg.norm(values, axis=1, keepdims=True)
        values = np.where(size > 1e-9, values / np.maximum(size, 1e-9), np.array([0.0, 0.0, 0.0, 1.0]))
    return values


def _hermite(before: np.ndarray, after: np.ndarray, u: np.ndarray, step: np.ndarray) -> np.ndarray:
    start, leave = before[:, 1], before[:, 2] * step
    end, arrive = after[:, 1], after[:, 0] * step
    u2, u3 = u * u, u * u * u
    return (2 * u3 - 3 * u2 + 1) * start + (u3 - 2 * u2 + u) * leave + (3 * u2 - 2 * u3) * end + (u3 - u2) * arrive


def _slerp(before: np.ndarray, after: np.ndarray, u: np.ndarray) -> np.ndarray:
    dot = np.sum(before * after, 1, keepdims=True)
    after = np.where(dot < 0, -after, after)
    angle = np.arccos(np.clip(np.abs(dot), 0.0, 1.0))
    sine = np.sin(angle)
    near = sine < 1e-4
    safe = np.where(near, 1.0, sine)
    first = np.where(near, 1 - u, np.sin((1 - u) * angle) / safe)
    second = np.where(near, u, np.sin(u * angle) / safe)
    return first * before + second * after


def sample_times(animation: Animation) -> np.ndarray:
    """Uniform sample times [F] over the animation, both ends included, at its own key rate within 30 to 60 Hz."""
    start, end = animation.span
    gaps = [np.median(np.diff(track.times)) for track in animation.tracks if len(track.times) > 2]
    rate = np.clip(1.0 / min(gaps), MIN_RATE_HZ, MAX_RATE_HZ) if gaps else MIN_RATE_HZ
    intervals = int(np.clip(round((end - start) * rate), MIN_INTERVALS, MAX_INTERVALS))
    return np.linspace(start, end, intervals + 1)


def pose(tree: NodeTree, animation: Animation, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Global linear maps, rotations and positions of all nodes at `times` (see `global_transforms`)."""
    count = len(times)
    translation = np.tile(tree.translation, (count, 1, 1))
    rotation = np.tile(tree.rotation, (count, 1, 1))
    scale = np.tile(tree.scale, (count, 1, 1))
    linear = np.tile(tree.linear, (count, 1, 1, 1))
    moved: set[int] = set()
    for track in animation.tracks:
        values = sample(track, times)
        if track.path == "translation":
            translation[:, track.node] = values
            continue
        moved.add(track.node)
        if track.path == "rotation":
            rotation[:, track.node] = np.roll(values, 1, axis=1)
        else:
            scale[:, track.node] = np.where(np.abs(values) < 1e-6, tree.scale[track.node], values)
    for node in moved:
        linear[:, node] = matrix(rotation[:, node]) * scale[:, node, None, :]
    return global_transforms(tree, translation, rotation, linear)
