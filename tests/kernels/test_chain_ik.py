"""Legs of many bones against bisection over angles in plain NumPy, and at every degenerate place."""

from __future__ import annotations

from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from kernels import chain_ik
from kernels.wall import apart
from tests.kernels.checks import (
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    in_single,
    unit_vectors,
)

KINDS = ("zigzag", "curl", "nearly straight", "in space")


def leg(kind: str, bones: int, count: int, seed: int = 0) -> np.ndarray:
    """Points [3, bones + 1, count] of random legs that hang down."""
    rng = np.random.default_rng(seed)
    length = rng.uniform(0.15, 0.5, (bones, count))
    if kind == "in space":
        way = unit_vectors(rng, 3, bones, count) + np.array([0, -1.5, 0])[:, None, None]
        way /= np.linalg.norm(way, axis=0)
    else:
        least, most = {"zigzag": (0.1, 1.2), "curl": (0.1, 0.5), "nearly straight": (0.005, 0.1)}[kind]
        bend = rng.uniform(least, most, (bones, count))
        if kind != "curl":
            bend *= np.where(np.arange(bones) % 2, 1, -1)[:, None]
        angle = np.cumsum(bend, 0)
        way = np.stack([0 * angle, -np.cos(angle), np.sin(angle)])
    steps = np.concatenate([rng.normal(size=(3, 1, count)), way * length], 1)
    return np.cumsum(steps, 1)


def turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rotation matrix about a unit axis (Rodrigues)."""
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def bent(bones: np.ndarray, change) -> tuple[np.ndarray, list[np.ndarray]]:
    """End [3] and rotations of bones [B, 3] whose interior angles beta become change(beta), as 5.3 has it."""
    rotation, rotations, end = np.eye(3), [np.eye(3)], bones[0]
    for a, b in pairwise(bones):
        normal = np.cross(a, b)
        beta = np.pi - np.arctan2(np.linalg.norm(normal), a @ b)
        rotation = rotation @ turn(normal / np.linalg.norm(normal), beta - change(beta))
        rotations.append(rotation)
        end = end + rotation @ b
    return end, rotations


def by_bisection(points: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """One leg [3, B + 1] solved as 5.3 has it, with 60 halvings: points and world rotations of the bones."""
    bones, way = np.diff(points.T, axis=0), target - points[:, 0]
    asked = np.linalg.norm(way)

    def reach(change) -> float:
        return float(np.linalg.norm(bent(bones, change)[0]))

    def straighter(x: float):
        return lambda beta: (1 - x) * np.pi + x * beta

    def folded(x: float):
        return lambda beta: max(beta - x * np.pi / 6, 0.0)

    if asked > reach(lambda beta: beta):
        change, low, high = straighter, 1.0, 0.0  # low: too short
    else:
        change, high = folded, 0.0
        low = next(float(x) for x in range(1, 7) if reach(folded(x)) <= asked)
        high = low - 1
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if reach(change(middle)) <= asked else (low, middle)
    end, rotations = bent(bones, change(low))
    a, b = end / np.linalg.norm(end), way / asked
    axis = np.cross(a, b)
    swing = turn(axis / np.linalg.norm(axis), float(np.arctan2(np.linalg.norm(axis), a @ b)))
    rotations = [swing @ rotation for rotation in rotations]
    steps = [rotation @ bone for rotation, bone in zip(rotations, bones, strict=True)]
    return np.cumsum([points[:, 0], *steps], axis=0).T, rotations


def goals(points: np.ndarray, seed: int = 1) -> np.ndarray:
    """Targets that folding or straightening comes to, away from either end."""
    rng = np.random.default_rng(seed)
    out = []
    for k in range(points.shape[-1]):
        bones = np.diff(points[..., k].T, axis=0)
        now, most = np.linalg.norm(bones.sum(0)), np.linalg.norm(bones, axis=1).sum()
        least = min(np.linalg.norm(bent(bones, lambda b, x=x: max(b - x * np.pi / 6, 0))[0]) for x in range(7))
        low, high = (least, now) if k % 2 else (now, 0.999 * most)
        out.append(low + (high - low) * rng.uniform(0.05, 1.0))
    return points[:, 0] + unit_vectors(rng, 3, points.shape[-1]) * np.array(out)


def lengths(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.diff(points, axis=1), axis=0)


def rotated(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    w, u = q[0], q[1:]
    return v + 2 * np.cross(u, np.cross(u, v, axis=0) + w * v, axis=0)


def solved(points: jax.Array, target: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """The bent leg, what is missing, and the rotations."""
    after, missing = chain_ik.chain(points, target)
    return after, missing, chain_ik.turns(points, after)


def walled(points: jax.Array, target: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """The same behind walls, which compile faster."""
    wall = apart.gate(jnp.isfinite(target.sum()))
    after, missing = chain_ik.chain(points, target, wall=wall)
    return after, missing, chain_ik.turns(points, after, wall)


@pytest.mark.parametrize("bones", [2, 3, 5])
def test_reachable_targets(bones: int) -> None:
    """Property 19, bone lengths, and the pose and rotations of the bisection."""
    points = np.concatenate([leg(kind, bones, 40, seed=bones) for kind in KINDS], -1)
    target = goals(points)
    after, missing, turned = in_single(solved, points, target)
    whole = lengths(points).sum(0)
    assert (missing < 1e-3 * whole).all()
    assert_close(np.linalg.norm(after[:, -1] - target, axis=0), missing, 1e-5)
    assert_close(lengths(after), lengths(points), 1e-5)
    assert_close(np.linalg.norm(turned, axis=0), np.ones(turned.shape[1:]), 1e-5)
    assert_close(rotated(turned, np.diff(points, axis=1)), np.diff(after, axis=1), 2e-5)
    same = 0
    for k in range(points.shape[-1]):
        expected, rotations = by_bisection(points[..., k], target[:, k])
        if np.abs(after[..., k] - expected).max() < 0.01 * whole[k]:
            same += 1
            for i, rotation in enumerate(rotations):
                ours = np.stack([rotated(turned[:, i, k], axis) for axis in np.eye(3)], 1)
                assert np.abs(ours - rotation).max() < 0.2, "no spurious twist"
    assert same >= 0.95 * points.shape[-1], "flat curves of reach may have a second solution"


def test_out_of_reach_is_straight_and_points_at_the_target() -> None:
    points = leg("zigzag", 3, 160)
    way = unit_vectors(np.random.default_rng(2), 3, 160) * np.linspace(1.8, 50.0, 160)
    after, missing, _ = in_single(solved, points, points[:, 0] + way)
    whole, span = lengths(points).sum(0), np.linalg.norm(after[:, -1] - after[:, 0], axis=0)
    assert (span > (1 - 1e-3) * whole).all()
    assert_close((after[:, -1] - after[:, 0]) / span, way / np.linalg.norm(way, axis=0), 1e-4)
    assert_close(missing, np.linalg.norm(way, axis=0) - span, 1e-4)


def test_padding_changes_nothing() -> None:
    """A leg of three bones with its hip repeated is the leg of three bones."""
    points = leg("zigzag", 3, 160)
    target = goals(points)
    padded = np.concatenate([points[:, :1], points[:, :1], points], 1)
    after, missing, turned = in_single(solved, padded, target)
    plain, same, fewer = in_single(solved, points, target)
    assert_close(after[:, 2:], plain, 1e-4)
    assert_close(after[:, :2], np.repeat(points[:, :1], 2, 1), 1e-5)
    assert_close(missing, same, 1e-4)
    assert_close(turned[:, 2:], fewer, 1e-3)
    assert_close(turned[:, 0], turned[:, 2], 1e-3)


def test_a_target_where_the_ankle_is_leaves_the_leg() -> None:
    points = leg("in space", 3, 160)
    after, missing, turned = in_single(solved, points, points[:, -1])
    assert_close(after, points, 3e-3)
    assert missing.max() < 1e-3
    assert np.abs(turned[1:]).max() < 0.01


def test_shapes_and_walls() -> None:
    points = leg("zigzag", 3, 160)
    target = goals(points)
    expected = in_single(solved, points, target)
    wide = in_single(solved, points.reshape(3, 4, 10, 16), target.reshape(3, 10, 16))
    assert_close([x.reshape(*x.shape[:-2], 160) for x in wide], list(expected), 1e-5)

    assert_close(in_single(walled, points, target), expected, 2e-5)
    mapped = in_single(jax.vmap(chain_ik.chain, (-1, -1), -1), points, target)
    assert_close(mapped, expected[:2], 1e-5)


DEGENERATE = {
    # points and target relative to the hip
    "straight": ([(0, 0, 0), (0, -0.4, 0), (0, -0.8, 0), (0, -1.0, 0)], (0.1, -0.7, 0)),
    "at the hip": ([(0, 0, 0), (0, -0.4, 0.1), (0, -0.8, 0), (0, -1.0, 0.1)], (0, 0, 0)),
    "opposite": ([(0, 0, 0), (0, 0, 0), (0, -0.4, 0.1), (0, -0.8, 0.0)], (0, 0.6, 0)),
    "no bones": ([(0, 0, 0), (0, 0, 0), (0, 0, 0), (0, 0, 0)], (0, -0.5, 0)),
    "folded flat": ([(0, 0, 0), (0, 0, 0), (0, -0.4, 0), (0, 0, 0)], (0, -0.5, 0)),
    "far": ([(0, 0, 0), (0, 0, 0), (0, -0.4, 0.1), (0, -0.8, 0)], (0, -1e4, 0)),
    "full stretch": ([(0, 0, 0), (0, 0, 0), (0, -0.3, 0.4), (0, -0.6, 0)], (0, -1.0, 0)),
    "as it is": ([(0, 0, 0), (0, -0.2, 0), (0, -0.3, 0.4), (0, -0.6, 0)], (0, -0.6, 0)),
}


def test_degenerate() -> None:
    points = np.moveaxis(np.array([case[0] for case in DEGENERATE.values()], float), (0, 2), (2, 0))
    target = np.array([case[1] for case in DEGENERATE.values()], float).T
    after, missing, turned = in_single(solved, points, target)
    assert_close(lengths(after), lengths(points), 1e-5)
    assert_close(missing, np.linalg.norm(after[:, -1] - target, axis=0), 1e-6)
    moved, bones = np.diff(after, axis=1), np.diff(points, axis=1)
    for k, case in enumerate(DEGENERATE):
        assert_close(rotated(turned[..., k], bones[..., k]), moved[..., k], 1e-4)
        if case in ("opposite", "full stretch", "as it is"):
            assert missing[k] < 1e-3, case
        if case in ("straight", "folded flat"):
            assert_close(np.linalg.norm(moved[..., k].sum(1)), np.linalg.norm(bones[..., k].sum(1)), 1e-5)
    assert_gradient_finite(walled, points, target)


def test_gradients_of_the_solution() -> None:
    """Folding and straightening."""
    points = np.concatenate([leg("zigzag", 3, 4, seed=9), leg("in space", 3, 4, seed=9)], -1)

    def bent_leg(points: jax.Array, target: jax.Array) -> tuple[jax.Array, jax.Array]:
        return chain_ik.chain(points, target, wall=apart.gate(jnp.isfinite(target.sum())))

    assert_gradients_agree(bent_leg, points, goals(points), tolerance=1e-3)


def test_gradients_of_rotations() -> None:
    before, after = leg("in space", 2, 6, seed=9), leg("in space", 2, 6, seed=10)

    def turned(before: jax.Array, after: jax.Array) -> jax.Array:
        return chain_ik.turns(before, after, apart.gate(jnp.isfinite(after.sum())))

    assert_gradients_agree(turned, before, after, tolerance=1e-3)
