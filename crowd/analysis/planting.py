"""When feet are planted, in the default mode: robust where the reference finders are not.

The reference's swing finder looks over a fifth of a cycle to either side, so that it ends stances of steady walks by
0.05 to 0.1 of a cycle too soon, and its height curves fail for feet that swing low or slide on landing. Here the stance
is the interval in which the contact point is low and moves back with the ground (`gait.stances`), grown while the
footbase stays down: a heel that lands before the ball, a toe that leaves after it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowd.analysis import gait, samples
from crowd.analysis.contact_times import contact_time
from crowd.analysis.gait import FINE, longest_run
from crowd.analysis.samples import SAMPLES, SOFTENING, LegAnalysis
from crowd.types import Archetype, Clip

FLIGHT = 3  # samples of 50: the shortest flight (0.06 of a cycle)
GROWN = 0.1  # of a cycle: the most that the footbase adds to either end of a stance
DOWN = 0.1  # of the footbase's range of height: a planted footbase rises no more than this over its stance
SLIP = 0.35  # of the speed: a foot about to lift off moves with the ground this well
BACK = 0.25  # of the speed: a foot that has landed moves back at least this fast
INNER = (0.25, 0.75)  # of the stance: where the stance time is looked for
STRAIGHT = 4.0  # degrees: sway of the feet turns a straight walk by as much; more is meant
FLAT = np.array([1.0, 0.0, 1.0])
VELOCITY = 2  # samples of FINE to either side


@dataclass(frozen=True, eq=False)
class Stances:
    """Planted intervals of L feet in clip time, and the travel they tell of."""

    start: np.ndarray  # [L] phase at which each foot lands, in [0, 1)
    duty: np.ndarray  # [L] share of the cycle that it is planted
    direction: np.ndarray  # [3] unit, horizontal, character frame
    speed: float  # m/s
    notes: tuple[str, ...]


def find_stances(archetype: Archetype, clip: Clip, contact: np.ndarray, footbase: np.ndarray, period: float) -> Stances:
    """Stances from contact points and footbases [FINE, L, 3] of one stride of `period` seconds."""
    planted, direction, speed, notes = gait.stances(archetype, clip, contact, period, supported=False)
    ahead = np.array([direction[0], 0.0, direction[1]])
    velocity = (np.roll(footbase, -VELOCITY, 0) - np.roll(footbase, VELOCITY, 0)) * FINE / (2 * VELOCITY * period)
    start, duty = np.zeros(len(archetype.legs)), np.zeros(len(archetype.legs))
    slide = np.zeros(3)
    for leg in range(len(archetype.legs)):
        first, length = longest_run(planted[:, leg])
        early, late = _growth(footbase[:, leg, 1], velocity[:, leg] * FLAT, first, length, ahead * speed)
        start[leg] = np.mod((first - early - 0.5) / FINE, 1.0)
        duty[leg] = min((length + early + late) / FINE, 0.95)
        slide += (footbase[(first + length - 1) % FINE, leg] - footbase[first, leg]) * FLAT
    return Stances(start, duty, _direction(slide, ahead, speed), speed, tuple(notes))


def _direction(slide: np.ndarray, ahead: np.ndarray, speed: float) -> np.ndarray:
    """Unit direction against the feet's slide [3] in stance; `ahead`, the nearest axis, where that is as good."""
    size = float(np.linalg.norm(slide))
    if speed <= 0 or size == 0 or abs(slide @ ahead) > np.cos(np.radians(STRAIGHT)) * size:
        return ahead
    return -slide / size


def _growth(height: np.ndarray, velocity: np.ndarray, first: int, length: int, travel: np.ndarray) -> tuple[int, int]:
    """Samples by which a stance begins earlier and ends later, by one footbase's height [FINE] and velocity."""
    speed = float(np.linalg.norm(travel))
    stance = (first + np.arange(length)) % FINE
    down = height < np.median(height[stance]) + DOWN * np.ptp(height)
    landed = down & (-(velocity @ travel) > BACK * speed**2)
    rests = down & (np.linalg.norm(velocity + travel, axis=-1) < SLIP * speed)
    most = min(int(GROWN * FINE), (FINE - length) // 3)
    early = _run(landed, first - 1, -1, most)
    return early, _run(rests, first + length, 1, most)


def _run(mask: np.ndarray, start: int, way: int, most: int) -> int:
    """How many samples of a periodic mask hold from `start` on, at most `most`."""
    values = mask[(start + way * np.arange(most)) % len(mask)]
    return int(np.argmin(np.append(values, False)))


def stance_index(leg: LegAnalysis, start: float, duty: float) -> int:
    """Sample (0..49) in the inner half of the stance that is lowest and nearest to the middle of its travel (2.3)."""
    rows = slice(0, SAMPLES)
    cost = samples.stance_cost(
        leg.heel[rows], leg.toe_tip[rows], leg.middle[rows], leg.centre, leg.y_range, leg.axis_scaling
    )
    share = np.mod(np.arange(SAMPLES) / SAMPLES - start, 1.0) / duty
    inside = (share >= INNER[0]) & (share <= INNER[1])
    if not inside.any():  # a stance shorter than two samples
        return int(np.argmin(np.abs(share - 0.5)))
    return int(np.argmin(np.where(inside, cost, np.inf)))


def key_times(leg: LegAnalysis, stance: int, start: float, duty: float, ground: float) -> np.ndarray:
    """[6] lift, liftoff, postlift, preland, strike, land in leg-cycle time, from the planted interval.

    Ordered lift <= liftoff <= postlift <= preland <= strike <= land, with at least 0.06 between liftoff and strike.
    Liftoff and strike are multiples of 1/50, so that tables of 50 samples are exactly at rest in stance. Lift and land
    are when the first of heel and toe rises and the last comes down (2.6), where that lies within the stance.
    """
    begin = np.mod(start - stance / SAMPLES, 1.0)
    end = np.mod(start + duty - stance / SAMPLES, 1.0)
    liftoff = int(np.clip(round(end * SAMPLES), 1, SAMPLES - 1 - FLIGHT))
    strike = int(np.clip(round(begin * SAMPLES), liftoff + FLIGHT, SAMPLES - 1))
    off, on = ([contact_time(point[:SAMPLES, 1], stance, way, leg.y_range, ground) for point in (leg.heel, leg.toe_tip)]
               for way in (1, -1))  # fmt: skip
    liftoff, strike = liftoff / SAMPLES, strike / SAMPLES
    lift = min([time for time in off if 0 < time <= liftoff], default=liftoff)
    land = max([time for time in on if strike <= time], default=strike)
    postlift = min(max(liftoff, lift + SOFTENING), strike)
    preland = max(min(strike, land - SOFTENING), liftoff)
    if postlift > preland:
        postlift = preland = 0.5 * (postlift + preland)
    return np.array([lift, liftoff, postlift, preland, strike, land])
