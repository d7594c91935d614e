"""Proposing a rig description for a character file (`crowd rig`)."""

from __future__ import annotations

from pathlib import Path


def propose(file: Path) -> str:
    """YAML text of a rig description: what was detected and what is unsure as comments, then the keys.

    The file goes beside the asset, which it names. Raises InputError when no character can be made of the file.
    """
    from crowd.characters.inspect import inspect

    return inspect(file).yaml
