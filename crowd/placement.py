"""Where the characters of a herd start and how they differ, drawn from (seed, herd name, character number) alone.

A character's draw depends on neither the count nor the other herds: uniform numbers come from a counter-based generator
(Philox) keyed by seed, herd name and purpose, and each character reads its own counters.
"""

from __future__ import annotations

import hashlib
import math
from statistics import NormalDist

import numpy as np

from crowd.errors import fail
from crowd.scenario_herd import Constant, Disc, Distribution, Grid, Herd, Places, PoissonDisc, Uniform

_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
_TRIES = 400  # darts per character before a Poisson disc counts as full


def uniforms(seed: int, herd: str, purpose: str, count: int, columns: int) -> np.ndarray:
    """Numbers in (0, 1), [count, columns]; row i is the same for every count."""
    key = hashlib.blake2b(f"{seed}/{herd}/{purpose}".encode(), digest_size=16).digest()
    raw = np.random.Philox(key=int.from_bytes(key, "little")).random_raw(count * columns)
    return ((raw >> np.uint64(11)).astype(np.float64) + 0.5).reshape(count, columns) * 2.0**-53


def place(herd: Herd, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Start points [n, 2] (world x, z in m) and headings [n] (rad, 0 = +z, positive to the left).

    The heading is `heading_deg`; where that is left out, along the desired velocity or to the first way-point.
    Raises `InputError` when a Poisson disc is full before all characters stand.
    """
    match herd.place:
        case Grid() as grid:
            points = _grid(grid, herd.count)
        case Disc() as disc:
            points = _disc(disc, herd.count)
        case PoissonDisc() as disc:
            points = _poisson_disc(disc, herd, seed)
        case Places() as places:
            points = np.array(places.points_m, dtype=np.float64)
        case None:  # along a path or where trajectories begin: see crowd.courses
            points = np.zeros((herd.count, 2))
    return points, np.full(herd.count, _heading(herd, points))


def variation(herd: Herd, seed: int) -> dict[str, np.ndarray]:
    """Factors "height", "mass" and "speed" of every character, each [n]."""
    drawn = uniforms(seed, herd.name, "variation", herd.count, 3)
    kinds = {"height": herd.variation.height, "mass": herd.variation.mass, "speed": herd.variation.speed}
    return {key: _draw(kind, drawn[:, column]) for column, (key, kind) in enumerate(kinds.items())}


def _draw(kind: Distribution, uniform: np.ndarray) -> np.ndarray:
    """Values of a distribution at cumulative probabilities."""
    if isinstance(kind, Constant):
        return np.full(uniform.shape, kind.value)
    if isinstance(kind, Uniform):
        return kind.min + (kind.max - kind.min) * uniform
    if kind.sd == 0.0:
        return np.full(uniform.shape, kind.mean)
    normal = NormalDist(kind.mean, kind.sd)  # importing scipy for this takes longer than drawing 100 000 characters
    low, high = normal.cdf(kind.low), normal.cdf(kind.high)
    value = np.array([normal.inv_cdf(share) for share in low + (high - low) * uniform])
    return np.clip(value, kind.low, kind.high)


def _heading(herd: Herd, points: np.ndarray) -> float:
    if "heading_deg" in herd.model_fields_set:
        return math.radians(herd.heading_deg)
    x, z = 0.0, 1.0
    if herd.velocity_m_s is not None:
        x, z = herd.velocity_m_s
    elif herd.waypoints is not None:
        x, z = np.subtract(herd.waypoints.points_m[0], points.mean(0))
    return math.atan2(x, z) if x or z else 0.0


def _grid(grid: Grid, count: int) -> np.ndarray:
    columns = min(count, grid.columns or math.ceil(math.sqrt(count)))
    row, column = np.divmod(np.arange(count), columns)
    rows = row[-1] + 1
    # The first character stands in front on the left; a short last row starts on the left too.
    x = ((columns - 1) / 2.0 - column) * grid.spacing_m
    z = ((rows - 1) / 2.0 - row) * grid.spacing_m
    return np.stack([x, z], 1) + np.array(grid.center_m)


def _disc(disc: Disc, count: int) -> np.ndarray:
    index = np.arange(count)
    radius = disc.radius_m * np.sqrt((index + 0.5) / count)
    angle = index * _GOLDEN_ANGLE
    return np.stack([radius * np.sin(angle), radius * np.cos(angle)], 1) + np.array(disc.center_m)


def _poisson_disc(disc: PoissonDisc, herd: Herd, seed: int) -> np.ndarray:
    """Darts thrown one after the other; one too near to those that stick is thrown away."""
    least = disc.min_distance_m
    cell = least / math.sqrt(2.0)  # at most one point per cell
    taken: dict[tuple[int, int], tuple[float, float]] = {}
    points: list[tuple[float, float]] = []
    darts = uniforms(seed, herd.name, "place", min(_TRIES * herd.count + 1000, 20_000_000), 2)
    radius = disc.radius_m * np.sqrt(darts[:, 0])
    angle = 2.0 * np.pi * darts[:, 1]
    for x, z in zip((radius * np.sin(angle)).tolist(), (radius * np.cos(angle)).tolist(), strict=True):
        i, j = math.floor(x / cell), math.floor(z / cell)
        near = (taken.get((i + di, j + dj)) for di in range(-2, 3) for dj in range(-2, 3))
        if any(p is not None and (p[0] - x) ** 2 + (p[1] - z) ** 2 < least * least for p in near):
            continue
        taken[i, j] = (x, z)
        points.append((x, z))
        if len(points) == herd.count:
            return np.array(points) + np.array(disc.center_m)
    raise fail(
        f"herds.{herd.name}.place",
        f"only {len(points)} of {herd.count} characters fit in a disc of {disc.radius_m:g} m with {least:g} m between "
        "them; a larger radius_m, a smaller min_distance_m or a smaller count is needed",
    )
