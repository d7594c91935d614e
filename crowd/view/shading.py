"""Colours of pixels: ground, bodies, water and sky, a band of the picture at a time. Linear light throughout."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowd.view.camera import NEAR, Camera
from crowd.view.geometry import Geometry, Level, Triangles
from crowd.view.light import HORIZON, TO_SUN, Occlusion, ShadowMap, contact_occlusion, diffuse, shadow_map, sky
from crowd.view.zbuffer import edge_functions

WET = np.array([0.66, 0.64, 0.60], np.float32)  # factor on the ground's colour under water
ABSORB = np.array([1.35, 0.75, 0.62], np.float32)  # of red, green, blue: what makes deep water blue
SHEEN = np.array([0.008, 0.018, 0.026], np.float32)  # light scattered back by the water just below its surface
DRY = 0.004  # m under the surface up to which the ground is still drawn dry: level ground and surface do not flicker
EDGE = 0.05  # difference of normals from which the pixels of the ground between them are drawn finely
UNDER = 0.5  # m below the ground seen from above: a body under a deck, which darkens nothing on the deck
WAVE_LIGHT = 1.6  # how much brighter water is that slopes towards the sun
FINEST = 0.25  # m, simulated waves that are drawn to this length
F32 = np.float32


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


@dataclass(frozen=True, eq=False)
class Shader:
    """Everything a band of pixels needs to be coloured."""

    geometry: Geometry
    camera: Camera
    size: tuple[int, int]
    triangles: Triangles
    corner: np.ndarray  # [T, 2] px, first corner
    slope: np.ndarray  # [T, 3, 2] barycentric coordinates per pixel
    near: np.ndarray  # [T, 3] 1/m
    shadow: ShadowMap | None
    occlusion: Occlusion | None

    @staticmethod
    def of(
        geometry: Geometry,
        camera: Camera,
        size: tuple[int, int],
        triangles: Triangles,
        xy: np.ndarray,
        near: np.ndarray,
    ) -> Shader:
        """Prepare shadows and interpolation for triangles with pixel positions `xy` [T, 3, 2], nearness [T, 3]."""
        bodies = triangles.corners[: triangles.ground]
        with np.errstate(invalid="ignore", over="ignore"):
            slope, _ = edge_functions(xy)
        casting = triangles.corners[: triangles.lowest]
        shadow = shadow_map(casting) if len(casting) else None
        occlusion = None
        if len(bodies) and geometry.ground is not None:
            centre = bodies.mean(1)
            area = 0.25 * np.abs(np.cross(bodies[:, 1] - bodies[:, 0], bodies[:, 2] - bodies[:, 0])[:, 1])
            above = geometry.above(centre)
            occlusion = contact_occlusion(centre, above, np.where(above > -UNDER, area, 0.0))
        return Shader(
            geometry,
            camera,
            size,
            triangles,
            xy[:, 0].astype(F32),
            slope.astype(F32),
            near.astype(F32),
            shadow,
            occlusion,
        )

    def colors(
        self, triangle: np.ndarray, nearness: np.ndarray, x: np.ndarray, y: np.ndarray, span: int = 1
    ) -> np.ndarray:
        """Colours [P, 3] at places x, y (px, pixel centres at +0.5) of the picture, from what is visible there [P].

        span: px that each place stands for in width and height; patterns finer than that are smoothed.
        """
        angle = F32(span / self.camera.focal(self.size[1]))
        rays = self.camera.rays(x, y, self.size)
        hit = triangle >= 0
        color = np.empty((len(triangle), 3), F32)
        clear = rays[~hit]
        color[~hit] = sky(clear / np.sqrt(_dot(clear, clear))[:, None])
        distance = np.full(len(triangle), np.inf, F32)
        distance[hit] = 1.0 / nearness[hit]
        if hit.any():
            color[hit] = self._surface(triangle[hit], rays[hit], distance[hit], x[hit], y[hit], angle)
        for level in self.geometry.levels:
            self._water(level, color, rays, distance, angle)
        return color

    def band(self, top: int, triangle: np.ndarray, nearness: np.ndarray, factor: int) -> np.ndarray:
        """Colours [h, w, 3] of finished pixels, `factor` x `factor` of the picture's, from its rows `top` on.

        triangle, nearness: what is visible there [h * factor, w * factor]. Pixels that see one ground or sky alone are
        coloured once at their centre, the others at each of their parts.
        """
        rows, columns = triangle.shape[0] // factor, triangle.shape[1] // factor
        cut = (rows, factor, columns, factor)
        parts = triangle.reshape(cut).transpose(0, 2, 1, 3).reshape(rows * columns, -1)
        near = nearness.reshape(cut).transpose(0, 2, 1, 3).reshape(rows * columns, -1)
        plain = self._one_ground(parts) | (parts < 0).all(1)
        y, x = np.divmod(np.arange(rows * columns), columns)
        color = np.empty((rows * columns, 3), F32)
        centre = F32(0.5 * factor)
        color[plain] = self.colors(
            parts[plain, 0],
            near[plain].mean(1),
            x[plain].astype(F32) * factor + centre,
            y[plain].astype(F32) * factor + centre + top,
            factor,
        )
        within = np.arange(factor, dtype=F32) + F32(0.5)
        fine_x = (x[~plain, None, None] * factor + within).repeat(factor, 1).astype(F32)
        fine_y = (y[~plain, None, None] * factor + within[:, None] + top).repeat(factor, 2).astype(F32)
        fine = self.colors(parts[~plain].ravel(), near[~plain].ravel(), fine_x.ravel(), fine_y.ravel())
        color[~plain] = fine.reshape(-1, factor * factor, 3).mean(1)
        return color.reshape(rows, columns, 3)

    def _one_ground(self, parts: np.ndarray) -> np.ndarray:
        """Which of the pixels [P, parts] see one piece of ground alone: no edge of stairs, slopes or a deck."""
        ground: np.ndarray = np.all(parts >= self.triangles.ground, axis=1)
        number = parts[ground]
        deck, normal = number < self.triangles.lowest, self.triangles.normals[number, 0]
        ground[ground] = (deck == deck[:, :1]).all(1) & (np.abs(normal - normal[:, :1]).max((1, 2)) < EDGE)
        return ground

    def _haze(self, color: np.ndarray, distance: np.ndarray) -> np.ndarray:
        reach = F32(7.0 * np.linalg.norm(np.subtract(self.camera.eye, self.camera.target)) + 30.0)
        haze = 1.0 - np.exp(-((distance / reach) ** 2))[:, None]
        return color + haze * (HORIZON.astype(F32) - color)

    def _surface(
        self, number: np.ndarray, ray: np.ndarray, depth: np.ndarray, x: np.ndarray, y: np.ndarray, angle: np.float32
    ) -> np.ndarray:
        """Colours [P, 3] of the pixels that see a triangle."""
        points = np.asarray(self.camera.eye, F32) + ray * depth[:, None]
        normal = self._normals(number, x, y)
        unit = ray / np.sqrt(_dot(ray, ray))[:, None]
        on_ground = number >= self.triangles.ground
        cosine = -_dot(normal, unit)
        normal[(cosine < 0) & ~on_ground] *= -1
        lit = np.ones(len(points), F32)
        if self.shadow is not None:
            lit = self.shadow.lit(points + normal * F32(max(0.012, 2.0 * self.shadow.texel)))
        albedo = self.triangles.color[number].astype(F32)
        below = points[on_ground]
        tone = grid_lines(below, unit[on_ground], depth[on_ground] * angle, np.maximum(cosine[on_ground], F32(0.04)))
        open_sky = np.ones(len(points), F32)
        if self.occlusion is not None:
            open_sky[on_ground] = self.occlusion.at(below)
            tone *= np.sqrt(open_sky[on_ground])
        albedo[on_ground] *= tone[:, None]
        for level in self.geometry.levels:
            x, z = points[:, 0], points[:, 2]
            height = level.height + level.rise(x, z)[0] if level.highest > 0 else level.height
            wet = on_ground & (points[:, 1] < height - DRY) & level.covers(x, z)
            albedo[wet] *= WET
        rim = np.where(on_ground, F32(0.0), F32(0.10) * (1.0 - np.abs(cosine)) ** 3)
        color = albedo * diffuse(normal, lit, open_sky) + rim[:, None] * HORIZON.astype(F32)
        return self._haze(color, depth)

    def _normals(self, number: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Corner normals interpolated (perspective-correct) at x, y in px [P, 3]."""
        origin, slope, near = self.corner[number], self.slope[number], self.near[number]
        dx, dy = x - origin[:, 0], y - origin[:, 1]
        corners = self.triangles.normals[number].astype(F32)
        normal = np.zeros((len(number), 3), F32)
        for k in range(3):
            share = slope[:, k, 0] * dx + slope[:, k, 1] * dy + F32(k == 0)
            normal += (np.clip(share, 0.0, 1.0) * near[:, k])[:, None] * corners[:, k]
        return normal / np.maximum(np.sqrt(_dot(normal, normal)), F32(1e-12))[:, None]

    def _water(
        self, level: Level, color: np.ndarray, rays: np.ndarray, distance: np.ndarray, angle: np.float32
    ) -> None:
        """Lay a fluid surface over the band, in place: what is below is tinted by its depth, the sky is mirrored."""
        with np.errstate(divide="ignore", invalid="ignore"):
            along = self._along(level, rays)
            over = (distance - along) * np.abs(rays[:, 1]) > F32(DRY)
            pixel = np.nonzero((along > NEAR) & (along < 1e5) & over)[0]
        ray, reach = rays[pixel], along[pixel]
        x, z = F32(self.camera.eye[0]) + ray[:, 0] * reach, F32(self.camera.eye[2]) + ray[:, 2] * reach
        inside = level.covers(x, z)
        pixel, ray, reach, x, z = pixel[inside], ray[inside], reach[inside], x[inside], z[inside]
        beyond = np.clip(distance[pixel] - reach, 0.0, 1e3)
        length = (beyond * np.abs(ray[:, 1]) * F32(1.5) + np.minimum(beyond, 8.0) * F32(0.05)) / F32(level.clarity)
        through = np.exp(-length[:, None] * ABSORB)
        unit = ray / np.sqrt(_dot(ray, ray))[:, None]
        steep = level.rise(x, z)[1:] if level.highest > 0 else None
        normal = ripples(x, z, reach * angle, np.abs(unit[:, 1]), steep)
        facing = np.clip(-_dot(normal, unit), 0.02, 1.0)
        mirror = unit + 2 * facing[:, None] * normal
        fresnel = (F32(0.02) + F32(0.60) * (1 - facing) ** 5)[:, None]
        glint = np.clip(mirror @ TO_SUN.astype(F32), 0.0, 1.0) ** 220 * F32(0.5)
        body = color[pixel] * through + np.asarray(level.color, F32) * (1 - through) + SHEEN
        if steep is not None:
            body *= np.clip(1 - F32(WAVE_LIGHT) * (steep[0] * TO_SUN[0] + steep[1] * TO_SUN[2]), 0.4, 2.2)[:, None]
        # Where the surface meets a leg or the shore a pale line shows the height of the water.
        edge = np.exp(-((beyond / F32(0.035)) ** 2))[:, None] * F32(0.35)
        body += edge * (F32(0.85) - body)
        color[pixel] = self._haze(body * (1 - fresnel) + fresnel * sky(mirror) + glint[:, None], reach)
        distance[pixel] = reach

    def _along(self, level: Level, rays: np.ndarray) -> np.ndarray:
        """[P] how far along the rays a fluid surface is met: waves by a few steps from the still level."""
        eye = np.asarray(self.camera.eye, F32)
        still = F32(level.height) - eye[1]
        along = still / rays[:, 1]
        if level.highest == 0:
            return along
        highest = F32(level.highest)
        near = np.abs(rays[:, 1] * F32(400.0)) > np.abs(still) + highest  # further off waves are thinner than a line
        ray, found = rays[near], along[near]
        for _ in range(6):
            height, slope_x, slope_z = level.rise(eye[0] + ray[:, 0] * found, eye[2] + ray[:, 2] * found)
            fall = ray[:, 1] - slope_x * ray[:, 0] - slope_z * ray[:, 2]
            fall = np.where(fall * ray[:, 1] > 0.25 * ray[:, 1] ** 2, fall, ray[:, 1])
            found = found - (found * ray[:, 1] - still - height) / fall
        along[near] = found
        return along


