"""The run behind every figure: one character per pool, side by side, all depths and fluids at once."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from crowd import characters, posing, simulate
from crowd.characters.belt import with_belt
from crowd.characters.builtin import NAMES
from crowd.errors import InputError, fail
from crowd.scenario import configs_folder
from crowd.scene import Scene, locomotion
from crowd.scene import load as load_scene
from crowd.types import Archetype

RATE, SECONDS = 60, 16.0
WIDTH = 6.0  # heights of the character between two pools
DEPTHS = {"ankle": 0.06, "shin": 0.39, "knee": 0.54, "thigh": 0.75, "waist": 1.0, "chest": 1.35}  # of the hips' height
QUADRUPED_DEPTHS = DEPTHS | {"chest": 1.15}  # its back is not far above its hips
FLUIDS = ("water", "mud", "goo")
BELT_FLUIDS = "fluids_belt.yaml"  # constants with B for every triangle of a body with a belt


@dataclass(frozen=True)
class Pool:
    """A character and the fluid it walks through."""

    name: str
    fluid: str
    depth: str
    jogs: bool = False
    arms: bool = True


@dataclass(frozen=True, eq=False)
class Walk:
    """What a character did in its pool. Arrays [t, ...], every frame from the start."""

    pool: Pool
    depth: float  # m
    asked: float  # m/s
    arrays: dict[str, np.ndarray]

    @property
    def speed(self) -> np.ndarray:
        """[t] m/s along the heading."""
        return self.arrays["velocity"][:, 2]

    def steady(self, seconds: float = 8.0) -> slice:
        """The last seconds, whole gait cycles of them."""
        total, phase = len(self.speed), self.arrays["phase"]
        starts = np.flatnonzero(np.diff(phase) < -0.5) + 1
        starts = starts[starts >= total - round(seconds * RATE)]
        return slice(int(starts[0]), int(starts[-1])) if len(starts) > 1 else slice(total // 2, total)

    @property
    def remaining(self) -> float:
        """Share of the speed asked for that is left, over whole cycles."""
        return float(self.speed[self.steady()].mean() / self.asked)


@dataclass(frozen=True, eq=False)
class Study:
    """The walks of one archetype."""

    archetype: str
    scene: Scene
    hip: float  # m
    walks: dict[str, Walk]
    belt: Study | None = None  # waist-deep in every fluid with a belt, B for every triangle; None: nowhere to wear it

    def depth_series(self) -> list[Walk]:
        """Water, from shallow to deep."""
        return [self.walks[f"water {depth}"] for depth in DEPTHS]


def pools(arms: bool, jogs: bool) -> list[Pool]:
    """Every pool of an archetype."""
    found = [Pool(f"water {depth}", "water", depth) for depth in DEPTHS]
    found += [Pool(f"{fluid} {depth}", fluid, depth) for depth in ("knee", "waist") for fluid in ("mud", "goo")]
    found += [Pool("jog", "water", "knee", jogs=True)] if jogs else []
    return found + ([Pool("arms down", "water", "chest", arms=False)] if arms else [])


def study(archetype: str, folder: Path, cache: Path) -> Study:
    """The walks of an archetype (a built-in name or a file); stepped once, then read from the cache."""
    if archetype not in NAMES and not (folder / archetype).exists():
        raise fail("archetype", f"'{archetype}': neither a built-in character ({', '.join(NAMES)}) nor a file")
    character = characters.load(archetype, folder)
    gaits = locomotion(character, archetype)
    _, at = posing.world_transforms(character.skeleton, posing.rest_motion(character.skeleton))
    hip = float(at[[leg.hip for leg in character.legs], 1].mean())
    depths = DEPTHS if len(character.legs) == 2 else QUADRUPED_DEPTHS
    wanted = pools(bool(character.arms), len(gaits) > 1)
    speeds = {False: round(float(gaits[0].speed), 3), True: round(float(gaits[-1].speed), 3)}
    model = scenario(archetype, wanted, {name: share * hip for name, share in depths.items()}, speeds, character.height)
    loaded = load_scene(model)
    arrays = _stepped(loaded, model, cache)
    walks = {}
    for herd, group in _grouped(wanted):
        for number, pool in enumerate(group):
            mine = {name: values[:, number] for name, values in arrays[herd].items()}
            walks[pool.name] = Walk(pool, depths[pool.depth] * hip, speeds[pool.jogs], mine)
    return Study(archetype, loaded, hip, walks, _belted(archetype, character, hip, speeds[False], cache))


def _belted(archetype: str, character: Archetype, hip: float, speed: float, cache: Path) -> Study | None:
    """Waist-deep walks with a belt, the offset force as printed (the same for every triangle)."""
    try:
        with_belt(character)
    except InputError:
        return None
    wanted = [Pool(f"{fluid} waist", fluid, "waist") for fluid in FLUIDS]
    model = scenario(archetype, wanted, {"waist": hip}, {False: speed}, character.height)
    model["fluids"] = str(configs_folder() / BELT_FLUIDS)
    model["drag"]["b_mode"] = "paper"
    model["herds"][0]["belt"] = True
    loaded = load_scene(model)
    arrays = _stepped(loaded, model, cache)["arms_up"]
    walks = {
        pool.name: Walk(pool, hip, speed, {name: values[:, number] for name, values in arrays.items()})
        for number, pool in enumerate(wanted)
    }
    return Study(archetype, loaded, hip, walks)


def _grouped(wanted: list[Pool]) -> list[tuple[str, list[Pool]]]:
    up, down = [pool for pool in wanted if pool.arms], [pool for pool in wanted if not pool.arms]
    return [("arms_up", up), *([("arms_down", down)] if down else [])]


def scenario(
    archetype: str, wanted: list[Pool], depths: dict[str, float], speeds: dict[bool, float], height: float
) -> dict[str, Any]:
    """The scenario: a pool every few metres along x, everybody walks along +z, level ground, the paper's gains."""
    spacing, fluids, herds, events, column = WIDTH * height, [], [], [], 0
    for name, group in _grouped(wanted):
        points = []
        for number, pool in enumerate(group):
            x = column * spacing
            area = {"x": [x - 0.49 * spacing, x + 0.49 * spacing], "z": [-1e3, 1e3]}
            fluids.append({"fluid": pool.fluid, "surface_m": depths[pool.depth], "area_m": area})
            points.append([x, 0.0])
            if pool.jogs:
                velocity = [0.0, speeds[True]]
                events.append({"at_s": 0.0, "herds": [name], "characters": [number], "velocity_m_s": velocity})
            column += 1
        herds.append(
            {
                "name": name, "archetype": archetype, "count": len(group), "speed_m_s": speeds[False],
                "place": {"kind": "list", "points_m": points}, "arms_up": name == "arms_up",
            }
        )  # fmt: skip
    return {
        "name": "figures", "seed": 1, "duration_s": SECONDS, "rate_hz": RATE, "gait": "footsteps",
        "drag": {"mesh": "skinned"}, "record": {"rate_hz": RATE, "pose": True},
        "world": {"fluids": fluids}, "herds": herds, "events": events,
    }  # fmt: skip


