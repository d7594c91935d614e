"""`crowd analyze`: its table and its pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from crowd.cli import app


def run(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["analyze", *arguments])
    return result.exit_code, result.output


def test_table_and_pictures(tmp_path: Path) -> None:
    code, text = run("hexapod", "--out", str(tmp_path / "out"))
    assert code == 0
    lines = text.splitlines()
    assert "6 legs" in lines[0]
    row = next(line for line in lines if line.startswith("walk ") and "locomotion" in line).split()
    assert row[1:6] == ["locomotion", "walk", "0.500", "0.450", "0.900"]
    legs = [line.split() for line in lines if line.startswith("  middle_left")]
    assert len(legs) == 3 and all(len(leg) == 12 for leg in legs)  # walk, its twin and run
    for leg in legs:
        times = np.array(leg[2:8], float)
        assert (np.diff(times) >= 0).all()
    files = sorted(file.name for file in (tmp_path / "out").iterdir())
    assert files == [
        "00_idle_1.png", "00_idle_2.png", "01_walk_1.png", "01_walk_2.png", "03_run_1.png", "03_run_2.png",
        "velocities.png",
    ]  # fmt: skip
    for file in (tmp_path / "out").iterdir():
        pixels = np.asarray(Image.open(file).convert("RGB"))
        assert pixels.shape[0] > 500 and (pixels < 128).any(-1).mean() > 0.003


def test_one_clip_and_the_published_way() -> None:
    code, text = run("human", "--clip", "walk", "--compat")
    assert code == 0 and "jog" not in text and "idle" not in text
    row = next(line for line in text.splitlines() if line.startswith("walk ") and "locomotion" in line).split()
    assert float(row[5]) == pytest.approx(1.3, rel=0.01)  # measured on the feet


def test_bad_names_are_told() -> None:
    code, text = run("human", "--clip", "wolk")
    assert code == 2 and "--clip wolk" in text and "did you mean 'walk'" in text
    code, text = run("hunam")
    assert code == 2 and "did you mean 'human'" in text and "Traceback" not in text
