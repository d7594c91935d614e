"""Sampling of cyclic clips against linear interpolation in NumPy."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from kernels import clips
from tests.kernels.checks import BATCHES, assert_close, assert_gradients_agree, assert_matches, in_single

SAMPLES, ROWS, CLIPS = 8, 5, 3
TABLE = np.random.default_rng(0).normal(size=(CLIPS * SAMPLES, 4, ROWS))


def sampled(clip: np.ndarray):
    """The blend as a function of table, phases and weights; the clips [slots, *b] are fixed."""

    def run(table, phase, weight):
        return clips.blend(table, *clips.frame_weights(jnp.asarray(clip), phase, weight, SAMPLES))

    return run


def reference(clip: np.ndarray, phase: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """[4, ROWS, *b] by np.interp around the closed cycle, one value at a time."""
    out = np.zeros((4, ROWS, *phase.shape[1:]))
    knots = np.arange(SAMPLES + 1) / SAMPLES
    for at in np.ndindex(phase.shape):
        columns = np.moveaxis(TABLE[clip[at] * SAMPLES : (clip[at] + 1) * SAMPLES], 0, 2)
        closed = np.concatenate([columns, columns[:, :, :1]], 2)
        value = np.array([[np.interp(phase[at], knots, row) for row in component] for component in closed])
        out[(slice(None), slice(None), *at[1:])] += weight[at] * value
    return out


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("slots", [1, 3])
def test_against_interpolation(slots: int, batch: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    clip = rng.integers(0, CLIPS, (slots, *batch)).astype(np.int32)
    phase, weight = rng.uniform(size=(2, slots, *batch))
    run = sampled(clip)
    assert_matches(run, reference(clip, phase, weight), TABLE, phase, weight)
    if batch == BATCHES[-1] and slots > 1:
        assert_gradients_agree(run, TABLE, phase, weight)


def test_shares_sum_to_the_weights() -> None:
    rng = np.random.default_rng(2)
    clip = np.zeros((2, 50), np.int32)
    phase, weight = rng.uniform(size=(2, 2, 50))
    column, share = in_single(lambda c, p, w: clips.frame_weights(c, p, w, SAMPLES), clip, phase, weight)
    assert_close(share.sum(0), weight, 1e-6)
    assert (share >= 0).all()
    assert ((column >= 0) & (column < SAMPLES)).all()


def test_phase_at_the_ends_of_the_cycle() -> None:
    """0 and 1 are one pose; so is a phase that rounding brought to 1 (wrapping -1e-9 in float32 gives 1)."""
    below = np.nextafter(np.float32(1), np.float32(0))
    phase = np.array([[0.0, 1.0, below]])
    clip, weight = np.full((1, 3), 1, np.int32), np.ones((1, 3))
    pose = in_single(sampled(clip), TABLE, phase, weight)
    assert_close(pose, np.repeat(TABLE[SAMPLES, :, :, None], 3, 2), 1e-5)
