"""Walls between stages: keep XLA's CPU backend from fusing one stage into the next.

On a CPU, XLA fuses a gather, the arithmetic after it and the reduction after that into one loop that recomputes the
gather for every output: 10 to 30 times slower, and the rounding of one character then depends on what stands beside it.
A wall is a conditional whose flag is an argument of the jitted program, so that the compiler cannot see through it. It
works under scan, map, shard_map, vmap (flag not batched) and reverse mode. On a GPU kernels are better large: no walls.

The rule: *gather | elementwise with one output | reduction* are never in one region.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

Wall = Callable[..., Any]


def no_wall(stage: Callable[..., Any], *arguments: Any) -> Any:
    """Run the stage as part of whatever surrounds it."""
    return stage(*arguments)


def through(flag: jax.Array) -> Wall:
    """A wall behind `flag`, a scalar bool that is true at run time and an unbatched argument of the jitted program."""

    def wall(stage: Callable[..., Any], *arguments: Any) -> Any:
        shapes = jax.eval_shape(stage, *arguments)

        def nothing(*_: Any) -> Any:
            return jax.tree.map(lambda shape: jnp.zeros(shape.shape, shape.dtype), shapes)

        return jax.lax.cond(flag, stage, nothing, *arguments)

    return wall
