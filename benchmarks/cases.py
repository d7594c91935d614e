"""What is measured: a literal list. Adding a case is adding a line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

RATE = 60  # Hz; recorded once a second, so that recording does not weigh
DEPTH = 0.5  # m of water; what a frame costs does not depend on it, only on whether there is water

# m/s, an ordinary walk of each built-in
SPEED = {"human": 1.3, "dog": 1.0, "hexapod": 0.3}


@dataclass(frozen=True)
class Case:
    """One program: herds of built-in characters, stepped on a number of devices (cores)."""

    name: str
    herds: tuple[tuple[str, int], ...]  # (built-in archetype, characters)
    mesh: Literal["rigid", "skinned"] = "rigid"
    water: bool = True
    gait: Literal["semi_procedural", "footsteps", "clip"] = "footsteps"
    devices: int = 1
    gradient: int = 0  # frames of a gradient instead of a run
    rubble: bool = False  # a height grid under everything, whose every look-up is four reads; otherwise flat

    @property
    def count(self) -> int:
        """Characters of all herds."""
        return sum(count for _, count in self.herds)


# Counts are whole tiles of 128, except N = 64, so that no padding is measured.
CASES = (
    Case("human-rigid-64", (("human", 64),)),
    Case("human-rigid-2048", (("human", 2048),)),
    Case("human-rigid-16384", (("human", 16384),)),
    Case("human-skinned-64", (("human", 64),), mesh="skinned"),
    Case("human-skinned-2048", (("human", 2048),), mesh="skinned"),
    Case("human-dry-2048", (("human", 2048),), water=False),
    Case("dog-rigid-2048", (("dog", 2048),)),
    Case("hexapod-rigid-2048", (("hexapod", 2048),)),
    Case("human-dog-rigid-2048", (("human", 1024), ("dog", 1024))),
    Case("human-dog-hexapod-rigid-2048", (("human", 768), ("dog", 640), ("hexapod", 640))),
    Case("human-strides-2048", (("human", 2048),), water=False, gait="semi_procedural", rubble=True),
    Case("human-clip-2048", (("human", 2048),), water=False, gait="clip", rubble=True),
    Case("dog-strides-2048", (("dog", 2048),), water=False, gait="semi_procedural", rubble=True),
    Case("dog-clip-2048", (("dog", 2048),), water=False, gait="clip", rubble=True),
    Case("human-rigid-2048-2dev", (("human", 2048),), devices=2),
    Case("human-skinned-2048-2dev", (("human", 2048),), mesh="skinned", devices=2),
    Case("human-rigid-64-gradient", (("human", 64),), gradient=120),
    Case("human-rigid-256-gradient", (("human", 256),), gradient=120),
    Case("human-skinned-64-gradient", (("human", 64),), mesh="skinned", gradient=120),
)

# On a GPU: from where it idles to where it is full.
GPU_CASES = (
    Case("human-rigid-64", (("human", 64),)),
    Case("human-rigid-2048", (("human", 2048),)),
    Case("human-rigid-16384", (("human", 16384),)),
    Case("human-rigid-102400", (("human", 102400),)),
    Case("human-skinned-2048", (("human", 2048),), mesh="skinned"),
    Case("human-skinned-16384", (("human", 16384),), mesh="skinned"),
    Case("human-skinned-102400", (("human", 102400),), mesh="skinned"),
    Case("human-strides-16384", (("human", 16384),), gait="semi_procedural"),
    Case("human-strides-102400", (("human", 102400),), gait="semi_procedural"),
    Case("dog-rigid-16384", (("dog", 16384),)),
    Case("human-dog-rigid-16384", (("human", 8192), ("dog", 8192))),
)

# The figures that are always asked for.
QUICK = (
    "human-rigid-2048",
    "human-skinned-2048",
    "dog-rigid-2048",
    "human-dog-rigid-2048",
    "human-strides-2048",
    "human-clip-2048",
    "dog-strides-2048",
    "dog-clip-2048",
    "human-rigid-2048-2dev",
)


def scenario(case: Case) -> dict[str, Any]:
    """The scenario of a case, as a mapping that `crowd.load` takes."""
    flat = {"kind": "flat", "height_m": 0.0}
    rubble = {"kind": "rubble", "amplitude_m": 0.1, "cell_m": 0.4}
    fluids = [{"fluid": "water", "surface_m": DEPTH}] if case.water else []
    return {
        "name": case.name,
        "seed": 1,
        "duration_s": 10.0,
        "rate_hz": RATE,
        "drag": {"mesh": case.mesh},
        "gait": case.gait,
        "world": {"ground": rubble if case.rubble else flat, "fluids": fluids},
        "herds": [
            {
                "name": archetype,
                "archetype": archetype,
                "count": count,
                "place": {"kind": "grid", "spacing_m": 1.5},
                "speed_m_s": SPEED[archetype],
            }
            for archetype, count in case.herds
        ],
        "record": {"rate_hz": 1, "pose": False},
    }
