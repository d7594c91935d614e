"""Ground height and slope at points of the ground plane: profiles along a line, waves, grids, and levels of them.

This is the height-field form of the ground query (spec 4.7, 11.4): the two rays become look-ups of height and slope.
Every kind exists with its slope and, cheaper, without.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from kernels.wall import Wall, no_wall

# sin(2 pi u) = u (c0 + c1 u^2 + ...) on |u| <= 1/4, of least greatest error.
SINE = (6.28318516, -41.34165503, 81.60100412, -76.54978343, 39.53671437)

Kind = Literal["flat", "slope", "ramp", "steps", "stretches", "sines", "grid"]


def profile(kind: Kind, parameters: Float[Array, "p"], s: Float[Array, "*b"]) -> tuple[Array, Array]:
    """Height and slope of an analytic ground at distance s along its axis, m.

    flat: (height); slope: (tangent); ramp: (start, end, drop): level, down by drop, level;
    steps: (start, tread, rise, count): the first riser stands at `start`; with a fifth, `back`, as many go down again
    from there; stretches: (start, length, tangent) for each of them, level before the first and behind the last.
    """
    height = profile_height(kind, parameters, s)
    if kind == "slope":
        return height, jnp.zeros_like(s) + parameters[0]
    if kind == "ramp":
        start, end, drop = parameters[0], parameters[1], parameters[2]
        t = (s - start) / (end - start)
        return height, jnp.where((t > 0) & (t < 1), -drop / (end - start), 0.0)
    slope = jnp.zeros_like(s)
    if kind == "stretches":
        for start, length, tangent in parameters.reshape(-1, 3):
            slope = slope + jnp.where((s > start) & (s < start + length), tangent, 0.0)
    return height, slope


def profile_height(kind: Kind, parameters: Float[Array, "p"], s: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """Height alone; see `profile`."""
    if kind == "flat":
        return jnp.zeros_like(s) + parameters[0]
    if kind == "slope":
        return s * parameters[0]
    if kind == "ramp":
        start, end, drop = parameters[0], parameters[1], parameters[2]
        return -drop * jnp.clip((s - start) / (end - start), 0.0, 1.0)
    if kind == "steps":
        start, tread, rise, count = parameters[:4]
        step = jnp.clip(jnp.floor((s - start) / tread) + 1.0, 0.0, count)
        if parameters.shape[0] > 4:
            step = step - jnp.clip(jnp.floor((s - parameters[4]) / tread) + 1.0, 0.0, count)
        return step * rise
    height = jnp.zeros_like(s)
    for start, length, tangent in parameters.reshape(-1, 3):
        # Clipped pieces, not hinges tangent * max(s - start, 0): those grow far away and cancel digits.
        height = height + tangent * jnp.clip(s - start, 0.0, length)
    return height


def sines(
    waves: Float[Array, "4 w"], x: Float[Array, "*b"], z: Float[Array, "*b"]
) -> tuple[Float[Array, "*b"], Float[Array, "*b"], Float[Array, "*b"]]:
    """Height and its derivatives by x and z of sine waves, each (amplitude m, cycles/m along x and z, phase cycles).

    Evaluated, not tabled: a polynomial costs less than the gathers of a table, which for 1 mm would need samples every
    few centimetres, and it has no edge.
    """
    height = by_x = by_z = jnp.zeros_like(x)
    for amplitude, along_x, along_z, phase in waves.T:
        cycles = x * along_x + z * along_z + phase
        rate = (2.0 * jnp.pi) * amplitude * sine(cycles + 0.25)
        height = height + amplitude * sine(cycles)
        by_x, by_z = by_x + rate * along_x, by_z + rate * along_z
    return height, by_x, by_z


def sines_height(waves: Float[Array, "4 w"], x: Float[Array, "*b"], z: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """Height alone; see `sines`."""
    height = jnp.zeros_like(x)
    for amplitude, along_x, along_z, phase in waves.T:
        height = height + amplitude * sine(x * along_x + z * along_z + phase)
    return height


def sine(cycles: Float[Array, "*b"]) -> Float[Array, "*b"]:
    """sin(2 pi cycles) by a polynomial on a quarter of the wave; to 4e-9, its derivative to 2e-6 of 2 pi."""
    part = cycles - jnp.round(cycles)  # -1/2 to 1/2
    part = 2.0 * jnp.clip(part, -0.25, 0.25) - part  # mirrored at the crests
    t = part * part
    series = SINE[-1]
    for coefficient in SINE[-2::-1]:
        series = coefficient + t * series
    return part * series


class Cell(NamedTuple):
    """The grid cell that points lie in."""

    corner: Int[Array, "*b"]  # index of its first post in the flattened grid
    a: Float[Array, "*b"]  # place in the cell along columns, 0 to 1
    b: Float[Array, "*b"]  # along rows
    inside_u: Bool[Array, "*b"]  # not beyond the first or last column
    inside_v: Bool[Array, "*b"]


def locate(
    shape: tuple[int, int], u: Float[Array, "*b"], v: Float[Array, "*b"], post: tuple[int, int] = (0, 0)
) -> Cell:
    """Cells of a [rows, columns] grid at column u and row v, counted from `post` (row, column).

    A post near the places that matter keeps the digits of u and v on large grids. Outside the grid: its border.
    """
    rows, columns = shape
    row, column = post
    u_in, v_in = jnp.clip(u, -column, columns - 1.0 - column), jnp.clip(v, -row, rows - 1.0 - row)
    # The integers are kept in range too: a place that is not finite must not read outside the grid.
    i = jnp.clip(jnp.floor(u_in).astype(jnp.int32), -column, columns - 2 - column)
    j = jnp.clip(jnp.floor(v_in).astype(jnp.int32), -row, rows - 2 - row)
    return Cell((j + row) * columns + (i + column), u_in - i, v_in - j, u == u_in, v == v_in)


def posts(
    grid: Float[Array, "cells"], columns: int, corner: Int[Array, "*b"], wall: Wall = no_wall
) -> Float[Array, "4 *b"]:
    """Heights of the four posts of cells: at the corner, one column on, one row on, both.

    One gather between walls: without them XLA gathers again for every result, three times for a height and its slope.
    """
    step = jnp.array([0, 1, columns, columns + 1]).reshape(4, *(1,) * corner.ndim)
    return wall(_taken, grid, wall(lambda corner: corner + step, corner))


def _taken(grid: Float[Array, "cells"], index: Int[Array, "*b"]) -> Float[Array, "*b"]:
    return grid.at[index].get(mode="promise_in_bounds", wrap_negative_indices=False)


def grid_height(posts: Float[Array, "4 *b"], cell: Cell) -> Float[Array, "*b"]:
    """Bilinear height in cells with these posts."""
    h00, h01, h10, h11 = posts
    near, far = h00 + (h01 - h00) * cell.a, h10 + (h11 - h10) * cell.a
    return near + (far - near) * cell.b


def grid_ground(posts: Float[Array, "4 *b"], cell: Cell) -> tuple[Array, Array, Array]:
    """Bilinear height and its derivatives by u and v (per cell); level beyond the border."""
    h00, h01, h10, h11 = posts
    near, far = h00 + (h01 - h00) * cell.a, h10 + (h11 - h10) * cell.a
    along_u = (h01 - h00) + ((h11 - h10) - (h01 - h00)) * cell.b
    return (
        near + (far - near) * cell.b,
        jnp.where(cell.inside_u, along_u, 0.0),
        jnp.where(cell.inside_v, far - near, 0.0),
    )


def whole(posts: Float[Array, "4 *b"], cell: Cell, gap: Float[Array, ""]) -> Bool[Array, "*b"]:
    """Which cells are ground: inside the grid, with posts that differ by less than `gap`, m."""
    h00, h01, h10, h11 = posts
    low = jnp.minimum(jnp.minimum(h00, h01), jnp.minimum(h10, h11))
    high = jnp.maximum(jnp.maximum(h00, h01), jnp.maximum(h10, h11))
    return cell.inside_u & cell.inside_v & (high - low < gap)


def bilinear(
    grid: Float[Array, "cells"], shape: tuple[int, int], u: Float[Array, "*b"], v: Float[Array, "*b"]
) -> tuple[Array, Array, Array]:
    """Height and its derivatives by u and v of a flattened [rows, columns] grid at column u and row v (in cells).

    Outside the grid the border goes on level.
    """
    cell = locate(shape, u, v)
    return grid_ground(posts(grid, shape[1], cell.corner), cell)


def upper(
    reach: Float[Array, "*#b"] | None,
    lower: Float[Array, "*b"],
    height: Float[Array, "*b"],
    there: Bool[Array, "*b"],
) -> Bool[Array, "*b"]:
    """Where a further level of `height` takes the place of the one found so far, `lower`.

    The highest level up to `reach` is meant (None: the highest of all); where none is that low, the lowest one.
    there: where the further level exists at all.
    """
    if reach is None:
        return there & (height > lower)
    within, below = height <= reach, lower <= reach
    return there & jnp.where(within, ~below | (height > lower), ~below & (height < lower))
