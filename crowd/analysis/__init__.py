"""Analysis of clips, offline, in NumPy double precision.

`analyse_samples` is the exact reference analysis on sampled matrices (semi-procedural locomotion, section 2).
`feet_of` finds the feet of a character; `analyse_clip` makes of a clip the `Motion` that the runtime plays, and
`crowd.analysis.motion_set.motion_set` analyses and aligns all motions of a character, a `MotionSet`.
`gait.analyse` is the analysis behind the footstep controller.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from crowd.analysis.backwards import backwards_twin
    from crowd.analysis.foot import Foot, feet_of
    from crowd.analysis.motion import Motion, analyse_clip
    from crowd.analysis.motion_set import MotionSet, default_clips
    from crowd.analysis.samples import LegAnalysis, MotionAnalysis, analyse_samples

# Loaded when asked for: name -> module.
_LAZY = {
    "LegAnalysis": "crowd.analysis.samples",
    "MotionAnalysis": "crowd.analysis.samples",
    "analyse_samples": "crowd.analysis.samples",
    "Foot": "crowd.analysis.foot",
    "feet_of": "crowd.analysis.foot",
    "Motion": "crowd.analysis.motion",
    "analyse_clip": "crowd.analysis.motion",
    "backwards_twin": "crowd.analysis.backwards",
    "MotionSet": "crowd.analysis.motion_set",
    "default_clips": "crowd.analysis.motion_set",
}
__all__ = [
    "Foot",
    "LegAnalysis",
    "Motion",
    "MotionAnalysis",
    "MotionSet",
    "analyse_clip",
    "analyse_samples",
    "backwards_twin",
    "default_clips",
    "feet_of",
]


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module 'crowd.analysis' has no attribute '{name}'")
    return getattr(import_module(_LAZY[name]), name)
