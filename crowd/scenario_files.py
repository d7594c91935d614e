"""Files that a scenario names: beside it, or in an installed Python package."""

from __future__ import annotations

import importlib.util
from pathlib import Path

PACKAGE = "package:"


def find_file(name: str, folder: Path) -> Path | None:
    """A file named in a scenario, relative to the scenario's folder; None when there is none."""
    path = folder / Path(name).expanduser()
    try:
        return path if path.is_file() else None
    except (OSError, ValueError):  # a name no file can have
        return None


def find_shared(name: str, folder: Path) -> tuple[Path, str]:
    """A file named in a scenario, or `package:NAME/FILE` in an installed package, and why it is not there ("": it is).

    The package is not imported.
    """
    if not name.startswith(PACKAGE):
        return folder / name, "" if find_file(name, folder) else f"no such file ({folder / name})"
    package, _, inside = name.removeprefix(PACKAGE).partition("/")
    try:
        spec = importlib.util.find_spec(package) if package.isidentifier() else None
    except (ImportError, ValueError):
        spec = None
    places = list(spec.submodule_search_locations or ()) if spec is not None else []
    if not places:
        return Path(inside), f"no package '{package}' is installed (package:NAME/FILE)"
    if ".." in Path(inside).parts:
        return Path(inside), f"'{inside}' leads out of the package"
    found = next((path for place in places if (path := find_file(inside, Path(place))) is not None), None)
    return (found, "") if found is not None else (Path(inside), f"package '{package}' has no file '{inside}'")
