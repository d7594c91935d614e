"""When a foot leaves and meets the ground, from curves over one cycle (sections 2.6 and 2.7), to the letter."""

from __future__ import annotations

import numpy as np

CONTACT_SPREAD = 5  # samples of 50, over which the curvature of a height curve is taken
SWING_SHARE = 5  # one in so many samples: spread of the velocity that tells of the swing


def contact_time(
    height: np.ndarray, stance: int, way: int, y_range: float, ground: float, threshold: float = 0.1
) -> float:
    """Leg-cycle time at which a point leaves (way 1) or meets (way -1) the ground: its height curve bends up most.

    height: [N] y over one cycle. The search goes from the stance sample on until the point is higher than `threshold`
    of the range. 0 when nothing is found, and for a curve without range.
    """
    count = len(height)
    if y_range <= 0:
        return 0.0
    at = stance + way * np.arange(count)
    before, here, behind = (height[(at + shift) % count] for shift in (-CONTACT_SPREAD, 0, CONTACT_SPREAD))
    bend = np.arctan(10 * (behind - here) / y_range) - np.arctan(10 * (here - before) / y_range)
    rises = np.where(behind - before >= 0, 1, -1) == way  # the sign of 0 is +1
    high = here > ground + threshold * y_range
    searched = np.arange(count) <= (np.argmax(high) if high.any() else count)
    bend = np.where(searched & rises & (here > ground) & (bend > 0), bend, 0.0)
    best = int(np.argmax(bend))  # the first of equals
    return float((way * best) % count / count) if bend[best] > 0 else 0.0


def swing_change(along: np.ndarray, stance: int, way: int, threshold: float = 0.5) -> float:
    """Leg-cycle time at which the foot's pace along the movement axis first differs by half from that at the stance.

    along: [N] place along the axis over one cycle. 0.99 forwards and 0.01 backwards when it never does.
    """
    count = len(along)
    spread = count // SWING_SHARE
    at = stance + way * np.arange(count)
    pace = along[(at + spread) % count] - along[(at - spread) % count]
    with np.errstate(divide="ignore", invalid="ignore"):
        changed = np.abs((pace - pace[0]) / pace[0]) > threshold  # 0 / 0 is no change
    if not changed.any():
        return float(np.mod(-0.01 * way, 1.0))
    return float((way * int(np.argmax(changed))) % count / count)
