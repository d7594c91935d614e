"""What has to hold of and between the fluids of a scenario: names, overlaps, layers, waves that would break."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from crowd.errors import nearest
from crowd.scenario_fluid import Layer
from crowd.scenario_world import FluidRegion, FluidTable
from crowd.scenario_yaml import KeyPath

STEEPEST = 1 / 7  # height over length of a wave that does not break (Stokes)
SHALLOWEST = 0.78  # height over depth (McCowan)

Found = Iterator[tuple[KeyPath, str]]


def fluid_problems(regions: dict[int, FluidRegion], table: FluidTable | None, buoyancy: bool) -> Found:
    """Problems of the valid fluid regions by number, each with its key path. table: named fluids, if there are any."""
    yield from _areas(regions)
    for index, region in regions.items():
        path: KeyPath = ("world", "fluids", index)
        yield from _layers(region, path)
        yield from _waves(region, path)
        yield from _flow(region, path)
        if region.surface_tension_n_m > 0 and not buoyancy:
            text = f"{region.surface_tension_n_m}: shows in the weight on the feet only; world.buoyancy: true is needed"
            yield (*path, "surface_tension_n_m"), text
        if table is not None:
            yield from _known(region, path, table)
            for number, layer in enumerate(region.layers):
                yield from _known(layer, (*path, "layers", number), table)


def _areas(regions: dict[int, FluidRegion]) -> Found:
    for index, region in regions.items():
        for axis in "xz" if region.area_m is not None else "":
            low, high = getattr(region.area_m, axis)
            if low >= high:
                yield ("world", "fluids", index, "area_m", axis), f"[{low}, {high}]: the first must be below the second"
    for (i, a), (j, b) in combinations(regions.items(), 2):
        if a.priority == b.priority and _overlap(a, b):
            yield (
                ("world", "fluids", j),
                f"overlaps world.fluids[{i}] and both have priority {a.priority}; give one a higher priority",
            )


def _overlap(a: FluidRegion, b: FluidRegion) -> bool:
    if a.area_m is None or b.area_m is None:
        return True
    pairs = ((a.area_m.x, b.area_m.x), (a.area_m.z, b.area_m.z))
    return all(max(p[0], q[0]) < min(p[1], q[1]) for p, q in pairs)


def _layers(region: FluidRegion, path: KeyPath) -> Found:
    above, name = region.surface_m, "the surface"
    for number, layer in enumerate(region.layers):
        if layer.top_m >= above:
            yield (
                (*path, "layers", number, "top_m"),
                f"{layer.top_m}: must be below {name} at {above:g} m; layers go from the top down",
            )
        above, name = layer.top_m, f"the top of layers[{number}]"


def _waves(region: FluidRegion, path: KeyPath) -> Found:
    for number, wave in enumerate(region.waves):
        here = (*path, "waves", number, "amplitude_m")
        if wave.wavelength_m is not None and 2 * wave.amplitude_m > STEEPEST * wave.wavelength_m:
            most = STEEPEST * wave.wavelength_m / 2
            yield here, f"{wave.amplitude_m}: a wave of {wave.wavelength_m:g} m breaks above {most:.3g} m"
        if region.wave_depth_m is not None and 2 * wave.amplitude_m > SHALLOWEST * region.wave_depth_m:
            most = SHALLOWEST * region.wave_depth_m / 2
            yield here, f"{wave.amplitude_m}: in {region.wave_depth_m:g} m of water waves break above {most:.3g} m"
    if region.wave_depth_m is not None and not region.waves and region.spectrum is None:
        yield (*path, "wave_depth_m"), f"{region.wave_depth_m}: there are no waves here; it is for waves and spectrum"


def _flow(region: FluidRegion, path: KeyPath) -> Found:
    share = region.turbulence.intensity_share if region.turbulence is not None else None
    flows = any(region.flow_m_s) or (region.river is not None and region.river.speed_m_s)
    if share is not None and not flows:
        here = (*path, "turbulence", "intensity_share")
        yield here, f"{share}: a share of a flow of 0; intensity_m_s says it in m/s"


def _known(fluid: FluidRegion | Layer, path: KeyPath, table: FluidTable) -> Found:
    names = list(table.fluids)
    if fluid.fluid is not None and fluid.fluid not in names:
        yield (
            (*path, "fluid"),
            f"'{fluid.fluid}': no such fluid{nearest(fluid.fluid, names)}; known: {', '.join(names)}",
        )
