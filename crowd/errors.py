"""Errors a user can cause: every problem at once, each with its place, its value and what is allowed."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Problem:
    """One thing wrong with the input.

    where: file with line or key path ("wade.yaml:12 herds[0].count", "Fox.glb accessor 3").
    message: value found, what is allowed and, where a name was mistyped, the nearest known one.
    """

    where: str
    message: str

    def __str__(self) -> str:
        return f"{self.where}: {self.message}"


class InputError(Exception):
    """Bad scenario, asset or argument. The command line prints it without a traceback and exits with 2."""

    def __init__(self, problems: Iterable[Problem]):
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


def fail(where: str, message: str) -> InputError:
    """The error for a single problem: `raise fail(where, message)`."""
    return InputError([Problem(where, message)])


def nearest(name: str, known: Sequence[str]) -> str:
    """ " (did you mean 'x'?)" for the known name closest to `name`, or an empty string when none is near."""
    match = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f" (did you mean '{match[0]}'?)" if match else ""
