"""Losses on rollouts: the frames of a plain run, derivatives that do not depend on checkpoints, and clear refusals."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest

import crowd
from crowd.compiler_options import options
from crowd.params import Params
from crowd.rollouts import Rollout, Start
from tests.crowd.scenes import herd, run, scenario

MODEL = scenario([herd("p", "human", 2, arms_up=False)], 0.6)
SECONDS = 0.4  # 24 frames


def velocity(states: tuple[Any, ...], frames: tuple[Any, ...]) -> Any:
    return {"velocity": states[0].velocity, "drag": frames[0].drag_force}


def speed(roll: Rollout, params: Params, start: Start) -> jax.Array:
    """m/s of the first character, mean over the rollout."""
    return roll(params, start, velocity)[0]["velocity"][:, 0, 1, 0].mean()


def test_frames_are_those_of_a_plain_run_and_it_goes_on_from_its_end() -> None:
    roll = crowd.rollout(crowd.load(MODEL), SECONDS)

    def both(params: Params, start: Start) -> Any:
        return roll(params, start, velocity)

    once = jax.jit(both, compiler_options=options())
    shown, end = once(roll.params, roll.start)
    more, _ = once(roll.params, end)
    plain = run(MODEL, 2 * SECONDS)["p"]
    found = np.concatenate([shown["velocity"], more["velocity"]])[:, 0, :, :2]
    np.testing.assert_array_equal(np.moveaxis(found, 1, 2), plain["velocity"][..., ::2])


def test_blocks_of_checkpoints_change_nothing_but_memory() -> None:
    """The gradient by all of Params: stronger walkers are faster, of the second one the first knows nothing."""
    scene, found, memory = crowd.load(MODEL), {}, {}
    for block in (1, 6):
        roll = crowd.rollout(scene, SECONDS, settle_s=0.5, block=block)
        gradient = jax.grad(lambda params, start, roll=roll: speed(roll, params, start), allow_int=True)
        kernels = options(one_function=False)  # compiles sooner
        compiled = jax.jit(gradient, compiler_options=kernels).lower(roll.params, roll.start).compile()
        found[block] = compiled(roll.params, roll.start)
        used = compiled.memory_analysis()
        assert used is not None
        memory[block] = used.temp_size_in_bytes
    for leaf in jax.tree.leaves(found[1]):
        assert leaf.dtype == jax.dtypes.float0 or np.isfinite(leaf).all()
    by_gain = {block: np.asarray(each.characters[0].gain_forward)[0] for block, each in found.items()}
    assert by_gain[1][0] > 1e-6 and not by_gain[1][1:].any()
    np.testing.assert_allclose(by_gain[6], by_gain[1], rtol=1e-5)
    assert found[1].fluids.base_drag.a < 0
    assert memory[6] < memory[1]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((0.4, 0.0, 7), "block: 7: must divide the 24 frames, e.g. 6"),
        ((0.001,), "at least a frame"),
        ((1.0, -1.0), "at least a frame"),
    ],
)
def test_lengths_that_do_not_fit_are_refused(arguments: tuple[Any, ...], told: str) -> None:
    with pytest.raises(crowd.InputError, match=told):
        crowd.rollout(crowd.load(MODEL), *arguments)
