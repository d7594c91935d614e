"""The command line. Heavy packages are imported inside the command that needs them, so that `--help` is instant."""

from __future__ import annotations

import errno
import functools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from crowd.errors import InputError

BAD_INPUT, INTERRUPTED = 2, 130

app = typer.Typer(
    name="crowd",
    help="Crowds of walking characters wading through fluid: a YAML scenario, one jitted JAX step.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

ScenarioFile = Annotated[Path, typer.Argument(metavar="SCENARIO", help="Scenario YAML file.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY.PATH=VALUE", help="Change a key, e.g. herds.people.count=10 (repeatable)."),
]


def _told(command: Callable[..., None]) -> Callable[..., None]:
    """Bad input ends with its problems and exit code 2, an interrupt with 130; neither shows a traceback."""

    @functools.wraps(command)
    def run(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except InputError as error:
            _refuse(error)
        except KeyboardInterrupt:
            print("interrupted", file=sys.stderr)
            raise typer.Exit(INTERRUPTED) from None
        except BrokenPipeError:  # the reader of our output has gone: `crowd schema | head`
            sys.stderr.close()
            raise typer.Exit(0) from None
        except OSError as error:
            if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EACCES, errno.EROFS):
                raise
            print(f"error: {error.filename or 'output'}: {error.strerror}", file=sys.stderr)
            raise typer.Exit(1) from None

    return run


def _refuse(error: InputError) -> NoReturn:
    for problem in error.problems:
        print(f"error: {problem}", file=sys.stderr)
    if len(error.problems) > 1:
        print(f"{len(error.problems)} problems; nothing was written", file=sys.stderr)
    raise typer.Exit(BAD_INPUT) from None


def _version(asked: bool) -> bool:
    if asked:
        import crowd

        print(f"crowd {crowd.__version__}")
        raise typer.Exit
    return asked


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Crowds of walking characters wading through fluid: a YAML scenario, one jitted JAX step."""


@app.command()
@_told
def run(
    scenario: ScenarioFile,
    out: Annotated[Path | None, typer.Option(help="Output folder [default: runs/NAME].")] = None,
    frames: Annotated[int | None, typer.Option(min=1, help="Frames to step instead of the scenario's.")] = None,
    seconds: Annotated[float | None, typer.Option(help="Seconds to run instead of the scenario's.")] = None,
    devices: Annotated[int | None, typer.Option(min=1, help="Devices (CPU: cores) to share the crowd among.")] = None,
    overrides: Overrides = None,
) -> None:
    """Run a scenario: recording (Zarr), metrics (CSV), plots and pictures (PNG)."""
    from crowd.run import Request, run_scenario

    run_scenario(Request(scenario, out, frames, seconds, devices, tuple(overrides or ())))


@app.command()
@_told
def check(scenario: ScenarioFile, overrides: Overrides = None) -> None:
    """Validate a scenario with all its files and tell what it needs, without compiling."""
    from crowd.check import needs, readable
    from crowd.scene import load

    scene = load(scenario, overrides or [])
    found = needs(scene)
    for herd in found.herds:
        print(herd)
    for note in found.notes:
        print(f"note: {note}")
    for warning in found.warnings:
        print(f"warning: {warning}")
    print(f"{scene.count:,} characters, {scene.scenario.frame_count:,} frames at {scene.scenario.rate_hz} Hz")
    print(f"memory about {readable(found.memory)}, recording about {readable(found.recording)} before compression")
    print("ok")


@app.command()
@_told
def rig(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Character: .glb, .gltf or .bvh.")],
    out: Annotated[Path | None, typer.Option(help="Write the rig description to this YAML file.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Inspect a character file and propose its rig description: legs, arms, scale, facing and clips."""
    import os

    from crowd.characters.description import dump
    from crowd.characters.inspect import inspect
    from crowd.errors import fail

    if out is not None and out.exists() and not force:
        raise fail(str(out), "exists; --force replaces it")
    found = inspect(file)
    print("\n".join(found.lines))
    if out is not None:
        asset = os.path.relpath(file, out.parent)
        text = dump(found.description.model_copy(update={"asset": asset}), ["Proposed by crowd rig:", *found.lines])
        _write(out, text)
        print(f"wrote {out}; name it as a herd's archetype, or as its rig")


@app.command()
@_told
def analyze(
    character: Annotated[
        str, typer.Argument(metavar="CHARACTER", help="Built-in name, .glb, .gltf or .bvh file, or rig description.")
    ],
    clip: Annotated[list[str] | None, typer.Option(help="Only this clip, of whatever role (repeatable).")] = None,
    out: Annotated[Path | None, typer.Option(help="Draw every motion into this folder.")] = None,
    compat: Annotated[bool, typer.Option("--compat", help="Analyse exactly as the published system does.")] = False,
) -> None:
    """Analyse a character's clips: speed, stances, key times and foot paths, as a table and as pictures."""
    from crowd.analyze import report

    report(character, clip or [], out, compat)


@app.command()
@_told
def tune(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="Tune YAML file.")],
    out: Annotated[Path | None, typer.Option(help="Output folder [default: runs/NAME].")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the search kept in the output folder.")] = False,
    overrides: Overrides = None,
) -> None:
    """Fit constants by gradient to target values: fitted constants (YAML), residuals, identifiability, plots."""
    from crowd.tune import Request, run_tune

    run_tune(Request(config, out, resume, tuple(overrides or ())))


@app.command()
@_told
def figures(
    archetypes: Annotated[
        list[str] | None,
        typer.Argument(metavar="[CHARACTER]...", help="Built-in names or files [default: human dog spider]."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Output folder [default: runs/figures].")] = None,
) -> None:
    """Reproduce the figures and the table of the character-fluid paper (PNG, CSV), each with a pass or a fail."""
    from crowd.figures.run import run_figures

    if not run_figures(tuple(archetypes or ("human", "dog", "spider")), out or Path("runs/figures")):
        raise typer.Exit(1)


@app.command()
@_told
def schema(out: Annotated[Path | None, typer.Option(help="Write to this file.")] = None) -> None:
    """Print the JSON Schema of scenario files, for editors."""
    import json

    from crowd.scenario import schema as scenario_schema

    text = json.dumps(scenario_schema(), indent=2, ensure_ascii=False) + "\n"
    if out is None:
        print(text, end="")
    else:
        _write(out, text)


@app.command()
@_told
def doctor() -> None:
    """Print versions, devices and caches."""
    from crowd.doctor import findings

    rows = findings()
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        print(f"{name:<{width}}  {value}")


@app.command(context_settings={"ignore_unknown_options": True}, add_help_option=False)
@_told
def bench(arguments: Annotated[list[str] | None, typer.Argument(metavar="[ARGS]...")] = None) -> None:
    """Run the benchmarks of a checkout; arguments (--help too) are passed on."""
    import importlib.util
    import runpy

    from crowd.errors import fail

    root = Path(__file__).resolve().parents[1]
    if not (root / "benchmarks" / "run.py").is_file():
        raise fail("crowd bench", f"benchmarks are part of a checkout; there are none in {root}")
    if importlib.util.find_spec("benchmarks") is None:
        sys.path.insert(0, str(root))
    sys.argv = ["crowd bench", *(arguments or [])]
    runpy.run_module("benchmarks.run", run_name="__main__")


def _write(path: Path, text: str) -> None:
    from crowd.errors import fail

    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise fail(str(path), f"cannot be written: {error.strerror}") from None


def main() -> None:
    """Entry point of the `crowd` command."""
    app()


if __name__ == "__main__":
    main()
