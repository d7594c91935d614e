"""Characters that need no file: each name's builder, imported when asked for."""

from __future__ import annotations

from functools import cache
from importlib import import_module

from crowd.errors import fail, nearest
from crowd.types import Archetype

_BUILDERS = {
    "human": "crowd.characters.human",
    "dog": "crowd.characters.dog",
    "hexapod": "crowd.characters.hexapod",
    "spider": "crowd.characters.spider",
}
NAMES = tuple(_BUILDERS)


@cache
def build(name: str) -> Archetype:
    """The built-in character of this name (made once per process; do not change its arrays). Raises InputError."""
    if name not in _BUILDERS:
        allowed = ", ".join(NAMES)
        raise fail("archetype", f"no built-in character '{name}'{nearest(name, NAMES)}; allowed: {allowed}")
    return import_module(_BUILDERS[name]).build()
