"""A triangle mesh as ground: what downward rays over a grid hit, in as many levels as one can walk on."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from crowd.errors import fail
from crowd.ground_files import MAX_CELLS
from crowd.ground_grids import filled
from crowd.ground_layer import Layer
from crowd.scenario_files import find_shared
from crowd.scenario_ground import Mesh

MOST_LEVELS = 4
BATCH = 1 << 20  # pairs of triangle and ray at a time
SAME = 1e-4  # m, hits of one ray nearer than that are one (triangles that share an edge)
BROKEN = 0.6  # of the headroom: neighbouring samples of one level differ by less
NOTHING = -1e6  # m, height of a higher level where a ray meets nothing: far enough for a gap


def mesh_layers(model: Mesh, folder: Path) -> tuple[list[Layer], list[str]]:
    """Levels of a mesh file, lowest first, and what the user should know. Raises `InputError` for bad files."""
    path = find_shared(model.file, folder)[0]
    vertices, faces = read_mesh(path)
    if model.up == "z":
        vertices = np.stack([vertices[:, 0], vertices[:, 2], -vertices[:, 1]], 1)
    vertices = vertices * model.scale + np.array(model.offset_m)
    cell = model.cell_m
    low, high = (vertices[faces].reshape(-1, 3)[:, [0, 2]]).min(0), (vertices[faces].reshape(-1, 3)[:, [0, 2]]).max(0)
    first, last = np.ceil(low / cell - 1e-6), np.floor(high / cell + 1e-6)
    columns, rows = (last - first + 1).astype(int).tolist()
    size = " x ".join(f"{side:.3g}" for side in high - low)
    if min(columns, rows) < 2:
        raise fail(str(path), f"{size} m seen from above: smaller than two cells of {cell:g} m (cell_m, scale, up)")
    if columns * rows > MAX_CELLS:
        raise fail(str(path), f"{size} m: {columns * rows:,} cells of {cell:g} m; at most {MAX_CELLS:,} (cell_m)")
    ray, height, floor = _hits(vertices / [cell, 1, cell] - [first[0], 0, first[1]], faces, (rows, columns))
    levels = _levels(ray, height, floor, model.headroom_m, rows * columns)
    if levels is None:
        raise fail(str(path), "nothing lies under the rays from above: the mesh has no face one could stand on")
    heights, more = levels
    notes = [f"{path.name}: more than {MOST_LEVELS} levels above each other; the lower ones are used"] if more else []
    missing = np.isnan(heights[0]).reshape(rows, columns)
    if missing.any():
        notes.append(f"{path.name}: nothing under {missing.sum():,} of {missing.size:,} rays; the nearest is used")
    grids = heights.reshape(-1, rows, columns)
    return [_layer(grid, missing, first * cell, model, n > 0, path) for n, grid in enumerate(grids)], notes


def read_mesh(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [V, 3] and triangles [T, 3] of a file; raises `InputError` when there are none."""
    import trimesh

    if not path.is_file():
        raise fail(str(path), "no such file")
    try:
        mesh = trimesh.load_mesh(path, process=False)
        vertices, faces = np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)
    except Exception as error:  # readers of many formats, each with errors of its own
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise fail(str(path), f"is not a readable mesh ({reason[:80]})") from None
    if len(faces) == 0:
        raise fail(str(path), "has no faces")
    if not np.isfinite(vertices[faces]).all():
        raise fail(str(path), "has a vertex that is not finite")
    return vertices, faces


def _layer(heights: np.ndarray, missing: np.ndarray, first: np.ndarray, model: Mesh, above: bool, path: Path) -> Layer:
    """heights: [rows, columns] from -z to +z and -x to +x; above: a level over others, with gaps where it ends."""
    return Layer(
        kind="grid",
        parameters=np.zeros(1),
        grid=np.where(missing, NOTHING, heights) if above else filled(heights),
        gap=BROKEN * model.headroom_m if above else None,
        origin=first,
        cell=np.full(2, model.cell_m),
        missing=missing if missing.any() and not above else None,
        source=path.name,
    )


