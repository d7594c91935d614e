"""One stride cut out of a motion that travels: the best loop, with travel, turning and climbing taken out and measured.

Poses are compared as clouds of joints after the best yaw and translation (Kovar, Gleicher and Pighin 2002, "Motion
Graphs", section 3.1), over a short window so that velocities count. The rigid move from the first to the last frame of
the loop is then removed as a constant screw motion, which closes the loop exactly and is the speed of the walker.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from crowd.errors import fail
from crowd.posing import conjugate, multiply, rotate
from crowd.resampling import align_hemispheres

SHORTEST, LONGEST = 0.25, 4.0  # s, of one stride
SEARCH_RATE = 30.0  # Hz, of the coarse search
LOOP_LIMIT = 0.2  # of the body's radius of gyration: a worse loop would visibly jump
STEADY = 0.15  # cost of a loop whose speed differs from the clip's typical speed, per relative difference
TURNING = 0.1  # cost of a loop that turns, per radian


@dataclass(frozen=True, eq=False)
class CyclePiece:
    """One loop, in place: sample i lies at i / F of the duration, and the pose after the last one is the first."""

    rotation: np.ndarray  # [F, J, 4] wxyz, joint to parent
    translation: np.ndarray  # [F, J, 3] joint to parent; roots in the world, their mean at x = z = 0
    duration: float  # s
    speed: float | None  # length units of the input per second; None: the clip was in place already, measure the feet
    direction: np.ndarray  # [2] unit (x, z) of travel in the frame of the piece; (0, 1) where speed is None
    turned: float  # rad, yaw taken out over the loop, positive to the left
    climbed: float  # rise taken out over the loop, length units
    mismatch: float  # distance of the loop's ends before blending, in radii of gyration of the body
    first: int  # frames of the input the loop was cut from
    last: int


def extract_cycle(
    rotation: np.ndarray,
    translation: np.ndarray,
    parents: Sequence[int],
    feet: Sequence[int],
    rate: float,
    where: str = "motion",
) -> CyclePiece:
    """The loop of one stride whose ends fit best and whose speed is typical of the clip.

    rotation [F, J, 4] and translation [F, J, 3]: joint to parent, y up, any length unit. feet: joints whose stepping
    defines the stride. rate: samples per second. where: named in errors.
    Raises InputError when the clip is shorter than one stride, the feet do not move or nothing repeats.
    """
    count = len(rotation)
    if count < 8:
        raise fail(where, f"{count} frames; a walk cycle needs at least 8")
    _, position = to_global(parents, rotation, translation)
    weight = np.ones(position.shape[1])
    weight[list(feet)] = 3.0
    step = max(1, int(rate / SEARCH_RATE))
    search = _Loops(position[::step], weight, list(feet), rate / step)
    _check_stepping(search, list(feet), where)
    first, last = search.best(where)
    if step > 1:
        fine = _Loops(position, weight, list(feet), rate)
        near = np.arange(max(0, (first - 1) * step), min(count - 1, (first + 1) * step) + 1)
        spans = range((last - first - 1) * step, (last - first + 1) * step + 1)
        loops = [(near[near + lag < count], lag) for lag in spans if (near + lag < count).any()]
        first, last = fine.pick(loops, search.pace(search.starts(last - first), last - first) / step, where)
    return _piece(rotation, translation, parents, position, weight, list(feet), (first, last), rate)


class _Loops:
    """Distances between the poses of a clip, and the loops they allow."""

    def __init__(self, position: np.ndarray, weight: np.ndarray, feet: list[int], rate: float):
        self.position, self.rate, self.count = position, rate, len(position)
        self.weight = weight / weight.sum()
        centre = np.einsum("j,fjc->fc", self.weight, position)
        self.centred, self.path = position - centre[:, None], centre
        self.size = float(np.sqrt(np.einsum("j,fjc->f", self.weight, self.centred**2).mean()))
        self.flat, self.high = self._windows()
        self.own = np.sum(np.abs(self.flat) ** 2, 1) + np.sum(self.high**2, 1)
        self.busy = self._busy(feet)

    def _windows(self) -> tuple[np.ndarray, np.ndarray]:
        """Weighted clouds about their centre over 0.1 s at each frame: x + iz and y, [F, 3 J]; ends extrapolated."""
        reach = max(1, round(0.05 * self.rate))
        before = 2 * self.position[:1] - self.position[reach:0:-1]
        after = 2 * self.position[-1:] - self.position[-2 : -2 - reach : -1]
        padded = np.concatenate([before, self.position, after])
        window = np.stack([padded[k : k + self.count] for k in (0, reach, 2 * reach)], 1)
        cloud = window.reshape(self.count, -1, 3)
        weight = np.tile(self.weight, 3) / 3
        cloud = (cloud - np.einsum("k,fkc->fc", weight, cloud)[:, None]) * np.sqrt(weight)[:, None]
        return cloud[..., 0] + 1j * cloud[..., 2], cloud[..., 1]

    def _busy(self, feet: list[int]) -> np.ndarray:
        """[F + 1] running count of frames in which the feet step at least half as fast as usual."""
        speed = np.linalg.norm(np.gradient(self.centred[:, feet], axis=0), axis=-1).mean(1)
        width = min(self.count, max(1, round(0.5 * self.rate)))
        speed = np.convolve(np.pad(speed, width // 2, mode="edge"), np.ones(width) / width, "valid")[: self.count]
        return np.concatenate([[0], np.cumsum(speed >= 0.5 * np.percentile(speed, 75))])

    def compare(self, first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rms distance (radii of gyration) of the clouds at frames `first` and `last`, and the turn (rad) between."""
        across = np.sum(self.flat[last] * self.flat[first].conj(), 1)
        level = np.sum(self.high[last] * self.high[first], 1)
        gap = self.own[first] + self.own[last] - 2 * (np.abs(across) + level)
        return np.sqrt(np.maximum(gap, 0.0)) / self.size, np.angle(across)

    def starts(self, lag: int) -> np.ndarray:
        """First frames of the loops of `lag` frames during which the feet step; all, where they never do for long."""
        first = np.arange(self.count - lag)
        stepping = (self.busy[first + lag] - self.busy[first]) >= 0.9 * lag
        return first[stepping] if stepping.any() else first

    def best(self, where: str) -> tuple[int, int]:
        """(first, last) frame of the best loop of one stride."""
        stride = self._stride(where)
        slack = max(1, round(0.12 * stride))
        lags = range(max(stride - slack, 4), min(stride + slack, self.count - 1) + 1)
        return self.pick([(self.starts(lag), lag) for lag in lags], self.pace(self.starts(stride), stride), where)

    def pace(self, first: np.ndarray, lag: int) -> float:
        """Typical travel per frame of the loops of `lag` frames that start at `first`."""
        return float(np.median(np.linalg.norm((self.path[first + lag] - self.path[first])[:, [0, 2]], axis=1))) / lag

    def pick(self, loops: Sequence[tuple[np.ndarray, int]], typical: float, where: str) -> tuple[int, int]:
        """The loop (first, first + lag) whose ends fit best, among those of typical speed and little turning."""
        best, least, fits = (0, 0), np.inf, np.inf
        for first, lag in loops:
            fit, turn = self.compare(first, first + lag)
            cost = fit + TURNING * np.abs(turn)
            if typical * self.rate > 0.02 * self.size:
                way = np.linalg.norm((self.path[first + lag] - self.path[first])[:, [0, 2]], axis=1)
                cost = cost + STEADY * np.abs(way / (lag * typical) - 1)
            k = int(np.argmin(cost))
            if cost[k] < least:
                best, least, fits = (int(first[k]), int(first[k]) + lag), float(cost[k]), float(fit[k])
        if fits > LOOP_LIMIT:
            raise self._not_cyclic(where, fits)
        return best

    def _stride(self, where: str) -> int:
        """Lag in frames of the first clear repetition: the shortest lag that fits nearly as well as the best one."""
        lags = np.arange(max(4, round(SHORTEST * self.rate)), min(self.count - 1, round(LONGEST * self.rate)) + 1)
        if len(lags) == 0:
            least = SHORTEST + 1 / self.rate
            raise fail(where, f"lasts {self.count / self.rate:.2f} s; one stride needs at least {least:.2f} s")
        fits = []
        for lag in lags.tolist():
            first = self.starts(lag)
            fits.append(np.percentile(self.compare(first, first + lag)[0], 20))
        fits = np.array(fits)
        inner = (fits <= np.append(fits[1:], np.inf)) & (fits <= np.append(np.inf, fits[:-1]))
        inner[0] = False  # a short lag always fits a little; it must be a dip
        dips = np.flatnonzero(inner)
        if len(dips) == 0:
            raise self._not_cyclic(where, float(fits.min()))
        good = dips[fits[dips] <= max(1.6 * fits[dips].min(), fits[dips].min() + 0.03)]
        if fits[good[0]] > LOOP_LIMIT or fits[good[0]] > 0.6 * fits[: good[0] + 1].max():
            raise self._not_cyclic(where, float(fits[good[0]]))
        return int(lags[good[0]])

    def _not_cyclic(self, where: str, fit: float) -> Exception:
        return fail(
            where,
            f"nothing repeats within {LONGEST:g} s: the best loop of {self.count / self.rate:.2f} s jumps by "
            f"{100 * fit:.0f} % of the body's size (allowed {100 * LOOP_LIMIT:.0f} %). A walk or other gait of at "
            "least one whole stride is needed",
        )


