"""Loads in pictures: a box where each character carries one. Only runs that still have their scenario show them."""

from __future__ import annotations

from typing import Any

import numpy as np

from crowd import posing
from crowd.herd_responses import load_place
from crowd.view.geometry import Body

DENSITY = 400.0  # kg/m3, of a packed rucksack
SHAPE = np.array([0.8, 1.3, 0.6])  # width, height and depth of the box against each other
COLOR = np.array([0.33, 0.16, 0.06])  # linear
FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def loads_at(run: Any, scene: Any, frame: int) -> list[Body]:
    """Boxes at a recorded frame, of the herds that carry something then."""
    events = [event for event in getattr(getattr(scene, "scenario", None), "events", ()) if event.load is not None]
    bodies = []
    for herd in scene.herds:
        load = getattr(getattr(herd, "model", None), "load", None)
        if load is None:
            continue
        there = carried(load.carried, events, herd, float(run.time[frame]))
        if there.any():
            bodies.append(_boxes(run.herds[herd.name], herd, frame, load.mass_kg, there))
    return bodies


def carried(start: bool, events: list[Any], herd: Any, time: float) -> np.ndarray:
    """[n] bool: who carries its load at a time in s."""
    there = np.full(herd.count, start)
    for event in sorted(events, key=lambda event: event.at_s):
        if event.at_s <= time and (event.herds is None or herd.name in event.herds):
            there[slice(None) if event.characters == "all" else list(event.characters)] = event.load == "pick_up"
    return there


def _boxes(arrays: Any, herd: Any, frame: int, mass: float, there: np.ndarray) -> Body:
    """The boxes of those who are `there`, in the axes of their trunks."""
    position, orientation = (
        np.asarray(arrays[name][frame], float)[there] for name in ("pose_position", "pose_orientation")
    )
    side = (mass / DENSITY / SHAPE.prod()) ** (1.0 / 3.0)
    corner = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * SHAPE * side
    height, ahead = load_place(herd)
    middle = np.array([0.0, height, ahead]) * np.asarray(herd.scale, float)[there, None]
    points = middle[:, None] + corner
    turned = posing.rotate(np.broadcast_to(orientation[:, None], (*points.shape[:2], 4)), points)
    quads = np.array(FACES)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    carriers = position + np.array([0.0, 0.5 * height, 0.0])
    return Body(position[:, None] + turned, triangles, np.tile(COLOR, (len(position), 1)), carriers)
