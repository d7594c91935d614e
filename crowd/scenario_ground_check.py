"""What has to hold within the ground of a scenario beyond the values of its keys."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from crowd.scenario_files import find_shared
from crowd.scenario_ground import Ground, HeightMap, Layers, Mesh, Ramp, Rubble, Surface
from crowd.scenario_yaml import KeyPath

MAP_SUFFIXES = (".png", ".npy", ".asc", ".npz")
SAYS_ITS_CELL = (".asc", ".npz")  # always, and sometimes
MESH_SUFFIXES = (".obj", ".ply", ".stl", ".glb", ".gltf", ".off")
MAX_RUBBLE = 16_000_000  # cells

Found = Iterator[tuple[KeyPath, str]]


def ground_problems(ground: Ground, folder: Path) -> Found:
    """Problems of the ground, each with its key path."""
    path: KeyPath = ("world", "ground")
    if ground.area_m is not None:
        yield (*path, "area_m"), "a rectangle is for a layer of `kind: layers`; the only ground lies everywhere"
    if not isinstance(ground, Layers):
        yield from _surface(ground, path, folder)
        return
    for index, layer in enumerate(ground.layers):
        yield from _surface(layer, (*path, "layers", index), folder)
    if all(layer.area_m is not None for layer in ground.layers):
        yield (*path, "layers"), "every layer has an area_m; one without is needed, so that there is ground everywhere"


def _surface(ground: Surface, path: KeyPath, folder: Path) -> Found:
    if ground.area_m is not None:
        for axis in "xz":
            low, high = getattr(ground.area_m, axis)
            if low >= high:
                yield (*path, "area_m", axis), f"[{low}, {high}]: the first must be below the second"
    match ground:
        case Ramp() if ground.end_m <= ground.start_m:
            yield (*path, "end_m"), f"{ground.end_m}: must be above start_m {ground.start_m}"
        case Rubble():
            cells = ground.extent_m[0] * ground.extent_m[1] / ground.cell_m**2
            if cells > MAX_RUBBLE:
                yield (*path, "extent_m"), f"{cells:,.0f} cells of {ground.cell_m:g} m; at most {MAX_RUBBLE:,}"
        case HeightMap():
            yield from _height_map(ground, path, folder)
        case Mesh():
            yield from _file(ground.file, MESH_SUFFIXES, path, folder)


def _file(name: str, suffixes: tuple[str, ...], path: KeyPath, folder: Path) -> Found:
    if Path(name).suffix.lower() not in suffixes:
        yield (*path, "file"), f"'{name}': must be a {', '.join(suffixes)} file"
        return
    _, reason = find_shared(name, folder)
    if reason:
        yield (*path, "file"), f"'{name}': {reason}"


def _height_map(ground: HeightMap, path: KeyPath, folder: Path) -> Found:
    yield from _file(ground.file, MAP_SUFFIXES, path, folder)
    suffix = Path(ground.file).suffix.lower()
    if suffix not in SAYS_ITS_CELL and ground.cell_m is None:
        yield path, "missing; 'cell_m' is needed (distance of neighbouring samples)"
    if suffix == ".png" and ground.height_scale_m is None:
        yield path, "missing; 'height_scale_m' is needed (height of white above black)"
