"""A raw rig and what was detected in it, brought to the conventions of an `Archetype`.

Metres, y up, +z forward, origin on the ground under the hips, joints in topological order with everything unused left
out, clips in place and uniformly sampled. Global motion is kept exactly; only the hierarchy it is told in changes.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from crowd.characters.body_mesh import for_skeleton
from crowd.characters.clips import clips_of
from crowd.characters.description import Axis, RigDescription
from crowd.characters.detect import Detection, detect
from crowd.characters.facing import AXES, upright
from crowd.characters.frame import Frame, global_motion, local_motion
from crowd.characters.idle import with_idle
from crowd.characters.mesh_cleaning import cleaned, volume
from crowd.characters.mocap import find_up, prepare
from crowd.characters.naming import clip_name
from crowd.characters.raw_rig import RawRig
from crowd.characters.size import plausible
from crowd.characters.thinning import kept_joints
from crowd.errors import InputError, Problem
from crowd.posing import conjugate, rotate, skin
from crowd.scenario_styles import MOVES
from crowd.types import Archetype, Arm, Clip, Leg, Mesh, Skeleton, Style

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
    styles = _styles(raw, description)
    clips = clips_of(found, frame, order, parents, legs, styles)
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
        styles=styles,
        also_backwards=_also_backwards(raw, description, clips, styles),
    )


def _frame(found: Detection) -> Frame:
    rest = found.subject.raw.rest_position
    hips = rest[[leg.hip for leg in found.legs]].mean(0)
    ground = min(float(leg.contact[1]) for leg in found.legs)
    return Frame(np.array([hips[0], ground, hips[2]]), found.metres)


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


def _skeleton(
    found: Detection, frame: Frame, order: list[int], parents: tuple[int, ...]
) -> tuple[Skeleton, np.ndarray, np.ndarray]:
    raw = found.subject.raw
    rest_q, rest_p = global_motion(frame, order, raw.rest_rotation, raw.rest_position)
    q, t = local_motion(rest_q, rest_p, parents)
    names = tuple("root of all" if j < 0 else raw.names[j] for j in order)
    return Skeleton(names, parents, np.where(q[:, :1] < 0, -q, q), t), rest_q, rest_p


def _leg(found: Detection, frame: Frame, number: dict[int, int], k: int, rest_q: np.ndarray, rest_p: np.ndarray) -> Leg:
    leg = found.legs[k]
    ball = number[leg.ball]
    offset = rotate(conjugate(rest_q[ball]), frame.place(leg.contact) - rest_p[ball])
    x, y, z = (float(value) for value in offset)
    assert leg.ankle is not None
    return Leg(found.leg_names[k], number[leg.hip], number[leg.knee], number[leg.ankle], ball, (x, y, z), leg.side)


def _mesh(
    found: Detection,
    frame: Frame,
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


def _styles(raw: RawRig, description: RigDescription) -> tuple[Style, ...]:
    """The description's styles with full clip names."""
    out = []
    for name, style in description.clips.styles.items():
        listed = {clip_name(raw, clip, f"styles.{name}.{role}"): role for clip, role in style.listed}
        out.append(Style(name, tuple(listed.items())))  # pyright: ignore[reportArgumentType]
    return tuple(out)


def _also_backwards(
    raw: RawRig, description: RigDescription, clips: tuple[Clip, ...], styles: tuple[Style, ...]
) -> tuple[str, ...]:
    """Full names of clips that serve reversed, too. Raises InputError for one that does not walk, run or step."""
    moves = {clip.name for clip in clips if clip.role in MOVES}
    moves |= {name for style in styles for name, role in style.clips if role in MOVES}
    names = [clip_name(raw, name, "also_backwards") for name in description.clips.also_backwards or []]
    problems = [
        Problem(f"{raw.path.name} clips.also_backwards", f"clip '{name}' is no walk, run or step") for name in names
    ]
    if bad := [problem for problem, name in zip(problems, names, strict=True) if name not in moves]:
        raise InputError(bad)
    return tuple(dict.fromkeys(names))


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
