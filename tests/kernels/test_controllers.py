"""Controllers against the exact solution of their linear equations: the exponential of the system's matrix (SciPy)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm

from kernels import controllers
from tests.kernels.checks import (
    assert_close,
    assert_gradient_finite,
    assert_gradients_agree,
    in_double,
    in_single,
)

FRAMES = (1 / 30, 1 / 60, 1 / 240)

# drag slope, mass, gain, damping
BODIES = {
    "walking": (0.0, 70.0, 900.0, 70.0),
    "in water": (350.0, 70.0, 900.0, 70.0),
    "no controller": (0.0, 70.0, 0.0, 0.0),
    "drag alone": (120.0, 70.0, 0.0, 0.0),
    "stiff": (0.0, 5.0, 2e4, 0.0),
    "near the series": (0.0, 70.0, 45.0, 70.0),
    "sluggish": (0.0, 70.0, 900.0, 5000.0),
}
# drag slope, inertia, gain, damping
LEANS = {
    "yaw": (0.0, 4.0, 500.0, 100.0),
    "pitch": (0.0, 12.0, 1500.0, 250.0),
    "in water": (60.0, 4.0, 500.0, 100.0),
    "under-damped": (0.0, 4.0, 500.0, 5.0),
    "undamped": (0.0, 4.0, 500.0, 0.0),
    "critical": (0.0, 4.0, 400.0, 80.0),
    "nearly critical": (0.0, 4.0, 400.0, 80.001),
    "over-damped": (0.0, 4.0, 100.0, 900.0),
    "no spring": (0.0, 4.0, 0.0, 100.0),
    "stiff": (0.0, 0.5, 5e4, 10.0),
}


def body(rng: np.random.Generator, case: tuple[float, ...], count: int = 6) -> tuple[np.ndarray, ...]:
    """velocity, desired, force, drag, mass, gain, damping."""
    v, desired, force = rng.normal(size=(3, count)) * np.array([[1.5], [1.5], [200.0]])
    return v, desired, force, *(np.full(count, x) for x in case)


def lean(rng: np.random.Generator, case: tuple[float, ...], count: int = 6) -> tuple[np.ndarray, ...]:
    """angle, rate, desired, torque, drag, inertia, gain, damping."""
    angle, rate, desired, torque = rng.normal(size=(4, count)) * np.array([[0.5], [1.0], [0.5], [20.0]])
    return angle, rate, desired, torque, *(np.full(count, x) for x in case)


def exact_velocity(v, desired, force, drag, mass, gain, damping, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """State (v, way, 1) of (m + b) v' = F - c (v - v_0) + k (v_d - v)."""
    out = np.zeros((2, len(v)))
    for i in range(len(v)):
        inertia = mass[i] + damping[i]
        constant = force[i] + drag[i] * v[i] + gain[i] * desired[i]
        system = np.array([[-(drag[i] + gain[i]) / inertia, 0, constant / inertia], [1, 0, 0], [0, 0, 0]])
        out[:, i] = (expm(system * dt) @ [v[i], 0.0, 1.0])[:2]
    return out[0], out[1]


def exact_orientation(
    angle, rate, desired, torque, drag, inertia, gain, damping, dt: float
) -> tuple[np.ndarray, np.ndarray]:
    """State (angle, rate, 1) of I a'' = tau - c (a' - a'_0) + k (a_d - a) - b a'."""
    out = np.zeros((2, len(angle)))
    for i in range(len(angle)):
        constant = torque[i] + drag[i] * rate[i] + gain[i] * desired[i]
        below = [-gain[i] / inertia[i], -(damping[i] + drag[i]) / inertia[i], constant / inertia[i]]
        out[:, i] = (expm(np.array([[0, 1, 0], below, [0, 0, 0]]) * dt) @ [angle[i], rate[i], 1.0])[:2]
    return out[0], out[1]


def over(kernel, dt: float):
    return lambda *at: kernel(*at, dt)


@pytest.mark.parametrize("dt", FRAMES)
def test_velocity(dt: float) -> None:
    """Every table row at once: the batch is (row, sample)."""
    rng = np.random.default_rng(0)
    rows = [body(rng, case) for case in BODIES.values()]
    expected = tuple(np.stack(x) for x in zip(*(exact_velocity(*row, dt=dt) for row in rows), strict=True))
    at = tuple(np.stack(x) for x in zip(*rows, strict=True))
    assert_close(in_double(over(controllers.velocity, dt), *at), expected, 1e-9)
    assert_close(in_single(over(controllers.velocity, dt), *at), expected, 1e-5)


@pytest.mark.parametrize("dt", FRAMES)
def test_orientation(dt: float) -> None:
    """Every table row at once. Without a spring the closed form has a tiny one, and loses digits in float32."""
    rng = np.random.default_rng(1)
    rows = [lean(rng, case) for case in LEANS.values()]
    expected = [np.stack(x) for x in zip(*(exact_orientation(*row, dt=dt) for row in rows), strict=True)]
    at = tuple(np.stack(x) for x in zip(*rows, strict=True))
    sprung = np.array([case[2] > 0 for case in LEANS.values()])
    double = in_double(over(controllers.orientation, dt), *at)
    single = in_single(over(controllers.orientation, dt), *at)
    for kernel, wanted in zip(zip(double, single, strict=True), expected, strict=True):
        assert_close(kernel[0], wanted, 1e-5)
        assert_close(kernel[1][sprung], wanted[sprung], 1e-5)
        assert_close(kernel[1][~sprung], wanted[~sprung], 5e-2)


