"""One run of built-in people, everything that the properties of the semi-procedural gait need: many orders at once."""

from __future__ import annotations

from typing import Any

import numpy as np

import crowd
from crowd import scene
from tests.crowd.scenes import scenario

RATE, FRAMES = 60, 900
# characters near the origin on level ground, and what they are told
STRAIGHT, SLOW, CREEP, LEFT, RIGHT, STOP, SPIN, SPIN_BACK, TWIN, JUMP, SLOPE, STAIRS = range(12)
COUNT = 128  # the others walk about at random
STOP_AT = 300  # frame
SPEED, TURN = 1.2, np.radians(60.0)
GROUND = {
    "kind": "layers",
    "layers": [
        {"kind": "flat"},
        {"kind": "slope", "angle_deg": 12.0, "toward_deg": 0.0, "area_m": {"x": [20, 60], "z": [-60, 60]}},
        {"kind": "stairs", "start_m": 2.0, "rise_m": 0.17, "tread_m": 0.3, "count": 40, "landing_m": 3.0,
         "area_m": {"x": [-60, -20], "z": [-60, 60]}},
    ],
}  # fmt: skip


def places() -> list[list[float]]:
    rng = np.random.default_rng(1)
    near = [[0.0, 0.0] for _ in range(10)] + [[40.0, -2.0], [-40.0, 0.0]]
    return near + (rng.uniform(-1, 1, (COUNT - 12, 2)) * [50.0, 30.0]).tolist()


def model() -> dict[str, Any]:
    people = {
        "name": "p", "archetype": "human", "count": COUNT, "velocity_m_s": [0.0, 0.0],
        "place": {"kind": "list", "points_m": places()},
    }  # fmt: skip
    events = [{"at_s": 6.0, "clip": "jump", "characters": [JUMP]}]
    record = {"rate_hz": RATE, "pose": True}
    return scenario([people], gait="semi_procedural", ground=GROUND, events=events) | {"record": record}


class Orders:
    """Velocities [n, 2] and headings [n] of every frame."""

    def __init__(self) -> None:
        self._rng = np.random.default_rng(2)
        self.velocity = np.zeros((COUNT, 2))
        self.facing = np.full(COUNT, np.nan)

    def at(self, frame: int) -> tuple[np.ndarray, np.ndarray]:
        t = frame / RATE
        self.velocity[:12] = [0.0, SPEED]
        self.velocity[SLOW], self.velocity[CREEP] = [0.0, 0.6], [0.0, 0.13]
        for who, turn in ((LEFT, TURN), (RIGHT, -TURN)):
            angle = np.sign(turn) * 0.5 + turn * t
            self.velocity[who] = SPEED * np.sin(angle), SPEED * np.cos(angle)
        if frame >= STOP_AT:
            self.velocity[STOP] = 0.0
        for who, turn in ((SPIN, 2 * TURN), (SPIN_BACK, -2 * TURN)):
            self.velocity[who] = 0.0
            self.facing[who] = turn * t
        changes = self._rng.uniform(size=COUNT) < 1 / 60
        changes[:12] = False
        speed, angle = self._rng.uniform(0, 3.0, COUNT), self._rng.uniform(-np.pi, np.pi, COUNT)
        speed = np.where(self._rng.uniform(size=COUNT) < 0.25, 0.0, speed)
        wanted = (speed * np.stack([np.sin(angle), np.cos(angle)])).T
        self.velocity = np.where(changes[:, None], wanted, self.velocity)
        looks = np.where(self._rng.uniform(size=COUNT) < 0.3, self._rng.uniform(-np.pi, np.pi, COUNT), np.nan)
        self.facing = np.where(changes, looks, self.facing)
        return self.velocity, self.facing


def walked(frames: int = FRAMES) -> dict[str, np.ndarray]:
    """Arrays [frame, character, ...] of all, and `stance_phase` of the stance of each leg."""
    loaded = scene.load(model())
    loaded.herds[0].phase[:] = 0.3
    loaded.herds[0].phase[[RIGHT, SPIN_BACK]] = 0.8  # mirrored: the other leg
    stepper, orders, found = crowd.stepper(loaded), Orders(), []
    for frame in range(frames):
        velocity, facing = orders.at(frame)
        found.append(dict(stepper.step(velocity={"p": velocity}, facing={"p": facing})["p"]))
    keep = set(found[0]) - {"joint_translation"}
    return {name: np.stack([each[name] for each in found]) for name in keep}
