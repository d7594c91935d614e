"""What a scene needs, told before anything is compiled: memory and disk, and how deep the characters start."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from crowd.check_gains import gain_warnings
from crowd.drag_error import detail_notes
from crowd.ground_walk import walk_notes
from crowd.scenario_check import recording_bytes
from crowd.scenario_water import WATER_HZ
from crowd.scene import HerdScene, Scene

TILE = 128  # characters are padded to whole tiles
CHUNK = 32  # recorded frames that leave the device at once
CHUNKS = 5  # in memory: being stepped, on the device, unpacked, waiting, being written


@dataclass(frozen=True)
class HerdNeeds:
    """One herd of the scene."""

    herd: HerdScene
    memory: int  # bytes while stepping
    recording: int  # bytes, uncompressed
    depth: float  # m, deepest fluid at the start places

    def __str__(self) -> str:
        kind = self.herd.archetype
        wet = f", starts in {self.depth:.2f} m of fluid" if self.depth > 0 else ""
        return (
            f"{self.herd.name}: {self.herd.count:,} x {kind.name} ({len(kind.legs)} legs, "
            f"{kind.skeleton.count} joints, {len(kind.mesh.triangles):,} triangles, "
            f"{kind.height:.2f} m, {kind.mass:.1f} kg){wet}"
        )


@dataclass(frozen=True)
class Needs:
    """What `crowd check` tells."""

    herds: tuple[HerdNeeds, ...]
    notes: tuple[str, ...]  # what importers were unsure of, gaps in height maps
    warnings: tuple[str, ...] = ()  # gains that are too soft for the drag
    water: tuple[int, int] = (0, 0)  # bytes of a water surface while stepping, and recorded

    @property
    def memory(self) -> int:
        """Bytes while stepping, without the compiled program."""
        return self.water[0] + sum(herd.memory for herd in self.herds)

    @property
    def recording(self) -> int:
        """Bytes of the recording, uncompressed."""
        return self.water[1] + sum(herd.recording for herd in self.herds)


def needs(scene: Scene, frames: int | None = None) -> Needs:
    """Estimates for `frames` frames (the scenario's when None). Compiles nothing."""
    count = scene.scenario.frame_count if frames is None else frames
    seconds = count / scene.scenario.rate_hz
    notes = [*scene.terrain.notes]
    ways = {herd.name: _way(herd, seconds) for herd in scene.herds}
    notes += walk_notes(scene.terrain, ways)
    for herd in scene.herds:
        notes += [f"{herd.name}: {note}" for note in (*herd.archetype.notes, *herd.notes)]
    notes += detail_notes(scene)
    warnings = gain_warnings(scene, {herd.name: _places(herd, ways[herd.name]) for herd in scene.herds})
    herds = tuple(_needs(scene, herd, count) for herd in scene.herds)
    return Needs(herds, tuple(dict.fromkeys(notes)), tuple(warnings), _water(scene, seconds))


def _water(scene: Scene, seconds: float) -> tuple[int, int]:
    """Bytes of a water surface while stepping (its state, about as much again in a frame, a chunk of heights on the
    device and on the host), and of its recorded heights."""
    if scene.water is None:
        return 0, 0
    cells = len(scene.water.x) * len(scene.water.z)
    state = 4 * cells * (1 + 2 + 2)  # height, flow, spectrum
    return 2 * state + 2 * 4 * cells * CHUNK, 4 * cells * math.ceil(seconds * WATER_HZ)


def _places(herd: HerdScene, way: np.ndarray) -> np.ndarray:
    """Points [k, 2] (x, z) that characters of a herd come by. way: the corners [n, m, 2] of `_way`."""
    some = way[:: max(1, len(way) // 64)]
    share = np.linspace(0.0, 1.0, 65)[:, None, None]
    legs = [a + (b - a) * share for a, b in zip(some.swapaxes(0, 1)[:-1], some.swapaxes(0, 1)[1:], strict=True)]
    found = [way.reshape(-1, 2), *(leg.reshape(-1, 2) for leg in legs)]
    found += [herd.curve.points] if herd.curve is not None else []
    found += [herd.track.place.reshape(-1, 2)] if herd.track is not None else []
    return np.concatenate(found)


def _way(herd: HerdScene, seconds: float) -> np.ndarray:
    """Corners [n, m, 2] (x, z) of the way that every character means to go; events are not looked at."""
    start, model, reach = herd.points, herd.model, seconds * herd.speed
    if model.waypoints is not None:
        offset = start - start.mean(0) if model.waypoints.keep_formation else np.zeros_like(start)
        corners, gone = [start], np.zeros(herd.count)
        for point in model.waypoints.points_m:
            step = np.array(point) + offset - corners[-1]
            length = np.hypot(*step.T)
            left = np.clip(model.waypoints.speed_m_s * reach - gone, 0.0, length)
            corners.append(corners[-1] + step * (left / np.maximum(length, 1e-9))[:, None])
            gone = gone + length
        return np.stack(corners, 1)
    if model.velocity_m_s is not None:
        way = np.array(model.velocity_m_s) * np.ones((herd.count, 1))
    else:
        way = (model.speed_m_s or 0.0) * np.stack([np.sin(herd.headings), np.cos(herd.headings)], 1)
    return np.stack([start, start + way * reach[:, None]], 1)


def _needs(scene: Scene, herd: HerdScene, frames: int) -> HerdNeeds:
    archetype, scenario = herd.archetype, scene.scenario
    joints, legs, moving = archetype.skeleton.count, len(archetype.legs), len(herd.moving)
    recorded = math.ceil(frames / (scenario.rate_hz // scenario.record.rate_hz))
    pose = scenario.record.pose
    padded = math.ceil(herd.count / TILE) * TILE
    # Parameters and state of every character, recorded frames on their way to the disk, and one frame of one tile:
    # poses, palette, skinned vertices and the drag of every triangle.
    trajectory = 0 if herd.track is None else 5 * len(herd.track.place)
    lasting = 4 * padded * (100 + 40 * legs + trajectory)
    if herd.model.detail is not None and herd.model.detail.every > 1:  # what is shown lies between two frames
        lasting += 2 * recording_bytes(padded, joints, legs, 1, pose, moving)
    chunk = CHUNKS * recording_bytes(padded, joints, legs, min(recorded, CHUNK), pose, moving)
    tile = 4 * TILE * (24 * joints + 9 * len(herd.drag_mesh.vertices) + 12 * len(herd.drag_mesh.triangles))
    x, z = herd.points.T
    depth = float((scene.surface(x, z) - scene.ground(x, z)).max())
    recording = recording_bytes(herd.count, joints, legs, recorded, pose, moving)
    return HerdNeeds(herd, lasting + chunk + tile, recording, max(depth, 0.0))


def readable(count: int) -> str:
    """Bytes in a fitting unit."""
    value = float(count)
    for unit in ("B", "kB", "MB", "GB"):
        if value < 1000:
            return f"{value:.0f} {unit}" if unit == "B" else f"{value:.1f} {unit}"
        value /= 1000
    return f"{value:.1f} TB"
