"""A motion-capture skeleton made ready for detection: y up, one pose to stand in, one stride in place, a body round it.

Capture files know nothing of a bind pose, of units or of loops: the rest pose is the calibration pose at the start, or
the tree's own, or is put together from the strides (each leg as it stands under the body, the rest at its mean).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from crowd.characters.binding import with_body
from crowd.characters.cycle import CyclePiece, extract_cycle, to_global, to_local
from crowd.characters.pruning import pruned
from crowd.characters.raw_rig import RawClip, RawRig
from crowd.characters.subject import turned
from crowd.errors import fail
from crowd.posing import conjugate, multiply, rotate

UNITS = {"m": 1.0, "cm": 0.01, "dm": 0.1, "inch": 0.0254, "0.45 inch": 0.0254 / 0.45, "mm": 0.001, "foot": 0.3048}
PERSON = (1.3, 2.15)  # m, joint height of bipeds taken as plausible
ANIMAL = (0.15, 2.6)  # m, of anything else
LOW = 0.08  # of the height: joints that come this near to the ground belong to feet
SKULL = 0.05  # of the height: a shorter highest bone is no head
HEAD = 0.08  # of the height: from the skull's joint to the crown
UNEVEN = 0.05  # of the height: ground that rises and falls by this much under planted feet is uneven
SAME_LEVEL = 0.06  # of the height: feet of a standing pose


@dataclass(frozen=True, eq=False)
class Motion:
    """Measures of a y-up clip that the steps below share."""

    height: float  # file units, extent of the joints along y
    feet: list[int]  # joints that come near the ground
    travel: dict[str, np.ndarray] = field(default_factory=dict)  # velocity [3] taken out of each clip that travelled


def prepare(raw: RawRig, up: str | None = None, metres_per_unit: float | None = None) -> RawRig:
    """The rig with y up, needless joints gone, a standing rest pose, its clips as single strides in place, and a mesh.

    up, metres_per_unit: what is known; None: judged by the motion and by plausible height. Clip speeds are in file
    units per second; `RawClip.speed` None: the clip did not travel. Everything unsure is added to the notes.
    Raises InputError naming the file when the skeleton holds no walk that can be cut into a cycle.
    """
    notes = list(raw.notes)
    where = raw.path.name
    clips, calibration = _split_calibration(raw)
    if calibration is not None:
        notes.append(f"the first {calibration[2]} frame(s) are a calibration pose and are not part of the motion")
    raw = replace(raw, clips=clips)
    chosen = up or raw.up
    if chosen is None:
        chosen, sure = find_up(raw, where)
        if chosen != "+y" or not sure:
            notes.append(f"the up axis is taken to be {chosen}{'' if sure else ' (unsure)'}")
    turn = _upright(chosen)
    raw = turned(raw, turn)
    motion = _measure(raw, where)
    with_pose = _with_clip(raw, calibration, turn)
    small, _ = pruned(with_pose, motion.height, motion.feet)
    if small.count < with_pose.count:
        notes.append(
            f"{with_pose.count - small.count} of {with_pose.count} joints (fingers, face, twists) were dropped"
        )
    motion = _measure(replace(small, clips=small.clips[: len(raw.clips)]), where)
    small = _with_head(small, motion)
    pose = small.clips[-1] if calibration is not None else None
    small = replace(small, clips=small.clips[: len(raw.clips)])
    skipped = calibration[2] if calibration is not None else 0
    cycled = replace(small, clips=tuple(_cycled(small, clip, motion, where, notes, skipped) for clip in small.clips))
    rested = _rested(cycled, pose, motion, notes)
    feet = _foot_tips(rested, motion)
    scale = metres_per_unit or raw.metres_per_unit or _unit(rested, len(feet), notes)
    return with_body(replace(rested, up="+y", metres_per_unit=scale, notes=tuple(notes)))


def _split_calibration(raw: RawRig) -> tuple[tuple[RawClip, ...], tuple[np.ndarray, np.ndarray, int] | None]:
    """Clips without a pose held at their start from which the motion jumps away; that pose and its frame count."""
    clips = []
    found = None
    for clip in raw.clips:
        count = len(clip.position)
        start = 0
        if count >= 8:
            centred = clip.position - clip.position.mean(1, keepdims=True)
            change = np.sqrt(np.mean(np.sum(np.diff(centred, axis=0) ** 2, -1), 1))
            size = np.sqrt(np.mean(np.sum(centred**2, -1)))
            early = max(1, min(count // 10, 30))
            jump = int(np.argmax(change[:early]))
            rest = np.percentile(change[early:], 98) if count > early + 1 else 0.0
            held = change[:jump].max() if jump else 0.0
            if change[jump] > max(3.0 * rest, 0.05 * size) and held <= max(rest, 0.01 * size):
                start = jump + 1
        if start and found is None:
            found = (clip.position[0], clip.rotation[0], start)
        duration = clip.duration * (count - 1 - start) / max(count - 1, 1)
        clips.append(RawClip(clip.name, duration, clip.position[start:], clip.rotation[start:], clip.speed))
    return tuple(clips), found


def find_up(raw: RawRig, where: str) -> tuple[str, bool]:
    """The axis at whose lower end the body stays level while moving most there, and whether that is clear.

    The head is as level as the ground under the feet, but feet move more than a head; left and right move alike; and
    nobody travels upwards.
    """
    clip = max(_split_calibration(raw)[0], key=lambda c: c.duration)
    position = _steady(clip)
    extent = np.median(np.ptp(position, axis=1), axis=0)
    if extent.max() <= 0:
        raise fail(where, "all joints lie in one point")
    way = clip.position[-1].mean(0) - clip.position[0].mean(0)
    along = np.abs(way) / max(float(np.linalg.norm(way)), 0.3 * float(extent.max()))
    moved = np.linalg.norm(position - position.mean(1, keepdims=True), axis=-1).std(0)
    ranks = []
    for axis, sign in ((axis, sign) for axis in range(3) for sign in (1.0, -1.0)):
        size = max(float(extent[axis]), 1e-9 * float(extent.max()))
        height = sign * position[..., axis]
        ragged = float(np.std(height.min(1))) / size
        level = np.median(height - height.min(1)[:, None], axis=0) / size
        low, high = level < 0.2, level > 0.8
        legs, head = (float(moved[part].mean()) if part.any() else 0.0 for part in (low, high))
        contrast = (legs - head) / max(legs + head, 1e-12) if low.any() and high.any() else 0.0
        still = 0.15 * (1.0 - contrast) if contrast > 0 else 0.4
        flat = 0.05 * (1.0 - size / float(extent.max()))
        convention = {(1, 1.0): 0.0, (2, 1.0): 0.02}.get((axis, sign), 0.06)
        cost = ragged + still + flat + convention + 0.5 * float(along[axis])
        ranks.append((cost, f"{'+' if sign > 0 else '-'}{'xyz'[axis]}"))
    ranks.sort()
    return ranks[0][1], bool(ranks[1][0] - ranks[0][0] > 0.05)


def _steady(clip: RawClip) -> np.ndarray:
    """Joint positions with the straight way of the whole body from first to last frame taken out."""
    body = clip.position.mean(1)
    return clip.position - np.linspace(0, 1, len(body))[:, None, None] * (body[-1] - body[0])


def _upright(up: str) -> np.ndarray:
    """Rotation matrix [3, 3] that takes the named axis to +y."""
    axis = (1.0 if up[0] == "+" else -1.0) * np.eye(3)["xyz".index(up[1])]
    ahead = np.array([0.0, 0, 1]) if abs(axis[2]) < 0.5 else np.array([0.0, -1, 0]) * axis[2]
    return np.stack([np.cross(axis, ahead), axis, ahead])


def _measure(raw: RawRig, where: str) -> Motion:
    clip = max(raw.clips, key=lambda c: c.duration)
    position = _steady(clip)
    height = float(np.median(np.ptp(position[..., 1], axis=1)))
    if not height > 0:
        raise fail(where, "all joints lie in one plane; a standing body is needed")
    below = position[..., 1] - position[..., 1].mean(1, keepdims=True)  # against the body: the ground may be uneven
    lowest = np.percentile(below, 5, axis=0)
    low = lowest < lowest.min() + LOW * height
    for joint in reversed(range(raw.count)):  # what carries the body is no foot, even if it lies on the ground
        if not low[joint] and raw.parents[joint] >= 0:
            low[raw.parents[joint]] = False
    if not low.any():
        raise fail(where, "no leg found: no chain of joints ends near the ground (is 'up' right?)")
    return Motion(height, np.flatnonzero(low).tolist())


def _with_clip(raw: RawRig, calibration: tuple[np.ndarray, np.ndarray, int] | None, turn: np.ndarray) -> RawRig:
    """The calibration pose as a last clip of one frame, turned as the rig was."""
    if calibration is None:
        return raw
    pose = RawClip("calibration", 0.0, calibration[0][None], calibration[1][None])
    return replace(raw, clips=(*raw.clips, turned(replace(raw, clips=(pose,)), turn).clips[0]))


def _with_head(raw: RawRig, motion: Motion) -> RawRig:
    """The rig with a joint at the crown, where a biped's highest bone is too short to be a head."""
    clip = max(raw.clips, key=lambda c: c.duration)
    top = int(np.argmax(np.median(clip.position[..., 1], axis=0)))
    bone = np.linalg.norm(clip.position[0, top] - clip.position[0, raw.parents[top]]) if raw.parents[top] >= 0 else 0.0
    if len(_foot_tips(raw, motion)) != 2 or bone > SKULL * motion.height:
        return raw
    name = f"{raw.names[top]} crown"
    while name in raw.names:
        name += "_"
    up = rotate(conjugate(_mean(clip.rotation[:, [top]])[0]), np.array([0.0, HEAD * motion.height, 0.0]))
    clips = []
    for c in raw.clips:
        crown = c.position[:, top] + rotate(c.rotation[:, top], up)
        position = np.concatenate([c.position, crown[:, None]], 1)
        clips.append(replace(c, position=position, rotation=np.concatenate([c.rotation, c.rotation[:, [top]]], 1)))
    crown = raw.rest_position[top] + rotate(raw.rest_rotation[top], up)
    return replace(
        raw,
        names=(*raw.names, name),
        parents=(*raw.parents, top),
        rest_position=np.concatenate([raw.rest_position, crown[None]]),
        rest_rotation=np.concatenate([raw.rest_rotation, raw.rest_rotation[[top]]]),
        clips=tuple(clips),
    )


