"""Whether yaw and pitch gains hold against the drag of a scenario: estimates, on the host, before anything is compiled.

Three effects of Eq. 7 on a walker whose drag is F. With the centre of pressure a m before the hips, F turns a body
further that has turned a little: a negative yaw spring of F a N m/rad; a softer yaw gain can let go. The centre swings
to the stepping leg once a cycle, by about the distance s of a hip from the middle: the yaw swings by SWAY (F - B') s
over the dynamic stiffness |k - F a - I w^2 + i b w|. With the centre h m below the hips the body leans by F h over the
pitch gain.

F is where drag meets the velocity gain: c u^2 + B' = k (v_d + flow - u), u the speed through the fluid. Events are not
looked at, nor waves and turbulence.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from crowd import posing
from crowd.build import gains
from crowd.scenario_world import Fluid, FluidRegion
from crowd.scene import HerdScene, Scene, by_priority
from crowd.types import Archetype
from kernels.fluid import REFERENCE_AREA

LEGS = 2.2  # legs swing through the fluid faster than the body moves: their drag over that of their shadow
SWAY = 1.4  # peak of the yaw torque over F s
MANY = 0.2  # of that for bodies of more than four legs: as many swing on the left as on the right
MOST_SWAY, MOST_LEAN = 0.2, math.radians(20.0)  # rad
YAW, PITCH = "yaw_n_m_rad", "pitch_n_m_rad"  # keys of `gains`
LEVELS = 12  # depths that are looked at, up to the deepest: shallow drag has the longest arm


class Wet(NamedTuple):
    """The standing body under one surface, for scale 1."""

    depth: float  # m
    area: float  # m2, facing forward
    pushed: float  # m2, the same with that of legs LEGS times
    ahead: float  # m, of the middle of `pushed` before the hips
    below: float  # m, of its middle under the hips


class Loads(NamedTuple):
    """What drag asks of n characters."""

    force: np.ndarray  # [n] N
    spring: np.ndarray  # [n] N m/rad, negative yaw spring
    sway: np.ndarray  # [n] N m, peak of the yaw torque
    lean: np.ndarray  # [n] N m, pitch torque


class Soft(NamedTuple):
    """A gain that is too small for somebody."""

    key: str  # under `gains`
    have: float  # N m/rad
    least: float
    force: float  # N
    does: str


def gain_warnings(scene: Scene, ways: dict[str, np.ndarray]) -> list[str]:
    """A line for each herd and gain that the scenario's drag is too much for, with the least value that will do.

    ways: by herd, points [k, 2] (x, z) m that its characters come by.
    """
    worst: dict[tuple[int, str], Soft] = {}
    for number, herd in enumerate(scene.herds):
        for region, deepest in _regions(scene, ways[herd.name]):
            for soft in _soft(scene, herd, region, deepest):
                known = worst.get((number, soft.key))
                if known is None or soft.least > known.least:
                    worst[number, soft.key] = soft
    told = []
    for (number, key), one in sorted(worst.items(), key=lambda item: (item[0][0], item[0][1] != YAW)):
        where, name = scene.scenario.where("herds", number, "gains", key), scene.herds[number].name
        soft = f"{one.have:.3g} is too soft for '{name}' in a drag of {one.force:.0f} N"
        told.append(f"{where}: {soft}: {one.does}; {_up(one.least):g} or more will do")
    return told


def under(archetype: Archetype, deepest: float) -> list[Wet]:
    """The rest pose in LEVELS depths up to the deepest, m. Every facing triangle counts, as for the drag."""
    turn, at = posing.world_transforms(archetype.skeleton, posing.rest_motion(archetype.skeleton))
    mesh, parents = archetype.mesh, archetype.skeleton.parents
    corner = posing.skin(mesh, turn, at, np.ones(()))[mesh.triangles]
    hips = at[[leg.hip for leg in archetype.legs]].mean(0)
    facing = np.maximum(0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2], 0.0)
    leg = np.zeros(len(parents), bool)
    for joint, parent in enumerate(parents):
        leg[joint] = joint in [one.hip for one in archetype.legs] or (parent >= 0 and leg[parent])
    bone = mesh.joints[np.arange(len(mesh.joints)), mesh.weights.argmax(1)]
    factor = 1.0 + (LEGS - 1.0) * leg[bone][mesh.triangles].mean(1)
    found = []
    for depth in deepest * np.arange(1, LEVELS + 1) / LEVELS:
        share = np.clip((depth - corner[..., 1]) / 0.02 + 0.5, 0.0, 1.0).mean(-1) * facing
        pushed = share * factor
        whole = max(float(pushed.sum()), 1e-12)
        middle = float(pushed @ np.minimum(corner[..., 1].mean(1), depth)) / whole
        ahead = float(pushed @ corner[..., 2].mean(1)) / whole - float(hips[2])
        found.append(Wet(float(depth), float(share.sum()), whole, max(ahead, 0.0), float(hips[1]) - middle))
    return found


def loads(herd: HerdScene, wet: Wet, fluid: Fluid, against: float) -> Loads:
    """Of a herd's characters, their standing bodies as wet as that. against: m/s, of a flow towards them."""
    assert fluid.drag_coefficient is not None and fluid.offset_force_n is not None
    scale, k = herd.scale, gains(herd)["gain_forward"]
    square = fluid.density_kg_m3 * fluid.drag_coefficient * wet.pushed * scale**2  # N s2/m2
    still = fluid.offset_force_n * wet.area * scale**2 / REFERENCE_AREA
    most = k * (_fastest(herd) + against)  # N, at which nobody moves on
    speed = (-k + np.sqrt(k * k + 4.0 * square * np.maximum(most - still, 0.0))) / (2.0 * np.maximum(square, 1e-9))
    force = np.minimum(square * speed**2 + still, most)
    _, at = posing.world_transforms(herd.archetype.skeleton, posing.rest_motion(herd.archetype.skeleton))
    aside = float(np.abs(at[[leg.hip for leg in herd.archetype.legs], 0]).mean())
    aside *= MANY if len(herd.archetype.legs) > 4 else 1.0
    swings = np.maximum(force - still, 0.0)  # B is the same for a quick leg and a slow one
    return Loads(force, force * wet.ahead * scale, SWAY * swings * aside * scale, force * wet.below * scale)


