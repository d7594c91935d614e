"""`--set key.path=value`: changes to a scenario before it is validated."""

from __future__ import annotations

import copy
import re
from collections.abc import Sequence
from typing import Any

from crowd.errors import InputError, Problem, nearest
from crowd.scenario_herd import Herd
from crowd.scenario_types import Model
from crowd.scenario_yaml import Document, KeyPath, key_text, read_text

_STEP = re.compile(r"([^.\[\]=]+)|\[(\d+)\]")
# Keys of which one replaces the others, so that `--set frames=60` works on a file with duration_s.
_INSTEAD = (
    ("duration_s", "frames"),
    ("speed_m_s", "velocity_m_s", "waypoints", "path", "trajectories"),
    ("fluid", "density_kg_m3"),
)


def apply_overrides(document: Document, overrides: Sequence[str], model: type[Model]) -> tuple[Document, list[Problem]]:
    """A changed copy of the document and what was wrong with the overrides.

    A path is keys with dots, list items by number or by name ("herds[0].count", "herds.people.count"). A single key
    that is no top-level key is looked for in the whole document ("archetype=dog" sets it in every herd).
    """
    changed = Document(document.label, copy.deepcopy(document.data), dict(document.lines), {})
    problems: list[Problem] = []
    for text in overrides:
        try:
            _apply(changed, text, model)
        except InputError as error:
            problems += error.problems
    return changed, problems


def _apply(document: Document, text: str, model: type[Model]) -> None:
    where = f"--set {text}"
    name, equals, written = text.partition("=")
    name = name.strip()
    steps = _steps(name)
    if not equals or steps is None:
        raise InputError([Problem(where, "must be key.path=value, e.g. herds[0].count=10")])
    value = read_text(written, where).data
    paths = [steps]
    if len(steps) == 1 and name not in model.model_fields:
        paths = _everywhere(document.data, name, where, list(model.model_fields))
    for path in paths:
        _write(document, path, value, where)


def _steps(name: str) -> KeyPath | None:
    """Keys and numbers of a path; None when it is not one."""
    found = list(_STEP.finditer(name))
    if not found or key_text(tuple(int(m[2]) if m[2] else m[1] for m in found)) != name:
        return None
    return tuple(int(m[2]) if m[2] else m[1] for m in found)


def _everywhere(data: Any, key: str, where: str, top: list[str]) -> list[KeyPath]:
    """Every place of a key, if all are of one sort; a herd's key may be absent so far."""
    found: list[KeyPath] = []
    _search(data, key, (), found)
    sorts = {tuple("*" if isinstance(step, int) else step for step in path) for path in found}
    if len(sorts) > 1:
        places = ", ".join(key_text(path) for path in found[:6])
        raise InputError([Problem(where, f"'{key}' is in several places ({places}); write the whole path")])
    herds = data.get("herds")
    if isinstance(herds, list) and key in Herd.model_fields and (not found or sorts == {("herds", "*", key)}):
        return [("herds", index, key) for index, herd in enumerate(herds) if isinstance(herd, dict)]
    if not found:
        raise InputError([Problem(where, f"no key '{key}' in the scenario{nearest(key, [*top, *Herd.model_fields])}")])
    return found


def _search(data: Any, key: str, path: KeyPath, found: list[KeyPath]) -> None:
    if isinstance(data, dict):
        if key in data:
            found.append((*path, key))
        for name, item in data.items():
            _search(item, key, (*path, name), found)
    elif isinstance(data, list):
        for index, item in enumerate(data):
            _search(item, key, (*path, index), found)


def _write(document: Document, steps: KeyPath, value: Any, where: str) -> None:
    """Puts the value at the path; mappings on the way are made, list items must be there."""
    here: Any = document.data
    path: KeyPath = ()
    for number, step in enumerate(steps):
        last = number == len(steps) - 1
        if isinstance(here, list):
            step = _index(here, step, path, where)
            here[step] = value if last else here[step]
        elif isinstance(here, dict) and isinstance(step, str):
            if last:
                _replace(here, step, value)
            elif here.get(step) is None:
                here[step] = {}
        else:
            at = key_text(path) or "the scenario"
            raise InputError([Problem(where, f"{at} is neither a mapping nor a list that has '{step}'")])
        path = (*path, step)
        here = here[step]  # pyright: ignore[reportArgumentType, reportCallIssue]
    document.overridden[path] = where


def _index(items: list[Any], step: str | int, path: KeyPath, where: str) -> int:
    if isinstance(step, int):
        if step < len(items):
            return step
        raise InputError([Problem(where, f"{key_text(path)} has {len(items)} items; there is no [{step}]")])
    names = [str(item.get("name", item.get("fluid"))) if isinstance(item, dict) else "" for item in items]
    if step in names:
        return names.index(step)
    raise InputError([Problem(where, f"{key_text(path)} has no '{step}'{nearest(step, names)}")])


def _replace(mapping: dict[str, Any], key: str, value: Any) -> None:
    for group in _INSTEAD:
        if key in group:
            for other in group:
                mapping.pop(other, None)
    mapping[key] = value