def _check_stepping(search: _Loops, feet: list[int], where: str) -> None:
    moved = np.ptp(search.centred[:, feet], axis=0).max(-1) if feet else np.zeros(1)
    if moved.max() < 0.1 * search.size:
        raise fail(where, f"the feet move by {moved.max() / search.size:.0%} of the body's size only, this is no gait")


def _piece(
    rotation: np.ndarray,
    translation: np.ndarray,
    parents: Sequence[int],
    position: np.ndarray,
    weight: np.ndarray,
    feet: list[int],
    span: tuple[int, int],
    rate: float,
) -> CyclePiece:
    first, last = span
    count = last - first
    weight = weight / weight.sum()
    clouds = position[[first, last]]
    centres = np.einsum("j,fjc->fc", weight, clouds)
    flat = (clouds[..., 0] - centres[:, None, 0]) + 1j * (clouds[..., 2] - centres[:, None, 2])
    angle = float(np.angle(np.sum(weight * flat[1] * flat[0].conj())))  # of x + iz; yaw about y is its negative
    start, end = centres[:, 0] + 1j * centres[:, 2]
    climbed = float(centres[1, 1] - centres[0, 1])
    shift = end - np.exp(1j * angle) * start  # the move is c -> e^(i angle) c + shift
    q, p = rotation[first : last + 1].copy(), translation[first : last + 1].copy()
    part = np.arange(count + 1) / count
    for root in (joint for joint, parent in enumerate(parents) if parent < 0):
        q[:, root], p[:, root] = _without_move(q[:, root], p[:, root], part, angle, shift, climbed)
    q, p = _closed(q, p, part)
    centre = np.einsum("j,fjc->fc", weight, to_global(parents, q[:-1], p[:-1])[1]).mean(0)
    for root in (joint for joint, parent in enumerate(parents) if parent < 0):
        p[:, root, [0, 2]] -= centre[[0, 2]]
    chord = end - start
    half = angle / 2
    travelled = abs(chord) * (half / np.sin(half) if abs(half) > 1e-6 else 1.0)
    size = float(np.sqrt(np.einsum("j,jc->", weight, (clouds[0] - centres[0]) ** 2)))
    swing = np.ptp(to_global(parents, q, p)[1][:, feet][..., [0, 2]], axis=0)
    moves = travelled > 0.2 * float(np.linalg.norm(swing, axis=-1).mean())  # a walk travels farther than its feet swing
    heading = chord * np.exp(-1j * half) / max(abs(chord), 1e-12)
    residual = np.sum(weight * np.abs(flat[1] - np.exp(1j * angle) * flat[0]) ** 2)
    residual += np.sum(weight * ((clouds[1, :, 1] - centres[1, 1]) - (clouds[0, :, 1] - centres[0, 1])) ** 2)
    return CyclePiece(
        rotation=align_hemispheres(q[:-1]),
        translation=p[:-1],
        duration=count / rate,
        speed=float(travelled * rate / count) if moves else None,
        direction=np.array([heading.real, heading.imag]) if moves else np.array([0.0, 1.0]),
        turned=-angle,
        climbed=climbed,
        mismatch=float(np.sqrt(residual) / size),
        first=first,
        last=last,
    )


