"""A perspective camera that looks at a point and can frame what it is shown."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

NEAR = 0.05  # m, nothing nearer than this is drawn


@dataclass(frozen=True)
class Camera:
    """Pinhole camera. World frame: metres, y up. `fov_deg` is the vertical field of view."""

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    fov_deg: float = 28.0

    def axes(self) -> np.ndarray:
        """Rows right, up, forward (unit, world) [3, 3]. Looking straight up or down, +z is up in the picture."""
        forward = np.asarray(self.target, float) - np.asarray(self.eye, float)
        length = np.linalg.norm(forward)
        forward = forward / length if length > 0 else np.array([0.0, 0, 1])
        right = np.cross(forward, [0.0, 1, 0])
        if np.linalg.norm(right) < 1e-6:
            right = np.cross(forward, [0.0, 0, 1])
        right = right / np.linalg.norm(right)
        return np.stack([right, np.cross(right, forward), forward])

    def focal(self, height_px: int) -> float:
        """Focal length in pixels of a picture of this height."""
        return 0.5 * height_px / math.tan(math.radians(self.fov_deg) / 2)

    def view(self, points: np.ndarray) -> np.ndarray:
        """World points [..., 3] to camera coordinates [..., 3]: right, up, distance along the viewing axis (m)."""
        return (np.asarray(points) - np.asarray(self.eye)) @ self.axes().T

    def project(self, points: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Pixel positions [..., 2] (x right, y down) and depth [...] in m of world points; behind the camera: NaN."""
        seen = self.view(points)
        depth = np.where(seen[..., 2] > NEAR, seen[..., 2], np.nan)
        scale = self.focal(size[1]) / depth
        xy = np.stack([0.5 * size[0] + seen[..., 0] * scale, 0.5 * size[1] - seen[..., 1] * scale], -1)
        return xy, depth

    def rays(self, x: np.ndarray, y: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        """World directions [P, 3] (float32) through places x, y [P] of a picture, with length 1 along the view."""
        right, up, forward = self.axes().astype(np.float32)
        focal = np.float32(self.focal(size[1]))
        across, upward = (x - np.float32(0.5 * size[0])) / focal, (np.float32(0.5 * size[1]) - y) / focal
        return across[:, None] * right + upward[:, None] * up + forward


def framing(
    points: np.ndarray,
    size: tuple[int, int],
    azimuth_deg: float = 35.0,
    elevation_deg: float = 16.0,
    fov_deg: float = 28.0,
    margin: float = 0.06,
) -> Camera:
    """Camera from which all `points` [..., 3] (world, m) just fit into a picture of `size` (width, height).

    azimuth_deg: where the camera stands, seen from the points: 0 in front (+z), 90 at +x, 180 behind.
    margin: free share of the picture on each side. Points that are not finite are ignored; no points: the origin.
    """
    cloud = np.asarray(points, float).reshape(-1, 3)
    cloud = cloud[np.isfinite(cloud).all(1)]
    if len(cloud) == 0:
        cloud = np.array([[-1.0, 0, -1], [1.0, 2, 1]])
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    back = np.array(
        [math.cos(elevation) * math.sin(azimuth), math.sin(elevation), math.cos(elevation) * math.cos(azimuth)]
    )
    axes = Camera(tuple(back), (0.0, 0.0, 0.0)).axes()
    half = math.tan(math.radians(fov_deg) / 2) * (1 - 2 * margin)
    slopes = np.array([half * size[0] / size[1], half])
    seen = cloud @ axes.T
    # On each axis the eye must stay behind both limiting planes: |x - centre| <= slope (z + distance).
    upper = np.max(seen[:, :2] - slopes * seen[:, 2:], 0)
    lower = np.min(seen[:, :2] + slopes * seen[:, 2:], 0)
    centre = 0.5 * (upper + lower)
    distance = max(float(np.max((upper - lower) / (2 * slopes))), float(-np.min(seen[:, 2]) + 0.3))
    eye = centre @ axes[:2] - distance * axes[2]
    middle = float(np.mean([seen[:, 2].min(), seen[:, 2].max()]))
    target = centre @ axes[:2] + middle * axes[2]
    return Camera(tuple(eye.tolist()), tuple(target.tolist()), fov_deg)