def _cycled(raw: RawRig, clip: RawClip, motion: Motion, where: str, notes: list[str], skipped: int) -> RawClip:
    """The best stride of a clip, in place; its first sample is repeated at the end, as raw clips are."""
    count = len(clip.position)
    place = f"{where} clip '{clip.name}'" if clip.name != raw.path.stem else where
    if count < 8 or clip.duration <= 0:
        raise fail(place, f"{count} frame(s) of motion; a walk cycle needs at least 8")
    rotation, translation = to_local(raw.parents, clip.rotation, clip.position)
    piece = extract_cycle(rotation, translation, raw.parents, motion.feet, (count - 1) / clip.duration, place)
    if piece.speed is not None:
        ahead = piece.speed * piece.direction
        motion.travel[clip.name] = np.array([ahead[0], piece.climbed / piece.duration, ahead[1]])
    notes.extend(_cycle_notes(clip, piece, motion, skipped))
    looped = [np.concatenate([part, part[:1]]) for part in (piece.rotation, piece.translation)]
    global_q, global_p = to_global(raw.parents, *looped)
    return RawClip(clip.name, piece.duration, global_p, global_q, piece.speed)


def _cycle_notes(clip: RawClip, piece: CyclePiece, motion: Motion, skipped: int) -> list[str]:
    span = f"{piece.first + skipped} to {piece.last + skipped}"
    notes = [f"clip '{clip.name}': frames {span} (counted from 0) make the cycle ({piece.duration:.2f} s)"]
    if piece.mismatch > 0.08:
        notes.append(
            f"clip '{clip.name}': the ends of the cycle differ by {piece.mismatch:.0%} of the body and are blended"
        )
    if abs(piece.turned) > np.radians(10):
        notes.append(f"clip '{clip.name}': a turn of {np.degrees(piece.turned):.0f} degrees per stride was taken out")
    if abs(piece.climbed) > 0.03 * motion.height:
        notes.append(f"clip '{clip.name}': a rise of {piece.climbed / motion.height:.0%} of the height was taken out")
    return notes


