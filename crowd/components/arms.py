"""Arms: hands and forearms that the clip would have under the surface are raised above it (section 4.2)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from crowd.assets import HerdAssets
from crowd.components.feet import Segments
from crowd.layout import HerdLayout
from crowd.params import Character, Params
from crowd.state import State
from kernels import ik, quat
from kernels.vec import TINY, dot, smoothstep, unit

FADE = 0.3  # of the arm's length: depth of the hand over which the response fades in
ASIDE = 0.45  # of the arm's length: how far hands move outward, so that forearms lie level


def arms(
    herd: HerdLayout,
    assets: HerdAssets,
    params: Params,
    character: Character,
    state: State,
    transforms: Array,
    drop: Array,
    surface: Array,
) -> Segments:
    """Upper arms, forearms and hands.

    surface [n]: relative to the character's position, -inf when dry (then nothing moves). The goal is the clip's hand
    raised to the surface and a margin and moved aside; the elbow points outward and up. It fades in with the depth of
    the hand or elbow, whichever is deeper; out of reach the arm points to the goal.
    """
    down = jnp.stack([jnp.zeros_like(drop), drop, jnp.zeros_like(drop)])[:, None]
    position = transforms[4:]
    shoulder, elbow, hand = (position[:, np.array(j)] - down for j in (herd.shoulders, herd.elbows, herd.hands))
    size = assets.arm_length * character.scale
    level = jnp.maximum(surface, -1e3) + params.control.arm_margin
    lowest = jnp.minimum(hand[1], elbow[1])
    response = smoothstep((level - lowest + 0.25 * FADE * size) / (FADE * size))
    short = level - hand[1]
    rise = 0.5 * (short + jnp.sqrt(short * short + (0.1 * size) ** 2))
    outward = quat.rotate(quat.about_y(state.yaw)[:, None], assets.arm_outward)
    goal = hand + outward * (ASIDE * size * response)
    goal = goal.at[1].add(rise * response)
    upper_clip, lower_clip = elbow - shoulder, hand - elbow
    upper = jnp.sqrt(dot(upper_clip, upper_clip) + TINY)
    lower = jnp.sqrt(dot(lower_clip, lower_clip) + TINY)
    reach = hand - shoulder
    bent = upper_clip - dot(upper_clip, reach) / (dot(reach, reach) + TINY) * reach
    raised = outward.at[1].add(1.0) * size
    pole = bent + (raised - bent) * response + 0.02 * size * outward
    new_elbow, new_hand, _ = ik.two_bone(shoulder, goal, pole, upper, lower)
    # blending the turns (not the targets) leaves the clip's arms exactly as they are while the hands are dry
    identity = jnp.zeros((4, *upper.shape), upper.dtype).at[0].set(1.0)
    upper_turn = quat.between(upper_clip / upper, (new_elbow - shoulder) / upper)
    lower_turn = quat.between(lower_clip / lower, unit(new_hand - new_elbow))
    fade = jnp.clip(response * 4.0, 0.0, 1.0)
    upper_turn = quat.normalize(identity + (upper_turn - identity) * fade)
    lower_turn = quat.normalize(identity + (lower_turn - identity) * fade)
    at_elbow = shoulder + quat.rotate(upper_turn, upper_clip)
    at_hand = at_elbow + quat.rotate(lower_turn, lower_clip)
    return Segments(
        jnp.concatenate([upper_turn, lower_turn, lower_turn], 1),
        jnp.concatenate([shoulder, elbow, hand], 1) + down,
        jnp.concatenate([shoulder, at_elbow, at_hand], 1),
    )
