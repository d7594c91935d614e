"""Leg responses of a herd as arrays: high steps and clearance between legs."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from crowd import posing
from crowd.analysis.gait import feet
from crowd.host_arrays import f32
from crowd.params import HighStep, LegClearance
from crowd.scene import HerdScene
from crowd.types import Archetype

LEG_SHARE = 0.22  # of the legs' length: feet that rest further apart count as resting at that


def leg_responses(herd: HerdScene, size: np.ndarray) -> dict[str, Any]:
    """Fields of `crowd.params.Responses` about legs, not yet in tiles; None for those not asked for. size [n]: over a
    person's."""
    own = herd.model.responses
    step, apart, pairs = own.high_step, own.leg_clearance, near_legs(herd)
    return dict(
        high_step=HighStep(f32(step.clearance_m * size), f32(step.to_depth_m * size)) if step is not None else None,
        clearance=LegClearance(f32(apart.gap_share * _distances(herd, pairs)[:, None] * herd.scale))
        if apart is not None and pairs
        else None,
    )


def near_legs(herd: HerdScene) -> tuple[tuple[int, int], ...]:
    """(a leg, one that it gives way to): its partner of the other side, and those before and behind on its own side."""
    legs, place = herd.archetype.legs, _stand(herd)
    both = {(i, p) for i, p in enumerate(partners(herd.archetype)) if p != i}
    for side in {leg.side for leg in legs}:
        row = sorted((i for i, leg in enumerate(legs) if leg.side == side), key=lambda i: float(place[i, 1]))
        both |= set(itertools.pairwise(row))
    return tuple(sorted(both | {(j, i) for i, j in both}))


def partners(rig: Archetype) -> tuple[int, ...]:
    """For each leg the nearest one of the other side, when that is mutual; else itself."""
    _, at_rest = posing.world_transforms(rig.skeleton, posing.rest_motion(rig.skeleton))
    place = np.array([at_rest[leg.hip] for leg in rig.legs])

    def nearest(i: int) -> int:
        others = [j for j, leg in enumerate(rig.legs) if leg.side == -rig.legs[i].side and leg.side != 0]
        mirrored = place[i] * [-1, 1, 1]
        return min(others, key=lambda j: float(np.linalg.norm(place[j] - mirrored)), default=i)

    return tuple(nearest(i) if nearest(nearest(i)) == i else i for i in range(len(rig.legs)))


def _distances(herd: HerdScene, pairs: tuple[tuple[int, int], ...]) -> np.ndarray:
    """[P] m at scale 1, at which the feet of pairs of legs stand at rest, or LEG_SHARE of the legs' length if less."""
    rig, place = herd.archetype, _stand(herd)
    _, at = posing.world_transforms(rig.skeleton, posing.rest_motion(rig.skeleton))
    length = [
        float(np.linalg.norm(at[leg.hip] - at[leg.knee]) + np.linalg.norm(at[leg.knee] - at[leg.ankle]))
        for leg in rig.legs
    ]
    return np.array([min(np.hypot(*(place[i] - place[j])), LEG_SHARE * min(length[i], length[j])) for i, j in pairs])


def _stand(herd: HerdScene) -> np.ndarray:
    """[L, 2] m (x, z), where the feet stand in the idle clip."""
    contact, _ = feet(herd.archetype, herd.idle.rotation, herd.idle.translation)
    return contact.mean(0)[:, [0, 2]]
