"""The footstep controller (section 4.1 of the character-fluid paper), for any number of legs.

One clock per character, its phase in cycles of the clip; leg i lifts off when the clock passes `lift_i` and swings for
1 - duty_i of a cycle. For two legs this is the paper's plan / step / plant machine: with step length s and duty D the
printed l, epsilon and d_plan become l = (2 - D) s, epsilon = D s, d_plan = (1 - D) s, and the root's way between two
plans is s whatever D. A leg's `progress` runs from 0 (lift-off) to 1 (planted).
"""

from __future__ import annotations

from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from kernels.vec import TINY

Schedule = Literal["paper", "scaled", "mixed", "actual"]

REAIM_UNTIL = 0.7  # of the swing; later the target stays


def cadence(schedule: Schedule, ratio: Float[Array, "*b"], desired_ratio: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """Cycles per period of the clip. ratio: speed over the clip's own; desired_ratio: the same of the desired speed.

    `paper`: as desired, whatever the drag (strides shrink); `scaled`: the clip's; `actual`: with the actual speed;
    `mixed`: with its fourth root, steps with its power 3/4, as people do in water.
    """
    ratio = jnp.clip(ratio, 0.1, 2.0)
    if schedule == "paper":
        return jnp.clip(desired_ratio, 0.1, 2.0)
    if schedule == "scaled":
        return jnp.ones_like(ratio)
    if schedule == "actual":
        return ratio
    return jnp.sqrt(jnp.sqrt(ratio))


def step_velocity(
    forward: Float[Array, "*b"], left: Float[Array, "*b"], threshold: Float[Array, "*#b"]
) -> tuple[Float[Array, "*b"], Float[Array, "*b"]]:
    """Velocity that steps follow, in the heading frame: sideways and backward parts count beyond a threshold (m/s).

    This is the direction d of Eq. 3: the heading, turning to the low-passed velocity as that leaves it.
    """
    ahead = jnp.where(forward > 0, forward, jnp.minimum(forward + threshold, 0.0))
    aside = left - jnp.clip(left, -threshold, threshold)
    return ahead, aside


def lift_off(
    phase: Float[Array, "*#b"],
    advance: Float[Array, "*#b"],
    lift: Float[Array, "*b"],
    progress: Float[Array, "*b"],
    walking: Bool[Array, "*#b"],
) -> Bool[Array, "*b"]:
    """Which planted legs lift off within this frame; `phase` is the clock at the frame's end, `advance` its way."""
    since = (phase - lift) - jnp.floor(phase - lift)
    return walking & (since < advance) & (progress >= 1.0)


def travelled(progress: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """Share of the step covered: integral of a speed that rises linearly to twice the mean and falls back (Fig. 3)."""
    rest = 1.0 - progress
    return jnp.where(progress < 0.5, 2.0 * progress * progress, 1.0 - 2.0 * rest * rest)


def move_handle(
    handle: Float[Array, "k *b"],
    target: Float[Array, "k *b"],
    before: Float[Array, "*b"],
    after: Float[Array, "*b"],
) -> Float[Array, "k *b"]:
    """The handle after its progress went from `before` to `after`: exact at every frame rate, fixed once planted.

    A target that moves in mid-swing is reached all the same: each frame covers its share of what remains.
    """
    start, end = travelled(before), travelled(after)
    share = (end - start) / jnp.maximum(1.0 - start, TINY)
    moved = handle + (target - handle) * jnp.clip(share, 0.0, 1.0)
    return jnp.where(before >= 1.0, handle, jnp.where(after >= 1.0, target, moved))


def landing(
    root: Float[Array, "2 *c"],
    rest: Float[Array, "2 *b"],
    stride: Float[Array, "2 *c"],
    progress: Float[Array, "*b"],
    duty: Float[Array, "*b"],
) -> Float[Array, "2 *d"]:
    """Where a foot should land (Eq. 3): its rest place as the root will be at landing, half a stance further on.

    root, stride (way per cycle) and rest (of the foot, relative to the root, turned to the heading): ground plane, m.
    """
    return root + rest + stride * ((1.0 - progress) * (1.0 - duty) + 0.5 * duty)
