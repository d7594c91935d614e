"""A scene: a validated scenario with its characters loaded, on the host. Everything random has been drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from crowd import characters, clip_tables, courses, placement, wave_components
from crowd import ground as grounds
from crowd import scenario as scenarios
from crowd.analysis.foot import Foot
from crowd.analysis.gait import Gait, analyse
from crowd.analysis.motion import Motion
from crowd.analysis.motion_set import Entry, MotionSet, default_clips, motion_set
from crowd.characters.belt import with_belt
from crowd.curves import Curve
from crowd.drag_mesh import decimated
from crowd.errors import InputError, Problem, fail
from crowd.ground import Ground
from crowd.ground_water import WaterGrid, water_grid
from crowd.scenario import Scenario
from crowd.scenario_belt import Belt
from crowd.scenario_herd import Herd
from crowd.scenario_styles import NORMAL
from crowd.styles import Play, Repertoire, StyleClips, repertoire, unmet
from crowd.tracks import Track
from crowd.types import Archetype, Clip, Mesh
from crowd.wave_components import Trains

MOST_GAITS = 4


@dataclass(frozen=True, eq=False)
class HerdScene:
    """The characters of one archetype: n of them."""

    name: str
    model: Herd
    archetype: Archetype
    gaits: tuple[Gait, ...]  # slowest first
    idle: Clip
    motions: tuple[Motion, ...]  # semi-procedural: analysed and on one clock; else none
    groups: tuple[int, ...]  # of each motion, into `styles`
    feet: tuple[Foot, ...]  # of each leg, with the motions
    points: np.ndarray  # [n, 2] m, world (x, z)
    headings: np.ndarray  # [n] rad
    scale: np.ndarray  # [n] factor on lengths
    mass: np.ndarray  # [n] kg
    speed: np.ndarray  # [n] factor on desired speeds
    phase: np.ndarray  # [n] cycles, where each one's clip starts
    styles: tuple[StyleClips, ...]  # those in use
    style: int  # into `styles`, at the start
    extras: tuple[Clip, ...]  # clips that events play; channels of `plays` are styles, then extras
    plays: tuple[Play, ...]  # style and clip events that meet this herd
    notes: tuple[str, ...]  # what of styles and events the user may not have meant
    curve: Curve | None = None  # to walk along
    along: np.ndarray | None = None  # [n] m, where on it each one starts
    track: Track | None = None  # trajectories to follow
    fewer: Mesh | None = None  # what the fluid drags on, where that is not the skin

    @property
    def count(self) -> int:
        return len(self.scale)

    @property
    def moving(self) -> tuple[int, ...]:
        """Joints whose translation is animated."""
        return self._moving

    @cached_property
    def _moving(self) -> tuple[int, ...]:
        return clip_tables.moving(self)

    @property
    def drag_mesh(self) -> Mesh:
        """What the fluid drags on; pictures show `archetype.mesh`."""
        return self.archetype.mesh if self.fewer is None else self.fewer

    def drag_kind(self, scenario: Scenario) -> Literal["skinned", "rigid"]:
        """How that mesh moves: as the herd says, otherwise as the scenario does."""
        detail = self.model.detail
        return scenario.drag.mesh if detail is None or detail.mesh is None else detail.mesh

    @property
    def reference_speed(self) -> np.ndarray:
        """[n] m/s, the slowest clip's own speed at each one's size."""
        return self.gaits[0].speed * np.sqrt(self.scale)


@dataclass(frozen=True, eq=False)
class Scene:
    """Scenario, ground and herds."""

    scenario: Scenario
    terrain: Ground
    herds: tuple[HerdScene, ...]
    water: WaterGrid | None = None  # of a surface that the crowd moves

    def ground(
        self, x: np.ndarray | float, z: np.ndarray | float, altitude: np.ndarray | float | None = None
    ) -> np.ndarray:
        """Height of the ground at world points, m; altitude: world height of who asks, see `crowd.ground.height`."""
        return grounds.height(self.terrain, x, z, altitude)

    def surface(self, x: np.ndarray | float, z: np.ndarray | float) -> np.ndarray:
        """Height of the fluid surface at world points, m; -inf where there is none."""
        x, z = np.broadcast_arrays(np.asarray(x, float), np.asarray(z, float))
        out = np.full(x.shape, -np.inf)
        for region in by_priority(self.scenario):
            area = region.area_m
            inside = np.ones(x.shape, bool)
            if area is not None:
                inside = (x >= area.x[0]) & (x <= area.x[1]) & (z >= area.z[0]) & (z <= area.z[1])
            out = np.where(inside, region.surface_m, out)
        return out

    def trains(self) -> list[Trains | None]:
        """Wave components of the fluid regions, in the order of `by_priority`."""
        around, seed = np.concatenate([herd.points for herd in self.herds]), self.scenario.seed
        return [wave_components.trains(region, self.ground, around, seed) for region in by_priority(self.scenario)]

    @property
    def count(self) -> int:
        """Characters of all herds."""
        return sum(herd.count for herd in self.herds)


def by_priority(scenario: Scenario) -> list[Any]:
    """Fluid regions, the one that counts where they overlap last."""
    return sorted(scenario.world.fluids, key=lambda region: region.priority)


def load(source: str | Path | Mapping[str, Any] | Scenario, overrides: Sequence[str] = ()) -> Scene:
    """The scene of a scenario file, mapping or model; `overrides` are "key.path=value".

    Raises `InputError` with every problem of the scenario, or of the first asset that cannot be used.
    """
    scenario = source if isinstance(source, Scenario) else scenarios.load(source, overrides)
    world = scenario.world
    terrain = grounds.build_ground(
        world.ground, scenario.folder, scenario.seed, world.max_step_height_m, math.radians(world.max_slope_deg)
    )
    water = water_grid(world, terrain, scenario.where("world", "water"))
    cache: dict[str, Archetype] = {}
    problems, herds = [], []
    for index, model in enumerate(scenario.herds):
        try:
            key = f"{model.archetype} {model.rig} {model.styles}"
            if key not in cache:
                place = partial(scenario.where, "herds", index, "styles")
                cache[key] = characters.load(model.archetype, scenario.folder, model.rig, model.styles, place)
            herds.append(_herd(scenario, index, _dressed(scenario, index, cache[key]), terrain))
        except InputError as error:
            problems += error.problems
    if problems := problems or unmet(scenario, herds):
        raise InputError(dict.fromkeys(problems))
    scene = Scene(scenario, terrain, tuple(herds), water)
    if problems := _buried(scene):
        raise InputError(problems)
    return scene


def _dressed(scenario: Scenario, index: int, archetype: Archetype) -> Archetype:
    """The archetype with the belt that the herd asks for."""
    belt = scenario.herds[index].belt
    if belt is False:
        return archetype
    asked = Belt() if belt is True else belt
    return with_belt(archetype, asked.triangles, asked.area_m2, scenario.where("herds", index, "belt"))


def _buried(scene: Scene) -> list[Problem]:
    """Fluids whose surface is below the ground wherever one looks."""
    around = np.concatenate([herd.points for herd in scene.herds])
    problems = []
    for index, region in enumerate(scene.scenario.world.fluids):
        lowest = float(wave_components.ground_under(region, scene.ground, around).min())
        if region.surface_m < lowest:
            where = scene.scenario.where("world", "fluids", index, "surface_m")
            problems.append(
                Problem(where, f"{region.surface_m}: below the ground, which is nowhere under {lowest:.3g} m")
            )
    return problems


def _herd(scenario: Scenario, index: int, archetype: Archetype, terrain: Ground) -> HerdScene:
    model = scenario.herds[index]
    where = scenario.where("herds", index, "archetype")
    start = courses.start(model, scenario.seed, scenario.folder, scenario.where("herds", index, "trajectories"))
    placed = "trajectories" if start.track is not None else "place"
    grounds.refuse_missing(terrain, start.points, scenario.where("herds", index, placed))
    drawn = placement.variation(model, scenario.seed)
    phase = placement.uniforms(scenario.seed, model.name, "phase", model.count, 1)[:, 0]
    idle = standing(archetype)
    plays = repertoire(scenario, index, archetype, idle)
    motions = _motions(scenario, archetype, plays) if scenario.gait == "semi_procedural" else None
    return HerdScene(
        motions=motions.motions if motions is not None else (),
        groups=_numbers(motions, plays) if motions is not None else (),
        feet=motions.feet if motions is not None else (),
        notes=(*plays.notes, *(motions.notes if motions is not None else ())),
        name=model.name,
        model=model,
        archetype=archetype,
        gaits=locomotion(archetype, where),
        idle=idle,
        points=start.points,
        headings=start.headings,
        scale=drawn["height"],
        mass=archetype.mass * drawn["height"] ** 3 * drawn["mass"],
        speed=drawn["speed"],
        phase=phase,
        styles=plays.styles,
        style=plays.style,
        extras=plays.extras,
        plays=plays.plays,
        curve=start.curve,
        along=start.along,
        track=start.track,
        fewer=_fewer(model, archetype),
    )


def _fewer(model: Herd, archetype: Archetype) -> Mesh | None:
    """The drag mesh of fewer triangles that a herd asks for."""
    if model.detail is None or model.detail.triangles is None:
        return None
    mesh = decimated(archetype.mesh, model.detail.triangles)
    return None if mesh is archetype.mesh else mesh


def _motions(scenario: Scenario, archetype: Archetype, plays: Repertoire) -> MotionSet:
    """Analysed motions of the styles in use. Of style normal those that detection selects."""
    if [style.name for style in plays.styles] == [NORMAL] and not archetype.also_backwards:
        return motion_set(archetype, compat=scenario.compat)
    entries: list[Entry] = []
    for style in plays.styles:
        if style.name == NORMAL:
            entries += [
                (c, NORMAL, back or c.name in archetype.also_backwards) for c, _, back in default_clips(archetype)
            ]
            continue
        back = [name for name in archetype.also_backwards if any(clip.name == name for clip, _ in style.clips)]
        if not back and not any(clip.role == "step" for clip, _ in style.clips):  # no way back: its first walk reversed
            back = [clip.name for clip, _ in style.clips if clip.role in ("walk", "run")][:1]
        entries += [(clip, style.name, clip.name in back) for clip, _ in style.clips]
    return motion_set(archetype, entries, scenario.compat)


def _numbers(motions: MotionSet, plays: Repertoire) -> tuple[int, ...]:
    """The style of each motion."""
    names = [style.name for style in plays.styles]
    return tuple(names.index(group) if group in names else 0 for group in motions.groups)


def locomotion(archetype: Archetype, where: str) -> tuple[Gait, ...]:
    """Forward gaits of an archetype, slowest first; of nearly equal speeds only the first clip is kept."""
    found = [analyse(archetype, clip, clip_tables.SAMPLES) for clip in archetype.clips if clip.role in ("walk", "run")]
    usable: list[Gait] = []
    for gait in sorted(found, key=lambda gait: gait.speed):
        ahead = gait.speed > 0.02 * archetype.height and gait.direction[1] > 0.9
        if ahead and (not usable or gait.speed > 1.25 * usable[-1].speed):
            usable.append(gait)
    if not usable:
        raise fail(
            where, f"'{archetype.name}' has no clip that walks forward; name one under clips in a rig description"
        )
    return tuple(usable[:MOST_GAITS])


def standing(archetype: Archetype) -> Clip:
    """The idle clip."""
    for clip in archetype.clips:
        if clip.role == "idle":
            return clip
    raise fail(archetype.source, "has no idle clip")
