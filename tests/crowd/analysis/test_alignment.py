"""Cycle offsets: the table of the original's human motions, few motions and many legs, any common shift."""

from __future__ import annotations

import numpy as np
import pytest

from crowd.analysis.alignment import cycle_offsets, signed

# Stance times of eight walk and run cycles of two legs, and the offsets that the original aims at (9.2, 9.3).
HUMAN = np.array(
    [(0.04, 0.52), (0.0, 0.52), (0.04, 0.5), (1.0, 0.46), (0.02, 0.5), (0.92, 0.48), (0.02, 0.52), (0.04, 0.52)]
)
OFFSETS = [-0.02366, -0.00374, -0.01370, 0.02616, -0.00373, 0.05603, -0.01370, -0.02366]


def spans(phase: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """[L] smallest arc that holds the aligned phases of each leg, when that is less than half a cycle."""
    aligned = phase + offsets[:, None]
    return np.ptp(signed(aligned - aligned[:1]), axis=0)


def test_offsets_of_the_human_set() -> None:
    assert cycle_offsets(HUMAN, compat=True) == pytest.approx(OFFSETS, abs=6e-6)
    closed = cycle_offsets(HUMAN)
    assert closed == pytest.approx(OFFSETS, abs=3e-4)
    for offsets in (closed, cycle_offsets(HUMAN, compat=True)):
        assert abs(offsets.sum()) < 1e-9
        assert (spans(HUMAN, offsets) < 0.06).all()  # property 24: .0503 and .0496


@pytest.mark.parametrize(("motions", "legs"), [(2, 1), (2, 2), (2, 4), (3, 2), (5, 4), (12, 12)])
def test_motions_of_one_pattern_are_brought_together(motions: int, legs: int) -> None:
    """Whatever the shifts: also where the relaxation swings for ever (n = 2, L = 2) or diverges (n = 2, L = 4)."""
    generator = np.random.default_rng(motions * 100 + legs)
    pattern, shift = generator.uniform(size=legs), generator.uniform(size=motions)
    phase = np.mod(pattern + shift[:, None] + 0.004 * generator.standard_normal((motions, legs)), 1.0)
    offsets = cycle_offsets(phase)
    assert abs(offsets.sum()) < 1e-9
    assert (spans(phase, offsets) < 0.03).all()


def test_small_differences_of_two_motions() -> None:
    """A difference of 0.05 becomes half of it on either side; the relaxation makes it larger for four legs."""
    phase = np.array([[0.0, 0.25, 0.5, 0.75], [0.05, 0.3, 0.55, 0.8]])
    assert cycle_offsets(phase) == pytest.approx([0.025, -0.025])
    assert np.ptp(cycle_offsets(phase, compat=True)) > 0.1


def test_a_minimum_of_the_squared_differences() -> None:
    generator = np.random.default_rng(4)
    phase = np.array([0.1, 0.6, 0.35]) + 0.05 * generator.standard_normal((6, 3))
    offsets = cycle_offsets(phase)

    def cost(tried: np.ndarray) -> float:
        aligned = phase + tried[:, None]
        return float(np.sum(signed(aligned[:, None] - aligned[None]) ** 2))

    best = cost(offsets)
    for _ in range(50):
        assert cost(offsets + 0.02 * generator.standard_normal(6)) > best - 1e-5


def test_one_motion_and_opposite_phases() -> None:
    assert cycle_offsets(np.array([[0.3, 0.8]])) == pytest.approx([0.0])
    offsets = cycle_offsets(np.array([[0.0, 0.5], [0.5, 0.0]]))
    assert np.isfinite(offsets).all() and spans(np.array([[0.0, 0.5], [0.5, 0.0]]), offsets) == pytest.approx([0, 0])
