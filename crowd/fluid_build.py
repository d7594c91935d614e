"""Fluid regions of a scene as arrays, and what of them the program has to know."""

from __future__ import annotations

from typing import Any

import numpy as np

from crowd import river_flow
from crowd.herd_assets import extent
from crowd.host_arrays import f32
from crowd.layout import FluidLayout
from crowd.params import Fluids, Layers, Sigmoid, Turbulence, WaveTrains
from crowd.river_flow import Modes
from crowd.scenario_world import FluidRegion, FluidTable
from crowd.scenario_world import Sigmoid as SigmoidModel
from crowd.scene import Scene, by_priority
from crowd.wave_components import Trains
from kernels.river import River
from kernels.turbulence import Eddies
from kernels.waves import Waves

SMALL = 0.1  # m, size below which surface tension is looked at


def fluid_layout(scene: Scene) -> FluidLayout:
    """What the fluid of a scene has beyond level surfaces and a constant flow."""
    regions = scene.scenario.world.fluids
    return FluidLayout(
        waves=sum(len(each.phase) for each in scene.trains() if each is not None),
        layers=max((len(region.layers) for region in regions), default=0),
        rivers=any(region.river for region in regions),
        modes=sum(region.turbulence.modes for region in regions if region.turbulence),
        buoyancy=scene.scenario.world.buoyancy and bool(regions),
        tension=tense(scene) if any(tense(scene)) else (),
    )


def _sigmoid(model: SigmoidModel) -> Sigmoid:
    return Sigmoid(f32(model.a), f32(model.b), f32(model.c))


def fluids(scene: Scene) -> Fluids:
    table, regions = scene.scenario.fluid_table, by_priority(scene.scenario)
    named = [table.fluids.get(region.fluid) if region.fluid else None for region in regions]
    resolved = [table.fluid(region) for region in regions]

    def override(attribute: str) -> Any:
        values = [getattr(fluid, attribute) if fluid else None for fluid in named]
        return f32(np.array([-1.0 if value is None else value for value in values]))

    far = 1e9
    low = [(r.area_m.x[0], r.area_m.z[0]) if r.area_m else (-far, -far) for r in regions]
    high = [(r.area_m.x[1], r.area_m.z[1]) if r.area_m else (far, far) for r in regions]
    components = scene.trains()
    eddies = [river_flow.modes(region, scene.scenario.seed) for region in regions]
    return Fluids(
        base_drag=_sigmoid(table.base_drag),
        offset_force=_sigmoid(table.offset_force_n),
        density=f32(np.array([fluid.density_kg_m3 for fluid in resolved])),
        drag_override=override("drag_coefficient"),
        offset_override=override("offset_force_n"),
        surface=f32(np.array([region.surface_m for region in regions])),
        flow=f32(np.array([region.flow_m_s for region in regions]).reshape(-1, 3).T),
        low=f32(np.array(low).reshape(-1, 2).T),
        high=f32(np.array(high).reshape(-1, 2).T),
        trains=_trains(components) if any(each is not None for each in components) else None,
        layers=_layers(table, regions) if any(region.layers for region in regions) else None,
        tension=f32(np.array([region.surface_tension_n_m for region in regions])) if any(tense(scene)) else None,
        rivers=_rivers(regions) if any(region.river for region in regions) else None,
        turbulence=_turbulence(eddies) if any(each is not None for each in eddies) else None,
    )


def tense(scene: Scene) -> tuple[bool, ...]:
    """Herds whose characters are so small that surface tension matters: the Bond number falls with the size squared."""
    world = scene.scenario.world
    there = world.buoyancy and any(region.surface_tension_n_m for region in world.fluids)
    return tuple(bool(there and extent(herd) * herd.scale.min() < SMALL) for herd in scene.herds)


def _layers(table: FluidTable, regions: list[FluidRegion]) -> Layers:
    """Fluids below the top ones; where a region has fewer, the rest lie far below the ground."""
    depth = max(len(region.layers) for region in regions)
    shape = (depth, len(regions))
    density, top, flow = np.full(shape, 1000.0), np.full(shape, -1e6), np.zeros((3, *shape))
    override = np.full((2, *shape), -1.0)
    for number, region in enumerate(regions):
        for level, layer in enumerate(region.layers):
            at = level, number
            density[at], top[at], flow[:, level, number] = table.fluid(layer).density_kg_m3, layer.top_m, layer.flow_m_s
            named = table.fluids.get(layer.fluid) if layer.fluid else None
            for row, value in enumerate((named.drag_coefficient, named.offset_force_n) if named else ()):
                override[row, level, number] = -1.0 if value is None else value
    return Layers(f32(density), f32(override[0]), f32(override[1]), f32(top), f32(flow))


def _trains(regions: list[Trains | None]) -> WaveTrains:
    """Components of all regions, one after the other."""
    there = [(number, each) for number, each in enumerate(regions) if each is not None]

    def joined(name: str) -> Any:
        return f32(np.concatenate([getattr(each, name) for _, each in there], -1))

    names = ("amplitude", "number", "frequency", "apparent", "phase")
    lengths = [len(each.phase) for _, each in there]
    depth = f32(np.repeat([each.depth for _, each in there], lengths))
    region = f32(np.repeat([number for number, _ in there], lengths))
    return WaveTrains(Waves(**{name: joined(name) for name in names}, depth=depth), region)


def _rivers(regions: list[FluidRegion]) -> River:
    """One river for every region; of no speed where there is none."""
    rivers = [region.river for region in regions]

    def each(value: Any, otherwise: float) -> Any:
        return f32(np.array([otherwise if one is None else value(one) for one in rivers]))

    def pair(value: Any) -> Any:
        return f32(np.array([(0.0, 1.0) if one is None else value(one) for one in rivers]).T)

    return River(
        direction=pair(lambda one: river_flow.along(one.toward_deg)),
        through=pair(lambda one: one.through_m),
        speed=each(lambda one: one.speed_m_s, 0.0),
        half_width=each(lambda one: one.width_m / 2, 1.0),
        roughness=each(lambda one: one.roughness_m, 1.0),
        across_log=each(lambda one: one.profile == "log", 0.0),
        over_depth=each(lambda one: one.over_depth == "log", 0.0),
    )


def _turbulence(regions: list[Modes | None]) -> Turbulence:
    """Modes of all regions, one after the other."""
    there = [(number, each) for number, each in enumerate(regions) if each is not None]
    names = ("amplitude", "number", "frequency", "phase")
    eddies = Eddies(*(f32(np.concatenate([getattr(each, name) for _, each in there], -1)) for name in names))
    region = np.repeat([number for number, _ in there], [len(each.phase) for _, each in there])
    return Turbulence(eddies, f32(region))
