"""Wave trains of a fluid region as sine components, on the host: dispersion, spectra, directions and phases."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from crowd.scenario_fluid import Spectrum, Wave
from crowd.scenario_world import FluidRegion

GRAVITY = 9.81  # m/s2
DEEPEST = 1e4  # m
Heights = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Trains:
    """W components; see `kernels.waves.Waves`."""

    amplitude: np.ndarray  # [W] m
    number: np.ndarray  # [2, W] rad/m (x, z)
    frequency: np.ndarray  # [W] rad/s, in still water
    apparent: np.ndarray  # [W] rad/s, seen from the ground
    phase: np.ndarray  # [W] rad
    depth: float  # m

    def rise(self, x: np.ndarray, z: np.ndarray, time: float) -> np.ndarray:
        """Height above the still level, m, at world places and a time in s."""
        x, z = np.asarray(x, float), np.asarray(z, float)
        total = np.zeros(np.broadcast_shapes(x.shape, z.shape))
        for a, (kx, kz), omega, phase in zip(self.amplitude, self.number.T, self.apparent, self.phase, strict=True):
            total += a * np.cos(kx * x + kz * z - omega * time + phase)
        return total


def dispersion(number: np.ndarray, depth: float) -> np.ndarray:
    """sigma = sqrt(g k tanh(k h)), rad/s."""
    return np.sqrt(GRAVITY * number * np.tanh(number * depth))


def wavenumber(frequency: np.ndarray, depth: float) -> np.ndarray:
    """k with sigma^2 = g k tanh(k h), rad/m; Newton's method from Eckart's guess."""
    deep = np.asarray(frequency, float) ** 2 / GRAVITY
    k = deep / np.sqrt(np.tanh(deep * depth))
    for _ in range(20):
        t = np.tanh(k * depth)
        k = k - (k * t - deep) / (t + k * depth * (1.0 - t * t))
    return k


def trains(region: FluidRegion, ground: Heights, around: np.ndarray, seed: int) -> Trains | None:
    """The components of a region; None without waves.

    around: [n, 2] places (x, z) about which a region without a rectangle is looked at. seed: the scenario's.
    """
    if not region.waves and region.spectrum is None:
        return None
    depth = region.wave_depth_m or mean_depth(region, ground, around)
    parts = [_wave(wave, depth) for wave in region.waves]
    if region.spectrum is not None:
        parts.append(_spectrum(region.spectrum, depth, seed))
    amplitude, k, toward, phase = (np.concatenate(part) for part in zip(*parts, strict=True))
    number = k * np.stack([np.sin(toward), np.cos(toward)])
    sigma = dispersion(k, depth)
    current = np.array([region.flow_m_s[0], region.flow_m_s[2]])
    return Trains(amplitude, number, sigma, sigma + current @ number, phase, depth)


def ground_under(region: FluidRegion, ground: Heights, around: np.ndarray) -> np.ndarray:
    """[33, 33] m, heights of the ground over the region; without a rectangle within 30 m of `around`."""
    area = region.area_m
    if area is not None:
        low, high = np.array([area.x[0], area.z[0]]), np.array([area.x[1], area.z[1]])
    else:
        low, high = around.min(0) - 30.0, around.max(0) + 30.0
    x, z = np.meshgrid(np.linspace(low[0], high[0], 33), np.linspace(low[1], high[1], 33))
    return np.broadcast_to(ground(x, z), x.shape)


def mean_depth(region: FluidRegion, ground: Heights, around: np.ndarray) -> float:
    """m, mean of the fluid's depth where there is any."""
    depth = region.surface_m - ground_under(region, ground, around)
    wet = depth[depth > 0.02]
    return float(np.clip(wet.mean(), 0.02, DEEPEST)) if len(wet) else 1.0


Part = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # amplitude m, k rad/m, direction rad, phase rad


def _wave(wave: Wave, depth: float) -> Part:
    if wave.wavelength_m is not None:
        k = np.array([2 * np.pi / wave.wavelength_m])
    else:
        k = wavenumber(np.array([2 * np.pi / (wave.period_s or 1.0)]), depth)
    return np.array([wave.amplitude_m]), k, np.radians([wave.toward_deg]), np.radians([wave.phase_deg])


def density(spectrum: Spectrum, frequency: np.ndarray) -> np.ndarray:
    """JONSWAP spectrum over angular frequency, up to a factor (Hasselmann 1973); peakedness 1 is Pierson-Moskowitz."""
    peak = 2 * np.pi / spectrum.period_s
    ratio = frequency / peak
    width = np.where(ratio <= 1, 0.07, 0.09)
    return ratio**-5 * np.exp(-1.25 * ratio**-4) * spectrum.peakedness ** np.exp(-(((ratio - 1) / width) ** 2) / 2)


def _spectrum(spectrum: Spectrum, depth: float, seed: int) -> Part:
    """Components of equal energy: each stands for an equal share of the spectrum, at a random place of its share."""
    count = spectrum.components
    key = hashlib.blake2b(f"{seed if spectrum.seed is None else spectrum.seed}/waves".encode(), digest_size=8).digest()
    rng = np.random.Generator(np.random.Philox(int.from_bytes(key, "little")))
    peak = 2 * np.pi / spectrum.period_s
    frequency = np.linspace(0.4, 5.0, 4000) * peak
    energy = np.cumsum(density(spectrum, frequency))
    share = (np.arange(count) + rng.uniform(0.1, 0.9, count)) / count
    sigma = np.interp(share, energy / energy[-1], frequency)
    toward = np.radians(spectrum.toward_deg + spectrum.spread_deg * rng.normal(size=count))
    phase = rng.uniform(0, 2 * np.pi, count)
    amplitude = np.full(count, spectrum.height_m / 4 * np.sqrt(2 / count))
    return amplitude, wavenumber(sigma, depth), toward, phase
