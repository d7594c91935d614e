"""A raw rig and what was detected in it, brought to the conventions of an `Archetype`.

Metres, y up, +z forward, origin on the ground under the hips, joints in topological order with everything unused left
out, clips in place and uniformly sampled. Global motion is kept exactly; only the hierarchy it is told in changes.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from crowd.characters.body_mesh import for_skeleton
from crowd.characters.description import Axis, RigDescription
from crowd.characters.detect import Detection, detect
from crowd.characters.facing import AXES, upright
from crowd.characters.idle import with_idle
from crowd.characters.mesh_cleaning import cleaned, volume
from crowd.characters.mocap import find_up, prepare
from crowd.characters.raw_rig import RawClip, RawRig
from crowd.characters.size import plausible
from crowd.characters.thinning import kept_joints
from crowd.errors import InputError, Problem
from crowd.posing import conjugate, multiply, rotate, skin
from crowd.resampling import align_hemispheres, resample, resample_rotation
from crowd.types import Archetype, Arm, Clip, Leg, Mesh, Skeleton

MIN_RATE_HZ, MAX_RATE_HZ, MIN_SAMPLES = 30.0, 60.0, 16
DENSITY = 1000.0  # kg/m3, of bodies
MASS_PER_BOX = (10.0, 700.0)  # kg per cubic metre of the box round the neutral pose: spiders to barrels


def character_from_rig(raw: RawRig, description: RigDescription | None = None) -> Archetype:
    """The archetype of a rig read from any format. Raises InputError naming the file and the joint or clip.

    A skeleton without mesh is taken as motion capture: it gets a standing pose, single strides and a body. A rig
    without an idle clip gets one made from its slowest gait.
    """
    given = description or RigDescription()
    raw, found = examined(raw, given)
    return with_idle(normalised(raw, found, given))


def examined(raw: RawRig, given: RigDescription) -> tuple[RawRig, Detection]:
    """The rig as detection saw it (motion capture: made ready first) and what was detected."""
    if raw.mesh is not None and raw.up is not None:
        return raw, detect(raw, given)
    guess, sure = (given.up or raw.up, True) if given.up or raw.up else find_up(raw, raw.path.name)
    up: Axis = next(axis for axis in AXES if axis == guess)
    ready = prepare(_sized(raw), up)
    # The rig is y up now, and so must be what the description says of the file's axes.
    turn = upright(up)
    axes: dict[str, str | None] = {"up": None}
    if given.forward is not None:
        ahead = turn @ AXES[given.forward]
        axes["forward"] = max(AXES, key=lambda axis: float(AXES[axis] @ ahead))
    found = detect(ready, given.model_copy(update=axes))
    forward = max(AXES, key=lambda axis: float((turn @ AXES[axis]) @ AXES[found.forward]))
    doubts = () if sure else (f"up is taken as {up}; set 'up' if the character lies down",)
    return ready, replace(found, up=up, forward=forward, unsure=(*doubts, *found.unsure))


def _sized(raw: RawRig) -> RawRig:
    """The rig without the format's unit, where it makes a skeleton implausible: the unit is then judged by its size."""
    if raw.metres_per_unit is None or plausible(raw.metres_per_unit * _tallest(raw)):
        return raw
    return replace(raw, metres_per_unit=None)


def _tallest(raw: RawRig) -> float:
    return float(max(np.median(np.ptp(clip.position, axis=1).max(-1)) for clip in raw.clips))


def normalised(raw: RawRig, found: Detection, description: RigDescription) -> Archetype:
    """The archetype of a detected rig; its notes say what was assumed and what is unsure."""
    _check_bones(found)
    frame = _frame(found)
    order, parents = kept_joints(found)
    skeleton, rest_q, rest_p = _skeleton(found, frame, order, parents)
    number = {joint: k for k, joint in enumerate(order) if joint >= 0}
    legs = tuple(_leg(found, frame, number, k, rest_q, rest_p) for k in range(len(found.legs)))
    arms = tuple(
        Arm("left" if a.side > 0 else "right", number[a.shoulder], number[a.elbow], number[a.hand], a.side)
        for a in found.arms
    )
    notes = [*found.notes, *found.unsure]
    mesh = _mesh(found, frame, order, number, skeleton, rest_q, rest_p, notes)
    clips = _clips(found, frame, order, parents, legs)
    height = found.subject.height * found.metres
    mass = _mass(mesh, rest_q, rest_p, description, notes)
    return Archetype(
        description.name or raw.path.stem,
        skeleton,
        mesh,
        legs,
        arms,
        clips,
        number[found.pelvis],
        float(height),
        mass,
        source=raw.path.name,
        notes=tuple(dict.fromkeys(notes)),
    )


