"""Curves on the ground to walk along: splines, polylines, circles and figures of eight, by arc length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowd.scenario_control import Route

STEP = 0.05  # m between samples of a curve
MOST = 20_000  # samples; longer curves are sampled more coarsely
DENSE = 64  # points per span of a spline before it is measured
CORNER = 0.5  # m, radius with which a polyline's corners are rounded
AT_ONCE = 0.7  # of the turn rate: what a curve may ask for; tighter ones are walked more slowly
BRAKES = 1.0  # m/s2, before such places and after them
SLOWEST = 0.25  # m/s, even round a hairpin


@dataclass(frozen=True, eq=False)
class Curve:
    """Points at equal distances along the curve; the last of a closed one is the first again."""

    points: np.ndarray  # [m, 2] m, world (x, z)
    length: float  # m
    closed: bool

    def speed(self, turn_rate: float) -> np.ndarray:
        """[m] m/s, the most with which characters that turn at this rate (rad/s) get round the curve's turns."""
        way = np.diff(self.points, axis=0)
        step = self.length / len(way)
        ways = np.concatenate([way[-1:], way, way[:1]] if self.closed else [way[:1], way, way[-1:]])
        angle = np.arctan2(ways[:, 0], ways[:, 1])
        turn = np.abs((np.diff(angle) + np.pi) % (2 * np.pi) - np.pi) / step
        square = np.maximum(AT_ONCE * turn_rate / np.maximum(turn, 1e-6), SLOWEST) ** 2
        for _ in range(2 if self.closed else 1):  # no change quicker than the brakes, forwards and backwards
            for order in (1, -1):
                square = square[::order]
                for i in range(1, len(square)):
                    square[i] = min(square[i], square[i - 1] + 2 * BRAKES * step)
                square = square[::order]
            if self.closed:
                square[0] = square[-1] = min(square[0], square[-1])
        return np.sqrt(square)

    def at(self, along: np.ndarray) -> np.ndarray:
        """Points [n, 2] at arc lengths [n] m; beyond the end of an open curve its end."""
        along = np.asarray(along, float)
        along = np.mod(along, self.length) if self.closed else np.clip(along, 0.0, self.length)
        where = along / self.length * (len(self.points) - 1)
        low = np.minimum(where.astype(int), len(self.points) - 2)
        share = (where - low)[:, None]
        return self.points[low] * (1 - share) + self.points[low + 1] * share

    def nearest(self, places: np.ndarray) -> np.ndarray:
        """Arc length [n] m of the point nearest to each place [n, 2]; of several the first."""
        a, way = self.points[:-1], np.diff(self.points, axis=0)
        square = np.maximum((way**2).sum(1), 1e-12)
        out = np.zeros(len(places))
        for number, place in enumerate(places):
            share = np.clip(((place - a) * way).sum(1) / square, 0.0, 1.0)
            off = ((a + way * share[:, None] - place) ** 2).sum(1)
            which = int(np.argmin(off))
            out[number] = (which + share[which]) / len(way) * self.length
        return np.minimum(out, self.length * (1 - 1e-6)) if self.closed else out


def build(route: Route) -> Curve:
    """The curve of a path; `points_m` or `radius_m` are there, as its `curve` needs (checked on load)."""
    closed = route.closed or route.curve in ("circle", "figure_eight")
    center, radius = np.array(route.center_m), route.radius_m or 1.0
    turn = np.linspace(0.0, 2.0 * np.pi, 4097)
    points = np.array(route.points_m or [(0.0, 0.0)], float)
    if route.curve == "circle":
        dense = center + radius * np.stack([np.sin(turn), np.cos(turn)], 1)
    elif route.curve == "figure_eight":  # Bernoulli's lemniscate: no turn tighter than a third of the radius
        share = radius / (1.0 + np.sin(turn) ** 2)
        dense = center + np.stack([share * np.cos(turn), share * np.sin(turn) * np.cos(turn)], 1)
    elif route.curve == "polyline":
        dense = rounded(points, closed)
    else:
        dense = spline(points, closed)
    return _resampled(dense, closed)


def spline(points: np.ndarray, closed: bool) -> np.ndarray:
    """Points [k, 2] on the centripetal Catmull-Rom spline through `points` [p, 2], p >= 2; a closed one ends where it
    begins.

    Centripetal knots make neither loops nor overshoot, however uneven the distances. Two points: a straight line.
    """
    if closed:
        knots = np.concatenate([points[-1:], points, points[:2]])
    else:
        knots = np.concatenate([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    gap = np.sqrt(np.maximum(np.linalg.norm(np.diff(knots, axis=0), axis=1), 1e-9))[:, None]
    slope = np.diff(knots, axis=0) / gap
    # derivative at every inner knot: the parabola's through it and its neighbours
    tangent = (slope[:-1] * gap[1:] + slope[1:] * gap[:-1]) / (gap[:-1] + gap[1:])
    u = (np.arange(DENSE) / DENSE)[None, :, None]
    a, b, width = knots[1:-2, None], knots[2:-1, None], gap[1:-1, None]
    ta, tb = tangent[:-1, None] * width, tangent[1:, None] * width
    spans = (
        (1 + 2 * u) * (1 - u) ** 2 * a + u * (1 - u) ** 2 * ta + u**2 * (3 - 2 * u) * b + u**2 * (u - 1) * tb
    ).reshape(-1, 2)
    return np.concatenate([spans, knots[-2:-1]])


def rounded(points: np.ndarray, closed: bool) -> np.ndarray:
    """A polyline with arcs for corners, of radius CORNER or what half of the shorter side leaves room for."""
    count = len(points)
    out = [] if closed else [points[:1]]
    for i in range(count) if closed else range(1, count - 1):
        before, after = points[i - 1] - points[i], points[(i + 1) % count] - points[i]
        lengths = np.linalg.norm(before), np.linalg.norm(after)
        before, after = before / lengths[0], after / lengths[1]
        half = 0.5 * np.arccos(np.clip(-before @ after, -1.0, 1.0))  # of the turn
        tangent = min(CORNER * np.tan(half), 0.5 * min(lengths))
        u = np.linspace(0.0, 1.0, 33)[:, None]
        if half < 1e-3 or half > 0.5 * np.pi - 1e-3:  # straight on, or straight back
            out.append(points[i : i + 1])
            continue
        radius = tangent / np.tan(half)
        middle = points[i] + (before + after) / np.linalg.norm(before + after) * radius / np.cos(half)
        first = points[i] + before * tangent - middle
        side = -(before + first * (first @ -before) / (first @ first)) * radius
        turned = 2.0 * half * u
        out.append(middle + first * np.cos(turned) + side * np.sin(turned))
    out = np.concatenate(out if closed else [*out, points[-1:]])
    return np.concatenate([out, out[:1]]) if closed else out


def _resampled(dense: np.ndarray, closed: bool) -> Curve:
    """Equal steps along a dense line of points."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(dense, axis=0), axis=1))])
    keep = np.concatenate([[True], np.diff(along) > 0])
    along, dense = along[keep], dense[keep]
    length = float(along[-1])
    count = int(np.clip(np.ceil(length / STEP), 32, MOST)) + 1
    at = np.linspace(0.0, length, count)
    points = np.stack([np.interp(at, along, dense[:, axis]) for axis in range(2)], 1)
    return Curve(points, length, closed)
