"""One ground of every kind, made small, with places on its edges."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from pydantic import TypeAdapter

from crowd.ground import Ground, build_ground
from crowd.scenario_ground import Ground as GroundModel

UP_AND_DOWN = {"kind": "stairs", "start_m": -2.0, "rise_m": 0.25, "tread_m": 0.5, "count": 4, "landing_m": 1.0}
WAVES = [
    {"amplitude_m": 0.3, "wavelength_m": 5.0, "toward_deg": 20},
    {"amplitude_m": 0.1, "wavelength_m": 1.7, "toward_deg": -70, "phase_deg": 40},
]
STRETCHES = [{"length_m": 2, "angle_deg": 20}, {"length_m": 1, "angle_deg": 0}, {"length_m": 3, "angle_deg": -25}]
DECK = {"kind": "flat", "height_m": 2.5, "area_m": {"x": [-1.0, 1.0], "z": [-4.0, 5.0]}}
KINDS: dict[str, dict[str, Any]] = {
    "flat": {"kind": "flat", "height_m": 0.3},
    "slope": {"kind": "slope", "angle_deg": -7.0, "toward_deg": 30.0, "height_m": 0.2},
    "ramp": {"kind": "ramp", "start_m": -2.0, "end_m": 6.0, "drop_m": 1.1},
    "steps": {"kind": "steps", "rise_m": -0.17, "tread_m": 0.29, "count": 10, "start_m": -1.0},
    "stairs": UP_AND_DOWN,
    "stairs aside": UP_AND_DOWN | {"toward_deg": -90.0, "height_m": 0.5},
    "stairs askew": UP_AND_DOWN | {"toward_deg": 37.0},
    "slopes": {"kind": "slopes", "start_m": -3.0, "toward_deg": 90.0, "stretches": STRETCHES},
    "sines": {"kind": "sines", "waves": WAVES, "height_m": 0.1},
    "rubble": {"kind": "rubble", "extent_m": [12.0, 8.0], "center_m": [1.0, 2.0]},
    "heightmap": {"kind": "heightmap", "file": "map.npy", "cell_m": [0.5, 0.8]},
    "bridge": {"kind": "layers", "layers": [{"kind": "sines", "waves": WAVES}, DECK]},
    "tower": {
        "kind": "layers",
        "layers": [
            {"kind": "flat", "area_m": {"x": [-3, 3], "z": [-3, 3]}, "height_m": 5},
            {"kind": "slope", "angle_deg": 3},
            {**UP_AND_DOWN, "area_m": {"x": [-1, 1], "z": [-8, 8]}},
        ],
    },
    "mesh": {"kind": "mesh", "file": "bridge.obj", "cell_m": 0.25},
}
# Places on risers, corners, borders and posts, in numbers that single precision has exactly.
EDGES: dict[str, list[tuple[float, float]]] = {name: [(0.0, 0.0)] for name in KINDS} | {
    "ramp": [(0, -2), (1, 6)],
    "stairs": [(0.5, -2 + 0.5 * k) for k in range(12)],
    "stairs aside": [(2 - 0.5 * k, 0.25) for k in range(12)],
    "slopes": [(-3, 0), (-1, 0), (0, 0), (3, 0)],
    "heightmap": [(2, 0), (-2, 2.4), (0.25, -2.4), (99, -99)],
    "rubble": [(-5, 2), (7, 6), (1, -2), (60, 60)],
    "bridge": [(1, 0), (-1, 0), (0, -4), (1, 5)],
    "tower": [(3, 3), (-3, 0), (1, 0), (0, -2)],
    "mesh": [(-4, -4), (4, 4), (0, 1), (0.25, 1.25), (-3, 1.25), (0, 0.75)],
}


def made(kind: str | dict[str, Any], folder: Path) -> Ground:
    """The ground of a kind, its files made in `folder`."""
    np.save(folder / "map.npy", np.random.default_rng(1).normal(size=(7, 9)))
    bridge().export(folder / "bridge.obj")
    model = KINDS[kind] if isinstance(kind, str) else kind
    return build_ground(TypeAdapter(GroundModel).validate_python(model), folder)


def bridge() -> trimesh.Trimesh:
    """A sheet of 8 m at height 0 with a deck over it: along x at z -1 to 1, its top at 3 m, 0.3 m thick."""
    sheet = trimesh.Trimesh([[-4, 0, -4], [-4, 0, 4], [4, 0, 4], [4, 0, -4]], [[0, 1, 2], [0, 2, 3]])
    deck = trimesh.creation.box(bounds=[[-3, 2.7, -1], [3, 3.0, 1]])
    vertices = np.concatenate([sheet.vertices, deck.vertices])
    return trimesh.Trimesh(vertices, np.concatenate([sheet.faces, deck.faces + len(sheet.vertices)]))