def yaw_need(herd: HerdScene, load: Loads) -> tuple[np.ndarray, np.ndarray]:
    """[n] N m/rad, the least yaw gain (0: any), and [n] rad, how far the yaw swings with the gains as they are."""
    have = gains(herd)
    cycle = _cycle(herd)
    inertia, damped = have["yaw_inertia"] * cycle**2, have["yaw_damping"] * cycle
    swing = load.sway / np.maximum(np.hypot(have["yaw_gain"] - load.spring - inertia, damped), 1e-9)
    enough = load.spring + inertia + np.sqrt(np.maximum((load.sway / MOST_SWAY) ** 2 - damped**2, 0.0))
    return np.maximum(load.spring, np.where(swing > MOST_SWAY, enough, 0.0)), swing


def _soft(scene: Scene, herd: HerdScene, region: FluidRegion, deepest: float) -> list[Soft]:
    """Gains of a herd that are too soft in a region: at most one for each key and depth."""
    table, river = scene.scenario.fluid_table, region.river
    fluid = max((table.fluid(one) for one in (region, *region.layers)), key=lambda one: one.density_kg_m3)
    against = math.hypot(region.flow_m_s[0], region.flow_m_s[2]) + (0.0 if river is None else abs(river.speed_m_s))
    have, found = gains(herd), []
    for wet in under(herd.archetype, deepest / float(herd.scale.min())):
        load = loads(herd, wet, fluid, against)
        reached = wet.depth * herd.scale <= deepest * (1.0 + 1e-9)
        least, swing = yaw_need(herd, load)
        lean = load.lean / have["pitch_gain"]
        for key, name, need in (
            (YAW, "yaw_gain", least),
            (PITCH, "pitch_gain", load.lean / MOST_LEAN),
        ):
            lacking = np.where(reached & (have[name] < need), need, 0.0)
            who = int(lacking.argmax())
            if lacking[who] > 0.0:
                does = f"the body leans by {math.degrees(lean[who]):.0f} degrees"
                if key == YAW:
                    loose = have[name][who] < load.spring[who]
                    does = "the body may turn away" if loose else f"it swings by {math.degrees(swing[who]):.0f} degrees"
                found.append(Soft(key, float(have[name][who]), float(need[who]), float(load.force[who]), does))
    return found


def _regions(scene: Scene, points: np.ndarray) -> list[tuple[FluidRegion, float]]:
    """Regions that points [k, 2] lie in, with the deepest place of each, m."""
    x, z = points.T
    ground, which = scene.ground(x, z), np.full(len(points), -1)
    regions = by_priority(scene.scenario)
    for number, region in enumerate(regions):
        area = region.area_m
        inside = np.ones(len(points), bool)
        if area is not None:
            inside = (x >= area.x[0]) & (x <= area.x[1]) & (z >= area.z[0]) & (z <= area.z[1])
        which[inside] = number
    ground = np.where(np.isfinite(ground), ground, np.inf)  # gaps of a map
    deepest = [float((region.surface_m - ground)[which == n].max(initial=0.0)) for n, region in enumerate(regions)]
    return [(region, depth) for region, depth in zip(regions, deepest, strict=True) if depth > 0.0]


def _fastest(herd: HerdScene) -> np.ndarray:
    """[n] m/s asked for at most, by the herd itself."""
    model = herd.model
    if herd.track is not None:
        return np.full(herd.count, float(np.linalg.norm(herd.track.velocity, axis=-1).max(initial=0.0)))
    way = model.waypoints or model.path
    asked = way.speed_m_s if way is not None else math.hypot(*(model.velocity_m_s or (model.speed_m_s or 0.0, 0.0)))
    return abs(asked) * herd.speed


def _cycle(herd: HerdScene) -> np.ndarray:
    """[n] rad/s, of the clip whose speed is nearest to the one asked for."""
    size = np.sqrt(herd.scale)
    speeds, periods = (np.array([getattr(gait, name) for gait in herd.gaits]) for name in ("speed", "period"))
    nearest = np.abs((_fastest(herd) / size)[:, None] - speeds).argmin(1)
    return 2.0 * math.pi / (periods[nearest] * size)


def _up(value: float) -> float:
    """To two digits, upwards."""
    digit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / digit - 1e-9) * digit
