"""Characters from three sources behind one type: built in, glTF (.glb, .gltf) and motion capture (.bvh)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from crowd.errors import fail, nearest
from crowd.scenario_styles import StyleNames
from crowd.types import Archetype

BUILT_IN = ("human", "dog", "hexapod", "spider")
SUFFIXES = (".glb", ".gltf", ".bvh", ".yaml", ".yml")

__all__ = ["BUILT_IN", "load"]


def load(
    reference: str,
    base: Path | str = ".",
    rig: object = None,
    styles: Mapping[str, StyleNames] | None = None,
    where: Callable[..., str] = lambda *keys: ".".join(("styles", *keys)),
) -> Archetype:
    """The character a scenario names.

    reference: a built-in name, or the path of a .glb, .gltf or .bvh file, or of a rig description .yaml that names
    its asset; relative to the folder `base`. rig: overrides for detection: the path of a rig description, a mapping
    with its keys, or a `RigDescription`; not for built-in names. styles: beside the character's own, by name; where:
    the place of a key path below them, for messages.
    Raises InputError naming the file and the place.
    """
    folder = Path(base)
    if reference in BUILT_IN:
        if rig:
            raise fail(f"archetype '{reference}'", "a built-in character takes no rig description")
        from crowd.characters.builtin import build

        if not styles:
            return build(reference)
        from crowd.characters.styles import with_styles

        return with_styles(build(reference), styles, where)
    suffix = Path(reference).suffix.lower()
    if suffix not in SUFFIXES:
        known = ", ".join(BUILT_IN)
        raise fail(
            f"archetype '{reference}'",
            f"is no built-in character{nearest(reference, BUILT_IN)} ({known}) and no file ending in "
            f"{', '.join(SUFFIXES)}",
        )
    return _from_file(folder / reference, folder, rig, styles or {}, where)


def _from_file(
    path: Path, folder: Path, rig: object, styles: Mapping[str, StyleNames], where: Callable[..., str]
) -> Archetype:
    from crowd.characters.description import RigDescription, parse
    from crowd.characters.description import read as read_description

    description: RigDescription | None = None
    if isinstance(rig, str | Path):
        description = read_description(folder / rig)
    elif isinstance(rig, Mapping | RigDescription):
        items: Any = rig
        description = parse(items, f"{path.name} rig")
    elif rig is not None:
        raise fail(f"{path.name} rig", f"is a {type(rig).__name__}; must be a path or a mapping")
    if path.suffix.lower() in (".yaml", ".yml"):
        own = read_description(path)
        if own.asset is None:
            raise fail(f"{path.name} asset", "is missing: the description must name its character file")
        path = path.parent / own.asset
        if path.suffix.lower() not in SUFFIXES[:3]:
            raise fail(f"{own.asset}", f"is no character file; allowed endings: {', '.join(SUFFIXES[:3])}")
        merged = {**own.model_dump(exclude_none=True, exclude_defaults=True)}
        if description is not None:
            merged |= description.model_dump(exclude_none=True, exclude_defaults=True)
        description = parse(merged, "rig")
    if path.suffix.lower() == ".bvh":
        from crowd.characters.bvh import read as read_rig
    else:
        from crowd.characters.gltf_scene import read_rig
    from crowd.characters.normalise import character_from_rig

    raw = read_rig(path)
    if styles:
        from crowd.characters.styles import check_clips, described

        check_clips(styles, [clip.name for clip in raw.clips], where)
        description = described(description, styles)
    return character_from_rig(raw, description)
