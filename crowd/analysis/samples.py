"""The reference analysis of one motion from sampled ankle and toe matrices (sections 2.1 to 2.11), to the letter.

Sample i of 0..N (N = 50) shows the clip at i/N of its duration. Indices wrap modulo N; the original sets sample N equal
to sample 0 once the stance is found, so from 2.4 on sample N is sample 0 here too. Every formula is component-wise: it
holds in any right- or left-handed frame with y up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from crowd.analysis.contact_times import contact_time, swing_change
from crowd.errors import fail

SAMPLES = 50  # N
SOFTENING = 0.2  # of a cycle, from lift to postlift and from preland to land at least
EDGE = 20.0  # how sharply balance changes with the height difference of heel and toe


@dataclass(frozen=True, eq=False)
class LegAnalysis:
    """What one leg does in one motion.

    Arrays over samples have N + 1 = 51 rows in clip time (row i: i/50 of the duration; row 50 is row 0 again).
    Positions are in the character frame, in the unit of the matrices. Key times are in leg-cycle time: fractions of the
    cycle since the stance time; all are multiples of 1/50, but 0.99 or 0.01 where the swing finder finds nothing.
    Grounded motions have stance index 0 and key times 0.
    """

    heel: np.ndarray  # [51, 3]
    toe_tip: np.ndarray  # [51, 3]
    middle: np.ndarray  # [51, 3] half-way between heel and toe tip
    balance: np.ndarray  # [51] 0: heel nearer to the ground, 1: toe nearer
    footbase: np.ndarray  # [51, 3] heel end of the footbase plate
    normalised_footbase: np.ndarray  # [50, 3] row j: leg-cycle time j/50, sample stance_index + j; z: 0..1 of a stride
    y_range: float  # the larger of the heel's and the toe tip's range of height
    centre: np.ndarray  # [3] mean of the middles, y = 0 (2.2: c)
    farthest: np.ndarray  # [3] middle farthest from the centre, y = 0 (2.2: P)
    opposite: np.ndarray  # [3] middle farthest from that one, y = 0 (2.2: Q)
    axis: np.ndarray  # [3] unit, P to Q; 0 for grounded motions and feet that stay in place
    axis_scaling: float  # |Q - P|
    stance_index: int  # 0..50
    stance_time: float  # stance_index / 50, in clip time
    lift: float
    liftoff: float
    postlift: float
    preland: float
    strike: float
    land: float
    heel_off: float  # contact finder (2.6) on the heel, forwards in time
    toe_off: float
    swing_start: float  # swing finder (2.7), forwards
    heel_on: float  # contact finder on the heel, backwards in time
    toe_on: float
    swing_end: float  # swing finder, backwards
    distance: float  # travelled in one cycle, by this leg's stance (2.9)
    direction: np.ndarray  # [3] unit, y = 0; 0 for grounded motions
    stance_position: np.ndarray  # [3] footbase at the stance time, y = ground height
    foot_vector: np.ndarray  # [3] heel to toe at the stance time, horizontal, as long as the foot (2.4: h)

    @property
    def keytimes(self) -> np.ndarray:
        """[6] lift, liftoff, postlift, preland, strike, land."""
        return np.array([self.lift, self.liftoff, self.postlift, self.preland, self.strike, self.land])

    @property
    def normalised_by_sample(self) -> np.ndarray:
        """[51, 3] the normalised footbase in clip time, as the original stores it with its samples."""
        return self.normalised_footbase[(np.arange(SAMPLES + 1) - self.stance_index) % SAMPLES]


@dataclass(frozen=True, eq=False)
class MotionAnalysis:
    """A motion of L legs; grounded motions have distance, direction, speed and velocity 0."""

    legs: tuple[LegAnalysis, ...]
    distance: float  # per cycle, mean of the legs'
    direction: np.ndarray  # [3] mean of the legs' directions, not renormalised
    speed: float  # distance / duration
    velocity: np.ndarray  # [3] direction * speed
    duration: float  # s
    grounded: bool


def analyse_samples(
    ankle: np.ndarray,
    toe: np.ndarray,
    heel: np.ndarray,
    toe_tip: np.ndarray,
    foot_length: np.ndarray | float,
    ground_height: float,
    duration: float,
    *,
    grounded: bool = False,
    fix_foot_skating: bool = False,
) -> MotionAnalysis:
    """Everything the reference analysis tells about one motion.

    ankle, toe: [51, 4, 4] (one leg) or [L, 51, 4, 4], matrices that take points of the ankle's and toe's frame to the
    character frame (column vectors: the last column holds the joint's place), sampled at i/50 of the duration,
    i = 0..50. heel: [3] or [L, 3] in the ankle's frame; toe_tip: [3] or [L, 3] in the toe's frame. foot_length: scalar
    or [L], in the matrices' unit, > 0. ground_height: y of the ground in the character frame. duration: s, > 0.
    grounded: the character stands; nothing is looked for. fix_foot_skating: the variant of 2.11 whose z is exactly 0
    and 1 in stance, by each leg's own distance.
    Axes: x sideways, y up, z forward, of whichever hand; the ground is level.

    Where the text divides by zero: feet at one height (y range 0) or in one place (axis scaling 0) leave that term out
    of the stance search; a motion that does not travel (D = 0) has z = 0 in its normalised footbase.
    """
    ankle, toe = np.asarray(ankle, float), np.asarray(toe, float)
    ankle, toe = (m[None] if m.ndim == 3 else m for m in (ankle, toe))
    count = len(ankle)
    if ankle.shape != (count, SAMPLES + 1, 4, 4) or toe.shape != ankle.shape:
        raise fail("analyse_samples", f"ankle {ankle.shape} and toe {toe.shape} must both be [L, {SAMPLES + 1}, 4, 4]")
    length = np.broadcast_to(np.asarray(foot_length, float), (count,))
    if not (length > 0).all() or not duration > 0:
        raise fail("analyse_samples", f"foot length {length} and duration {duration} must be > 0")
    legs = analyse_points(
        _points(ankle, np.broadcast_to(np.asarray(heel, float), (count, 3))),
        _points(toe, np.broadcast_to(np.asarray(toe_tip, float), (count, 3))),
        length, ground_height, grounded,
    )  # fmt: skip
    return _motion(legs, ground_height, duration, grounded, fix_foot_skating)


def analyse_points(
    heel: np.ndarray, toe_tip: np.ndarray, foot_length: np.ndarray, ground_height: float, grounded: bool
) -> tuple[LegAnalysis, ...]:
    """Sections 2.1 to 2.9 from heels and toe tips [L, 51, 3]; normalised footbases are left zero."""
    legs = zip(heel, toe_tip, foot_length, strict=True)
    return tuple(_leg(h, t, float(length), ground_height, grounded) for h, t, length in legs)


def _points(matrices: np.ndarray, local: np.ndarray) -> np.ndarray:
    """[L, 51, 3] places of one local point per leg."""
    return np.einsum("lnij,lj->lni", matrices[..., :3, :3], local) + matrices[..., :3, 3]


def _leg(heel: np.ndarray, toe: np.ndarray, length: float, ground: float, grounded: bool) -> LegAnalysis:
    y_range = float(max(np.ptp(heel[:, 1]), np.ptp(toe[:, 1])))
    middle = 0.5 * (heel + toe)
    zero = np.zeros(3)
    centre, farthest, opposite, axis, scaling = (zero, zero, zero, zero, 0.0) if grounded else _movement_axis(middle)
    stance = 0 if grounded else _stance_index(heel, toe, middle, centre, y_range, scaling)
    heel, toe, middle = (np.concatenate([points[:SAMPLES], points[:1]]) for points in (heel, toe, middle))
    balance = np.arctan(EDGE * (heel[:, 1] - toe[:, 1]) / length) / np.pi + 0.5
    foot_vector = hat(_flat(toe[stance] - heel[stance])) * length
    footbase = (1 - balance)[:, None] * heel + balance[:, None] * (toe - foot_vector)
    found = {} if grounded else _contacts(heel[:, 1], toe[:, 1], footbase, axis, stance, y_range, ground)
    stance_time = stance / SAMPLES
    times = _keytimes(found) if found else dict.fromkeys(KEYTIMES, 0.0)
    distance, direction = (0.0, zero) if grounded else _travel(footbase, stance_time, times["liftoff"], times["strike"])
    position = footbase[stance].copy()
    position[1] = ground
    return LegAnalysis(
        heel=heel, toe_tip=toe, middle=middle, balance=balance, footbase=footbase,
        normalised_footbase=np.zeros((SAMPLES, 3)), y_range=y_range,
        centre=centre, farthest=farthest, opposite=opposite, axis=axis, axis_scaling=scaling,
        stance_index=stance, stance_time=stance_time, **times, **(found or dict.fromkeys(CONTACTS, 0.0)),
        distance=distance, direction=direction, stance_position=position, foot_vector=foot_vector,
    )  # fmt: skip


def _flat(v: np.ndarray) -> np.ndarray:
    return v * np.array([1.0, 0.0, 1.0])


def hat(v: np.ndarray) -> np.ndarray:
    """Unit vector of [3], 0 where the length is at most 1e-5 (section 0.2)."""
    size = float(np.linalg.norm(v))
    return v / size if size > 1e-5 else np.zeros_like(v)


def _movement_axis(middle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """Centre, farthest point, the point farthest from that, axis and scaling (2.2); the first of equals wins."""
    points = _flat(middle[:SAMPLES])
    centre = points.mean(0)
    farthest = points[np.argmax(np.linalg.norm(points - centre, axis=-1))]
    opposite = points[np.argmax(np.linalg.norm(points - farthest, axis=-1))]
    scaling = float(np.linalg.norm(opposite - farthest))
    return centre, farthest, opposite, hat(opposite - farthest), scaling


def _stance_index(
    heel: np.ndarray, toe: np.ndarray, middle: np.ndarray, centre: np.ndarray, y_range: float, scaling: float
) -> int:
    """2.3 over all N + 1 samples as given."""
    return int(np.argmin(stance_cost(heel, toe, middle, centre, y_range, scaling)))


def stance_cost(
    heel: np.ndarray, toe: np.ndarray, middle: np.ndarray, centre: np.ndarray, y_range: float, scaling: float
) -> np.ndarray:
    """[n] what 2.3 minimises: low, and in the middle of its travel."""
    cost = np.zeros(len(heel))
    if y_range > 0:
        cost += np.maximum(heel[:, 1], toe[:, 1]) / y_range
    if scaling > 0:
        cost += np.linalg.norm(_flat(middle) - centre, axis=-1) / scaling
    return cost


KEYTIMES = ("lift", "liftoff", "postlift", "preland", "strike", "land")
CONTACTS = ("heel_off", "toe_off", "swing_start", "heel_on", "toe_on", "swing_end")


def _contacts(
    heel: np.ndarray, toe: np.ndarray, footbase: np.ndarray, axis: np.ndarray, stance: int, y_range: float,
    ground: float,
) -> dict[str, float]:  # fmt: skip
    along = footbase[:SAMPLES] @ axis
    found = {}
    for suffix, way in (("off", 1), ("on", -1)):
        found[f"heel_{suffix}"] = contact_time(heel[:SAMPLES], stance, way, y_range, ground)
        found[f"toe_{suffix}"] = contact_time(toe[:SAMPLES], stance, way, y_range, ground)
    found["swing_start"] = swing_change(along, stance, 1)
    found["swing_end"] = swing_change(along, stance, -1)
    return found


def _keytimes(found: dict[str, float]) -> dict[str, float]:
    """2.8."""
    lift, liftoff = sorted((found["heel_off"], found["toe_off"]))
    if liftoff > found["swing_start"]:
        liftoff = found["swing_start"]
        lift = min(lift, liftoff)
    strike, land = sorted((found["heel_on"], found["toe_on"]))
    if strike < found["swing_end"]:
        strike = found["swing_end"]
        land = max(land, strike)
    postlift, preland = max(liftoff, lift + SOFTENING), min(strike, land - SOFTENING)
    return dict(zip(KEYTIMES, (lift, liftoff, postlift, preland, strike, land), strict=True))


def index_of(time: float) -> int:
    """Nearest sample to a cycle time, modulo N (2.9)."""
    return int(np.floor(time * SAMPLES + 0.5)) % SAMPLES


def _travel(footbase: np.ndarray, stance_time: float, liftoff: float, strike: float) -> tuple[float, np.ndarray]:
    """Distance per cycle and direction, from the backward slide between strike and lift-off (2.9)."""
    slide = _flat(footbase[index_of(liftoff + stance_time)] - footbase[index_of(strike + stance_time)])
    planted = liftoff - strike + 1.0
    distance = float(np.linalg.norm(slide)) / planted if planted > 0 else 0.0
    return distance, -hat(slide)


def _motion(legs: tuple[LegAnalysis, ...], ground: float, duration: float, grounded: bool, fix: bool) -> MotionAnalysis:
    """2.10 and 2.11."""
    distance = float(np.mean([leg.distance for leg in legs]))
    direction = np.mean([leg.direction for leg in legs], axis=0)
    speed = distance / duration
    done = []
    for leg in legs:
        if grounded:
            paths = leg.footbase[:SAMPLES] - leg.stance_position
        elif fix:
            paths = _without_skating(leg, ground)
        else:
            at = _leg_order(leg)
            reference = leg.footbase[leg.stance_index % SAMPLES] - distance * direction * _TIMES[:, None]
            paths = normalised(leg.footbase[at], reference, direction, distance, ground)
        done.append(replace(leg, normalised_footbase=paths))
    return MotionAnalysis(tuple(done), distance, direction, speed, direction * speed, duration, grounded)


_TIMES = np.arange(SAMPLES) / SAMPLES


def _leg_order(leg: LegAnalysis) -> np.ndarray:
    """[N] sample indices from the stance on."""
    return (leg.stance_index + np.arange(SAMPLES)) % SAMPLES


def normalised(
    footbase: np.ndarray, reference: np.ndarray, direction: np.ndarray, distance: float, ground: float
) -> np.ndarray:
    """Footbases [n, 3] against the moving reference [n, 3], turned so that z is `direction` and divided by distance."""
    ahead = hat(direction) if np.any(direction) else np.array([0.0, 0.0, 1.0])
    left = np.array([ahead[2], 0.0, -ahead[0]])
    off = footbase - reference
    along = off @ ahead / distance if distance > 0 else np.zeros(len(off))
    return np.stack([off @ left, footbase[:, 1] - ground, along], -1)


def _without_skating(leg: LegAnalysis, ground: float) -> np.ndarray:
    """The variant of 2.11: the leg's own distance and direction, the foot at rest at lift-off, z clamped in stance."""
    start = leg.footbase[index_of(leg.liftoff + leg.stance_time)]
    reference = start - leg.distance * leg.direction * (_TIMES - leg.liftoff)[:, None]
    path = normalised(leg.footbase[_leg_order(leg)], reference, leg.direction, leg.distance, ground)
    planted_before, planted_behind = leg.liftoff >= _TIMES, leg.strike <= _TIMES
    path[:, 2] = np.where(planted_before, 0.0, np.where(planted_behind, 1.0, path[:, 2]))
    return path
