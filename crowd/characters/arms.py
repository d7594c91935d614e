"""Arms: mirrored long chains from the upper trunk that do not stand on the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crowd.characters.subject import Subject

SHORTEST = 0.2  # of the height: shorter chains are ears, horns or fins


@dataclass(frozen=True)
class ArmChain:
    shoulder: int
    elbow: int
    hand: int
    side: int  # +1 left (+x), -1 right


def find_arms(subject: Subject, legs: set[int], trunk: list[int], hips_height: float) -> list[ArmChain]:
    """Arms of a +z-forward subject, left before right. legs: joints of the legs; trunk: joints between the legs."""
    rest = subject.raw.rest_position
    free = [j for j in range(subject.raw.count) if subject.carries[j] and j not in legs]
    children = subject.children
    leaves = [j for j in free if not any(subject.carries[k] for c in children[j] for k in subject.below(c))]
    found: dict[tuple[int, int], tuple[float, list[int]]] = {}
    for leaf in leaves:
        mirror = _mirror_of(subject, leaf, leaves)
        if mirror is None:
            continue
        other = set(subject.above(mirror))
        chain = [j for j in subject.above(leaf) if j not in other and j not in trunk][::-1]
        if not chain or rest[chain[0], 1] < hips_height - 0.05 * subject.height:
            continue
        length = float(np.linalg.norm(np.diff(rest[chain], axis=0), axis=1).sum())
        key = (chain[0], int(np.sign(rest[leaf, 0])))
        if length > found.get(key, (SHORTEST * subject.height, []))[0]:
            found[key] = (length, chain)
    divided = _agreeing([(chain, side, _divided(subject, chain)) for (_, side), (_, chain) in found.items()])
    arms = [ArmChain(chain[a], chain[b], chain[c], side) for chain, side, (a, b, c) in divided]
    arms.sort(key=lambda a: (-round(rest[a.shoulder, 2] / (0.2 * subject.height)), -a.side))
    return arms if sum(a.side for a in arms) == 0 else []


Divided = tuple[list[int], int, tuple[int, int, int] | None]


def _agreeing(arms: list[Divided]) -> list[tuple[list[int], int, tuple[int, int, int]]]:
    """Arms that could be divided; a right chain as long as a left one is divided alike."""
    lefts = {len(chain): parts for chain, side, parts in arms if side > 0 and parts is not None}
    out = []
    for chain, side, parts in arms:
        chosen = lefts.get(len(chain), parts) if side < 0 else parts
        if chosen is not None:
            out.append((chain, side, chosen))
    return out


def _mirror_of(subject: Subject, leaf: int, leaves: list[int]) -> int | None:
    rest = subject.raw.rest_position
    if abs(rest[leaf, 0]) < 0.02 * subject.height:
        return None
    image = rest[leaf] * np.array([-1.0, 1, 1])
    gaps = {other: float(np.linalg.norm(rest[other] - image)) for other in leaves if other != leaf}
    best = min(gaps, key=lambda k: gaps[k], default=None)
    return best if best is not None and gaps[best] < 0.15 * subject.height else None


def _divided(subject: Subject, chain: list[int]) -> tuple[int, int, int] | None:
    """Places of shoulder, elbow and hand in a chain from the trunk to a fingertip."""
    rest, children = subject.raw.rest_position, subject.children
    if len(chain) < 3:
        return None
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rest[chain], axis=0), axis=1))])
    total = along[-1]
    last = len(chain) - 1
    for k in range(2, len(chain)):
        branches = [c for c in children[chain[k]] if any(subject.carries[b] for b in subject.below(c))]
        spread = [float(np.linalg.norm(rest[c] - rest[chain[k]])) for c in branches]
        if len(branches) > 1 or total - along[k] < 0.32 * total:
            # Fingers that start far from where they split leave from a palm of their own: the first joint of one.
            last = k + 1 if spread and min(spread) > 0.15 * total and k + 1 < len(chain) else k
            break
    # From the hand upwards: the forearm is the first long bone, the upper arm the next; collar bones lie above.
    long = [k for k in range(last, 0, -1) if along[k] - along[k - 1] > 0.15 * along[last]]
    if len(long) < 2 or along[last] < 0.5 * SHORTEST * subject.height:
        return None
    elbow, shoulder = long[0] - 1, long[1] - 1
    return shoulder, elbow, last
