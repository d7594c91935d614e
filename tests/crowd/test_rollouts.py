"""Losses on rollouts: the frames of a plain run, derivatives that do not depend on checkpoints, and clear refusals."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import crowd
from crowd.params import Params
from crowd.rollouts import Rollout, Start
from tests.crowd.scenes import herd, run, scenario

MODEL = scenario([herd("p", "human", 2, arms_up=False)], 0.6)
SECONDS = 0.4  # 24 frames


def velocity(states: tuple[Any, ...], frames: tuple[Any, ...]) -> Any:
    return {"velocity": states[0].velocity, "drag": frames[0].drag_force}


def speed(roll: Rollout, gain: jax.Array, start: Start) -> jax.Array:
    """m/s of the first character, mean over the rollout, with so many times the gains."""
    walker = roll.params.characters[0]
    walker = dataclasses.replace(walker, gain_forward=walker.gain_forward * gain)
    shown, _ = roll(dataclasses.replace(roll.params, characters=(walker,)), start, velocity)
    return shown["velocity"][:, 0, 1, 0].mean()


def test_frames_are_those_of_a_plain_run_and_it_goes_on_from_its_end() -> None:
    roll = crowd.rollout(crowd.load(MODEL), SECONDS)

    def both(params: Params, start: Start) -> Any:
        return roll(params, start, velocity)

    once = jax.jit(both)
    shown, end = once(roll.params, roll.start)
    more, _ = once(roll.params, end)
    plain = run(MODEL, 2 * SECONDS)["p"]
    found = np.concatenate([shown["velocity"], more["velocity"]])[:, 0, :, :2]
    np.testing.assert_array_equal(np.moveaxis(found, 1, 2), plain["velocity"][..., ::2])


def test_blocks_of_checkpoints_change_nothing_but_memory() -> None:
    scene, found, memory = crowd.load(MODEL), {}, {}
    for block in (1, 6):
        roll = crowd.rollout(scene, SECONDS, settle_s=0.5, block=block)
        program = jax.jit(jax.grad(lambda gain, start, roll=roll: speed(roll, gain, start)))
        compiled = program.lower(jnp.float32(1.0), roll.start).compile()
        found[block] = float(compiled(jnp.float32(1.0), roll.start))
        used = compiled.memory_analysis()
        assert used is not None
        memory[block] = used.temp_size_in_bytes
    assert found[1] > 1e-3, "stronger walkers are faster"
    assert found[6] == pytest.approx(found[1], rel=1e-5)
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