def _without_move(
    q: np.ndarray, p: np.ndarray, part: np.ndarray, angle: float, shift: complex, climbed: float
) -> tuple[np.ndarray, np.ndarray]:
    """World poses of a root with the share `part` of the loop's rigid move undone at each frame."""
    turn = np.exp(1j * angle * part)
    share = (turn - 1) / (np.exp(1j * angle) - 1) if abs(angle) > 1e-9 else part
    flat = (p[:, 0] + 1j * p[:, 2] - shift * share) / turn
    half = angle * part / 2  # undoing a turn of -angle about y
    yaw = np.stack([np.cos(half), np.zeros_like(half), np.sin(half), np.zeros_like(half)], -1)
    return multiply(yaw, q), np.stack([flat.real, p[:, 1] - climbed * part, flat.imag], -1)


def _closed(q: np.ndarray, p: np.ndarray, part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What is missing between last and first pose, spread evenly: half of it before the start, half after the end."""
    share = part - 0.5
    gap = multiply(conjugate(q[-1]), q[0])
    gap = np.where(gap[..., :1] < 0, -gap, gap)
    sine = np.linalg.norm(gap[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, gap[..., :1])
    axis = gap[..., 1:] / np.maximum(sine, 1e-12)
    half = angle * share[:, None, None] / 2
    q = multiply(q, np.concatenate([np.cos(half), axis * np.sin(half)], -1))
    return q, p + (p[0] - p[-1]) * share[:, None, None]


def to_global(parents: Sequence[int], rotation: np.ndarray, translation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation [F, J, 4] and position [F, J, 3] in the file frame, of local ones; several roots allowed."""
    out_q, out_p = np.array(rotation, float), np.array(translation, float)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            out_q[:, joint] = multiply(out_q[:, parent], rotation[:, joint])
            out_p[:, joint] = out_p[:, parent] + rotate(out_q[:, parent], translation[:, joint])
    return out_q, out_p


def to_local(parents: Sequence[int], rotation: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The inverse of `to_global`."""
    out_q, out_p = np.array(rotation, float), np.array(position, float)
    for joint, parent in enumerate(parents):
        if parent >= 0:
            back = conjugate(rotation[:, parent])
            out_q[:, joint] = multiply(back, rotation[:, joint])
            out_p[:, joint] = rotate(back, position[:, joint] - position[:, parent])
    return align_hemispheres(out_q), out_p
