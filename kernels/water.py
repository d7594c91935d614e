"""Linear waves on a height field, with exact dispersion, driven and hindered by bodies (Tessendorf 2004, 2014).

A wave of wave number k (rad/m) turns at omega = sqrt(g k tanh(k h)) over water of depth h. With psi = (omega / g) phi
in place of the potential phi at the surface, d eta/dt = omega psi and d psi/dt = -omega eta: height and psi, both in m,
turn into each other, for any time step exactly. The state is the height and, for psi, the horizontal vector field
`motion` with the spectrum i k/|k| psi: in shallow water the velocity times sqrt(h / g), in deep water its longer waves.
The energy is rho g / 2 (height^2 + |motion|^2) summed over the surface, so whatever makes either smaller somewhere
takes energy away. Fields are [..., rows along z, columns along x], periodic; spectra as `jnp.fft.rfft2` lays them out.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Complex, Float

from kernels import terrain
from kernels.wall import Wall, no_wall

GRAVITY = 9.81  # m/s2
STEEPEST = 0.4  # slope near which real waves break (Stokes' steepest wave has k a = 0.44)
BREAKING = 10.0  # 1/s


class Waves(NamedTuple):
    """What one time step does to every wave of a grid, [rows, columns // 2 + 1] each."""

    cos: Float[Array, "r h"]  # of the angle omega dt
    sin: Float[Array, "r h"]
    drift: Complex[Array, "r h"]  # the way that the water itself goes in the step
    reach: Float[Array, "2 r h"]  # m: how much of the upper and the lower layer's depth moves the surface
    toward: Float[Array, "2 r h"]  # k/|k|, (x, z)
    flow: Float[Array, "r h"]  # 1/s, velocity at the surface per motion


def waves(
    shape: tuple[int, int],
    cell: Float[Array, ""],
    dt: float,
    depth: Float[Array, ""],
    upper: Float[Array, ""],
    current: Float[Array, "2"],
    gravity: float = GRAVITY,
) -> Waves:
    """The step of dt s for a grid of `shape` with cells of `cell` m, over `depth` m of water moving at (x, z) m/s.

    upper: thickness, m, of the layer of water in which bodies move short waves too, less than the depth.
    """
    rows, columns = shape
    cycles_z, cycles_x = jnp.fft.fftfreq(rows)[:, None], jnp.fft.rfftfreq(columns)[None, :]
    kx, kz = (2.0 * jnp.pi / cell) * cycles_x, (2.0 * jnp.pi / cell) * cycles_z
    square = kx * kx + kz * kz
    moving = square > 0
    k = jnp.sqrt(jnp.where(moving, square, 1.0))
    steep = jnp.tanh(k * depth)
    omega = jnp.where(moving, jnp.sqrt(gravity * k * steep), 0.0)
    # A wave of two cells has no sign, hence no direction.
    way_x, way_z = jnp.where(jnp.abs(cycles_x) < 0.5, kx, 0.0), jnp.where(jnp.abs(cycles_z) < 0.5, kz, 0.0)
    length = way_x * way_x + way_z * way_z
    length = jnp.sqrt(jnp.where(length > 0, length, 1.0))
    turned = dt * (kx * current[0] + kz * current[1])
    return Waves(
        cos=jnp.cos(omega * dt),
        sin=jnp.sin(omega * dt),
        drift=jnp.cos(turned) - 1j * jnp.sin(turned),
        reach=jnp.where(moving, _reach(k, depth, upper) / k, jnp.stack([upper, depth - upper])[:, None, None]),
        toward=jnp.stack([way_x / length + 0.0 * kz, way_z / length + 0.0 * kx]),
        flow=jnp.where(moving, gravity * k / jnp.where(moving, omega, 1.0), 0.0),
    )


def _reach(k: Float[Array, "r h"], depth: Float[Array, ""], upper: Float[Array, ""]) -> Float[Array, "2 r h"]:
    """k times the depths of `Waves.reach`: integrals of cosh(k (z + h)) / cosh(k h) over each layer, in falling
    exponentials. Together they are tanh(k h)."""
    lower = (jnp.exp(-k * upper) - jnp.exp(-k * (2.0 * depth - upper))) / (1.0 + jnp.exp(-2.0 * k * depth))
    return jnp.stack([jnp.tanh(k * depth) - lower, lower])


def pushed(bodies: Float[Array, "*b 2 r c"], waves: Waves) -> Complex[Array, "*b r h"]:
    """Spectrum of the height, m, that water gains where bodies are put into it at once.

    bodies: share of each cell's water that they take up in the upper and in the lower layer. Sources at depth z lift
    the surface by cosh(k (z + h)) / cosh(k h) (Laplace's equation with phi = 0 above, no flow through the bottom):
    long waves by the volume, short ones by what is near the surface.
    """
    return (waves.reach * jnp.fft.rfft2(bodies)).sum(-3)


def propagate(
    height: Float[Array, "*b r c"],
    motion: Float[Array, "*b 2 r c"],
    before: Complex[Array, "*b r h"],
    now: Complex[Array, "*b r h"],
    waves: Waves,
) -> tuple[Float[Array, "*b r c"], Float[Array, "*b 2 r c"]]:
    """Height and motion, m, one step later, while bodies move.

    before, now: spectra of what they have `pushed`: they push away what they move into and leave room behind.
    """
    shape = height.shape[-2:]
    eta, psi = jnp.fft.rfft2(height), _scalar(motion, waves)
    risen = waves.drift * (waves.cos * eta + waves.sin * psi - before) + now
    swung = waves.drift * (waves.cos * psi - waves.sin * eta)
    return jnp.fft.irfft2(risen, shape), jnp.fft.irfft2(1j * waves.toward * swung[..., None, :, :], shape)


def _scalar(motion: Float[Array, "*b 2 r c"], waves: Waves) -> Complex[Array, "*b r h"]:
    """Spectrum of psi; eddies, which losses at some places leave in the motion, make no waves."""
    return -1j * (waves.toward * jnp.fft.rfft2(motion)).sum(-3)


def damped(
    height: Float[Array, "*b r c"],
    motion: Float[Array, "*b 2 r c"],
    calm: Float[Array, "*#b r c"],
    blocked: Float[Array, "*#b r c"],
    dt: float,
) -> tuple[Float[Array, "*b r c"], Float[Array, "*b 2 r c"]]:
    """Height and motion, m, after dt s of losses at rates in 1/s: all of a wave where `calm` (border and shore), and
    only its motion where `blocked`: water that cannot flow reflects waves as a wall does, and no volume is lost.
    """
    kept = jnp.exp(-calm * dt)
    return height * kept, motion * (kept * jnp.exp(-blocked * dt))[..., None, :, :]


def breaking(height: Float[Array, "*b r c"], cell: Float[Array, ""]) -> Float[Array, "*b r c"]:
    """1/s, the rate at which waves lose motion where they are steeper than STEEPEST: linear ones would go on growing.

    From 0 with the square of the slope, at most 10 times BREAKING.
    """
    by_x, by_z = ((jnp.roll(height, -1, axis) - jnp.roll(height, 1, axis)) / (2.0 * cell) for axis in (-1, -2))
    excess = (by_x * by_x + by_z * by_z) / (STEEPEST * STEEPEST) - 1.0
    return BREAKING * jnp.clip(excess, 0.0, 10.0)


def surface_flow(motion: Float[Array, "*b 2 r c"], waves: Waves) -> Float[Array, "*b 2 r c"]:
    """Horizontal velocity (x, z) of the water at the surface, m/s, in the frame of the current: the gradient of phi."""
    spectrum = (waves.flow * _scalar(motion, waves))[..., None, :, :]
    return jnp.fft.irfft2(1j * waves.toward * spectrum, motion.shape[-2:])


def splat(
    shape: tuple[int, int],
    u: Float[Array, "p"],
    v: Float[Array, "p"],
    amount: Float[Array, "p"],
) -> Float[Array, "r c"]:
    """Amounts at columns u and rows v (cells from the middle of the first one) shared among 4 x 4 cells each.

    Cubic B-splines: their sum is the amount, their mean the place, and they move smoothly. Off the grid they are lost.
    """
    rows, columns = shape
    i, across = _spline(u)
    j, along = _spline(v)
    inside = ((i >= 0) & (i < columns))[:, None] & ((j >= 0) & (j < rows))[None, :]
    index = jnp.where(inside, j[None, :] * columns + i[:, None], rows * columns)
    share = across[:, None] * along[None, :] * amount
    flat = jnp.zeros(rows * columns, share.dtype).at[index.reshape(-1)].add(share.reshape(-1), mode="drop")
    return flat.reshape(rows, columns)


def _spline(u: Float[Array, "p"]) -> tuple[Array, Array]:
    """Numbers [4, p] of the cells that a cubic B-spline at u covers, and their weights [4, p]."""
    left = jnp.floor(u)
    t = u - left
    s = 1.0 - t
    middle = (4.0 - 6.0 * t * t + 3.0 * t * t * t, 4.0 - 6.0 * s * s + 3.0 * s * s * s)
    first = jnp.clip(left, -9.0, 1e6).astype(jnp.int32) - 1
    return first + jnp.arange(4)[:, None], jnp.stack([s * s * s, *middle, t * t * t]) / 6.0


def sample(
    fields: Float[Array, "f r c"], u: Float[Array, "*b"], v: Float[Array, "*b"], wall: Wall = no_wall
) -> Float[Array, "f *b"]:
    """Fields at columns u and rows v, bilinear; beyond the grid the border goes on."""
    shape = fields.shape[-2:]
    cell = terrain.locate((shape[0], shape[1]), u, v)
    return jnp.stack([
        terrain.grid_height(terrain.posts(field.reshape(-1), shape[1], cell.corner, wall), cell) for field in fields
    ])  # fmt: skip


def border(shape: tuple[int, int], width: float, rate: float) -> Float[Array, "r c"]:
    """Rates of loss, 1/s: `rate` at the edge of the grid, falling with the square to 0 at `width` cells from it."""
    rows, columns = (jnp.arange(size) + 0.5 for size in shape)
    near_x, near_z = jnp.minimum(columns, shape[1] - columns), jnp.minimum(rows, shape[0] - rows)
    inward = jnp.minimum(near_x[None, :], near_z[:, None])
    return rate * jnp.clip(1.0 - inward / width, 0.0, 1.0) ** 2


def energy(
    height: Float[Array, "*b r c"],
    motion: Float[Array, "*b 2 r c"],
    cell: float,
    density: float = 1000.0,
    gravity: float = GRAVITY,
) -> Float[Array, "*b"]:
    """J, of the waves on the whole grid: density in kg/m3, cells of `cell` m."""
    return 0.5 * density * gravity * cell * cell * (height * height + (motion * motion).sum(-3)).sum((-2, -1))
