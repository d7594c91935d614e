"""Up axes of body and legs: hugging the ground, leaning into accelerations and climbs (section 4.9).

The body's yaw is the only rotation that control knows; its up axis is vertical, so tilts live in the character's own
axes (x to its left, z ahead) and are small rotations from the vertical.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from kernels import controllers
from kernels.vec import TINY, dot, unit, with_row

UPRIGHT = 0.1  # m2, of a person


class Tilt(NamedTuple):
    """How much a body tilts; every field broadcasts to the characters."""

    hug_x: Array  # 0 keeps the body upright across, 1 lays it along the ground (roll)
    hug_z: Array  # the same along (pitch): quadrupeds
    climb: Array  # lean into a climb
    climb_sensitivity: Array  # s/m, how soon that grows with speed; 0: never
    accelerate: Array  # lean into accelerations, per m/s2
    accelerate_sensitivity: Array  # s/m; 0: never


def ground_up(
    footing: Float[Array, "3 legs *b"], before: Float[Array, "3 *b"], bias: Float[Array, "*#b"] | float = UPRIGHT
) -> Float[Array, "3 *b"]:
    """Up axis of the plane through the feet with unit height, near the one before where feet do not say it.

    footing: `Support.footing`. before: this axis in the frame before (y = 1). bias: m2, pull towards the vertical, on
    the scale of the squared distances between the feet; the original has `UPRIGHT` whatever the size of the character,
    and small ones then hardly follow the ground.
    """
    middle = footing.mean(1)
    away = footing - middle[:, None]
    size2 = dot(away, away)
    along = dot(away, before[:, None])
    total = (before[:, None] * size2 - away * along).sum(1)
    up = with_row(total, 1, total[1] + bias)
    usable = up[1] > 1e-6
    return jnp.where(usable, up / jnp.where(usable, up[1], 1.0), before)


def lean(
    tilt: Tilt,
    current: Float[Array, "2 *b"],
    acceleration: Float[Array, "2 *b"],
    dt: float | Array,
) -> Float[Array, "2 *b"]:
    """Low-passed lean (left, ahead) from the smoothed acceleration in the character's axes, m/s2."""
    amount = tilt.accelerate * tilt.accelerate_sensitivity
    wanted = jnp.stack([acceleration[0] * amount * (1.0 - tilt.hug_x), acceleration[1] * amount * (1.0 - tilt.hug_z)])
    return current + (wanted - current) * controllers.approach(10.0, dt)


def up_axes(
    tilt: Tilt,
    ground: Float[Array, "3 *b"],
    leaning: Float[Array, "2 *b"],
    travel: Float[Array, "3 *b"],
    speed: Float[Array, "*b"],
) -> tuple[Float[Array, "3 *b"], Float[Array, "3 *b"]]:
    """Unit up axes of the body and of the legs. All in the character's axes.

    ground: `ground_up` turned to the character; travel: `Support.travel` likewise; speed: smoothed, level, m/s.
    """
    fast = 1.0 - 1.0 / (speed * tilt.accelerate_sensitivity + 1.0)
    lean_x, lean_z = leaning[0] * fast, leaning[1] * fast
    x, _, z = ground
    hug = jnp.stack([x * tilt.hug_x, jnp.ones_like(x), z * tilt.hug_z])
    level2 = travel[0] * travel[0] + travel[2] * travel[2]
    moves = level2 > 1e-8
    # up axis of the steps' own slope, with unit height: minus the rise per metre, along the way
    rise = jnp.where(moves, travel[1] / jnp.where(moves, level2, 1.0), 0.0)
    faster = tilt.climb * (1.0 - 1.0 / (speed * tilt.climb_sensitivity + 1.0))
    climb_x = rise * travel[0] * faster * (1.0 - tilt.hug_x)
    climb_z = rise * travel[2] * faster * (1.0 - tilt.hug_z)
    hug = hug / jnp.sqrt(dot(hug, hug) + TINY)
    body = unit(jnp.stack([hug[0] + lean_x + climb_x, hug[1], hug[2] + lean_z + climb_z]))
    legs = unit(jnp.stack([lean_x, jnp.ones_like(lean_x), lean_z]))
    return body, legs


def hugged(tilt: Tilt, ground: Float[Array, "3 *b"], stance: Float[Array, "3 legs *b"]) -> Float[Array, "3 legs *b"]:
    """Stance places of a body that lies along the ground: as much nearer, seen from above, as its hips are.

    ground: `ground_up` turned to the character. The original leaves them where they are on level ground, out of reach
    of the front legs where it is steep downhill. Upright bodies keep theirs.
    """
    x, z = ground[0] * tilt.hug_x, ground[2] * tilt.hug_z
    return jnp.stack([stance[0] / jnp.sqrt(1.0 + x * x), stance[1], stance[2] / jnp.sqrt(1.0 + z * z)])
