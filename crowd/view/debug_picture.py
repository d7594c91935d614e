"""Debug pictures: one character near by with its footprints, and beside it the ghost of its unadjusted pose (7.2)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from PIL import Image

from crowd.recorded_scene import HerdLike, SceneLike, motions_of
from crowd.view.camera import framing
from crowd.view.crowd_picture import nearest_frame, surfaces, vertices_at
from crowd.view.footprints import footprint_bodies
from crowd.view.geometry import Body, Geometry
from crowd.view.ghost import ghost_bodies
from crowd.view.palette import linear, srgb
from crowd.view.raster import draw

VIEW = (38.0, 26.0)  # degrees: azimuth from where the character looks, and elevation
FOV = 22.0
BODY = linear(srgb("#56616d"))  # apart from the colours of the legs, darker than the ghost
CLEAR = 0.25  # of the character's height between it and its ghost


def debug_pictures(
    run: Any, scene: SceneLike, herd: HerdLike, moments: Sequence[float], size: tuple[int, int], character: int = 0
) -> list[tuple[float, Image.Image]]:
    """For each moment (s) its time and a picture of one character of a semi-procedural herd, alone on the ground."""
    frames = sorted({nearest_frame(run.time, moment) for moment in moments})
    return [(float(run.time[frame]), _picture(run, scene, herd, frame, size, character)) for frame in frames]


def bodies(run: Any, herd: HerdLike, frame: int, character: int = 0) -> list[Body]:
    """The character, its footprints and its ghost, in this order; what is not known is left out."""
    arrays, one = run.herds[herd.name], slice(character, character + 1)
    vertices = vertices_at(herd, arrays, frame, one)
    own = Body(vertices, np.asarray(herd.archetype.mesh.triangles), BODY[None])
    prints = footprint_bodies(arrays, frame, one)
    ghost = ghost_bodies(herd, arrays, np.asarray(run.time), frame, one, -beside(herd))
    return [own, *prints, *ghost]


def beside(herd: HerdLike) -> float:
    """m between a character of size 1 and its ghost: the body's width and some air."""
    return float(np.ptp(herd.archetype.mesh.vertices[:, 0])) + CLEAR * herd.archetype.height


def _picture(
    run: Any, scene: SceneLike, herd: HerdLike, frame: int, size: tuple[int, int], character: int
) -> Image.Image:
    shown = bodies(run, herd, frame, character)
    points = np.concatenate([body.vertices.reshape(-1, 3) for body in shown])
    yaw = float(np.degrees(run.herds[herd.name]["yaw"][frame, character]))
    camera = framing(points, size, yaw + VIEW[0], VIEW[1], FOV, margin=0.12)
    return draw(Geometry(shown, scene.ground, surfaces(scene), getattr(scene, "terrain", None)), camera, size)


def debug_herds(scene: SceneLike) -> list[HerdLike]:
    """Herds that have something to show: the semi-procedural ones."""
    return [herd for herd in scene.herds if motions_of(herd)]
