"""What is measured: a literal list. Adding a case is adding a line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

RATE = 60  # Hz; recorded once a second, so that recording does not weigh
DEPTH = 0.5  # m of water, to the knees of a person
DEEP = 1.3  # m, to the chest: groups of triangles that are dry cost nothing, so depth matters

# m of water that come up as far on others as DEPTH on a person, in shares of their heights
KNEES = {"dog": 0.24, "hexapod": 0.16, "spider": 0.16}

# m/s, an ordinary walk of each built-in
SPEED = {"human": 1.3, "dog": 1.0, "hexapod": 0.3, "spider": 0.3}


@dataclass(frozen=True)
class Case:
    """One program: herds of built-in characters, stepped on a number of devices (cores)."""

    name: str
    herds: tuple[tuple[str, int], ...]  # (built-in archetype, characters)
    mesh: Literal["rigid", "skinned"] = "rigid"
    depth: float = DEPTH  # m of water; 0: none anywhere
    gait: Literal["semi_procedural", "footsteps", "clip"] = "footsteps"
    devices: int = 1
    gradient: int = 0  # frames of a gradient instead of a run
    recorded: bool = False  # full poses of every frame to disk, against a run that records nothing
    rubble: bool = False  # a height grid under everything, whose every look-up is four reads; otherwise flat
    asked: Literal["quick", "usual", "all"] = "usual"  # the smallest set that it is in: --quick, without option, --all

    @property
    def count(self) -> int:
        """Characters of all herds."""
        return sum(count for _, count in self.herds)

    @property
    def water(self) -> bool:
        """Whether there is any."""
        return self.depth > 0


def named(case: Case) -> str:
    """What a case of the lists is called: who, in what, how they walk (footsteps unless said), how many, and then."""
    ground = "rubble" if case.rubble else "dry"
    parts = [archetype for archetype, _ in case.herds] + [case.mesh if case.water else ground]
    parts += ["deep"] if case.depth == DEEP else ["knees"] if case.depth in KNEES.values() else []
    parts += {"footsteps": [], "semi_procedural": ["strides"], "clip": ["clip"]}[case.gait]
    parts.append(str(case.count))
    parts += [f"{case.devices}dev"] if case.devices > 1 else []
    return "-".join([*parts, *["gradient"] * bool(case.gradient), *["recorded"] * case.recorded])


# Counts are whole tiles of 128 (64 for a herd of so many), so that no padding is measured: but 1, which is about it,
# and 100 000, of which 96 more are a thousandth.
CASES = (
    Case("human-rigid-1", (("human", 1),)),
    Case("human-rigid-64", (("human", 64),), asked="quick"),
    Case("human-rigid-256", (("human", 256),)),
    Case("human-rigid-2048", (("human", 2048),), asked="quick"),
    Case("human-rigid-16384", (("human", 16384),)),
    Case("human-rigid-100000", (("human", 100000),)),
    Case("human-skinned-64", (("human", 64),), mesh="skinned"),
    Case("human-skinned-2048", (("human", 2048),), mesh="skinned", asked="quick"),
    Case("human-skinned-16384", (("human", 16384),), mesh="skinned"),
    Case("human-skinned-100000", (("human", 100000),), mesh="skinned", asked="all"),
    Case("human-dry-2048", (("human", 2048),), depth=0),
    Case("human-rigid-deep-2048", (("human", 2048),), depth=DEEP),
    Case("human-skinned-deep-2048", (("human", 2048),), mesh="skinned", depth=DEEP),
    Case("dog-rigid-2048", (("dog", 2048),), asked="quick"),
    Case("hexapod-rigid-2048", (("hexapod", 2048),)),
    Case("spider-rigid-2048", (("spider", 2048),), asked="quick"),
    Case("dog-rigid-knees-2048", (("dog", 2048),), depth=KNEES["dog"], asked="quick"),
    Case("hexapod-rigid-knees-2048", (("hexapod", 2048),), depth=KNEES["hexapod"]),
    Case("spider-rigid-knees-2048", (("spider", 2048),), depth=KNEES["spider"], asked="quick"),
    Case("dog-skinned-2048", (("dog", 2048),), mesh="skinned", asked="all"),
    Case("hexapod-skinned-2048", (("hexapod", 2048),), mesh="skinned", asked="all"),
    Case("spider-skinned-2048", (("spider", 2048),), mesh="skinned", asked="all"),
    Case("human-dog-rigid-2048", (("human", 1024), ("dog", 1024)), asked="quick"),
    Case("human-dog-hexapod-spider-rigid-2048", (("human", 512), ("dog", 512), ("hexapod", 512), ("spider", 512))),
    Case("human-rigid-strides-2048", (("human", 2048),), gait="semi_procedural"),
    Case("human-rigid-clip-2048", (("human", 2048),), gait="clip"),
    Case("human-skinned-strides-2048", (("human", 2048),), mesh="skinned", gait="semi_procedural", asked="all"),
    Case("dog-rigid-strides-2048", (("dog", 2048),), gait="semi_procedural", asked="all"),
    Case("dog-rigid-clip-2048", (("dog", 2048),), gait="clip", asked="all"),
    Case("spider-rigid-strides-2048", (("spider", 2048),), gait="semi_procedural", asked="all"),
    Case("human-rubble-strides-2048", (("human", 2048),), depth=0, gait="semi_procedural", rubble=True, asked="quick"),
    Case("human-rubble-clip-2048", (("human", 2048),), depth=0, gait="clip", rubble=True, asked="quick"),
    Case("dog-rubble-strides-2048", (("dog", 2048),), depth=0, gait="semi_procedural", rubble=True, asked="quick"),
    Case("dog-rubble-clip-2048", (("dog", 2048),), depth=0, gait="clip", rubble=True, asked="quick"),
    Case("human-rigid-2048-2dev", (("human", 2048),), devices=2, asked="quick"),
    Case("human-skinned-2048-2dev", (("human", 2048),), mesh="skinned", devices=2, asked="quick"),
    Case("human-rigid-64-gradient", (("human", 64),), gradient=120, asked="quick"),
    Case("human-rigid-256-gradient", (("human", 256),), gradient=120),
    Case("human-skinned-64-gradient", (("human", 64),), mesh="skinned", gradient=120),
    Case("human-rigid-2048-recorded", (("human", 2048),), recorded=True, asked="quick"),
)

# On a GPU: from where it idles to where it is full.
GPU_CASES = (
    Case("human-rigid-64", (("human", 64),)),
    Case("human-rigid-2048", (("human", 2048),), asked="quick"),
    Case("human-rigid-16384", (("human", 16384),)),
    Case("human-rigid-102400", (("human", 102400),)),
    Case("human-skinned-2048", (("human", 2048),), mesh="skinned", asked="quick"),
    Case("human-skinned-16384", (("human", 16384),), mesh="skinned"),
    Case("human-skinned-102400", (("human", 102400),), mesh="skinned"),
    Case("human-rigid-strides-16384", (("human", 16384),), gait="semi_procedural"),
    Case("human-rigid-strides-102400", (("human", 102400),), gait="semi_procedural"),
    Case("dog-rigid-16384", (("dog", 16384),)),
    Case("human-dog-rigid-16384", (("human", 8192), ("dog", 8192))),
    Case("human-rigid-2048-gradient", (("human", 2048),), gradient=60),
    Case("human-skinned-2048-gradient", (("human", 2048),), mesh="skinned", gradient=60),
)


def scenario(case: Case) -> dict[str, Any]:
    """The scenario of a case, as a mapping that `crowd.load` takes."""
    flat = {"kind": "flat", "height_m": 0.0}
    rubble = {"kind": "rubble", "amplitude_m": 0.1, "cell_m": 0.4}
    fluids = [{"fluid": "water", "surface_m": case.depth}] if case.water else []
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