@dataclass(frozen=True, eq=False)
class _Frame:
    """File frame (turned) to character frame: x -> (x - origin) * metres."""

    origin: np.ndarray  # [3]
    metres: float

    def place(self, position: np.ndarray) -> np.ndarray:
        return (position - self.origin) * self.metres


def _frame(found: Detection) -> _Frame:
    rest = found.subject.raw.rest_position
    hips = rest[[leg.hip for leg in found.legs]].mean(0)
    ground = min(float(leg.contact[1]) for leg in found.legs)
    return _Frame(np.array([hips[0], ground, hips[2]]), found.metres)


def _check_bones(found: Detection) -> None:
    """Legs need bones of some length to bend."""
    raw, problems = found.subject.raw, []
    for leg, name in zip(found.legs, found.leg_names, strict=True):
        parts = [("hip", leg.hip), ("knee", leg.knee), ("ankle", leg.ankle)]
        for (upper, a), (lower, b) in itertools.pairwise(parts):
            length = np.linalg.norm(raw.rest_position[a] - raw.rest_position[b or 0])
            if length < 0.005 * found.subject.height:
                problems.append(
                    Problem(
                        f"{raw.path.name} leg '{name}'",
                        f"the bone from {upper} '{raw.names[a]}' to {lower} '{raw.names[b or 0]}' "
                        f"has length {length:.2g}",
                    )
                )
    if problems:
        raise InputError(problems)


