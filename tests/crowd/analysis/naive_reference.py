"""Section 2 of the specification written again in plain loops, one sample at a time, to compare the analysis with."""

from __future__ import annotations

import math

N = 50


def sign(x: float) -> int:
    return 1 if x >= 0 else -1


def horizontal(v: list[float]) -> list[float]:
    return [v[0], 0.0, v[2]]


def minus(a: list[float], b: list[float]) -> list[float]:
    return [a[0] - b[0], a[1] - b[1], a[2] - b[2]]


def dot(a: list[float], b: list[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def size(a: list[float]) -> float:
    return math.sqrt(dot(a, a))


def scaled(a: list[float], s: float) -> list[float]:
    return [a[0] * s, a[1] * s, a[2] * s]


def unit(a: list[float]) -> list[float]:
    return scaled(a, 1 / size(a)) if size(a) > 1e-5 else [0.0, 0.0, 0.0]


def transformed(matrix: list[list[float]], v: list[float]) -> list[float]:
    return [sum(matrix[r][c] * v[c] for c in range(3)) + matrix[r][3] for r in range(3)]


def contact(y: list[float], s: int, way: int, y_range: float, g: float) -> float:
    best, best_index = 0.0, s
    k = 0
    while abs(k) < N:
        y0, y1, y2 = (y[(s + k + d) % N] for d in (-5, 0, 5))
        curve = math.atan(10 * (y2 - y1) / y_range) - math.atan(10 * (y1 - y0) / y_range)
        if y1 > g and curve > best and sign(y2 - y0) == way:
            best, best_index = curve, s + k
        if y1 > g + 0.1 * y_range:
            break
        k += way
    return ((best_index - s) % N) / N


def swing(base: list[list[float]], axis: list[float], s: int, way: int) -> float:
    def pace(k: int) -> float:
        return dot(minus(base[(s + k + 10) % N], base[(s + k - 10) % N]), axis)

    k = 0
    while abs(k) < N:
        if abs((pace(k) - pace(0)) / pace(0)) > 0.5:
            return (k % N) / N
        k += way
    return 0.99 if way == 1 else 0.01


def leg(
    ankle: list[list[list[float]]], toe: list[list[list[float]]], heel_at: list[float], toe_at: list[float],
    length: float, g: float,
) -> dict:  # fmt: skip
    heels = [transformed(m, heel_at) for m in ankle]
    toes = [transformed(m, toe_at) for m in toe]
    y_range = max(
        max(h[1] for h in heels) - min(h[1] for h in heels), max(t[1] for t in toes) - min(t[1] for t in toes)
    )
    middles = [scaled([h[0] + t[0], h[1] + t[1], h[2] + t[2]], 0.5) for h, t in zip(heels, toes, strict=True)]
    flat = [horizontal(m) for m in middles[:N]]
    centre = [sum(m[c] for m in flat) / N for c in range(3)]
    far = opposite = centre
    best = 0.0
    for m in flat:
        if size(minus(m, centre)) > best:
            best, far = size(minus(m, centre)), m
    best = 0.0
    for m in flat:
        if size(minus(m, far)) > best:
            best, opposite = size(minus(m, far)), m
    axis, scaling = unit(minus(opposite, far)), size(minus(opposite, far))
    lowest, s = math.inf, 0
    for i in range(N + 1):
        cost = max(heels[i][1], toes[i][1]) / y_range + size(minus(horizontal(middles[i]), centre)) / scaling
        if cost < lowest:
            lowest, s = cost, i
    heels[N], toes[N] = heels[0], toes[0]
    h = scaled(unit(horizontal(minus(toes[s], heels[s]))), length)
    balance = [math.atan(20 * (a[1] - b[1]) / length) / math.pi + 0.5 for a, b in zip(heels, toes, strict=True)]
    base = [
        [(1 - w) * a[c] + w * (b[c] - h[c]) for c in range(3)] for w, a, b in zip(balance, heels, toes, strict=True)
    ]
    a, b = (contact([p[1] for p in points], s, 1, y_range, g) for points in (heels, toes))
    lift, liftoff, w = min(a, b), max(a, b), swing(base, axis, s, 1)
    if liftoff > w:
        liftoff = w
        lift = min(lift, liftoff)
    a, b = (contact([p[1] for p in points], s, -1, y_range, g) for points in (heels, toes))
    strike, land, w = min(a, b), max(a, b), swing(base, axis, s, -1)
    if strike < w:
        strike = w
        land = max(land, strike)

    def index(t: float) -> int:
        return math.floor(t * N + 0.5) % N

    e = horizontal(minus(base[index(liftoff + s / N)], base[index(strike + s / N)]))
    return {
        "s": s, "y_range": y_range, "axis": axis, "scaling": scaling, "balance": balance, "base": base, "h": h,
        "keys": [lift, liftoff, max(liftoff, lift + 0.2), min(strike, land - 0.2), strike, land],
        "distance": size(e) / (liftoff - strike + 1), "direction": scaled(unit(e), -1.0),
        "position": [base[s][0], g, base[s][2]],
    }  # fmt: skip


def motion(legs: list[dict], duration: float, g: float) -> dict:
    distance = sum(item["distance"] for item in legs) / len(legs)
    d = [sum(item["direction"][c] for item in legs) / len(legs) for c in range(3)]
    paths = []
    for item in legs:
        path = []
        start = item["base"][item["s"]]
        for j in range(N):
            point = item["base"][(item["s"] + j) % N]
            r = minus(point, minus(start, scaled(d, distance * j / N)))
            forward = unit(d)
            path.append([r[0] * forward[2] - r[2] * forward[0], point[1] - g, dot(r, forward) / distance])
        paths.append(path)
    return {"distance": distance, "direction": d, "speed": distance / duration, "paths": paths}
