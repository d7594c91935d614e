"""Pictures of a run: the skinned crowd at chosen moments, as a whole and from near by."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
from PIL import Image

from crowd import posing
from crowd.recorded_scene import HerdLike, SceneLike, levels_of
from crowd.types import Motion
from crowd.view.camera import Camera, framing
from crowd.view.geometry import Body, Geometry, Level
from crowd.view.loads import loads_at
from crowd.view.palette import character_colors
from crowd.view.raster import draw
from crowd.view.relief import relief_at

MOST_TRIANGLES = 1_500_000  # in one picture; of larger crowds an even selection is drawn
GROUP = 6  # characters in a close-up
# Degrees: azimuths from the direction of travel from which the crowd may be seen, and elevations.
WIDE_AZIMUTHS, WIDE_ELEVATION = (40.0, 25.0, 10.0, 55.0, -20.0, -40.0), 17.0
CLOSE_VIEW = (62.0, 9.0)
ASIDE = (75.0, -75.0, 100.0, -100.0, 130.0)  # azimuths for ground that hides the crowd from the others
CLEAR = 0.9  # share of the crowd that has to be seen
WIDE_FOV, CLOSE_FOV = 24.0, 24.0
# Linear colour and clarity (m) by density in kg/m3: water, mud, goo.
FLUIDS = ((1000.0, (0.008, 0.12, 0.23), 1.3), (1840.0, (0.15, 0.085, 0.045), 0.32), (2750.0, (0.09, 0.19, 0.025), 0.45))
NEEDED = ("pose_position", "pose_orientation", "joint_rotation", "joint_translation")


def has_poses(run: Any) -> bool:
    """Whether the run's arrays are enough to draw its characters."""
    return all(name in arrays for arrays in run.herds.values() for name in NEEDED)


def motion_at(herd: HerdLike, arrays: Any, frame: int, people: slice | int = slice(None)) -> Motion:
    """Poses [n] of a herd at a recorded frame."""
    position, orientation, rotation, translation = (np.asarray(arrays[name][frame, people], float) for name in NEEDED)
    return Motion(position, orientation, rotation, translation, np.asarray(herd.scale, float)[people])


def vertices_at(herd: HerdLike, arrays: Any, frame: int, people: slice | int = slice(None)) -> np.ndarray:
    """World vertices [n, V, 3] of a herd's characters at a recorded frame."""
    motion = motion_at(herd, arrays, frame, people)
    rotation, position = posing.world_transforms(herd.archetype.skeleton, motion)
    return posing.skin(herd.archetype.mesh, rotation, position, motion.scale)


