"""Grids of heights as levels of the ground: maps from files, and random rubble."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from crowd.errors import fail
from crowd.ground_files import read_heights
from crowd.ground_layer import Layer
from crowd.placement import uniforms
from crowd.scenario_files import find_shared
from crowd.scenario_ground import HeightMap, Rubble


def grid_layer(
    heights: np.ndarray, spacing: tuple[float, float], center: tuple[float, float], source: str = ""
) -> Layer:
    """Layer of heights [rows, columns], NaN where there are none (filled with the nearest).

    Rows run from far (+z) to near, columns from +x to -x; spacing and center: m along (x, z).
    """
    rows, columns = heights.shape
    missing = np.isnan(heights)
    size = (columns - 1) * spacing[0], (rows - 1) * spacing[1]
    return Layer(
        kind="grid",
        parameters=np.zeros(1),
        grid=filled(heights),
        origin=np.array([center[0] + size[0] / 2, center[1] + size[1] / 2]),
        cell=-np.array(spacing, float),
        missing=missing if missing.any() else None,
        source=source,
    )


def filled(heights: np.ndarray) -> np.ndarray:
    """Heights with every NaN replaced by the nearest one that is not; at least one is not."""
    missing = np.isnan(heights)
    if not missing.any():
        return heights
    from scipy.ndimage import distance_transform_edt

    nearest_cell = distance_transform_edt(missing, return_distances=False, return_indices=True)
    return heights[tuple(np.asarray(nearest_cell))]


def height_map(model: HeightMap, folder: Path) -> tuple[Layer, list[str]]:
    """The layer of a file and what the user should know of it. Raises `InputError` for bad files."""
    path = find_shared(model.file, folder)[0]
    read = read_heights(path, model.key)
    spacing = model.cell_m if model.cell_m is not None else read.cell
    if spacing is None:
        raise fail(str(path), f"{read.unsure or 'does not say how far its samples are apart'}; cell_m is needed")
    notes = [f"{path.name}: {read.note}"] if read.note and model.cell_m is None else []
    missing = np.isnan(read.heights)
    if missing.any():
        notes.append(f"{path.name}: {missing.sum():,} of {missing.size:,} cells have no height; the nearest is used")
    heights = read.heights * (1.0 if model.height_scale_m is None else model.height_scale_m)
    datum = model.datum_m
    if datum == "center":
        datum = _middle(filled(heights))
    heights = heights - datum
    if np.nanmax(np.abs(heights)) > 2000.0:
        notes.append(
            f"{path.name}: heights up to {np.nanmax(np.abs(heights)):.0f} m; datum_m: center keeps more digits"
        )
    pair = (spacing, spacing) if isinstance(spacing, float | int) else spacing
    return grid_layer(heights, (float(pair[0]), float(pair[1])), model.center_m, path.name), notes


def _middle(heights: np.ndarray) -> float:
    """Height in the middle of a map: the mean of the one, two or four posts there."""
    rows, columns = ((n - 1) // 2 for n in heights.shape)
    return float(heights[rows : heights.shape[0] - rows, columns : heights.shape[1] - columns].mean())


def rubble(model: Rubble, seed: int, number: int = 0) -> Layer:
    """Random heights from the scenario's seed and the layer's number; the outermost posts are level."""
    columns, rows = (int(np.ceil(size / model.cell_m)) + 1 for size in model.extent_m)
    columns, rows = max(columns, 2), max(rows, 2)
    drawn = uniforms(seed, f"ground {number}", "rubble", rows, columns)
    heights = np.zeros((rows, columns))
    heights[1:-1, 1:-1] = model.amplitude_m * (2.0 * drawn[1:-1, 1:-1] - 1.0)
    return grid_layer(heights + model.height_m, (model.cell_m, model.cell_m), model.center_m)
