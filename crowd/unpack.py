"""From tiles on a device to the arrays users see: [time, character, ..., component], padding removed."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import jax
import numpy as np

from crowd.layout import Layout
from crowd.scene import HerdScene
from crowd.state import StrideFrame


class Unpacked(Mapping[str, np.ndarray]):
    """Arrays by name, some of them made whenever they are asked for and not kept."""

    def __init__(
        self,
        arrays: dict[str, np.ndarray],
        made: dict[str, Callable[[], np.ndarray]],
        parts: dict[str, Callable[[], list[np.ndarray]]],
    ):
        self._arrays, self._made, self._parts = arrays, made, parts

    def __getitem__(self, name: str) -> np.ndarray:
        return self._made[name]() if name in self._made else self._arrays[name]

    def __contains__(self, name: object) -> bool:
        return name in self._arrays or name in self._made  # a mapping's own way makes the array

    def __iter__(self) -> Iterator[str]:
        return itertools.chain(self._arrays, self._made)

    def __len__(self) -> int:
        return len(self._arrays) + len(self._made)

    def parts(self, name: str) -> list[np.ndarray]:
        """An array's characters in pieces one after the other, which are no copies where it still lies in tiles."""
        return self._parts[name]() if name in self._parts else [self[name]]


def unpacked(herd: HerdScene, layout: Layout, which: int, shown: Sequence[Any], recorded: int) -> Unpacked:
    """Users' arrays [time, character, ..., component] of one herd, padding removed. shown: of each device.

    In memory characters stay last, as on the device: a recording lies on disk like that, and one copy is enough. Poses
    are made one by one when asked for: together they are most of a recording, and memory that is used again is faster.
    """
    rotations = [np.asarray(frame.joint_rotation) for _, frame in shown]
    shown = [(slim, dataclasses.replace(frame, joint_rotation=())) for slim, frame in shown]
    slim, frame = jax.tree.map(lambda *leaves: _untiled(leaves, recorded, herd.count), *shown)
    flat = _level(slim["velocity"])
    out = dict(
        position=slim["position"],
        velocity=flat,
        yaw=slim["yaw"],
        pitch=slim["pitch"],
        desired_velocity=_level(slim["desired"]),
        phase=slim["phase"],
        drag_force=frame.drag_force,
        drag_torque=frame.drag_torque,
        center_of_pressure=frame.center_of_pressure,
        drag_power=-np.sum(frame.drag_force * flat, -1),
        depth=frame.depth,
        fault=slim["fault"],
        contact=frame.planted,
        handle=frame.handle,
        ball=frame.ball,
        ankle=frame.ankle,
        over_reach=frame.over_reach,
        pose_position=frame.pose_position,
        pose_orientation=frame.pose_orientation,
    )
    if frame.apparent_weight is not None:
        out["apparent_weight"] = frame.apparent_weight
    if "gear" in slim:
        out["gear"] = slim["gear"].astype(np.int8)
    if frame.strides is not None:
        out |= _strides(slim, frame.strides, layout.record_pose)
    if not layout.record_pose:
        return Unpacked(out, {}, {})
    rest, moving = herd.archetype.skeleton.rest_translation, layout.herds[which].moving
    translation = out["moving_translation"] = frame.joint_translation
    made = dict(
        joint_rotation=lambda: _untiled(rotations, recorded, herd.count),
        joint_translation=lambda: _translations(rest, moving, translation),
    )
    return Unpacked(out, made, dict(joint_rotation=lambda: _tiles(rotations, recorded, herd.count)))


def _strides(slim: dict[str, np.ndarray], frame: StrideFrame, footprints: bool) -> dict[str, np.ndarray]:
    """What the semi-procedural system shows."""
    out = dict(
        heel=frame.heel,
        toe=frame.toe,
        cycle_time=slim["gait_time"],
        cycle_designated=slim["gait_designated"],
        parked=slim["gait_parked"],
        foot_phase=slim["gait_phase"],
        steps=slim["gait_steps"],
        weights=frame.weights,
        alignment=frame.alignment,
    )
    if footprints:
        out |= dict(
            footprint_from=slim["gait_from_position"],
            footprint_from_direction=_sole(*(slim[f"gait_from_{part}"] for part in ("foot", "yaw", "normal"))),
            footprint_to=slim["gait_to_position"],
            footprint_to_direction=_sole(*(slim[f"gait_to_{part}"] for part in ("foot", "yaw", "normal"))),
            footprint_goal=slim["gait_goal"],
        )
    return {name: np.asarray(values) for name, values in out.items()}


def _sole(foot: np.ndarray, yaw: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """[..., 3] from heel end to toe end of a print: `kernels.footprint.Footprint.sole` on the host."""
    x, z = np.moveaxis(foot, -1, 0)
    sin, cos = np.sin(yaw), np.cos(yaw)
    x, z = x * cos + z * sin, z * cos - x * sin
    nx, ny, nz = np.moveaxis(normal, -1, 0)
    along = nx * x + nz * z
    return _last([x - nx * along / (1.0 + ny), -along, z - nz * along / (1.0 + ny)])


def _level(velocity: np.ndarray) -> np.ndarray:
    """[t, n, 3] of (x, z) [t, n, 2]."""
    x, z = np.moveaxis(velocity, -1, 0)
    return _last([x, np.zeros_like(x), z])


def _translations(rest: np.ndarray, moving: tuple[int, ...], translation: np.ndarray) -> np.ndarray:
    """[t, n, J, 3] of all joints: at rest [J, 3] but for the moving ones [t, n, moving, 3]."""
    frames, people = translation.shape[:2]
    out = np.empty((frames, 3, len(rest), people), np.float32)
    out[:] = rest.T[:, :, None]
    out[:, :, list(moving)] = translation.transpose(0, 3, 2, 1)
    return out.transpose(0, 3, 2, 1)


def _last(components: Sequence[np.ndarray]) -> np.ndarray:
    """Components along a last axis; in memory they follow time, characters last."""
    first = components[0]
    out = np.empty((len(first), len(components), *first.shape[:0:-1]), first.dtype)
    for number, component in enumerate(components):
        out[:, number] = component.transpose(0, *range(component.ndim - 1, 0, -1))
    return out.transpose(0, *range(out.ndim - 1, 0, -1))


def _tiles(leaves: Sequence[np.ndarray], recorded: int, count: int) -> list[np.ndarray]:
    """Views [t, 128, *components last] of each tile of [tiles, t, *components first, 128] of each device, unpadded."""
    tiles = [tile[:recorded].transpose(0, *range(tile.ndim - 1, 0, -1)) for leaf in leaves for tile in leaf]
    first = np.cumsum([0, *(tile.shape[1] for tile in tiles)])
    return [tile[:, : count - at] for tile, at in zip(tiles, first, strict=False) if at < count]


def _untiled(leaves: Sequence[Any], recorded: int, count: int) -> np.ndarray:
    """[tiles, t, *components first*, 128] of each device to [t, n, *components last*], the first `recorded` of t.

    The copy moves rows of 128 characters; components come last in a view of it.
    """
    parts = [np.asarray(leaf)[:, :recorded] for leaf in leaves]
    _, frames, *middle, width = parts[0].shape
    out = np.empty((frames, *middle, sum(map(len, parts)), width), parts[0].dtype)
    first = 0
    for part in parts:
        out[..., first : first + len(part), :] = np.moveaxis(part, 0, -2)
        first += len(part)
    flat = out.reshape(frames, *middle, first * width)[..., :count]
    return flat.transpose(0, *range(flat.ndim - 1, 0, -1))
