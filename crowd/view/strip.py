"""Strips of pictures: a character's clip phase by phase, from several sides."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from crowd import posing
from crowd.types import Archetype, Clip, Motion
from crowd.view.camera import Camera, framing
from crowd.view.palette import character_colors
from crowd.view.raster import Body, Geometry, contact_sheet, draw

# azimuth, elevation in degrees; azimuth 0 looks at the face, 90 at the left side
VIEWS = {
    "side": (90.0, 4.0),
    "front": (0.0, 6.0),
    "three_quarter": (38.0, 14.0),
    "back": (180.0, 6.0),
    "top": (90.0, 80.0),
}


def clip_strip(
    archetype: Archetype,
    clip: str | Clip | None,
    path: str | Path,
    views: Sequence[str] = ("side", "front", "three_quarter"),
    phases: int = 8,
    cell: tuple[int, int] | None = None,
    bones: bool = False,
    smooth: bool = True,
) -> Path:
    """Write a PNG of a clip on the spot over a 1 m ground grid: a row per view, a column per phase; returns its path.

    clip: a clip of the archetype by name, any Clip of its skeleton, or None for the rest pose. views: names in VIEWS.
    cell: width and height of one picture in pixels; by default fitted to the character's shape. bones: lay the joints
    over the picture. The feet should stand on the grid, dark patches under them; a foot that hovers shows a gap.
    ValueError for an unknown clip or view.
    """
    unknown = [view for view in views if view not in VIEWS]
    if unknown:
        raise ValueError(f"views {unknown} not among {sorted(VIEWS)}")
    name, duration, motion, shares = _phases(archetype, clip, phases)
    rotation, position = posing.world_transforms(archetype.skeleton, motion)
    vertices = posing.skin(archetype.mesh, rotation, position, motion.scale)
    size = cell or _cell(vertices)
    color = character_colors(0, 1)
    images, labels = [], []
    for view in views:
        azimuth, elevation = VIEWS[view]
        cloud = vertices.reshape(-1, 3)
        camera = framing(np.concatenate([cloud, cloud * [1, 0, 1]]), size, azimuth, elevation, 22.0, 0.05)
        for number, share in enumerate(shares):
            body = Body(vertices[number][None], archetype.mesh.triangles, color)
            image = draw(Geometry([body], lambda x, z: np.zeros_like(x)), camera, size, smooth)
            if bones:
                _draw_bones(image, archetype.skeleton.parents, position[number], camera)
            images.append(image)
            labels.append(view.replace("_", " ") if number == 0 else f"{share:.0%}")
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    title = f"{archetype.name} · {name}" + (f" · {duration:.2f} s" if duration else "")
    contact_sheet(images, labels, len(shares), 3, title).save(path)
    return path


def _phases(archetype: Archetype, clip: str | Clip | None, phases: int) -> tuple[str, float, Motion, np.ndarray]:
    """Name, duration (s), poses [phases] and shares of the cycle of the clip asked for."""
    if clip is None:
        rest = posing.rest_motion(archetype.skeleton)
        parts = (rest.position, rest.orientation, rest.rotation, rest.translation, rest.scale)
        return "rest", 0.0, Motion(*(np.asarray(part)[None] for part in parts)), np.zeros(1)
    if isinstance(clip, str):
        known = {each.name: each for each in archetype.clips}
        if clip not in known:
            raise ValueError(f"clip {clip!r} not among {sorted(known)}")
        clip = known[clip]
    shares = np.arange(phases) / phases
    frame = np.round(shares * len(clip.rotation)).astype(int) % len(clip.rotation)
    whole = posing.clip_motion(clip)
    return (
        clip.name,
        clip.duration,
        Motion(
            whole.position[frame],
            whole.orientation[frame],
            whole.rotation[frame],
            whole.translation[frame],
            whole.scale[frame],
        ),
        shares,
    )


def _cell(vertices: np.ndarray) -> tuple[int, int]:
    """Picture size that suits the character's height over its length."""
    extent = np.ptp(vertices.reshape(-1, 3), axis=0)
    ratio = float(np.clip(max(extent[0], extent[2]) / max(float(extent[1]), 1e-6), 0.6, 1.8))
    return (int(200 * ratio**0.5) + 20, int(230 / ratio**0.5) + 20)


def _draw_bones(image: Image.Image, parents: Sequence[int], position: np.ndarray, camera: Camera) -> None:
    pen = ImageDraw.Draw(image)
    xy, _ = camera.project(position, image.size)
    for joint, parent in enumerate(parents):
        if parent >= 0 and np.isfinite(xy[[joint, parent]]).all():
            pen.line([*xy[parent], *xy[joint]], fill=(20, 20, 20), width=1)
    for x, y in xy[np.isfinite(xy).all(1)]:
        pen.ellipse([x - 2, y - 2, x + 2, y + 2], fill=(255, 255, 255), outline=(20, 20, 20))