def _rested(raw: RawRig, pose: RawClip | None, motion: Motion, notes: list[str]) -> RawRig:
    """The rig with a standing rest pose on y = 0 and every clip facing as it does, on the same ground."""
    raw = replace(raw, clips=tuple(_levelled(c, _foot_tips(raw, motion), motion, notes) for c in raw.clips))
    clip = max(raw.clips, key=lambda c: c.duration)
    if pose is not None and _stands(raw, pose.position[0], clip, motion):
        position, rotation = pose.position[0], pose.rotation[0]
    elif _stands(raw, raw.rest_position, clip, motion):
        position, rotation = raw.rest_position, raw.rest_rotation
    else:
        position, rotation = _neutral(raw, clip, motion)
        notes.append("no pose of the file stands; the rest pose is put together from the stride")
    position = position - np.array([0.0, position[motion.feet, 1].min(), 0.0])
    centre = position.mean(0) * np.array([1.0, 0.0, 1.0])
    position = position - centre
    clips = tuple(_facing_as(position, c, motion) for c in raw.clips)
    return replace(raw, rest_position=position, rest_rotation=rotation, clips=clips)


def _stands(raw: RawRig, position: np.ndarray, clip: RawClip, motion: Motion) -> bool:
    """Whether a pose is as tall as the motion and has its feet, and nothing else, on one level at the bottom."""
    height = float(np.ptp(position[:, 1]))
    tips = _foot_tips(raw, motion)
    level = position[:, 1] - position[:, 1].min()
    if height < 0.93 * motion.height or height > 1.3 * motion.height or not tips:
        return False
    feet = np.array([min(level[j] for j in tip) for tip in tips])
    others = np.setdiff1d(np.arange(raw.count), motion.feet)
    return bool(feet.max() < SAME_LEVEL * motion.height and np.all(level[others] > 0.5 * LOW * motion.height))


