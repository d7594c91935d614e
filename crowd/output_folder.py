"""The folder a command writes to: never somebody else's."""

from __future__ import annotations

import os
from pathlib import Path

from crowd.errors import fail


def refuse_foreign(out: Path, kind: str, *ours: str) -> None:
    """`InputError` unless the folder is new, empty or an earlier `kind` (it holds one of the files or folders `ours`),
    and can be written to."""
    if out.exists() and not out.is_dir():
        raise fail(str(out), "is a file; the output is a folder")
    if out.is_dir() and any(out.iterdir()) and not any((out / name).exists() for name in ours):
        raise fail(str(out), f"is not empty and not an earlier {kind}; choose another folder with --out or remove it")
    if not os.access(existing(out), os.W_OK):
        raise fail(str(out), f"cannot be made: {existing(out)} is not writable")


def existing(out: Path) -> Path:
    """The folder, or the nearest one above it that is there already."""
    return next(folder for folder in (out, *out.absolute().parents) if folder.exists())
