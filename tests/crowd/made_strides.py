"""The box men of `conftest` with what the semi-procedural gait shows of itself, every number known."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from crowd.recorded_scene import RecordedMotion
from tests.crowd.conftest import MadeHerd, MadeResult

KEYS = (0.2, 0.3, 0.4, 0.6, 0.7, 0.8)  # lift, liftoff, postlift, preland, strike, land
UNDER = {"heel": 0.003, "toe": 0.001}  # m under the ground in stance
DIP = 0.004  # m that the toe comes under the ground in the middle of the flight


@dataclass(frozen=True, eq=False)
class StridingHerd(MadeHerd):
    motions: tuple[Any, ...] = ()


def striding(result: MadeResult) -> MadeResult:
    """The result with its first herd, `ones`, as a semi-procedural one; the other one stays as it is.

    Each leg's stance is in the middle of its planted time. The last character's second leg rests throughout.
    """
    herd = result.scene.herds[0]
    keys = np.tile(KEYS, (2, 1))
    motions = (
        RecordedMotion("stand", np.zeros(3), np.tile([0.0, 0.0, 0.0, 1.0, 1.0, 1.0], (2, 1))),
        RecordedMotion("walk", np.array([0.0, 0.0, 1.2]), keys),
    )
    fields = {field.name: getattr(herd, field.name) for field in dataclasses.fields(herd)}
    scene = dataclasses.replace(result.scene, herds=(StridingHerd(**fields, motions=motions), *result.scene.herds[1:]))
    arrays = result.herds[herd.name]
    return dataclasses.replace(result, scene=scene, herds=result.herds | {herd.name: arrays | _strides(result, arrays)})


def _strides(result: MadeResult, arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    count = arrays["position"].shape[1]
    since = (result.time[:, None] - 0.5 * np.arange(2)) % 1.0  # [t, leg]
    time = np.round((since - 0.3) % 1.0, 9)
    phase = np.digitize(time, [KEYS[0], KEYS[1], KEYS[4], KEYS[5]]) % 4
    dips = np.abs(time - 0.5) < 0.06

    def everyone(values: np.ndarray, kind: type = float) -> np.ndarray:
        return np.repeat(values[:, None].astype(kind), count, 1)

    points = {}
    for name, along in (("heel", -0.1), ("toe", 0.1)):
        point = arrays["ball"] + np.array([0.0, 0.0, along])
        above = np.where(arrays["contact"], -UNDER[name], 0.05)
        above = np.where(everyone(dips, bool) & (name == "toe"), -DIP, above)
        point[..., 1] = result.scene.ground(point[..., 0], point[..., 2]) + above
        points[name] = point
    parked = np.zeros((*arrays["contact"].shape,), bool)
    parked[:, -1, 1] = True
    start = 1.2 * (np.floor(result.time[:, None] - 0.5 * np.arange(2) + 1e-9) + 0.5 * np.arange(2) + 0.3)
    behind = np.stack([arrays["handle"][..., 0], 0 * parked, everyone(start) - 0.1], -1)
    plate = np.broadcast_to([0.0, 0.0, 0.2], behind.shape)
    return points | {
        "cycle_time": everyone(time), "cycle_designated": everyone((time + 0.05) % 1.0), "parked": parked,
        "foot_phase": everyone(phase, np.int8), "steps": np.zeros(parked.shape, np.int32),
        "weights": np.broadcast_to([0.2, 0.8], (len(result.time), count, 2)), "alignment": np.ones(parked.shape[:2]),
        "footprint_from": behind, "footprint_from_direction": plate,
        "footprint_to": behind + np.array([0.0, 0.0, 1.2]), "footprint_to_direction": plate,
        "footprint_goal": behind + np.array([0.02, 0.0, 1.25]),
    }  # fmt: skip
