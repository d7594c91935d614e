"""Cycle offsets: walk motions shifted in phase so that their feet are planted together (section 2.14)."""

from __future__ import annotations

import numpy as np

ITERATIONS, SETTLED = 100, 1e-4
PULL, GAIN = 0.1, 5.0  # of the original's relaxation
TOGETHER = 0.7  # length of the mean phasor of a leg's phases from which their circular mean means something


def cycle_offsets(stance_time: np.ndarray, compat: bool = False) -> np.ndarray:
    """Offsets [M] in cycles, of sum 0, that bring the stance phases [M, L] of each leg together.

    Default: least squared circular differences. Each leg has the circular mean of its phases, a motion's offset is the
    mean over its legs of what its phases lack to that. Phases spread over the circle are first brought together by the
    strongest common phase pattern (first singular vector of the unit phasors).
    compat: the original's relaxation. Its error shrinks by 1 - L / (M - 1) per iteration (linearised): it never settles
    for M = 2, L = 2, where it swaps the phases to and fro, and for M = 2, L = 4 it leaves noise; it ends after 100
    iterations with whatever it has.
    """
    stance_time = np.asarray(stance_time, float)
    if len(stance_time) < 2:
        return np.zeros(len(stance_time))
    if compat:
        return _relaxed(stance_time)
    offsets = np.zeros(len(stance_time))
    if np.abs(np.exp(2j * np.pi * stance_time).mean(0)).min() < TOGETHER:
        offsets = _pattern(stance_time)
    offsets = offsets + _lack(stance_time + offsets[:, None]).mean(1)
    return offsets - offsets.mean()


def wrapped(phase: np.ndarray) -> np.ndarray:
    """Phases in cycles as [0, 1); np.mod(-1e-17, 1) is 1."""
    phase = np.mod(phase, 1.0)
    return np.where(phase < 1.0, phase, 0.0)


def signed(phase: np.ndarray) -> np.ndarray:
    """Phases in cycles as (-0.5, 0.5]."""
    return 0.5 - np.mod(0.5 - phase, 1.0)


def _lack(phase: np.ndarray) -> np.ndarray:
    """[M, L] signed way from each phase to its leg's circular mean."""
    mean = np.angle(np.exp(2j * np.pi * phase).mean(0)) / (2 * np.pi)
    return signed(mean - phase)


def _pattern(phase: np.ndarray) -> np.ndarray:
    """[M] offsets that bring phases of any spread near to each other, near 0 themselves."""
    phasors = np.exp(2j * np.pi * phase)
    motion = np.linalg.svd(phasors, full_matrices=False)[0][:, 0]
    offsets = -np.angle(motion) / (2 * np.pi)
    common = np.angle(np.exp(2j * np.pi * offsets).sum()) / (2 * np.pi)
    return signed(offsets - common)


def _relaxed(phase: np.ndarray) -> np.ndarray:
    """The original's springs between every two motions, to the letter."""
    count = len(phase)
    springs = count * (count - 1) / 2
    offsets = np.zeros(count)
    first, second = np.triu_indices(count, 1)
    for _ in range(ITERATIONS):
        points = np.exp(2j * np.pi * (phase + offsets[:, None]))
        a, b = points[first], points[second]
        change = np.zeros(count)
        for index, own, other in ((first, a, b), (second, b, a)):
            turned = signed((np.angle(own + PULL * (other - own)) - np.angle(own)) / (2 * np.pi))
            np.add.at(change, index, GAIN / springs * turned.sum(1))
        offsets += change
        if np.abs(change).max() < SETTLED:
            break
    return offsets
