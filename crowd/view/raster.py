"""Pictures of skinned crowds with no display: geometry in, image out, in NumPy alone.

A z-buffer finds the triangle seen in each pixel (twice as many pixels each way as asked for); ground, bodies, shadows,
water and sky are coloured afterwards and averaged down. Drawing the same geometry twice gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from crowd.view.camera import Camera
from crowd.view.geometry import Body, Geometry, Level, collect
from crowd.view.shading import Shader
from crowd.view.zbuffer import rasterize

SUPERSAMPLE = 2
BAND = 12  # rows of the finished picture coloured at a time: small enough to stay near the processor


def draw(geometry: Geometry, camera: Camera, size: tuple[int, int] = (1600, 700), smooth: bool = True) -> Image.Image:
    """Picture (RGB, width x height pixels) of the geometry. smooth: shade across edges; False shows the facets."""
    fine = (size[0] * SUPERSAMPLE, size[1] * SUPERSAMPLE)
    triangles = collect(geometry, camera, smooth)
    xy, depth = camera.project(triangles.corners, fine)
    near = np.nan_to_num(1.0 / depth)
    visible = rasterize(xy, near, fine)
    shader = Shader.of(geometry, camera, fine, triangles, xy, near)
    picture = np.empty((size[1], size[0], 3), np.uint8)
    for top in range(0, size[1], BAND):
        rows = slice(top * SUPERSAMPLE, min(top + BAND, size[1]) * SUPERSAMPLE)
        color = shader.band(rows.start, visible.triangle[rows], visible.nearness[rows], SUPERSAMPLE)
        picture[top : top + BAND] = np.clip(color, 0.0, 1.0) ** (1 / 2.2) * 255 + 0.5
    return Image.fromarray(picture)


def label(image: Image.Image, text: str, at: tuple[int, int] = (12, 8), size_px: int = 22) -> Image.Image:
    """Copy of the picture with dark text on a pale plate."""
    out = image.convert("RGBA")
    plate = Image.new("RGBA", out.size, (0, 0, 0, 0))
    pen = ImageDraw.Draw(plate)
    font = ImageFont.load_default(size_px)
    left, top, right, bottom = pen.textbbox(at, text, font=font)
    pen.rounded_rectangle((left - 7, top - 5, right + 7, bottom + 6), 6, fill=(255, 255, 255, 190))
    pen.text(at, text, font=font, fill=(31, 41, 51, 255))
    return Image.alpha_composite(out, plate).convert("RGB")


def contact_sheet(
    images: Sequence[Image.Image],
    labels: Sequence[str] = (),
    columns: int = 1,
    gap_px: int = 6,
    title: str = "",
) -> Image.Image:
    """Pictures side by side, row by row, `columns` per row, each with its label and all under a title.

    At least one picture; a column is as wide as its widest picture.
    """
    columns = min(columns, len(images))
    widths = [max(image.width for image in images[column::columns]) for column in range(columns)]
    left = np.concatenate([[0], np.cumsum(np.add(widths, gap_px))]).astype(int).tolist()
    height, top = max(image.height for image in images), 28 if title else 0
    rows = -(-len(images) // columns)
    sheet = Image.new("RGB", (left[-1] - gap_px, top + rows * (height + gap_px) - gap_px), "white")
    if title:
        ImageDraw.Draw(sheet).text((8, 4), title, font=ImageFont.load_default(17), fill=(31, 41, 51))
    for number, image in enumerate(images):
        text = labels[number] if number < len(labels) else ""
        shown = label(image, text, size_px=int(np.clip(height / 18, 11, 26))) if text else image
        sheet.paste(shown, (left[number % columns], top + (number // columns) * (height + gap_px)))
    return sheet


__all__ = ["Body", "Geometry", "Level", "contact_sheet", "draw", "label"]
