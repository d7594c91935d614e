"""Joints added to a rig where a leg ends in a bare tip (insects), so that inverse kinematics has an end to place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from crowd.characters.raw_rig import RawClip
from crowd.characters.subject import Subject
from crowd.posing import conjugate, rotate


def add_joint(subject: Subject, parent: int, name: str, place: np.ndarray) -> tuple[Subject, int]:
    """The subject with one more joint, fixed to `parent`, at `place` [3] of the rest pose; and its index."""
    raw = subject.raw
    while name in raw.names:
        name += "'"
    local = rotate(conjugate(raw.rest_rotation[parent]), place - raw.rest_position[parent])
    clips = []
    for clip in raw.clips:
        at = clip.position[:, parent] + rotate(clip.rotation[:, parent], local)
        position = np.concatenate([clip.position, at[:, None]], 1)
        rotation = np.concatenate([clip.rotation, clip.rotation[:, parent, None]], 1)
        clips.append(RawClip(clip.name, clip.duration, position, rotation, clip.speed))
    mesh = raw.mesh
    if mesh is not None:
        mesh = replace(mesh, inverse_bind=np.concatenate([mesh.inverse_bind, np.eye(4)[None]]))
    extended = replace(
        raw,
        names=(*raw.names, name),
        parents=(*raw.parents, parent),
        rest_position=np.concatenate([raw.rest_position, place[None]]),
        rest_rotation=np.concatenate([raw.rest_rotation, raw.rest_rotation[parent, None]]),
        clips=tuple(clips),
        mesh=mesh,
    )
    points = np.concatenate([subject.points, np.zeros((1, *subject.points.shape[1:]))])
    grown = replace(
        subject, raw=extended, parents=(*subject.parents, parent), carries=np.append(subject.carries, False),
        points=points,
    )  # fmt: skip
    return grown, raw.count
