"""A walk played backwards (section 2.13): motions that a character has no clip for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crowd.analysis.motion import Motion, mirrored
from crowd.errors import fail

SUFFIX = " (backwards)"


def backwards_twin(motion: Motion) -> Motion:
    """The motion played backwards: the negative velocity, mirrored key times, phases and foot flight.

    The twin of a twin is the original motion. compat: its table is the original's read backwards; the sample that the
    original holds at the end of its table comes first there, which `Motion.flight_at` reads right.
    Raises InputError for grounded motions.
    """
    if motion.kind == "grounded":
        raise fail(f"clip '{motion.name}'", "is grounded; only walks can be played backwards")
    name = motion.name.removesuffix(SUFFIX) if motion.backwards else motion.name + SUFFIX
    offset = motion.cycle_offset
    return replace(
        motion,
        name=name,
        direction=-motion.direction,
        velocity=-motion.velocity,
        stance_time=1.0 - (motion.stance_time - offset) + offset,
        keytimes=1.0 - motion.keytimes[:, ::-1],
        flight=mirrored(motion.flight),
        backwards=not motion.backwards,
        notes=motion.notes,
    )


def travels_backwards(velocity: np.ndarray) -> bool:
    """Whether a velocity [3] points backwards rather than sideways or forwards."""
    return bool(velocity[2] < -0.7 * np.linalg.norm(velocity)) and bool(np.any(velocity))
