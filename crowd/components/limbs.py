"""Limbs: carry every joint along with the limb segment it belongs to, after inverse kinematics."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from crowd.components.feet import Segments
from crowd.layout import HerdLayout
from kernels import quat
from kernels.rows import merged, picked
from kernels.vec import plus
from kernels.wall import Wall


def joined(first: Segments, second: Segments | None) -> Segments:
    """The segments of legs and arms together."""
    if second is None:
        return first
    return Segments(*(jnp.concatenate([a, b], 1) for a, b in zip(first, second, strict=True)))


def bend(herd: HerdLayout, transforms: Array, segments: Segments, shift: Array, wall: Wall) -> Array:
    """Transforms [7, J, n] with the body moved by `shift` [3, n] and the limbs turned."""
    segment = herd.limb_segments
    limb = np.flatnonzero((segment >= 0) & (segment < segments.turn.shape[1]))
    if not len(limb):
        return transforms
    trunk = np.setdiff1d(np.arange(herd.joints), limb)
    which = segment[limb]

    def moved(transforms: Array, shift: Array) -> Array:
        return jnp.concatenate([transforms[:4], transforms[4:] + shift[:, None]])

    def turned(transforms: Array, segment: Array) -> Array:
        turn, before, after = jnp.split(segment, (4, 7))
        position = plus(after, quat.rotate(turn, transforms[4:] - before))
        return jnp.concatenate([quat.multiply(turn, transforms[:4]), position])

    body = wall(moved, picked(transforms, trunk, wall), shift)
    each = picked(wall(lambda *parts: jnp.concatenate(parts), *segments), which, wall)
    return merged([body, wall(turned, picked(transforms, limb, wall), each)], [trunk, limb], wall)
