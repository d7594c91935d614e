"""Commands within limits per second, against small steps; tables; and pursuit that keeps a lagging body on a circle."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from kernels import steering
from tests.kernels.checks import (
    BATCHES,
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    assert_matches,
    in_double,
    in_single,
)


def limited(dt: float) -> Callable[..., Any]:
    """`approach` over dt."""

    def over(command: Any, desired: Any, up: Any, down: Any) -> Any:
        return steering.approach(command, desired, up, down, dt)

    return over


def halfway(tangent: Any, soon: Any, off: Any, late: Any) -> Any:
    """`pursuit` with half of the lag as preview."""
    return steering.pursuit(tangent, soon, off, late, 0.5)


def small_steps(
    command: np.ndarray, desired: np.ndarray, up: np.ndarray, down: np.ndarray, dt: float, steps: int = 20000
) -> tuple[np.ndarray, np.ndarray]:
    """Command and its mean after dt, by many small straight steps of at most the limit that holds at each."""
    total, h = np.zeros_like(command), dt / steps
    for _ in range(steps):
        way = desired - command
        size = np.hypot(*way)
        falls = (command * way).sum(0) < 0
        most = np.where(falls, down, up) * h
        new = command + way * np.minimum(1.0, most / np.maximum(size, 1e-12))
        total += 0.5 * (command + new)
        command = new
    return command, total / steps


def velocities(seed: int, batch: tuple[int, ...]) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    command, desired = rng.normal(size=(2, 2, *batch))
    up, down = rng.uniform(0.5, 3.0, size=(2, *batch))
    return command, desired, up, down


@pytest.mark.parametrize("batch", BATCHES)
def test_approach_is_what_small_steps_do(batch: tuple[int, ...]) -> None:
    for dt in (0.05, 0.6, 3.0):
        command, desired, up, down = velocities(3, batch)
        expected = small_steps(command, desired, up, down, dt)
        found = in_double(limited(dt), command, desired, up, down)
        assert_close(found, expected, 2e-3)
    if batch == BATCHES[-1]:
        assert_gradients_agree(limited(0.3), command, desired, up, down)


def test_two_halves_make_a_whole() -> None:
    command, desired, up, down = velocities(1, (200,))
    whole, mean = in_double(limited(0.4), command, desired, up, down)
    half, first = in_double(limited(0.2), command, desired, up, down)
    end, second = in_double(limited(0.2), half, desired, up, down)
    np.testing.assert_allclose(end, whole, atol=1e-5)  # 1e-6 m/s are added under the square root
    np.testing.assert_allclose(0.5 * (first + second), mean, atol=1e-5)


def test_approach_arrives_to_the_last_bit_and_is_smooth_there() -> None:
    command, desired, up, down = velocities(2, (50,))
    found, _ = in_single(limited(60.0), command, desired, up, down)
    np.testing.assert_array_equal(found, desired.astype(np.float32))
    stays = in_single(limited(0.1), desired, desired, up, down)
    assert_close(stays, (desired, desired), 1e-6)
    for now in ((desired, desired), (np.zeros((2, 50)), np.zeros((2, 50))), (command, -command)):
        assert_gradient_finite(limited(0.1), *now, up, down)


def test_approach_brakes_and_quickens_at_its_own_rates() -> None:
    """From 1 m/s straight back to -1 m/s: 0.5 s of braking at 2 m/s2, then 1 s at 1 m/s2."""
    start, back = np.array([[0.0], [1.0]]), np.array([[0.0], [-1.0]])
    for dt, speed in ((0.25, 0.5), (0.5, 0.0), (1.0, -0.5), (1.5, -1.0), (9.0, -1.0)):
        found, _ = in_double(limited(dt), start, back, np.ones(1), np.full(1, 2.0))
        np.testing.assert_allclose(found[:, 0], [0.0, speed], atol=2e-6)


@pytest.mark.parametrize("own", [False, True])
def test_between_is_linear_and_held_at_the_ends(own: bool) -> None:
    rng = np.random.default_rng(4)
    table, at = rng.normal(size=(3, 9, 7 if own else 1)), rng.uniform(-3, 12, size=7)
    columns = [table[:, :, n if own else 0] for n in range(7)]
    expected = np.stack([[np.interp(at[n], np.arange(9), row) for row in columns[n]] for n in range(7)], 1)
    assert_matches(steering.between, expected, table, at)
    assert_gradient_finite(steering.between, table, at)
    assert_close(in_single(steering.between, table[:, :1], at), np.broadcast_to(table[:, 0], (3, 7)), 1e-6)


def test_braking_stops_at_the_end_and_not_beyond() -> None:
    """A body with a lag of 0.15 s that follows the allowed speed stops within a centimetre."""
    place, speed, dt = np.zeros(()), np.full((), 1.5), 1 / 60
    for _ in range(600):
        wanted = min(1.5, float(in_double(steering.braking, 2.0 - place, 1.0, 0.45)))
        after = wanted + (speed - wanted) * np.exp(-dt / 0.15)
        place = place + wanted * dt + (speed - after) * 0.15
        speed = after
    assert abs(place - 2.0) < 0.01
    expected = np.sqrt(0.45**2 + 2 * np.array([0.0, 0.5, 8.0])) - 0.45
    assert_matches(steering.braking, expected, np.array([0.0, 0.5, 8.0]), np.ones(1), np.full(1, 0.45))
    assert_gradient_finite(steering.braking, np.array([-1.0, 0.0, 1.0]), np.ones(1), np.full(1, 0.45))


def test_response_time_along_and_across() -> None:
    inertia, forward, side = (np.full(3, value) for value in (140.0, 900.0, 250.0))
    found = in_double(steering.response_time, inertia, forward, side, np.array([0.0, 0.5, 1.0]))
    np.testing.assert_allclose(found, 140.0 / np.array([250.0, 575.0, 900.0]))


@pytest.mark.parametrize(("radius", "speed"), [(2.0, 1.3), (3.0, 0.8), (3.0, 2.0)])
def test_pursuit_keeps_a_lagging_body_on_a_circle(radius: float, speed: float) -> None:
    """The body's velocity follows the one asked for with 0.5 s across its heading, which is the way asked for."""
    lag, dt = 0.5, 0.01
    late = speed * lag
    place, velocity = np.array([radius + 0.2, 0.0]), np.array([0.0, speed])
    off, tangent, soon, curve = [], place, place, place
    for _ in range(2500):
        angle = np.arctan2(place[1], place[0])
        tangent = np.array([-np.sin(angle), np.cos(angle)])
        ahead = angle + 0.5 * late / radius
        soon = np.array([-np.sin(ahead), np.cos(ahead)])
        curve = radius * np.array([np.cos(angle), np.sin(angle)])
        way = tangent + (soon - tangent) / 0.5 + (curve - place) / (2 * late)
        way /= np.linalg.norm(way)
        across = velocity - (velocity @ way) * way
        velocity = speed * way + across * np.exp(-dt / lag)
        place = place + velocity * dt
        off.append(np.hypot(*place) - radius)
    found = in_double(halfway, tangent, soon, curve - place, np.float64(late))
    expected = tangent + (soon - tangent) / 0.5 + (curve - place) / (2 * late)
    np.testing.assert_allclose(found, expected / np.linalg.norm(expected), atol=1e-9)
    assert np.abs(off[1500:]).max() < 0.05
    assert min(off) > -0.1  # it came from 0.2 m outside without swinging far through


def test_pursuit_gradients_and_degenerate_directions() -> None:
    rng = np.random.default_rng(6)
    tangent, soon, off = rng.normal(size=(3, 2, 5))
    late = rng.uniform(0.3, 1.0, size=5)
    assert_gradients_agree(halfway, tangent, soon, off, late)
    zero = np.zeros((2, 5))
    assert_gradient_finite(halfway, zero, zero, zero, late)
