"""The command line as a user meets it: exit codes, messages, what is written and what is not."""

from __future__ import annotations

import errno
import functools
import importlib
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from crowd.cli import app
from crowd.errors import fail
from crowd.progress import Progress

REPOSITORY = Path(__file__).resolve().parents[2]
CONFIGS = REPOSITORY / "configs"
SMALL = """
name: small
duration_s: 0.5
herds:
- name: people
  archetype: human
  count: 3
  place: {kind: grid, spacing_m: 1.5}
  speed_m_s: 1.3
world:
  ground: {kind: ramp, start_m: 0, end_m: 2, drop_m: 0.5}
  fluids:
  - {fluid: water, surface_m: 0}
pictures: {at_s: [0.4], width_px: 160, height_px: 90}
"""


def crowd(*arguments: str | Path) -> Result:
    """The command in this process."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def process(*arguments: str | Path, cwd: Path = REPOSITORY) -> subprocess.CompletedProcess[str]:
    """The command as a user starts it."""
    command = [sys.executable, "-m", "crowd", *(str(argument) for argument in arguments)]
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=environment, check=False)


@pytest.fixture
def small(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(SMALL)
    return path


def test_help_and_version() -> None:
    done = process("--help")
    assert done.returncode == 0
    for command in ("run", "check", "rig", "schema", "doctor", "bench"):
        assert re.search(rf"\b{command}\b", done.stdout)
    assert process("--version").stdout.startswith("crowd ")


@pytest.mark.parametrize("command", ["run", "check"])
def test_bad_scenario_ends_with_two_and_no_traceback(command: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(SMALL.replace("count: 3", "cuont: -3").replace("human", "humann"))
    done = process(command, path, cwd=tmp_path)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    lines = done.stderr.splitlines()
    assert all(line.startswith("error: bad.yaml:") for line in lines[:-1])
    assert "bad.yaml:6 herds[0].archetype: 'humann': must be human" in done.stderr
    assert "unknown key 'cuont' (did you mean 'count'?)" in done.stderr
    assert lines[-1] == f"{len(lines) - 1} problems; nothing was written"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["run", "gone.yaml"], "gone.yaml: no such file"),
        (["check", "."], "is a folder"),
        (["run", "small.yaml", "--set", "herds.people.count=0"], "must be greater than or equal to 1"),
        (["run", "small.yaml", "--frames", "3", "--seconds", "1"], "only one of them"),
        (["run", "small.yaml", "--seconds", "nan"], "--seconds: nan: must be a positive number"),
        (["run", "small.yaml", "--out", "small.yaml"], "is a file; the output is a folder"),
        (["run", "small.yaml", "--out", "full"], "full: is not empty and not an earlier run"),
        (["run", "small.yaml", "--devices", "1000"], "--devices: 1000; this machine has"),
        (["rig", "gone.glb"], "gone.glb"),
        (["schema", "--out", "no/such/folder.json"], "cannot be written"),
    ],
)
def test_bad_arguments(arguments: list[str], says: str, small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(small.parent)
    (small.parent / "full").mkdir()
    (small.parent / "full" / "thesis.txt").write_text("do not touch")
    before = sorted(small.parent.rglob("*"))
    done = process(*arguments, cwd=small.parent) if "--devices" in arguments else crowd(*arguments)
    assert (done.returncode if isinstance(done, subprocess.CompletedProcess) else done.exit_code) == 2
    assert says in done.stderr
    assert done.stderr.startswith("error: ")
    assert sorted(small.parent.rglob("*")) == before


@pytest.mark.parametrize("arguments", [["walk"], ["run"], ["run", "x", "--frames", "0"], ["run", "x", "--frames", "q"]])
def test_usage_errors_end_with_two(arguments: list[str]) -> None:
    assert crowd(*arguments).exit_code == 2


def test_schema_is_json() -> None:
    done = crowd("schema")
    assert done.exit_code == 0
    assert json.loads(done.stdout) == json.loads((CONFIGS / "schema" / "scenario.json").read_text())


def test_doctor_names_versions_devices_and_caches() -> None:
    done = crowd("doctor")
    assert done.exit_code == 0
    for word in ("python", "jax", "numpy", "zarr", "device", "compile cache", "memory"):
        assert word in done.stdout


@pytest.mark.parametrize(
    "path",
    sorted(path for path in CONFIGS.glob("*.yaml") if not path.name.startswith(("fluids", "tune_"))),
    ids=lambda p: p.stem,
)
def test_check_accepts_every_config(path: Path) -> None:
    done = crowd("check", path)
    assert done.exit_code == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "ok"
    assert re.search(r"memory about [\d.]+ .?B, recording about [\d.]+ .?B", done.stdout)


def test_rig_reports_writes_and_is_used(shared_data: Path, tmp_path: Path) -> None:
    fox = shared_data / "characters" / "Fox.glb"
    done = crowd("rig", fox)
    assert done.exit_code == 0, done.stderr
    assert done.stdout.count("\nleg ") == 4
    assert "walk" in done.stdout
    out = tmp_path / "fox.rig.yaml"
    assert crowd("rig", fox, "--out", out).exit_code == 0
    again = crowd("rig", fox, "--out", out)
    assert (again.exit_code, again.stderr) == (2, f"error: {out}: exists; --force replaces it\n")
    assert crowd("rig", fox, "--out", out, "--force").exit_code == 0
    checked = crowd("check", CONFIGS / "own_character.yaml", "--set", f"archetype={out}")
    assert checked.exit_code == 0, checked.stderr
    assert "(4 legs" in checked.stdout


def test_check_compiles_nothing_and_writes_nothing(small: Path) -> None:
    import jax

    def refuse(*args: Any, **kwargs: Any) -> None:
        raise AssertionError("compiled")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jax, "jit", refuse)
        done = crowd("check", small)
    assert done.exit_code == 0
    assert "people: 3 x human (2 legs" in done.stdout
    assert list(small.parent.iterdir()) == [small]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, str]:
    """A small run: its folder, standard output and standard error."""
    folder = tmp_path_factory.mktemp("run")
    (folder / "small.yaml").write_text(SMALL)
    done = process("run", "small.yaml", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout, done.stderr


def test_run_writes_recording_metrics_and_pictures(finished: tuple[Path, str, str]) -> None:
    import xarray

    folder, said, progress = finished
    out = folder / "runs" / "small"
    recording = xarray.open_zarr(out / "recording.zarr")
    assert dict(recording.sizes)["time"] == 15
    assert dict(recording.sizes)["character"] == 3
    assert np.isfinite(recording["position"].values).all()
    assert recording.attrs["seed"] == 0
    assert (out / "metrics.csv").read_text().startswith("herd,depth,quantity,unit")
    assert len(list((out / "report").glob("*.png"))) >= 5
    assert "small: 3 characters, 30 frames at 60 Hz" in said
    for path in ("recording.zarr", "metrics.csv", "report/pictures.png"):
        assert f"runs/small/{path}" in said
        assert (folder / "runs" / "small" / path).exists()
    assert "frame 30/30 (100 %)" in progress
    assert "Warning" not in progress


def test_run_again_replaces_the_earlier_run(finished: tuple[Path, str, str]) -> None:
    import xarray

    folder, _, _ = finished
    stale = folder / "runs" / "small" / "report" / "crowd_099.00s.png"
    stale.write_bytes(b"")
    done = process("run", "small.yaml", "--frames", "20", "--set", "record.pose=false", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert dict(xarray.open_zarr(folder / "runs" / "small" / "recording.zarr").sizes)["time"] == 10
    assert not stale.exists()


def test_interrupt_ends_with_130_and_leaves_a_readable_recording(small: Path) -> None:
    from crowd.recorded import open_recording

    command = [sys.executable, "-m", "crowd", "run", str(small), "--out", "out", "--seconds", "3600"]
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
    listens = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # also where the tests run deaf to it
    with subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, cwd=small.parent, env=environment, preexec_fn=listens
    ) as running:
        assert running.stderr is not None
        for line in running.stderr:
            if "frames/s" in line:
                break
        running.send_signal(signal.SIGINT)
        rest = running.stderr.read()
        assert running.wait(timeout=60) == 130
    assert "Traceback" not in rest
    assert rest.splitlines()[-1] == "interrupted"
    recording = open_recording(small.parent / "out" / "recording.zarr")
    assert len(recording.time) > 0
    assert np.isfinite(np.asarray(recording.herds["people"]["position"])).all()


def test_interrupt_in_a_command_ends_with_130(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("crowd.doctor.findings", interrupted)
    done = crowd("doctor")
    assert done.exit_code == 130
    assert done.stderr == "interrupted\n"


def test_run_too_large_for_disk_or_memory_is_refused(small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = importlib.import_module("crowd.run")
    monkeypatch.chdir(small.parent)
    with monkeypatch.context() as patch:
        patch.setattr(run.shutil, "disk_usage", lambda path: SimpleNamespace(free=1000))
        done = crowd("run", small)
    assert done.exit_code == 2
    assert "the recording needs about" in done.stderr
    assert "1.0 kB are free" in done.stderr
    monkeypatch.setattr(run.check.Needs, "memory", 10**15)
    done = crowd("run", small)
    assert done.exit_code == 2
    assert "about 1000.0 TB are needed" in done.stderr
    assert list(small.parent.iterdir()) == [small]


def test_full_disk_ends_with_one_and_no_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device", "recording.zarr")

    monkeypatch.setattr("crowd.doctor.findings", full)
    done = crowd("doctor")
    assert (done.exit_code, done.stderr) == (1, "error: recording.zarr: No space left on device\n")


def test_every_problem_is_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused() -> None:
        raise fail("here", "is wrong")

    monkeypatch.setattr("crowd.doctor.findings", refused)
    done = crowd("doctor")
    assert (done.exit_code, done.stderr) == (2, "error: here: is wrong\n")


@contextmanager
def clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[float]]:
    now = [100.0]
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    yield now


def test_progress_is_a_line_per_chunk_when_not_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO()
    with clock(monkeypatch) as now, Progress(600, 60.0, 256, stream) as progress:
        now[0] += 3.0  # compiling
        progress.advance(60)
        now[0] += 1.0
        progress.advance(180)
        now[0] += 1.0
        progress.advance(300)
    lines = stream.getvalue().splitlines()
    assert lines[0] == "frame 60/600 (10 %)  first frames after 3.0 s"
    assert lines[1] == "frame 180/600 (30 %)  120 frames/s  512 characters at real time  4 s left"
    assert lines[2] == "frame 300/600 (50 %)  120 frames/s  512 characters at real time  2 s left"


def test_progress_in_a_terminal_is_a_bar() -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    stream = Terminal()
    with Progress(10, 60.0, 3, stream) as progress:
        progress.advance(10)
    assert "10/10" in stream.getvalue()


def test_bench_outside_a_checkout_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    cli = importlib.import_module("crowd.cli")
    monkeypatch.setattr(cli, "__file__", str(tmp_path / "crowd" / "cli.py"))
    done = crowd("bench")
    assert done.exit_code == 2
    assert "part of a checkout" in done.stderr


def test_frozen_characters_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    run = importlib.import_module("crowd.run")
    codes = np.array([0, 1, 0, 3])
    run._report_faults(
        {"people": run.Faults(codes, np.array([np.inf, 0.5, np.inf, 1.25])), "dogs": run.Faults(codes * 0, codes)}
    )
    said = capsys.readouterr().out
    assert said.count("\n") == 1
    assert "2 of 4 characters of 'people'" in said
    assert "1 (from 0.50 s: position, velocity or heading)" in said
    assert "3 (from 1.25 s: position, velocity or heading and drag)" in said