def _stepped(loaded: Scene, model: dict[str, Any], cache: Path) -> dict[str, dict[str, np.ndarray]]:
    """Arrays of every herd; kept under a hash of the scenario, the fluids and the program."""
    table = loaded.scenario.fluid_table.model_dump()
    text = json.dumps([model, table, _program()], sort_keys=True, default=str)
    path = cache / f"{hashlib.sha256(text.encode()).hexdigest()[:20]}.npz"
    if path.is_file():
        with np.load(path, allow_pickle=False) as kept:
            found: dict[str, dict[str, np.ndarray]] = {}
            for key in kept.files:
                herd, name = key.split("/")
                found.setdefault(herd, {})[name] = kept[key]
            return found
    herds = simulate.simulate(loaded, devices=1).herds
    cache.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part.npz")
    np.savez(part, **{f"{herd}/{name}": values for herd, arrays in herds.items() for name, values in arrays.items()})
    part.replace(path)
    return herds


def _program() -> str:
    """Hash of the source that a run depends on."""
    import crowd
    import kernels

    digest = hashlib.sha256()
    for package in (crowd, kernels):
        for file in sorted(Path(str(package.__file__)).parent.rglob("*.py")):
            if not {"view", "figures", "tuning"} & set(file.parts):
                digest.update(file.read_bytes())
    return digest.hexdigest()
