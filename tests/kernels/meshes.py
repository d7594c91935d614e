"""Meshes for drag, and drag itself from Eq. 6 to 8 by clipping polygons one triangle at a time (NumPy, x64)."""

from __future__ import annotations

import numpy as np
import trimesh

REFERENCE_AREA, FADE_SPEED, STILL_SPEED = 0.2, 0.01, 1e-4


def plate(cells: int = 1, side: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Square in the plane z = 0 facing +z, centred: vertices [V, 3], triangles [T, 3]."""
    at = (np.arange(cells + 1) / cells - 0.5) * side
    x, y = np.meshgrid(at, at)
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1, 1)
    lower, upper = corner + np.array([0, 1, cells + 2]), corner + np.array([0, cells + 2, cells + 1])
    return vertices, np.concatenate([lower, upper]).astype(np.int32)


def sphere(refinement: int) -> tuple[np.ndarray, np.ndarray]:
    """Icosphere of radius 1."""
    body = trimesh.creation.icosphere(subdivisions=refinement)
    return np.array(body.vertices), np.array(body.faces, np.int32)


def box(size: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Cuboid about the origin."""
    body = trimesh.creation.box(size)
    return np.array(body.vertices), np.array(body.faces, np.int32)


def blob(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A closed, dented, lopsided body of 80 triangles, about 1 m across."""
    vertices, triangles = sphere(1)
    rng = np.random.default_rng(seed)
    vertices = vertices * rng.uniform(0.3, 0.7, (len(vertices), 1)) * np.array([0.8, 1.2, 0.6])
    return vertices, triangles


def split(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every triangle in four, by the middles of its sides."""
    more, faces = trimesh.remesh.subdivide(vertices, triangles)[:2]
    return np.array(more), np.array(faces, np.int32)


def wet_part(depth: np.ndarray) -> tuple[float, np.ndarray]:
    """Share of a triangle's area with depth > 0, and barycentric coordinates of that part's centroid.

    Sutherland and Hodgman's clipping of the triangle (in barycentric coordinates), then a fan of triangles.
    """
    corners, out = np.eye(3), []
    for k in range(3):
        a, b = depth[k], depth[(k + 1) % 3]
        if a > 0:
            out.append(corners[k])
        if (a > 0) != (b > 0):
            out.append(corners[k] + a / (a - b) * (corners[(k + 1) % 3] - corners[k]))
    area, moment = 0.0, np.zeros(3)
    for k in range(1, len(out) - 1):
        part = abs(np.linalg.det([out[0], out[k], out[k + 1]]))
        area += part
        moment += part * (out[0] + out[k] + out[k + 1]) / 3
    return area, moment / area if area > 0 else np.ones(3) / 3


def reference(
    triangles: np.ndarray,
    vertices: np.ndarray,
    velocity: np.ndarray,
    coefficients: tuple[float, float],
    surface: float,
    submersion: str,
    mode: str,
    whole: bool = False,
) -> tuple[np.ndarray, float, np.ndarray, float]:
    """force, sum |F_i|, sum |F_i| c_i and sum F_i/u_i of one body [V, 3].

    coefficients: C_D0 rho and B. whole: velocity and centre of the whole triangle, area of its wet part.
    """
    force, total, moment, slope = np.zeros(3), 0.0, np.zeros(3), 0.0
    for triangle in triangles:
        a, b, c = vertices[triangle]
        area_vector = 0.5 * np.cross(b - a, c - a)
        area = np.linalg.norm(area_vector)
        depth = surface - vertices[triangle, 1]
        if submersion == "clipped":
            share, centroid = wet_part(depth)
        else:
            share, centroid = float(depth.sum() > 0), np.ones(3) / 3
        if whole:
            centroid = np.ones(3) / 3
        centre, u = centroid @ vertices[triangle], -(centroid @ velocity[triangle])
        speed = np.linalg.norm(u)
        if area == 0 or share == 0 or speed <= STILL_SPEED:
            continue
        projected = share * area * max(-(area_vector / area) @ (u / speed), 0.0)
        if projected == 0:
            continue
        fade = speed**2 / (speed**2 + FADE_SPEED**2)
        offset = coefficients[1] * fade * (projected / REFERENCE_AREA if mode == "area" else 1.0)
        size = coefficients[0] * projected * speed**2 + offset
        force += size * u / speed
        total += size
        moment += size * centre
        slope += size / speed
    return force, float(total), moment, float(slope)
