"""Results against earlier ones: `crowd bench --compare FILE`, `python -m benchmarks.compare EARLIER NOW`."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

Line = dict[str, Any]
# what is compared of a case: heading, key, unit
COLUMNS = (("µs", "us", 1.0), ("compile s", "compile_cold_s", 1.0), ("temp kB/char", "temp_bytes_per_character", 1e-3))
SAME = ("cpu", "cores", "jax")  # of the machines, or numbers do not compare


def read(path: Path) -> list[Line]:
    """Lines of a results file. Raises typer.BadParameter, with the line, where it is none."""
    try:
        texts = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not text"
        raise typer.BadParameter(f"{path}: cannot be read: {reason}") from None
    lines = []
    for number, text in enumerate(texts, 1):
        if not text.strip():
            continue
        try:
            line = json.loads(text)
        except ValueError as error:
            raise typer.BadParameter(f"{path}:{number}: not JSON: {error}") from None
        if problem := _problem(line):
            raise typer.BadParameter(f"{path}:{number}: {problem}")
        lines.append(line)
    if not lines:
        raise typer.BadParameter(f"{path}: holds no results")
    return lines


def _problem(line: Any) -> str:
    """What is wrong with a line, or nothing."""
    if not isinstance(line, dict) or not isinstance(line.get("kind"), str):
        return "no line of results: a mapping with a 'kind' is expected"
    if line["kind"] == "case" and not isinstance(line.get("case"), str):
        return "a case without a name"
    for _, key, _ in COLUMNS if line["kind"] == "case" else ():
        value = line.get(key, 1.0)
        if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
            return f"{key}: {value!r} is no number above 0"
    return ""


def differences(then: Iterable[Line], now: Iterable[Line]) -> list[str]:
    """What differs between the machines of two runs, in words."""
    found = []
    for key in SAME:
        one, other = (
            sorted({str(line["machine"].get(key)) for line in lines if isinstance(line.get("machine"), dict)})
            for lines in (then, now)
        )
        if one != other:
            found.append(f"{key}: {', '.join(one) or 'unknown'} then, {', '.join(other) or 'unknown'} now")
    return found


def show(then: list[Line], now: list[Line], console: Console) -> None:
    """Prints every case of both: then, now and the ratio."""
    before = {line["case"]: line for line in then if line["kind"] == "case" and "error" not in line}
    both = [line for line in now if line["kind"] == "case" and "error" not in line and line["case"] in before]
    if not both:
        console.print("[yellow]nothing to compare: no case is in both files[/]")
        return
    for difference in differences(then, now):
        console.print(f"[yellow]machines differ, so numbers do not compare: {difference}[/]")
    table = Table(title="Against earlier results: then, now, now over then")
    table.add_column("case", no_wrap=True)
    for heading, _, _ in COLUMNS:
        for name in (heading, "now", "ratio"):
            table.add_column(name, justify="right", no_wrap=True)
    for line in both:
        cells = [cell for _, key, unit in COLUMNS for cell in _cells(before[line["case"]], line, key, unit)]
        table.add_row(line["case"], *cells)
    console.print(table)


def _cells(then: Line, now: Line, key: str, unit: float) -> tuple[str, str, str]:
    one, other = then.get(key), now.get(key)
    shown = ["" if value is None else f"{unit * value:#.3g}" for value in (one, other)]
    ratio = "" if one is None or other is None else f"{other / one:.2f}"
    return shown[0], shown[1], ratio


def main(
    earlier: Annotated[Path, typer.Argument(help="A results file (JSON lines).")],
    now: Annotated[Path, typer.Argument(help="A later one.")],
) -> None:
    """Compare two files of results."""
    show(read(earlier), read(now), Console() if sys.stdout.isatty() else Console(width=160))


if __name__ == "__main__":
    typer.run(main)
