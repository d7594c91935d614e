"""The gradient of a rollout: reverse mode, forward mode and central differences are one number, in x64."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from crowd import advance, scene
from crowd.build import Program, build
from tests.crowd.scenes import herd, scenario

FRAMES, STEP = 75, 1e-5
QUICKLY: dict[str, Any] = {"xla_backend_optimization_level": 0}  # the programs run once
# factors on C_D0, on B and on the velocity gain; goo, so that each matters
DIRECTION = np.array([1.0, -0.6, 0.3])


def mean_speed(program: Program, factors: jax.Array) -> jax.Array:
    """m/s over the second half of FRAMES frames."""
    layout, assets, params, states = program
    fluids, walker = params.fluids, params.characters[0]
    base, offset = (
        dataclasses.replace(sigmoid, a=sigmoid.a * factor)
        for sigmoid, factor in zip((fluids.base_drag, fluids.offset_force), factors[:2], strict=True)
    )
    walker = dataclasses.replace(walker, gain_forward=walker.gain_forward * factors[2])
    fluids = dataclasses.replace(fluids, base_drag=base, offset_force=offset)
    changed = dataclasses.replace(params, fluids=fluids, characters=(walker,))

    def frame(states: Any, _: None) -> Any:
        states, _ = advance.one_frame(layout, assets, changed, states)
        return states, states[0].velocity[0, 1, 0]

    return jax.lax.scan(frame, states, None, length=FRAMES)[1][FRAMES // 2 :].mean()


def wide(leaf: Any) -> Any:
    value = np.asarray(leaf)
    return jnp.asarray(value, np.float64 if value.dtype.kind == "f" else value.dtype)


def test_reverse_forward_and_differences_agree() -> None:
    """To 1e-4 (to 1e-8 as measured): mode `area`, B smooth, steps of schedule `paper`, several of them."""
    model = scenario([herd("p", "human", 1, arms_up=False)], 0.9, fluid="goo", schedule="paper")
    layout, *trees = build(scene.load(model), walls=False, tile=1)
    with jax.enable_x64(True):
        given = jax.tree.map(wide, trees)

        def run(factors: jax.Array, given: Any) -> jax.Array:
            return mean_speed((layout, *given), factors)

        def forward(factors: jax.Array, given: Any) -> jax.Array:
            return jax.jvp(lambda factors: run(factors, given), (factors,), (jnp.asarray(DIRECTION),))[1]

        def compiled(function: Callable[..., Any]) -> Any:
            return jax.jit(function).lower(jnp.ones(3), given).compile(compiler_options=QUICKLY)

        plain, one = compiled(run), jnp.ones(3)
        reverse = np.asarray(compiled(jax.grad(run))(one, given))
        ahead = float(compiled(forward)(one, given))
        ends = [float(plain(one + sign * STEP * DIRECTION, given)) for sign in (1.0, -1.0)]
        each = [
            float(plain(one + STEP * unit, given) - plain(one - STEP * unit, given)) / (2 * STEP) for unit in np.eye(3)
        ]
    assert np.abs(each).min() > 1e-3
    np.testing.assert_allclose(reverse, each, rtol=1e-4)
    np.testing.assert_allclose(reverse @ DIRECTION, ahead, rtol=1e-9)
    np.testing.assert_allclose((ends[0] - ends[1]) / (2 * STEP), ahead, rtol=1e-4)
