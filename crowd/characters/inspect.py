"""`crowd rig FILE`: what a character file holds, and a rig description proposed for it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crowd.characters.description import (
    ArmDescription,
    ClipRoles,
    LegDescription,
    RigDescription,
    dump,
    parse,
)
from crowd.characters.detect import Detection
from crowd.characters.normalise import examined, normalised
from crowd.characters.raw_rig import RawRig
from crowd.errors import fail
from crowd.scenario_styles import MOVES
from crowd.types import Archetype

ASSETS = (".glb", ".gltf", ".bvh")


@dataclass(frozen=True, eq=False)
class Inspection:
    """Result of looking at a character file."""

    path: Path
    description: RigDescription  # everything detected, spelled out
    lines: tuple[str, ...]  # report, for people
    unsure: tuple[str, ...]  # what should be looked at
    archetype: Archetype

    @property
    def yaml(self) -> str:
        """The description as YAML: the report as comments, then every key that detection decided."""
        head = f"rig description of {self.path.name}, proposed by detection; delete what detection may decide"
        return dump(self.description, [head, *self.lines])


def inspect(path: Path | str, rig: object = None) -> Inspection:
    """Detect everything in a .glb, .gltf or .bvh file. rig: a description that overrides parts of it, or None.

    Raises InputError naming the file and the place when no character can be made of it.
    """
    path = Path(path)
    given = RigDescription() if rig is None else parse(rig, f"{path.name} rig")  # type: ignore[arg-type]
    raw, found = examined(read_asset(path), given)
    archetype = normalised(raw, found, given)
    return Inspection(
        path, _description(path, found, archetype, given), _lines(found, archetype), found.unsure, archetype
    )


def read_asset(path: Path) -> RawRig:
    """The rig in a .glb, .gltf or .bvh file."""
    if path.suffix.lower() not in ASSETS:
        raise fail(str(path), f"ends in '{path.suffix}'; allowed: {', '.join(ASSETS)}")
    if path.suffix.lower() == ".bvh":
        from crowd.characters.bvh import read
    else:
        from crowd.characters.gltf_scene import read_rig as read
    return read(path)


def _description(path: Path, found: Detection, archetype: Archetype, given: RigDescription) -> RigDescription:
    names = found.subject.raw.names
    legs = [
        LegDescription(
            name=name, hip=names[leg.hip], knee=names[leg.knee], ankle=names[leg.ankle or 0], ball=names[leg.ball]
        )
        for leg, name in zip(found.legs, found.leg_names, strict=True)
    ]
    arms = [
        ArmDescription(
            name="left" if arm.side > 0 else "right",
            shoulder=names[arm.shoulder],
            elbow=names[arm.elbow],
            hand=names[arm.hand],
        )
        for arm in found.arms
    ]
    by_role = {role: [clip.name for clip in archetype.clips if clip.role == role] for role in ("idle", *MOVES)}
    roles = ClipRoles(
        idle=next(iter(by_role["idle"]), None),
        walk=by_role["walk"],
        run=by_role["run"],
        step=by_role["step"] or None,
        also_backwards=list(archetype.also_backwards) or None,
        styles=given.clips.styles,
    )
    return RigDescription(
        asset=path.name,
        name=archetype.name,
        metres_per_unit=float(f"{found.metres:.6g}"),
        up=found.up,
        forward=found.forward,
        pelvis=names[found.pelvis],
        legs=legs,
        arms=arms,
        attach={names[child]: names[parent] for child, parent in found.attached.items()} or None,
        clips=roles,
        mass_kg=float(f"{archetype.mass:.4g}"),
    )


def _lines(found: Detection, archetype: Archetype) -> tuple[str, ...]:
    names = found.subject.raw.names
    skeleton, mesh = archetype.skeleton, archetype.mesh
    lines = [
        f"{archetype.source}: {archetype.height:.2f} m tall, {archetype.mass:.3g} kg, up {found.up}, "
        f"forward {found.forward}, 1 unit = {found.metres:.4g} m",
        f"{skeleton.count} joints kept, {len(mesh.vertices)} vertices, {len(mesh.triangles)} triangles, "
        f"pelvis '{names[found.pelvis]}'",
    ]
    for leg, name in zip(found.legs, found.leg_names, strict=True):
        chain = " > ".join(names[j] for j in dict.fromkeys((leg.hip, leg.knee, leg.ankle or 0, leg.ball)))
        lines.append(f"leg {name}: {chain}")
    for arm in found.arms:
        chain = " > ".join(names[j] for j in (arm.shoulder, arm.elbow, arm.hand))
        lines.append(f"arm {'left' if arm.side > 0 else 'right'}: {chain}")
    ranks = ("idle", *MOVES)
    for report in sorted((r for r in found.clips if r.role != "other"), key=lambda r: ranks.index(r.role)):
        speed, landing = "", ""
        if report.role in MOVES:
            way = f" {way_name(report.direction)}" if report.role == "step" else ""
            speed = f"{way}, {report.speed * found.metres:.2f} m/s"
            phases = zip(found.leg_names, report.touchdown, strict=True)
            landing = "; touchdown at " + ", ".join(f"{name} {phase % 1.0:.2f}" for name, phase in phases)
        lines.append(f"clip '{report.name}' ({report.duration:.2f} s): {report.role}{speed}; {report.why}{landing}")
    lines += _others(found)
    lines += [f"style '{s.name}': " + ", ".join(f"{role} '{n}'" for n, role in s.clips) for s in archetype.styles]
    lines += [f"note: {note}" for note in archetype.notes if note not in found.unsure]
    return (*lines, *(f"unsure: {note}" for note in found.unsure))


def _others(found: Detection) -> list[str]:
    """One line for the clips of no role, by the reason why they have none; none where there are no such clips."""
    reasons: dict[str, list[str]] = {}
    for report in found.clips:
        if report.role == "other":
            reasons.setdefault(report.why, []).append(f"'{report.name}'")
    told = "; ".join(f"{', '.join(names)} ({why})" for why, names in reasons.items())
    return [f"other clips, played when asked for by name: {told}"] if told else []


def way_name(direction: tuple[float, float]) -> str:
    """Words for a unit direction (x, z) in the character frame: "backwards", "left", "forward right (60 deg)"."""
    x, z = direction
    degrees = float(np.degrees(np.arctan2(abs(x), z)))
    if degrees < 20.0 or degrees > 160.0:
        return "forward" if degrees < 20.0 else "backwards"
    side = "left" if x > 0 else "right"
    if 70.0 < degrees < 110.0:
        return side
    return f"{'forward' if z > 0 else 'back'} {side} ({degrees:.0f} deg)"
