"""Residuals of a tune problem and their derivatives, for many starts at once: rollouts plus closed forms."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from crowd import metrics, simulate, triangle_statistics
from crowd.build import Program, build
from crowd.errors import InputError, Problem, fail
from crowd.scene import HerdScene, Scene, by_priority
from crowd.scene import load as load_scene
from crowd.tuning import parameters, rollout
from crowd.tuning.config import Problemset, Target
from crowd.tuning.parameters import Free
from crowd.tuning.quantities import SIMULATED

MEDIAN = "median_drag_coefficient"


class Region(NamedTuple):
    """What a character stands in."""

    number: int  # in `Params.fluids`
    density: float  # kg/m3
    surface: float  # m
    flow: np.ndarray  # [3] m/s


class Evaluation:
    """A tune problem ready to be evaluated: `residuals(places)`."""

    def __init__(self, problem: Problemset):
        self.problem, tune = problem, problem.tune
        self.scene = at_depth(load_scene(problem.scenario), tune.depth_hips)
        self.free = _free(problem, self.scene)
        self.targets: tuple[Target, ...] = tune.targets
        self.values = np.array([target.value for target in self.targets])
        self.tolerances = np.array([target.tolerance for target in self.targets])
        self.per_offset = np.zeros(len(self.targets))  # of median targets: `triangle_statistics.per_offset`
        self._parts = [self._part(herd) for herd in self.scene.herds if self._wanted(herd.name)]
        self.memory = 0  # bytes that the gradient needs beside its arguments, once compiled

    def _wanted(self, name: str) -> list[int]:
        return [k for k, target in enumerate(self.targets) if target.herd == name and target.quantity in SIMULATED]

    def _part(self, herd: HerdScene) -> tuple[HerdScene, Program, rollout.Plan]:
        which = self.scene.herds.index(herd)
        program = build(self.scene, 1, tile=max(one.count for one in self.scene.herds))
        names = sorted({self.targets[k].quantity for k in self._wanted(herd.name)})
        h = self.problem.tune.horizon
        plan = rollout.plan_of(program[0], which, self.free, names, (h.settle_s, h.lead_s, h.window_s))
        return herd, program, plan

    def residuals(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals [s, t] in tolerances and their derivatives [s, t, p] by places."""
        value, slope = self.quantities(places)
        return (value - self.values) / self.tolerances, slope / self.tolerances[:, None]

    def quantities(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values [s, t] of the targets' quantities and their derivatives [s, t, p] by places."""
        numbers = np.stack([one.value(places[:, p]) for p, one in enumerate(self.free)], 1)
        chain = np.stack([one.slope(places[:, p]) for p, one in enumerate(self.free)], 1)
        value = np.zeros((len(places), len(self.targets)))
        slope = np.zeros((*value.shape, len(self.free)))
        for herd, program, plan in self._parts:
            found, slopes = self._rolled(program, plan, herd.count, numbers)
            for k in self._wanted(herd.name):
                row, who = plan.quantities.index(self.targets[k].quantity), self.targets[k].character
                value[:, k], slope[:, k] = found[:, row, who], slopes[:, row, :, who]
        for k, target in enumerate(self.targets):
            if target.quantity == MEDIAN:
                value[:, k], slope[:, k] = self._median(k, numbers)
        return value, slope * chain[:, None]

    def _rolled(
        self, program: Program, plan: rollout.Plan, count: int, numbers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Quantities [s, q, count] and derivatives [s, q, p, count], a tile of starts after the other."""
        at_once = min(rollout.starts_at_once(count), len(numbers))
        found, slopes = [], []
        for first in range(0, len(numbers), at_once):
            index = np.minimum(np.arange(first, first + at_once), len(numbers) - 1)
            free = tuple(np.repeat(numbers[index, p], count).astype(np.float32) for p in range(len(self.free)))
            given = rollout.lanes(program, plan.which, at_once)
            run, memory = rollout.compiled(plan, given, free)
            self.memory = max(self.memory, memory)
            q, j = (np.asarray(part, float) for part in run(given, free))
            keep = len(numbers[first : first + at_once])
            found.append(q.reshape(len(q), at_once, count).transpose(1, 0, 2)[:keep])
            slopes.append(j.reshape(*j.shape[:2], at_once, count).transpose(2, 0, 1, 3)[:keep])
        return np.concatenate(found), np.concatenate(slopes)

    def _median(self, k: int, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """[s] C_D0 + B per_offset of a target's fluid, and its derivative [s, p]; the triangles' speeds stay."""
        import jax
        import jax.numpy as jnp

        from crowd.components.sense import coefficients

        params, region = self._program()[2], self.region(self.targets[k])

        def value(one: Any) -> Any:
            chosen = parameters.put(params, {f.steps: one[p][None] for p, f in enumerate(self.free)})
            fluids = rollout.wide(chosen).fluids
            base, offset = coefficients(fluids, fluids)
            return base[region.number, 0] + offset[region.number, 0] * self.per_offset[k]

        both = jax.vmap(jax.value_and_grad(value))(jnp.asarray(numbers, jnp.float32))
        return np.asarray(both[0], float), np.asarray(both[1], float)

    def _program(self) -> Program:
        return self._parts[0][1] if self._parts else build(self.scene, 1)

    def region(self, target: Target) -> Region:
        """The fluid that a target's character starts in."""
        herd = next(herd for herd in self.scene.herds if herd.name == target.herd)
        x, z = herd.points[target.character]
        scenario, found = self.scene.scenario, None
        for number, region in enumerate(by_priority(scenario)):
            area = region.area_m
            if area is None or (area.x[0] <= x <= area.x[1] and area.z[0] <= z <= area.z[1]):
                density = scenario.fluid_table.fluid(region).density_kg_m3
                found = Region(number, density, region.surface_m, np.array(region.flow_m_s))
        if found is None:
            raise fail(f"targets ({target.herd} {target.character})", f"no fluid where it stands, [{x:.2f}, {z:.2f}]")
        return found

    def settle_statistics(self, place: np.ndarray) -> None:
        """Measure what triangles see in a plain run with the numbers of a place [p], for the median targets."""
        wanted = [k for k, target in enumerate(self.targets) if target.quantity == MEDIAN]
        if not wanted:
            return
        result = self.simulated(place)
        mode = self.scene.scenario.drag.b_mode
        for k in wanted:
            found, region = self.triangles(result, self.targets[k]), self.region(self.targets[k])
            self.per_offset[k] = triangle_statistics.per_offset(found, region.density, mode)

    def triangles(self, result: simulate.Result, target: Target) -> triangle_statistics.Triangles:
        """Relevant triangles of a target's character in the measured window of a plain run."""
        h, rate, region = self.problem.tune.horizon, self.scene.scenario.rate_hz, self.region(target)
        herd = next(herd for herd in self.scene.herds if herd.name == target.herd)
        first = round((h.settle_s + h.lead_s) * rate)
        arrays = result.herds[target.herd]
        return triangle_statistics.relevant(herd, arrays, target.character, region.surface, region.flow, rate, first)

    @property
    def has_statistics(self) -> bool:
        """Whether some target is one of triangles."""
        return any(target.quantity == MEDIAN for target in self.targets)

    def verified(self, place: np.ndarray) -> np.ndarray:
        """[t] values of the targets' quantities in a plain run with the numbers of a place [p]."""
        result, h, rate = self.simulated(place), self.problem.tune.horizon, self.scene.scenario.rate_hz
        first = round((h.settle_s + h.lead_s) * rate)
        mode = self.scene.scenario.drag.b_mode
        found = []
        for target in self.targets:
            if target.quantity == MEDIAN:
                base, offset = self._fluid(place, self.region(target).number)
                seen = triangle_statistics.statistics(
                    self.triangles(result, target), self.region(target).density, base, offset, mode
                )
                found.append(seen.median)
            else:
                found.append(plain(target.quantity, result.herds[target.herd], target.character, first, 1.0 / rate))
        return np.array(found)

    def _fluid(self, place: np.ndarray, region: int) -> tuple[float, float]:
        """C_D0 and B of a region with the numbers of a place."""
        from crowd.components.sense import coefficients

        params = parameters.assign(
            self._program()[2], {f.steps: float(f.value(place[p])) for p, f in enumerate(self.free)}
        )
        base, offset = coefficients(params.fluids, params.fluids)
        return float(base[region]), float(offset[region])

    def simulated(self, place: np.ndarray) -> simulate.Result:
        """A plain run of the whole horizon with the numbers of a place [p], every frame with its pose."""
        h, scenario = self.problem.tune.horizon, self.scene.scenario
        layout, assets, params, states = build(self.scene, 1)
        params = parameters.assign(params, {f.steps: float(f.value(place[p])) for p, f in enumerate(self.free)})
        frames = round((h.settle_s + h.lead_s + h.window_s) * scenario.rate_hz)
        return simulate.simulate(self.scene, frames=frames, devices=1, program=(layout, assets, params, states))


def at_depth(scene: Scene, hips: float | None) -> Scene:
    """The scene with every surface at that multiple of the first herd's hip height; None: as it is. Records all."""
    import dataclasses

    scenario = scene.scenario
    world = scenario.world
    if hips is not None:
        surface = hips * float(metrics.hip_height(scene.herds[0])[0])
        fluids = tuple(region.model_copy(update={"surface_m": surface}) for region in world.fluids)
        world = world.model_copy(update={"fluids": fluids})
    record = scenario.record.model_copy(update={"rate_hz": scenario.rate_hz, "pose": True})
    changed = scenario.model_copy(update={"world": world, "record": record})
    return dataclasses.replace(scene, scenario=changed)


def _free(problem: Problemset, scene: Scene) -> tuple[Free, ...]:
    params = build(scene, 1)[2]
    known = parameters.names(params, tuple(herd.name for herd in scene.herds))
    problems: list[Problem] = []
    found = []
    for name, one in problem.tune.free.items():
        where = problem.where("free", name)
        if name not in known:
            problems.append(parameters.unknown(name, known, where))
            continue
        usual = parameters.current(params, known[name])
        unit = usual if one.relative else 1.0
        low, high, start = one.low * unit, one.high * unit, usual if one.start is None else one.start * unit
        if not low <= start <= high or low == high:
            message = f"the bounds {low:g} to {high:g} exclude the start, {start:g}; give a start or other bounds"
            problems.append(Problem(where, message))
            continue
        found.append(Free(name, known[name], low, high, start, one.scale == "log"))
    if any(region.layers for region in scene.scenario.world.fluids):
        fluids = [name for name in problem.tune.free if name.startswith("fluids.")]
        told = "constants of fluids cannot be free where a region has layers; leave the layers out"
        problems += [Problem(problem.where("free", name), told) for name in fluids]
    if problems:
        raise InputError(problems)
    return tuple(found)


def plain(quantity: str, arrays: dict[str, np.ndarray], character: int, first: int, dt: float) -> float:
    """A quantity from recorded arrays, every frame from `first` on: the same definitions in NumPy."""
    velocity = arrays["velocity"][first:, character][:, [0, 2]]
    asked = arrays["desired_velocity"][first:, character]
    asked = asked[:, [0, 2]]
    hann = np.hanning(len(velocity) + 2)[1:-1]
    hann = hann / hann.sum()
    if quantity == "settling_s":
        error = ((velocity - asked) ** 2).sum(1)
        return float(8.0 * (np.arange(len(error)) * dt * error).sum() / (error.sum() + 1e-9))
    if quantity == "lean_deg":
        return float((hann * np.degrees(arrays["pitch"][first:, character])).sum())
    if quantity == "drag_force":
        return float((hann * np.linalg.norm(arrays["drag_force"][first:, character], axis=-1)).sum())
    speed = np.linalg.norm(asked, axis=1)
    ahead = (velocity * asked).sum(1) / np.maximum(speed, 1e-9)
    return float((hann * (ahead / np.maximum(speed, 1e-3) if quantity == "relative_speed" else ahead)).sum())