def bodies_at(run: Any, scene: SceneLike, frame: int, most: int = MOST_TRIANGLES) -> list[Body]:
    """All herds at a recorded frame, each in its colour; of very large crowds every k-th character."""
    total = sum(herd.count * len(herd.archetype.mesh.triangles) for herd in scene.herds)
    stride = max(1, -(-total // most))
    bodies = []
    for number, herd in enumerate(scene.herds):
        people = slice(0, herd.count, stride)
        vertices = vertices_at(herd, run.herds[herd.name], frame, people)
        color = character_colors(number, herd.count)[people]
        bodies.append(Body(vertices, np.asarray(herd.archetype.mesh.triangles), color))
    return bodies


def surfaces(scene: SceneLike, time: float = 0.0) -> list[Level]:
    """Fluid surfaces of a scene as they are drawn at a time in s, coloured by density."""
    levels: list[Level] = []
    for level in sorted(levels_of(scene), key=lambda each: -each["priority"]):
        density = level["density_kg_m3"] or FLUIDS[0][0]
        _, color, clarity = min(FLUIDS, key=lambda fluid: abs(fluid[0] - density))
        x, z = (tuple(level[axis]) if level[axis] else (-np.inf, np.inf) for axis in ("x", "z"))
        waves = tuple((a, kx, kz, phase - omega * time) for a, kx, kz, omega, phase in level.get("waves", ()))
        levels.append(Level(level["surface_m"], color, x, z, clarity, tuple(levels), waves))
    return levels


def geometry_at(run: Any, scene: SceneLike, frame: int) -> Geometry:
    """Everything to be seen at a recorded frame."""
    time = float(run.time[frame])
    levels = waved(run, surfaces(scene, time), time)
    bodies = [*bodies_at(run, scene, frame), *loads_at(run, scene, frame)]
    return Geometry(bodies, scene.ground, levels, getattr(scene, "terrain", None))


def waved(run: Any, levels: list[Level], time: float) -> list[Level]:
    """The levels, that of the run's water surface with its waves at a moment in s."""
    water = getattr(run, "water", None)
    if water is None or len(water.time) == 0:
        return levels
    x, z = np.array([water.x.mean()]), np.array([water.z.mean()])
    for number, level in enumerate(levels):
        if level.height == water.surface and level.covers(x, z)[0]:
            return [*levels[:number], replace(level, relief=relief_at(water, time)), *levels[number + 1 :]]
    return levels


def travel_azimuth(run: Any, scene: SceneLike, frames: Sequence[int]) -> float:
    """Direction in degrees (0: +z, 90: +x) in which the crowd moves on average; 0 when it stands."""
    desired = [np.asarray(run.herds[herd.name]["desired_velocity"][frame]) for herd in scene.herds for frame in frames]
    mean = np.nanmean(np.concatenate(desired), 0) if desired else np.zeros(3)
    return float(np.degrees(np.arctan2(mean[0], mean[2]))) if np.hypot(mean[0], mean[2]) > 1e-3 else 0.0


def seen(scene: SceneLike, eye: Sequence[float], points: np.ndarray) -> float:
    """Share of the points [P, 3] that no ground hides from the eye."""
    share = np.linspace(0.02, 0.98, 64)[:, None]
    x, y, z = (eye[axis] + (points[:, axis] - eye[axis]) * share for axis in range(3))
    return float(np.mean((scene.ground(x, z) < y).all(0)))


def clear_azimuth(
    run: Any, scene: SceneLike, herds: Sequence[Any], frames: Sequence[int], size: tuple[int, int],
    turns: Sequence[float], view: tuple[float, float], travel: float,
) -> list[float]:  # fmt: skip
    """Those of the azimuths, as turns from the direction of travel, from which the ground hides the herds least.

    view: elevation and field of view, degrees. All turns that always show nearly everybody; when none does, the one of
    them or of ASIDE that shows most at the worst moment.
    """
    up = np.array([0.0, 0.2, 0.0])

    def share(turn: float) -> float:
        shares = []
        for frame in frames:
            points = np.concatenate([np.asarray(run.herds[herd.name]["position"][frame], float) for herd in herds])
            points = points[np.isfinite(points).all(1)][:: max(1, len(points) // 200)] + up
            if len(points):
                shares.append(seen(scene, framing(points, size, travel + turn, *view, 0.04).eye, points))
        return min(shares, default=1.0)

    clear = [turn for turn in turns if share(turn) >= CLEAR]
    return clear or [max((*turns, *ASIDE), key=share)]


def wide_azimuth(run: Any, scene: SceneLike, frames: Sequence[int], size: tuple[int, int], travel: float) -> float:
    """Azimuth in degrees, from the front, from which the smallest herd in the picture of the whole crowd is largest.

    Only of those from which the ground does not hide the crowd.
    """
    frame = frames[len(frames) // 2]
    herds = [np.asarray(run.herds[herd.name]["position"][frame], float) for herd in scene.herds]
    points = np.concatenate(herds)
    turns = clear_azimuth(run, scene, scene.herds, frames, size, WIDE_AZIMUTHS, (WIDE_ELEVATION, WIDE_FOV), travel)

    def size_of_smallest(turn: float) -> float:
        camera = framing(points, size, travel + turn, WIDE_ELEVATION, WIDE_FOV, 0.04)
        return min(1.0 / float(np.nanmedian(camera.view(herd)[:, 2])) for herd in herds)

    return travel + max(turns, key=size_of_smallest)


def close_group(run: Any, scene: SceneLike, herd: HerdLike, frames: Sequence[int]) -> np.ndarray:
    """Numbers of the characters of a herd that a close-up shows: those at the edge towards the camera, together."""
    azimuth = np.radians(travel_azimuth(run, scene, frames) + CLOSE_VIEW[0])
    arrays = run.herds[herd.name]
    alive = np.asarray(arrays["fault"][frames[-1]]) == 0
    position = np.asarray(arrays["position"][frames[len(frames) // 2]], float)[:, [0, 2]]
    alive &= np.isfinite(position).all(1)
    if not alive.any():
        alive[:] = True
        position = np.nan_to_num(position)
    toward = position @ np.array([np.sin(azimuth), np.cos(azimuth)])
    lead = int(np.argmax(np.where(alive, toward, -np.inf)))
    distance = np.where(alive, np.linalg.norm(position - position[lead], axis=1), np.inf)
    return np.sort(np.argsort(distance, kind="stable")[: min(GROUP, int(alive.sum()))])


def clear_view(geometry: Geometry, camera: Camera, points: np.ndarray) -> Geometry:
    """The geometry without characters that stand between the camera and `points` [..., 3]."""
    near = float(np.nanmin(camera.view(points)[..., 2])) - 0.2
    bodies = []
    for body in geometry.bodies:
        keep = camera.view(body.middle)[:, 2] >= near
        carriers = None if body.carriers is None else body.carriers[keep]
        bodies.append(Body(body.vertices[keep], body.triangles, body.color[keep], carriers))
    return Geometry(bodies, geometry.ground, geometry.levels, geometry.terrain)


def nearest_frame(time: np.ndarray, moment: float) -> int:
    """Recorded frame closest to a moment in s."""
    return int(np.argmin(np.abs(np.asarray(time) - moment)))


def crowd_pictures(
    run: Any, scene: SceneLike, moments: Sequence[float], size: tuple[int, int] = (1600, 700), follow: str | None = None
) -> list[tuple[float, Image.Image, Image.Image]]:
    """For each moment in s: its time, the whole crowd and a group from near by.

    follow: name of the herd the close-ups show; default the first one. The close-up is 0.6 as wide. ValueError when the
    run has no poses.
    """
    if not has_poses(run):
        raise ValueError("poses were not recorded")
    frames = sorted({nearest_frame(run.time, moment) for moment in moments})
    herd = next((each for each in scene.herds if each.name == follow), scene.herds[0])
    near_size = (max(size[0] * 3 // 5, 1), size[1])
    azimuth, group = travel_azimuth(run, scene, frames), close_group(run, scene, herd, frames)
    around = wide_azimuth(run, scene, frames, size, azimuth)
    view = CLOSE_VIEW[1], CLOSE_FOV
    beside = azimuth + clear_azimuth(run, scene, [herd], frames, near_size, CLOSE_VIEW[:1], view, azimuth)[0]

    def shot(frame: int) -> tuple[float, Image.Image, Image.Image]:
        geometry = geometry_at(run, scene, frame)
        everybody = np.concatenate([body.vertices.reshape(-1, 3) for body in geometry.bodies])
        wide = framing(everybody, size, around, WIDE_ELEVATION, WIDE_FOV, margin=0.04)
        some = np.concatenate([vertices_at(herd, run.herds[herd.name], frame, slice(k, k + 1)) for k in group.tolist()])
        near = framing(some, near_size, beside, CLOSE_VIEW[1], CLOSE_FOV, margin=0.07)
        close = clear_view(geometry, near, some.mean(1))
        return float(run.time[frame]), draw(geometry, wide, size), draw(close, near, near_size)

    workers = min(len(frames), 4, os.cpu_count() or 1)
    with ThreadPoolExecutor(max(workers, 1)) as pool:
        return list(pool.map(shot, frames))
