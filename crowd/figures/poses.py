"""Fig. 5: the body in rising water and in thicker fluids, with the speed that is left as a bar."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from crowd.figures.pools import DEPTHS, FLUIDS, Study, Walk
from crowd.recorded_scene import HerdLike
from crowd.view.camera import framing
from crowd.view.crowd_picture import FLUIDS as TINTS
from crowd.view.crowd_picture import vertices_at
from crowd.view.geometry import Body, Geometry, Level
from crowd.view.palette import character_colors
from crowd.view.raster import contact_sheet, draw

SIZE = (420, 460)
AZIMUTH, ELEVATION, FIELD_OF_VIEW = 62.0, 9.0, 24.0  # degrees, from the front left


def figure_5(study: Study, path: Path) -> Path:
    """Two rows: depths of water; fluids, knee-deep and waist-deep."""
    top = [f"water {depth}" for depth in DEPTHS]
    bottom = [*(f"{fluid} knee" for fluid in FLUIDS), *(f"{fluid} waist" for fluid in FLUIDS[1:])]
    images, labels = [], []
    for name in (*top, *bottom):
        walk = study.walks[name]
        images.append(_barred(_picture(study, walk), walk.remaining))
        labels.append(f"{name}: {100 * walk.remaining:.0f} %")
    contact_sheet(images, labels, columns=len(top)).save(path)
    return path


def _picture(study: Study, walk: Walk) -> Image.Image:
    """The walker from its left, at a moment near its end with the right leg ahead."""
    herd: HerdLike = study.scene.herds[0]
    rest = study.scene.herds[0].archetype.mesh.vertices
    reach = np.abs(rest[:, [0, 2]]).max()
    frame = int(np.flatnonzero(np.diff(walk.arrays["phase"]) < -0.5)[-1])
    arrays = {name: values[:, None] for name, values in walk.arrays.items()}
    vertices = vertices_at(herd, arrays, frame, slice(0, 1))
    at = walk.arrays["position"][frame]
    half = 4.0 * max(reach, 0.5 * float(rest[:, 1].max()))
    x, z = ((float(at[axis] - half), float(at[axis] + half)) for axis in (0, 2))
    _, color, clarity = TINTS[FLUIDS.index(walk.pool.fluid)]
    level = Level(walk.depth, color, x, z, clarity)
    body = Body(vertices, herd.archetype.mesh.triangles, character_colors(0, 1))
    # the same box for every walk of a body: its rest pose, a little longer for the strides
    box = at + np.array([[0.0, 0.0, -1.1 * reach], [0.0, rest[:, 1].max(), 1.1 * reach]])
    camera = framing(np.concatenate([box, at + rest]), SIZE, AZIMUTH, ELEVATION, FIELD_OF_VIEW, 0.03)
    return draw(Geometry([body], level_ground, [level]), camera, SIZE)


def level_ground(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Height 0 everywhere."""
    return np.zeros(np.broadcast_shapes(np.shape(x), np.shape(z)))


def _barred(image: Image.Image, share: float) -> Image.Image:
    """A blue bar at the left edge, as high as the share of the speed that is left."""
    pen = ImageDraw.Draw(image)
    height = image.size[1]
    low, high = int(0.92 * height), int(0.12 * height)
    pen.rectangle((14, high, 30, low), outline=(31, 41, 51), width=2)
    pen.rectangle((16, int(low - (low - high) * min(share, 1.0)), 28, low - 2), fill=(0, 114, 178))
    return image
