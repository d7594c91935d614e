"""What a scenario needs, told before anything is compiled: its files, the characters' places, memory and disk."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from crowd import characters
from crowd.errors import InputError, Problem
from crowd.ground import Ground, build_ground, height, refuse_missing
from crowd.placement import place, variation
from crowd.scenario import Scenario
from crowd.scenario_check import recording_bytes
from crowd.types import Archetype

TILE = 128


@dataclass(frozen=True)
class HerdSummary:
    """One herd of the scenario."""

    name: str
    archetype: Archetype
    count: int
    memory: int  # bytes while stepping
    recording: int  # bytes, uncompressed
    depth: float  # m, deepest fluid at the start places


@dataclass(frozen=True)
class Summary:
    """What `crowd check` tells."""

    herds: tuple[HerdSummary, ...]
    frames: int
    notes: tuple[str, ...]

    @property
    def memory(self) -> int:
        """Bytes while stepping, without the compiled program."""
        return sum(herd.memory for herd in self.herds)

    @property
    def recording(self) -> int:
        """Bytes of the recording, uncompressed."""
        return sum(herd.recording for herd in self.herds)


def check(scenario: Scenario) -> Summary:
    """Reads every file a scenario names and places every character. Raises `InputError` with every problem found."""
    problems: list[Problem] = []
    herds: list[HerdSummary] = []
    notes: list[str] = []
    ground = None
    try:
        ground = build_ground(scenario.world.ground, scenario.folder)
        notes += ground.notes
    except InputError as error:
        problems += error.problems
    for index, herd in enumerate(scenario.herds):
        try:
            archetype = characters.load(herd.archetype, scenario.folder, herd.rig)
            points, _ = place(herd, scenario.seed)
            variation(herd, scenario.seed)
            if ground is not None:
                refuse_missing(ground, points, scenario.where("herds", index, "place"))
        except InputError as error:
            problems += error.problems
            continue
        notes += [f"{herd.name}: {note}" for note in archetype.notes]
        depth = 0.0 if ground is None else deepest(scenario, ground, points)
        herds.append(_summary(scenario, herd.name, herd.count, archetype, depth))
    if problems:
        raise InputError(problems)
    return Summary(tuple(herds), scenario.frame_count, tuple(notes))


def deepest(scenario: Scenario, ground: Ground, points: np.ndarray) -> float:
    """Largest depth of fluid, m, at points [n, 2] (x, z); 0 when all are dry."""
    x, z = points[:, 0], points[:, 1]
    bottom = height(ground, x, z)
    depth = 0.0
    for region in scenario.world.fluids:
        inside = np.ones(len(points), dtype=bool)
        if region.area_m is not None:
            inside = (x >= region.area_m.x[0]) & (x <= region.area_m.x[1])
            inside &= (z >= region.area_m.z[0]) & (z <= region.area_m.z[1])
        if inside.any():
            depth = max(depth, float((region.surface_m - bottom[inside]).max()))
    return depth


def _summary(scenario: Scenario, name: str, count: int, archetype: Archetype, depth: float) -> HerdSummary:
    joints, legs = archetype.skeleton.count, len(archetype.legs)
    every = scenario.rate_hz // scenario.record.rate_hz
    recorded = math.ceil(scenario.frame_count / every)
    recording = recording_bytes(count, joints, legs, recorded, scenario.record.pose)
    padded = math.ceil(count / TILE) * TILE
    # State and parameters of every character, one recorded chunk, and a frame of one tile (pose, palette, skin, drag).
    chunk = recording_bytes(padded, joints, legs, min(recorded, 64), scenario.record.pose)
    tile = 4 * TILE * (12 * joints + 6 * len(archetype.mesh.vertices) + 12 * len(archetype.mesh.triangles))
    return HerdSummary(name, archetype, count, 4 * padded * (120 + 40 * legs) + chunk + tile, recording, depth)
