"""Rivers and turbulence of fluid regions as numbers, on the host."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from crowd.scenario_world import FluidRegion

TURNOVER = 0.5  # of an eddy's own rate of change: its velocity times its wave number


@dataclass(frozen=True, eq=False)
class Modes:
    """M modes; see `kernels.turbulence.Eddies`."""

    amplitude: np.ndarray  # [M] m/s
    number: np.ndarray  # [2, M] rad/m (x, z)
    frequency: np.ndarray  # [M] rad/s
    phase: np.ndarray  # [M] rad


def along(toward_deg: float) -> np.ndarray:
    """Unit vector (x, z): 0 is +z, 90 is +x."""
    angle = np.radians(toward_deg)
    return np.array([np.sin(angle), np.cos(angle)])


def mean_flow(region: FluidRegion) -> np.ndarray:
    """[2] m/s (x, z) in the middle of a region's river, with its constant flow."""
    flow = np.array([region.flow_m_s[0], region.flow_m_s[2]])
    return flow if region.river is None else flow + region.river.speed_m_s * along(region.river.toward_deg)


def modes(region: FluidRegion, seed: int) -> Modes | None:
    """The eddies of a region; None without turbulence. seed: the scenario's."""
    model = region.turbulence
    if model is None:
        return None
    key = f"{seed if model.seed is None else model.seed}/turbulence".encode()
    digest = hashlib.blake2b(key, digest_size=8).digest()
    rng = np.random.Generator(np.random.Philox(int.from_bytes(digest, "little")))
    flow, count = mean_flow(region), model.modes
    intensity = model.intensity_m_s or (model.intensity_share or 0.0) * float(np.hypot(*flow))
    length = model.length_m * 2.0 ** rng.uniform(-1, 1, count)
    # directions spread evenly, from a random start: then both components are equally strong with few modes too
    toward = np.pi * (np.arange(count) + rng.uniform()) / count + np.pi * rng.integers(0, 2, count)
    number = 2 * np.pi / length * np.stack([np.sin(toward), np.cos(toward)])
    own = TURNOVER * intensity * 2 * np.pi / length * rng.uniform(-1, 1, count)
    return Modes(
        np.full(count, 2 * intensity / np.sqrt(count)), number, flow @ number + own, rng.uniform(0, 2 * np.pi, count)
    )
