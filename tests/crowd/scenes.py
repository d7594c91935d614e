"""Small scenarios that the tests of the step share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from crowd import scene, simulate


def herd(name: str, archetype: str, count: int, speed: float | None = 1.3, **more: Any) -> dict[str, Any]:
    """A herd in a row along x, 1.5 m apart, walking along +z."""
    row = {"kind": "list", "points_m": [[1.5 * i, 0.1 * i] for i in range(count)]}
    model = {"name": name, "archetype": archetype, "count": count, "place": row, **more}
    return model if speed is None else {"speed_m_s": speed, **model}


def beside(*herds: dict[str, Any]) -> list[dict[str, Any]]:
    """The herds, of one character each, 3 m apart."""
    return [
        {**each, "place": {"kind": "list", "points_m": [[3.0 * i, 0.0]]}, "count": 1} for i, each in enumerate(herds)
    ]


def scenario(herds: Sequence[dict[str, Any]], surface: float | None = None, **more: Any) -> dict[str, Any]:
    """A scenario on flat ground, recorded every frame; `surface`: depth of still water everywhere."""
    fluids = [] if surface is None else [{"fluid": more.pop("fluid", "water"), "surface_m": surface}]
    world = {"ground": more.pop("ground", {"kind": "flat"}), "fluids": fluids}
    rate = more.get("rate_hz", 60)
    model = {"name": "test", "seed": 3, "duration_s": 60.0, "rate_hz": rate, "world": world, "herds": list(herds)}
    usual = {"record": {"rate_hz": rate, "pose": False}, "drag": {"mesh": "rigid"}, "gait": "footsteps"}
    return {**usual, **model, **more}


def run(model: dict[str, Any], seconds: float, devices: int = 1, chunk: int = 32) -> dict[str, dict[str, np.ndarray]]:
    """Recorded arrays of every herd."""
    loaded = scene.load(model)
    frames = round(seconds * loaded.scenario.rate_hz)
    chunks = list(simulate.stream(loaded, frames, devices, chunk))
    return {
        name: {key: np.concatenate([chunk.herds[name][key] for chunk in chunks]) for key in arrays}
        for name, arrays in chunks[0].herds.items()
    }