def grid_lines(points: np.ndarray, unit: np.ndarray, footprint: np.ndarray, slant: np.ndarray) -> np.ndarray:
    """Factor [P] on the ground's colour: thin lines every metre, stronger every five.

    Lines are smoothed to the patch of ground that a pixel sees along `unit` [P, 3]: `footprint` [P] m across the view,
    footprint / slant along it.
    """
    factor = np.ones(len(points), F32)
    flat = np.maximum(np.sqrt(unit[:, 0] ** 2 + unit[:, 2] ** 2), F32(1e-6))
    for axis, other in ((0, 2), (2, 0)):
        along, across = unit[:, axis] / flat, unit[:, other] / flat
        width = footprint * np.sqrt((along / slant) ** 2 + across**2)
        for every, half, depth in ((F32(1.0), F32(0.012), F32(0.13)), (F32(5.0), F32(0.022), F32(0.20))):
            place = points[:, axis] / every
            distance = np.abs(place - np.round(place)) * every
            cover = np.clip((half - distance) / width + F32(0.5), 0.0, 1.0) * np.minimum(
                F32(1.0), F32(2.2) * half / width
            )
            factor *= 1 - depth * cover
    return factor


def ripples(
    x: np.ndarray, z: np.ndarray, footprint: np.ndarray, slant: np.ndarray, slopes: np.ndarray | None = None
) -> np.ndarray:
    """Unit normals [P, 3] of a quiet water surface; waves smaller than a pixel fade away.

    slopes: [2, P] along x and z of simulated waves; the quiet ones are a third as high then.
    """
    slope_x, slope_z = np.zeros(len(x), F32), np.zeros(len(x), F32)
    blur = footprint / np.maximum(slant, F32(0.05))
    for length, angle, steep in ((2.3, 0.4, 0.018), (1.1, 1.5, 0.022), (0.61, -0.7, 0.024), (0.37, 2.4, 0.022)):
        kx, kz = F32(2 * np.pi / length * np.cos(angle)), F32(2 * np.pi / length * np.sin(angle))
        wave = F32(steep) * np.cos(kx * x + kz * z + F32(3 * angle)) * np.exp(-((blur * F32(2 / length)) ** 2))
        slope_x += wave * F32(np.cos(angle))
        slope_z += wave * F32(np.sin(angle))
    if slopes is not None:
        seen = np.exp(-((blur * F32(2 / FINEST)) ** 2))
        slope_x, slope_z = slope_x / 3 + seen * slopes[0], slope_z / 3 + seen * slopes[1]
    normal = np.stack([-slope_x, np.ones_like(slope_x), -slope_z], -1)
    return normal / np.sqrt(_dot(normal, normal))[:, None]