def _foot_tips(raw: RawRig, motion: Motion) -> list[list[int]]:
    """The low joints of each leg: those connected with each other through low joints."""
    groups: dict[int, list[int]] = {}
    for joint in motion.feet:
        top = joint
        while raw.parents[top] in motion.feet:
            top = raw.parents[top]
        groups.setdefault(top, []).append(joint)
    return list(groups.values())


def _neutral(raw: RawRig, clip: RawClip, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Global position [J, 3] and rotation [J, 4]: each leg as it is with its foot under the body, rest at its mean."""
    rotation, translation = to_local(raw.parents, clip.rotation, clip.position)
    mean_q = _mean(rotation[:-1])
    mean_p = translation[:-1].mean(0)
    counts = np.zeros(raw.count, int)
    chains = []
    for tips in _foot_tips(raw, motion):
        chain = set(tips)
        joint = raw.parents[min(tips)]
        while joint >= 0:
            chain.add(joint)
            joint = raw.parents[joint]
        chains.append((tips, chain))
        counts[list(chain)] += 1
    for tips, chain in chains:
        frame = _mid_stance(clip, tips, motion.travel.get(clip.name))
        legs = [joint for joint in chain if counts[joint] == 1]
        mean_q[legs], mean_p[legs] = rotation[frame, legs], translation[frame, legs]
    q, p = to_global(raw.parents, mean_q[None], mean_p[None])
    return p[0], q[0]


def _mid_stance(clip: RawClip, tips: list[int], travel: np.ndarray | None) -> int:
    """The frame in the middle of the stance of the foot made of joints `tips` (see `_planted`)."""
    weight = _planted(clip, tips, travel)
    count = len(weight)
    centre = np.angle(np.sum(weight * np.exp(2j * np.pi * np.arange(count) / count))) / (2 * np.pi) * count
    frames = np.flatnonzero(weight > 0)
    return int(frames[np.argmin(np.abs(np.mod(frames - centre + count / 2, count) - count / 2))])


def _planted(clip: RawClip, tips: list[int], travel: np.ndarray | None) -> np.ndarray:
    """How surely a foot stands in each frame of the cycle [F - 1], 0..1, somewhere above 0.

    travel: velocity [3] that was taken out of the clip; a planted foot moves against it. None: the foot is planted
    while it is low against the body.
    """
    position = clip.position[:-1]
    if travel is None:
        away = (position[:, tips, 1] - position[..., 1].mean(1, keepdims=True)).sum(1)
        away = (away - away.min()) / max(np.ptp(away), 1e-12) / 0.12
    else:
        foot = position[:, tips].mean(1)
        velocity = (np.roll(foot, -1, 0) - np.roll(foot, 1, 0)) * len(position) / (2 * clip.duration)
        away = np.linalg.norm(velocity + travel, axis=-1)
        away = away / max(0.3 * float(np.linalg.norm(travel)), 2.0 * float(away.min()), 1e-12)
    return np.maximum(1.0 - away, 0.0)


def _mean(rotation: np.ndarray) -> np.ndarray:
    """Mean of quaternions [F, J, 4] over time (normalised sum; good to third order in the spread)."""
    signs = np.where(np.sum(rotation * rotation[:1], -1, keepdims=True) < 0, -1.0, 1.0)
    total = np.sum(rotation * signs, 0)
    return total / np.linalg.norm(total, axis=-1, keepdims=True)


def _levelled(clip: RawClip, feet: list[list[int]], motion: Motion, notes: list[str]) -> RawClip:
    """The clip as it would be on level ground, where its feet stand on different heights (stones, stairs).

    The ground's height is that of the planted feet, interpolated while there are none and smoothed over a tenth of
    the cycle.
    """
    count = len(clip.position) - 1
    weight = np.stack([_planted(clip, tips, motion.travel.get(clip.name)) for tips in feet])
    height = np.stack([clip.position[:-1, tips, 1].min(1) for tips in feet])
    total = weight.sum(0)
    told = np.flatnonzero(total > 0)
    if len(told) == 0:
        return clip
    ground = np.sum(weight * height, 0)[told] / total[told]
    ground = np.interp(np.arange(count), told, ground, period=count)
    reach = max(1, round(0.05 * count))
    kernel = np.hanning(2 * reach + 3)[1:-1]
    padded = np.concatenate([ground[-reach:], ground, ground[:reach]])
    ground = np.convolve(padded, kernel / kernel.sum(), "valid")
    if np.ptp(ground) < UNEVEN * motion.height:
        return clip
    share = np.ptp(ground) / motion.height
    notes.append(f"clip '{clip.name}': the ground under it rises and falls by {share:.0%} of the height; it was evened")
    ground = np.append(ground, ground[0])
    return replace(clip, position=clip.position - np.stack([0 * ground, ground, 0 * ground], -1)[:, None])


def _facing_as(rest: np.ndarray, clip: RawClip, motion: Motion) -> RawClip:
    """The clip yawed so that its mean pose faces as the rest pose, with its feet on the rest pose's ground."""
    mean = clip.position.mean(0)
    flat = (mean[:, 0] - mean[:, 0].mean()) + 1j * (mean[:, 2] - mean[:, 2].mean())
    goal = (rest[:, 0] - rest[:, 0].mean()) + 1j * (rest[:, 2] - rest[:, 2].mean())
    angle = -np.angle(np.sum(goal * flat.conj()))  # yaw about y is the negative of the angle of x + iz
    yaw = np.array([np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0])
    position = rotate(yaw, clip.position)
    ground = position[:, motion.feet, 1].min() - rest[motion.feet, 1].min()
    centre = position.mean((0, 1)) - rest.mean(0)
    position = position - np.array([centre[0], ground, centre[2]])
    return RawClip(clip.name, clip.duration, position, multiply(yaw, clip.rotation), clip.speed)


def _unit(raw: RawRig, legs: int, notes: list[str]) -> float:
    """Metres per file unit: the first usual unit that makes the body plausibly tall."""
    height = float(np.ptp(raw.rest_position[:, 1]))
    low, high = PERSON if legs <= 2 else ANIMAL
    fits = [name for name, size in UNITS.items() if low <= height * size <= high]
    if fits:
        chosen = fits[0]
        also = f" (or {', '.join(fits[1:])})" if len(fits) > 1 else ""
        notes.append(
            f"one unit of the file is taken as {chosen}{also}: the joints stand {height * UNITS[chosen]:.2f} m tall"
        )
        return UNITS[chosen]
    size = (1.65 if legs <= 2 else 0.8) / height
    notes.append(f"no usual unit makes a height of {height:g} plausible; it is scaled to {size * height:.2f} m")
    return size