def _hits(vertices: np.ndarray, faces: np.ndarray, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where vertical rays at whole x and z meet triangles: number of the ray, height, whether one can stand there."""
    corner = vertices[faces]
    floors = _floors(vertices, faces)
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    area = a[:, 0] * b[:, 2] - a[:, 2] * b[:, 0]
    low = np.maximum(np.ceil(corner.min(1) - 1e-6), 0).astype(int)[:, [0, 2]]
    high = np.minimum(np.floor(corner.max(1) + 1e-6)[:, [0, 2]], [shape[1] - 1, shape[0] - 1]).astype(int)
    span = np.maximum(high - low + 1, 0)
    count = np.where(np.abs(area) > 1e-9, span[:, 0] * span[:, 1], 0)
    rays, heights, floor = [], [], []
    ends = np.cumsum(count)
    for part in np.split(np.arange(len(faces)), np.unique(np.searchsorted(ends, np.arange(BATCH, ends[-1], BATCH)))):
        face = np.repeat(part, count[part])
        within = np.arange(len(face)) - np.repeat(np.cumsum(count[part]) - count[part], count[part])
        x, z = low[face, 0] + within % span[face, 0], low[face, 1] + within // span[face, 0]
        dx, dz = x - corner[face, 0, 0], z - corner[face, 0, 2]
        s = (dx * b[face, 2] - dz * b[face, 0]) / area[face]
        t = (dz * a[face, 0] - dx * a[face, 2]) / area[face]
        hit = (s >= -1e-6) & (t >= -1e-6) & (s + t <= 1 + 1e-6)
        rays.append((z * shape[1] + x)[hit])
        heights.append((corner[face, 0, 1] + s * a[face, 1] + t * b[face, 1])[hit])
        floor.append(floors[face][hit])
    return np.concatenate(rays), np.concatenate(heights), np.concatenate(floor)


def _floors(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """[T] whether one can stand on a triangle: on an open sheet on each, on a closed body where it faces up."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    _, same = np.unique(np.round(vertices, 6), axis=0, return_inverse=True)
    faces = same.reshape(-1)[faces]
    points = np.zeros((same.max() + 1, 3))
    points[same.reshape(-1)] = vertices
    edge = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    body = connected_components(coo_array((np.ones(len(edge)), edge.T), shape=(len(points),) * 2), directed=False)[1]
    _, number = np.unique(np.sort(edge, 1), axis=0, return_inverse=True)
    direction = np.where(edge[:, 0] < edge[:, 1], 1, -1)
    number = number.reshape(-1)
    closed_edge = (np.bincount(number) == 2) & (np.bincount(number, direction) == 0)
    bodies = body.max() + 1
    closed = np.bincount(body[edge[:, 0]], ~closed_edge[number], bodies) == 0
    p, q, r = (points[faces[:, k]] for k in range(3))
    normal = np.cross(q - p, r - p)
    middle = points.mean(0)
    volume = np.bincount(body[faces[:, 0]], ((p - middle) * normal).sum(1), bodies)
    mine = body[faces[:, 0]]
    return ~closed[mine] | (normal[:, 1] * np.sign(volume[mine]) > 0)


def _levels(
    ray: np.ndarray, height: np.ndarray, floor: np.ndarray, headroom: float, rays: int
) -> tuple[np.ndarray, bool] | None:
    """Heights [levels, rays] of floors with headroom, lowest level first; NaN where a ray meets nothing.

    Where there are fewer floors than levels the lowest one fills them up, so that the first level is the lowest floor
    everywhere and the last one what is seen from above. Also whether there were more than MOST_LEVELS. None: no floor.
    """
    order = np.lexsort((-height, ray))
    ray, height, floor = ray[order], height[order], floor[order]
    new = np.ones(len(ray), bool)
    new[1:] = (ray[1:] != ray[:-1]) | (height[:-1] - height[1:] > SAME)
    group = np.cumsum(new) - 1
    floor = np.bincount(group, floor) > 0 if len(ray) else floor
    ray, height = ray[new], height[new]
    space = np.full(len(ray), np.inf)
    space[1:] = np.where(ray[1:] == ray[:-1], height[:-1] - height[1:], np.inf)
    use = floor & (space >= headroom)
    ray, height = ray[use], height[use]
    if len(ray) == 0:
        return None
    start = np.searchsorted(ray, ray)  # sorted by ray: the first hit of each one
    rank = np.arange(len(ray)) - start
    count = int(rank.max()) + 1
    table = np.full((count, rays), np.nan)
    table[rank, ray] = height
    for k in range(1, count):
        table[k] = np.where(np.isnan(table[k]), table[k - 1], table[k])
    return table[::-1][:MOST_LEVELS], count > MOST_LEVELS