def _local(rotation: np.ndarray, position: np.ndarray, parents: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Joint-to-parent rotation and translation of global ones [..., J, 4] and [..., J, 3]."""
    q, t = rotation.copy(), position.copy()
    for joint, parent in enumerate(parents):
        if parent >= 0:
            back = conjugate(rotation[..., parent, :])
            q[..., joint, :] = multiply(back, rotation[..., joint, :])
            t[..., joint, :] = rotate(back, position[..., joint, :] - position[..., parent, :])
    return q / np.linalg.norm(q, axis=-1, keepdims=True), t


def _picked(values: np.ndarray, order: list[int], root: np.ndarray) -> np.ndarray:
    """Columns `order` of [..., J, C]; -1 is the added root with value `root`."""
    out = values[..., [max(j, 0) for j in order], :].copy()
    for k, joint in enumerate(order):
        if joint < 0:
            out[..., k, :] = root
    return out


def _globals(
    frame: _Frame, order: list[int], rotation: np.ndarray, position: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    q = _picked(rotation, order, np.array([1.0, 0, 0, 0]))
    return q, _picked(frame.place(position), order, np.zeros(3))


def _skeleton(
    found: Detection, frame: _Frame, order: list[int], parents: tuple[int, ...]
) -> tuple[Skeleton, np.ndarray, np.ndarray]:
    raw = found.subject.raw
    rest_q, rest_p = _globals(frame, order, raw.rest_rotation, raw.rest_position)
    q, t = _local(rest_q, rest_p, parents)
    names = tuple("root of all" if j < 0 else raw.names[j] for j in order)
    return Skeleton(names, parents, np.where(q[:, :1] < 0, -q, q), t), rest_q, rest_p


def _leg(
    found: Detection, frame: _Frame, number: dict[int, int], k: int, rest_q: np.ndarray, rest_p: np.ndarray
) -> Leg:
    leg = found.legs[k]
    ball = number[leg.ball]
    offset = rotate(conjugate(rest_q[ball]), frame.place(leg.contact) - rest_p[ball])
    x, y, z = (float(value) for value in offset)
    assert leg.ankle is not None
    return Leg(found.leg_names[k], number[leg.hip], number[leg.knee], number[leg.ankle], ball, (x, y, z), leg.side)


def _mesh(
    found: Detection,
    frame: _Frame,
    order: list[int],
    number: dict[int, int],
    skeleton: Skeleton,
    rest_q: np.ndarray,
    rest_p: np.ndarray,
    notes: list[str],
) -> Mesh:
    raw = found.subject.raw.mesh
    if raw is None:
        return for_skeleton(skeleton.names, skeleton.parents, rest_p, rotations=rest_q)
    inverse_bind = np.tile(np.eye(4), (len(order), 1, 1))
    for joint, k in number.items():
        given = raw.inverse_bind[joint]
        inverse_bind[k, :3, :3] = given[:3, :3]
        inverse_bind[k, :3, 3] = frame.metres * (given[:3, :3] @ frame.origin + given[:3, 3])
    table = np.zeros(found.subject.raw.count, np.int64)
    for joint, k in number.items():
        table[joint] = k
    joints = np.where(raw.weights > 0, table[raw.joints], 0)
    mesh = Mesh(frame.place(raw.vertices), raw.triangles, joints, raw.weights, inverse_bind)
    return cleaned(mesh, rest_q, rest_p, notes, f"{found.subject.raw.path.name} mesh")


def _clips(
    found: Detection, frame: _Frame, order: list[int], parents: tuple[int, ...], legs: tuple[Leg, ...]
) -> tuple[Clip, ...]:
    out = []
    named = {"idle": 0, "walk": 1, "run": 2}
    pairs = [(c, r) for c, r in zip(found.subject.raw.clips, found.clips, strict=True) if r.role in named]
    for clip, report in sorted(pairs, key=lambda pair: (named[pair[1].role], pair[1].speed)):
        rotation, position = _uniform(clip)
        q, p = _globals(frame, order, rotation, position)
        p = _centred(p, q, legs, parents, report.role != "idle")
        local_q, local_t = _local(q, p, parents)
        speed = None if clip.speed is None else float(clip.speed * found.metres)
        out.append(Clip(clip.name, report.role, clip.duration, align_hemispheres(local_q), local_t, True, speed))
    return tuple(out)


def _uniform(clip: RawClip) -> tuple[np.ndarray, np.ndarray]:
    """Global rotation and position of F samples at f / F of the duration, 30 to 60 per second."""
    intervals = len(clip.position) - 1
    rate = intervals / clip.duration
    wanted = max(MIN_SAMPLES, round(clip.duration * float(np.clip(rate, MIN_RATE_HZ, MAX_RATE_HZ))))
    # Steady drift is spread over the cycle, so that the sample after the last is the first.
    drift = (clip.position[-1] - clip.position[0]).mean(0) * np.array([1.0, 0.0, 1.0])
    position = clip.position - np.linspace(0, 1, intervals + 1)[:, None, None] * drift
    rotation = align_hemispheres(clip.rotation)
    if wanted == intervals:
        return rotation[:-1], position[:-1]
    at = np.arange(wanted) * (intervals / wanted)
    return resample_rotation(rotation, at, cyclic=False), resample(position, at, cyclic=False)


def _centred(
    position: np.ndarray, rotation: np.ndarray, legs: tuple[Leg, ...], parents: tuple[int, ...], lowest: bool
) -> np.ndarray:
    """Positions [F, J, 3] with the hips over the origin on average and the contact points on the ground.

    lowest: the lowest contact of the clip is at y = 0 (gaits); otherwise the typical lowest one (standing).
    """
    hips = position[:, [leg.hip for leg in legs]].mean((0, 1))
    contacts = [position[:, leg.ball] + rotate(rotation[:, leg.ball], np.asarray(leg.ball_offset)) for leg in legs]
    heights = np.stack(contacts)[..., 1]
    ground = heights.min() if lowest else np.median(heights.min(0))
    moved = position - np.array([hips[0], ground, hips[2]])
    if parents.count(-1) == 1 and np.allclose(position[:, 0], 0.0):
        moved[:, 0] = 0.0  # an added root stays at the origin
    return moved


def _mass(mesh: Mesh, rest_q: np.ndarray, rest_p: np.ndarray, description: RigDescription, notes: list[str]) -> float:
    if description.mass_kg is not None:
        return description.mass_kg
    cubic_metres, closed = volume(mesh, rest_q, rest_p)
    how = f"the volume of the {'closed' if closed else 'open (so only about)'} mesh"
    mass = DENSITY * cubic_metres
    box = float(np.prod(np.ptp(skin(mesh, rest_q, rest_p), axis=0)))
    low, high = (factor * box for factor in MASS_PER_BOX)
    clamped = float(np.clip(mass, low, high))
    said = "" if clamped == mass else f", held between {low:.3g} and {high:.3g} kg for its size"
    notes.append(f"mass {clamped:.3g} kg from {how} at {DENSITY:.0f} kg/m3{said}; set 'mass_kg' to change it")
    return clamped
