"""Stances of feet, found in recorded contacts, and how far points of the foot travel in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

FLAT_RATE = 0.02  # m/s of the ankle's height, times the character's size, below which the foot counts as flat
FLAT_TIME = 0.1  # s, shorter pauses are none


@dataclass(frozen=True, eq=False)
class Stances:
    """Stances [S] of many characters: recorded frames first to last (both in contact) of one leg of one character."""

    character: np.ndarray
    leg: np.ndarray
    first: np.ndarray
    last: np.ndarray
    begun: np.ndarray  # the plant was seen
    whole: np.ndarray  # plant and lift were seen

    def __len__(self) -> int:
        return len(self.first)

    def frames(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Every frame of every stance: (stance, frame) [F] and where each stance starts among them [S]."""
        length = self.last - self.first + 1
        start = np.cumsum(length) - length
        stance = np.repeat(np.arange(len(self)), length)
        return stance, np.arange(len(stance)) - start[stance] + self.first[stance], start


def find_stances(contact: np.ndarray, alive: np.ndarray) -> Stances:
    """Runs of contact [t, n, legs] among frames in which the character is alive [t, n].

    Ordered by character, leg and time. A stance cut off by the ends of the recording or by a fault is not whole.
    """
    frames, _, legs = contact.shape
    planted = (contact & alive[..., None]).reshape(frames, -1).T
    edge = np.diff(np.pad(planted.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    column, first = np.nonzero(edge > 0)
    last = np.nonzero(edge < 0)[1] - 1
    character, leg = column // legs if legs else column, column % legs if legs else column
    begun = (first > 0) & alive[np.maximum(first - 1, 0), character]
    ended = (last < frames - 1) & alive[np.minimum(last + 1, frames - 1), character]
    return Stances(character, leg, first, last, begun, begun & ended)


def chosen(stances: Stances, keep: np.ndarray) -> Stances:
    """The stances where `keep` [S] holds."""
    parts = (stances.character, stances.leg, stances.first, stances.last, stances.begun, stances.whole)
    return Stances(*(part[keep] for part in parts))


def to_measure(stances: Stances) -> Stances:
    """Whole stances; of legs that have none (standing, a short recording) those that last at least three frames."""
    if len(stances) == 0:
        return stances
    leg = stances.character * (int(stances.leg.max()) + 1) + stances.leg
    served = np.isin(leg, leg[stances.whole])
    return chosen(stances, stances.whole | (~served & (stances.last - stances.first >= 2)))


def travel(stances: Stances, points: np.ndarray, horizontal: bool = True) -> np.ndarray:
    """Largest distance [S] in m of a point [t, n, legs, 3] from where it was when the stance began."""
    if len(stances) == 0:
        return np.zeros(0)
    stance, frame, start = stances.frames()
    axes = [0, 2] if horizontal else [0, 1, 2]
    place = points[frame, stances.character[stance], stances.leg[stance]][:, axes].astype(float)
    return np.maximum.reduceat(np.linalg.norm(place - place[start[stance]], axis=-1), start)


def flat_travel(stances: Stances, ankle: np.ndarray, time: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Horizontal travel [S] in m of the ankle [t, n, legs, 3] while the foot lies flat; NaN where it never does.

    Flat: the longest time in the stance during which the height of the ankle changes by less than FLAT_RATE times the
    character's `size` [n], so neither the landing nor the rising heel counts; an animal on its toes has no such time.
    Largest distance from where the ankle was when that time began.
    """
    if len(stances) == 0:
        return np.zeros(0)
    stance, frame, start = stances.frames()
    place = ankle[frame, stances.character[stance], stances.leg[stance]].astype(float)
    pause = np.diff(time[frame])
    limit = FLAT_RATE * size[stances.character[stance[1:]]] * pause
    calm = (np.diff(stance) == 0) & (np.abs(np.diff(place[:, 1])) < limit)
    # Frames joined by calm steps form a run; in each stance the longest one (the first of equals) is the flat one.
    run = np.concatenate([[0], np.cumsum(~calm)])
    length = np.bincount(run)[run]
    longest = np.maximum.reduceat(length, start)
    number = np.arange(len(stance))
    origin = np.minimum.reduceat(np.where(length == longest[stance], number, len(stance)), start)
    inside = run == run[origin][stance]
    moved = np.linalg.norm((place - place[origin[stance]])[:, [0, 2]], axis=-1)
    lasted = time[frame[origin + longest - 1]] - time[frame[origin]]
    travelled = np.maximum.reduceat(np.where(inside, moved, 0.0), start)
    return np.where(lasted >= FLAT_TIME - 1e-9, travelled, np.nan)


def strides(
    stances: Stances, handle: np.ndarray, time: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Strides [R] between successive plants of the same foot that were both seen.

    Returns the character, the recorded frame of the second plant, the length in m and the duration in s.
    """
    now, then = slice(1, None), slice(None, -1)
    same = (stances.character[now] == stances.character[then]) & (stances.leg[now] == stances.leg[then])
    pair = np.nonzero(same & stances.begun[then] & stances.begun[now])[0]
    frame = stances.first[pair + 1]
    plant = handle[stances.first, stances.character, stances.leg].astype(float)
    length = np.linalg.norm((plant[pair + 1] - plant[pair])[:, [0, 2]], axis=-1)
    return stances.character[pair], frame, length, time[frame] - time[stances.first[pair]]
