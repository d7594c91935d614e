"""The part of a scene that pictures and measures need, from a live scene or from a recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np

from crowd.types import Archetype

Heights = Callable[[np.ndarray, np.ndarray], np.ndarray]


@runtime_checkable
class HerdLike(Protocol):
    """A herd of a scene; arrays [n]."""

    @property
    def name(self) -> str: ...
    @property
    def archetype(self) -> Archetype: ...
    @property
    def count(self) -> int: ...
    @property
    def scale(self) -> np.ndarray: ...
    @property
    def mass(self) -> np.ndarray: ...
    @property
    def reference_speed(self) -> np.ndarray: ...
    @property
    def moving(self) -> tuple[int, ...]:
        """Joints whose translation is animated."""
        ...


@runtime_checkable
class SceneLike(Protocol):
    """Herds and the ground they walk on; ground(x, z) gives heights in m."""

    @property
    def herds(self) -> Sequence[Any]: ...
    def ground(self, x: Any, z: Any) -> Any: ...


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """What a recording says of an analysed motion. Its poses are not recorded."""

    name: str
    velocity: np.ndarray  # [3] m/s at scale 1, character frame
    keytimes: np.ndarray  # [L, 6] lift, liftoff, postlift, preland, strike, land, in cycles since stance


@dataclass(frozen=True, eq=False)
class RecordedHerd:
    """A herd read back from a recording. Clips are not recorded."""

    name: str
    archetype: Archetype
    count: int
    scale: np.ndarray
    mass: np.ndarray
    reference_speed: np.ndarray
    moving: tuple[int, ...] = ()  # joints that do not stay at their place in the parent's frame
    motions: tuple[RecordedMotion, ...] = ()  # of a semi-procedural herd


@dataclass(frozen=True, eq=False)
class RecordedScene:
    """A scene read back from a recording."""

    herds: tuple[RecordedHerd, ...]
    heights: Heights
    levels: list[dict[str, Any]] = field(default_factory=list)
    scenario: None = None

    def ground(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Height in m of the ground at x, z, bilinear between the recorded samples, level beyond them."""
        return self.heights(x, z)


def motions_of(herd: HerdLike) -> tuple[Any, ...]:
    """Analysed motions of a herd, each with name, velocity and keytimes; none unless it is a semi-procedural one."""
    return tuple(getattr(herd, "motions", ()))


def levels_of(scene: SceneLike) -> list[dict[str, Any]]:
    """Fluid surfaces of a scene: surface_m, fluid, density_kg_m3, x and z ranges (None: everywhere), priority.

    `waves`, where there are any: [amplitude m, kx rad/m, kz, omega rad/s, phase rad] of every component.
    """
    recorded = getattr(scene, "levels", None)
    if recorded is not None:
        return recorded
    scenario = getattr(scene, "scenario", None)
    if scenario is None:
        return []
    levels = []
    regions = sorted(scenario.world.fluids, key=lambda region: region.priority)
    made = getattr(scene, "trains", None)
    trains: list[Any] = [None] * len(regions) if made is None else made()
    for region, train in zip(regions, trains, strict=True):
        table = getattr(scenario, "fluid_table", None)
        density = region.density_kg_m3 if table is None else table.fluid(region).density_kg_m3
        area = region.area_m
        levels.append(
            {
                "surface_m": float(region.surface_m),
                "fluid": region.fluid or "",
                "density_kg_m3": None if density is None else float(density),
                "x": None if area is None else [float(value) for value in area.x],
                "z": None if area is None else [float(value) for value in area.z],
                "priority": int(region.priority),
            }
        )
        if train is not None:
            rows = np.stack([train.amplitude, *train.number, train.apparent, train.phase], 1)
            levels[-1]["waves"] = rows.tolist()
    return levels


def grid_heights(x: np.ndarray, z: np.ndarray, height: np.ndarray) -> Heights:
    """Bilinear heights over samples [z, x] on an even grid; level beyond its edge."""

    def at(place_x: np.ndarray, place_z: np.ndarray) -> np.ndarray:
        u = np.clip((np.asarray(place_x, float) - x[0]) / (x[1] - x[0]), 0, len(x) - 1)
        v = np.clip((np.asarray(place_z, float) - z[0]) / (z[1] - z[0]), 0, len(z) - 1)
        i, j = np.minimum(u.astype(int), len(x) - 2), np.minimum(v.astype(int), len(z) - 2)
        s, t = u - i, v - j
        near = height[j, i] * (1 - s) + height[j, i + 1] * s
        return near * (1 - t) + (height[j + 1, i] * (1 - s) + height[j + 1, i + 1] * s) * t

    return at