@pytest.mark.parametrize("batch", [(), (1,), (3, 2)])
def test_any_batch_shape(batch: tuple[int, ...]) -> None:
    rng = np.random.default_rng(2)
    v, desired, force = (x.reshape(batch) for x in rng.normal(size=(3, *batch)))
    constants = [np.full(batch, x) for x in (50.0, 70.0, 900.0, 70.0)]
    flat = [np.ravel(x) for x in (v, desired, force, *constants)]
    expected = tuple(x.reshape(batch) for x in exact_velocity(*flat, dt=1 / 60))
    assert_close(in_double(over(controllers.velocity, 1 / 60), v, desired, force, *constants), expected, 1e-9)


@pytest.mark.parametrize("dt", FRAMES)
def test_two_half_steps_are_one_step(dt: float) -> None:
    """With the external force following its slope, as the model says: F' = F - c (v' - v)."""
    rng = np.random.default_rng(3)
    v, desired, force, drag, *rest = (np.stack(x) for x in zip(*(body(rng, c) for c in BODIES.values()), strict=True))
    half = over(controllers.velocity, dt / 2)
    middle, way = in_double(half, v, desired, force, drag, *rest)
    end, more = in_double(half, middle, desired, force - drag * (middle - v), drag, *rest)
    assert_close((end, way + more), in_double(over(controllers.velocity, dt), v, desired, force, drag, *rest), 1e-9)

    angle, rate, desired, torque, drag, *rest = (
        np.stack(x) for x in zip(*(lean(rng, c) for c in LEANS.values()), strict=True)
    )
    half = over(controllers.orientation, dt / 2)
    turned, slower = in_double(half, angle, rate, desired, torque, drag, *rest)
    end = in_double(half, turned, slower, desired, torque - drag * (slower - rate), drag, *rest)
    assert_close(end, in_double(over(controllers.orientation, dt), angle, rate, desired, torque, drag, *rest), 1e-6)


def test_gradients() -> None:
    rng = np.random.default_rng(4)
    at = tuple(np.stack(x) for x in zip(*(body(rng, case, 2) for case in BODIES.values()), strict=True))
    assert_gradients_agree(over(controllers.velocity, 1 / 60), *at)
    sprung = [case for name, case in LEANS.items() if name != "no spring"]
    at = tuple(np.stack(x) for x in zip(*(lean(rng, case, 2) for case in sprung), strict=True))
    assert_gradients_agree(over(controllers.orientation, 1 / 60), *at, tolerance=1e-4)


@pytest.mark.parametrize("gain", [0.0, 500.0])
def test_gradient_finite_at_rest(gain: float) -> None:
    zero, one = np.zeros(2), np.ones(2)
    assert_gradient_finite(over(controllers.velocity, 1 / 60), zero, zero, zero, zero, one, gain * one, zero)
    turn = over(controllers.orientation, 1 / 60)
    assert_gradient_finite(turn, zero, zero, zero, zero, zero, one, gain * one, zero)
    critical = 2 * np.sqrt(gain) * one
    assert_gradient_finite(turn, zero, zero, zero, zero, zero, one, gain * one, critical)


@pytest.mark.parametrize("gain", [900.0, 158.0])
def test_steady_state(gain: float) -> None:
    """v_d + F / k, and a_d + tau / k, once every transient has died."""
    full = [np.full(1, x) for x in (0.0, 1.3, -300.0, 0.0, 70.0, gain, 70.0)]
    speed, _ = in_double(over(controllers.velocity, 1e3), *full)
    assert_close(speed, np.array([1.3 - 300.0 / gain]), 1e-9)
    full = [np.full(1, x) for x in (0.3, 0.0, 0.1, 25.0, 0.0, 4.0, 500.0, 100.0)]
    angle, rate = in_double(over(controllers.orientation, 10.0), *full)
    assert_close((angle, rate), (np.array([0.15]), np.zeros(1)), 1e-9)


@pytest.mark.parametrize("dt", [1 / 15, 1 / 60])
def test_drag_never_pushes_past_the_flow(dt: float) -> None:
    """A quadratic drag given by its force and slope now, however strong, and a body that only drifts."""
    strength, start = np.meshgrid(np.logspace(0, 8, 9), [0.0, -3.0, 5.0])
    flow, v, zero = 2.0, start, np.zeros_like(start)
    drift = over(controllers.velocity, dt)
    for _ in range(20):
        slope = strength * np.abs(flow - v)
        after, _ = in_single(drift, v, zero, slope * (flow - v), slope, zero + 70, zero, zero)
        assert (np.abs(flow - after) <= np.abs(flow - v) + 1e-5).all()
        assert ((flow - after) * np.sign(flow - start) >= -1e-5).all()
        v = after.astype(float)
    assert (np.abs(v[:, -1] - flow) < 1e-3).all()


def test_stable_at_15_hz_for_any_gains() -> None:
    """The distance from rest never grows beyond the first, over 20 frames of 1/15 s."""
    gain, damping = np.meshgrid([0.0, 1.0, 1e3, 1e6], [0.0, 10.0, 1e4])
    zero = np.zeros_like(gain)
    angle, rate = zero + 0.5, zero
    run = over(controllers.orientation, 1 / 15)
    for _ in range(20):
        angle, rate = in_single(run, angle, rate, zero, zero, zero, zero + 4.0, gain, damping)
        assert np.abs(angle).max() < 0.5 + 1e-3


def test_wrap() -> None:
    angle = np.concatenate([np.linspace(-20, 20, 101), [np.pi, -np.pi, 3 * np.pi]])
    wrapped = in_double(controllers.wrap, angle)
    assert (np.abs(wrapped) <= np.pi + 1e-12).all()
    assert_close(np.stack([np.sin(wrapped), np.cos(wrapped)]), np.stack([np.sin(angle), np.cos(angle)]), 1e-12)
    assert controllers.wrap(jnp.array(np.pi, jnp.float32)) < 0
