"""Matrices of synthetic feet: what their heels and toes do is known."""

from __future__ import annotations

import numpy as np

N = 50
LENGTH = 0.3
HEEL, TOE_TIP = np.array([0.0, -0.1, -0.08]), np.array([0.0, -0.03, 0.08])
TOE_JOINT = np.array([0.0, -0.07, 0.14])  # in the ankle's frame


def about_x(angle: np.ndarray) -> np.ndarray:
    """[n, 3, 3] rotations about x."""
    out = np.tile(np.eye(3), (len(angle), 1, 1))
    out[:, 1, 1] = out[:, 2, 2] = np.cos(angle)
    out[:, 1, 2], out[:, 2, 1] = -np.sin(angle), np.sin(angle)
    return out


def matrices(rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    """[n, 4, 4] of rotations [n, 3, 3] and positions [n, 3]."""
    out = np.zeros((len(position), 4, 4))
    out[:, :3, :3], out[:, :3, 3], out[:, 3, 3] = rotation, position, 1.0
    return out


def foot(heel: np.ndarray, pitch: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ankle and toe matrices [n, 4, 4] of a stiff foot whose heel is at `heel` [n, 3], pitched toe down by `pitch`."""
    turn = about_x(pitch)
    ankle = heel - turn @ HEEL
    return matrices(turn, ankle), matrices(turn, ankle + turn @ TOE_JOINT)


def ideal_walk(
    stance: float = 0.0,
    distance: float = 1.2,
    duty: float = 0.5,
    lift: float = 0.1,
    at: tuple[float, float] = (0.1, 0.0),
) -> tuple[np.ndarray, np.ndarray]:
    """Flat feet that move back steadily for `duty` of a cycle, its middle at `stance`, and forward in a smooth arc."""
    t = np.mod(np.arange(N + 1) / N - stance + 0.5 * duty, 1.0)
    u = np.clip((t - duty) / (1 - duty), 0, 1)
    travel = distance * duty
    planted = t < duty
    z = np.where(planted, 0.5 * travel - distance * t, -0.5 * travel * np.cos(np.pi * u))
    y = np.where(planted, 0.0, lift * np.sin(np.pi * u) ** 2)
    heel = np.stack([np.full(N + 1, at[0]), y, z + at[1]], -1)
    heel[N] = heel[0]
    return foot(heel, np.zeros(N + 1))


def rolling_walk(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A smooth random cyclic walk with roll of the foot, not quite closed: sample N is close to sample 0."""
    generator = np.random.default_rng(seed)
    t = np.arange(N + 1) / N
    shift = generator.uniform()
    wave = np.mod(t + shift, 1.0)
    heel = np.zeros((N + 1, 3))
    heel[:, 2] = 0.5 * np.cos(2 * np.pi * wave) + 0.05 * generator.standard_normal() * np.sin(4 * np.pi * wave)
    heel[:, 0] = 0.1 + 0.03 * generator.standard_normal() * np.cos(2 * np.pi * wave)
    heel[:, 1] = 0.12 * np.maximum(np.sin(2 * np.pi * wave), 0.0) ** 1.5 + 0.002 * generator.standard_normal(N + 1)
    pitch = 0.4 * np.sin(2 * np.pi * wave + generator.uniform(-0.5, 0.5)) * (heel[:, 1] > 0.02)
    return foot(heel, pitch)
