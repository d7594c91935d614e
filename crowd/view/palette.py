"""Colours that people with colour-blindness can tell apart (Okabe and Ito 2008), and their small variations."""

from __future__ import annotations

import numpy as np

# sRGB. Ordered so that the first ones stand out from ground and water.
HERD_COLORS = ("#d55e00", "#009e73", "#cc79a7", "#f0e442", "#0072b2", "#e69f00", "#56b4e9", "#8c8c8c")
LEFT, RIGHT = "#0072b2", "#d55e00"
LEG_COLORS = (LEFT, RIGHT, "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#8c8c8c", "#a89c00")
INK, QUIET, GRID = "#1f2933", "#6b7785", "#d9dee4"


def srgb(color: str) -> np.ndarray:
    """`#rrggbb` as sRGB values [3] in 0..1."""
    return np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0


def linear(color: np.ndarray) -> np.ndarray:
    """sRGB 0..1 to linear light (the usual 2.2 power, exact enough for pictures)."""
    return np.power(np.clip(color, 0.0, 1.0), 2.2)


def herd_color(index: int) -> str:
    """Colour of the herd with this index; repeats after eight."""
    return HERD_COLORS[index % len(HERD_COLORS)]


def leg_color(index: int) -> str:
    """Colour of the leg with this index, left before right; repeats after eight."""
    return LEG_COLORS[index % len(LEG_COLORS)]


def character_colors(index: int, count: int) -> np.ndarray:
    """Linear colours [count, 3] of one herd: its own colour, lighter or darker from one character to the next.

    The variation follows the golden ratio, so it is the same in every picture and neighbours differ.
    """
    step = (np.arange(count) * 0.6180339887) % 1.0
    warm = (np.arange(count) * 0.7548776662) % 1.0
    own = linear(srgb(herd_color(index)))
    light = 0.78 + 0.5 * step[:, None]
    tint = 1.0 + (warm[:, None] - 0.5) * np.array([0.16, 0.0, -0.16])
    white = 0.06 * step[:, None]
    return np.clip(own * light * tint * (1 - white) + white, 0.0, 1.0)
