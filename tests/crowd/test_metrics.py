"""Measures against numbers known by construction (see `made_walk` in conftest)."""

from __future__ import annotations

import csv
import dataclasses
from io import StringIO

import numpy as np
import pytest

from crowd import metrics
from crowd.metrics import measure, print_metrics, whole_cycles, write_metrics
from crowd.recorded import open_recording
from crowd.recording import Recorder
from crowd.stances import find_stances, flat_travel, strides, to_measure, travel
from tests.crowd.made_strides import DIP, UNDER, striding


def table(run, **options) -> dict[tuple[str, str, str], metrics.Row]:
    return {(row.herd, row.depth, row.quantity): row for row in measure(run, **options)}


def test_foot_slide(made_result):
    rows = table(made_result)
    # The sole creeps 4 mm and the ankle 1 mm in a stance of 12 frames; the last sample is 11/12 of the way.
    assert rows["ones", "all", "foot_slide_handle"].max == pytest.approx(0.0, abs=1e-9)
    assert rows["ones", "all", "foot_slide_sole"].mean == pytest.approx(4 * 11 / 12, rel=1e-6)
    assert rows["ones", "all", "foot_slide_ankle"].max == pytest.approx(11 / 12, rel=1e-6)
    # 4 s: left feet plant at 0, 1, 2, 3 (the first one unseen), right feet at 0.5, 1.5, 2.5, 3.5 (the last not lifted).
    assert rows["ones", "all", "foot_slide_sole"].n == 3 * (3 + 3)


def test_steps(made_result):
    rows = table(made_result)
    assert rows["twos", "all", "step_length"].mean == pytest.approx(0.6)
    assert rows["twos", "all", "step_frequency"].mean == pytest.approx(2.0)
    assert rows["twos", "all", "step_frequency"].n == 2


def test_speed_drag_and_lean(made_result):
    rows = table(made_result)
    assert rows["ones", "all", "speed"].mean == pytest.approx(1.2)
    assert rows["ones", "all", "relative_speed"].mean == pytest.approx(0.8)
    assert rows["ones", "all", "lean"].mean == pytest.approx(np.degrees(0.05))
    depth = made_result.herds["ones"]["depth"]
    assert rows["ones", "all", "drag_force"].mean == pytest.approx(90 * depth[depth > 0].mean())
    assert rows["ones", "all", "drag_power"].max == pytest.approx(108 * depth[depth > 0].mean())
    assert ("ones", "dry", "drag_force") not in rows
    assert rows["ones", "dry", "relative_speed"].mean == pytest.approx(0.8)


def test_reach_and_faults(made_result):
    rows = table(made_result)
    reach = rows["ones", "all", "over_reach"]
    assert reach.max == pytest.approx(2.0)
    assert reach.median == 0.0
    share = made_result.herds["ones"]["contact"][:, 0].mean()
    assert rows["ones", "all", "over_reach_share"].max == pytest.approx(share)
    assert rows["ones", "all", "faults"].max == 0.0
    broken = {name: dict(herd) for name, herd in made_result.herds.items()}
    fault = np.zeros_like(broken["ones"]["fault"])
    fault[40:, 1] = 4
    ball = broken["ones"]["ball"].copy()
    ball[40:, 1] = np.nan
    broken["ones"] |= {"fault": fault, "ball": ball}
    rows = table(dataclasses.replace(made_result, herds=broken))
    assert rows["ones", "all", "faults"].mean == pytest.approx(1 / 3)
    assert np.isfinite(rows["ones", "all", "foot_slide_sole"].max)


def test_penetration_and_rest(made_result):
    made = striding(made_result)
    rows = table(made, ground=lambda x, z, altitude: made.scene.ground(x, z))
    stance, flight = (rows["ones", "all", f"penetration_{name}"] for name in ("stance", "flight"))
    assert (stance.mean, stance.max) == pytest.approx((1000 * UNDER["heel"],) * 2)  # the heel lies deeper than the toe
    assert (flight.mean, flight.max) == pytest.approx((1000 * DIP,) * 2)
    # Whole stances as above; flights: left feet at 0.6, 1.6, 2.6 (3.6 not over), right feet at 0.1, 1.1, 2.1, 3.1.
    assert (stance.n, flight.n) == (3 * 6, 3 * 7)
    drift = rows["ones", "all", "foot_slide_footbase"]
    assert (drift.mean, drift.n) == (pytest.approx(4 * 11 / 12, rel=1e-6), 3 * 6)
    rests = rows["ones", "all", "parked_share"]
    assert (rests.mean, rests.max, rests.n) == (pytest.approx(1 / 6), pytest.approx(0.5), 3)
    assert ("twos", "all", "parked_share") not in rows


def test_penetration_asks_for_the_level_of_the_character(made_result):
    made = striding(made_result)
    asked = []

    def ground(x, z, altitude):
        asked.append(altitude + 0 * x)
        return made.scene.ground(x, z)

    measure(made, ground=ground)
    position = made.herds["ones"]["position"][..., 1, None]
    assert np.allclose(asked[0], np.broadcast_to(position, asked[0].shape))
    # A recorded ground is only a coarse grid: it says nothing about millimetres.
    assert ("ones", "all", "penetration_stance") not in table(made)
    broken = {name: dict(herd) for name, herd in made.herds.items()}
    broken["ones"]["heel"] = broken["ones"]["heel"].copy()
    broken["ones"]["heel"][40:, 1] = np.nan
    broken["ones"]["fault"] = broken["ones"]["fault"].copy()
    broken["ones"]["fault"][40:, 1] = 1
    rows = table(dataclasses.replace(made, herds=broken), ground=ground)
    assert rows["ones", "all", "penetration_stance"].max == pytest.approx(1000 * UNDER["heel"])
    assert rows["ones", "all", "penetration_stance"].n < 18


def test_bands_follow_the_hips(made_result):
    hips = metrics.hip_height(made_result.scene.herds[0])
    assert np.allclose(hips, 0.85)
    depth = made_result.herds["ones"]["depth"]
    assert 0 < depth.max() < 0.85 / 2
    rows = table(made_result)
    assert ("ones", "to mid-leg", "speed") in rows
    assert ("ones", "to hip", "speed") not in rows
    assert ("ones", "dry", "step_length") not in rows  # at 1.25 s in the water, first stride over at 1.5 s
    assert rows["ones", "to mid-leg", "step_length"].n == rows["ones", "all", "step_length"].n


def test_stances_of_hand_made_contacts():
    contact = np.array([[1, 0, 0, 1, 1, 1, 0, 1, 1], [1, 1, 1, 1, 1, 1, 1, 1, 1]], bool).T[:, None, :]
    alive = np.ones((9, 1), bool)
    stances = find_stances(contact, alive)
    assert list(zip(stances.leg, stances.first, stances.last, strict=True)) == [
        (0, 0, 0),
        (0, 3, 5),
        (0, 7, 8),
        (1, 0, 8),
    ]
    assert list(stances.whole) == [False, True, False, False]
    kept = to_measure(stances)
    assert list(kept.first) == [3, 0]  # the standing foot has no whole stance and is measured all the same
    point = np.zeros((9, 1, 2, 3))
    point[:, 0, 0, 0] = [9, 9, 9, 1.0, 1.5, 1.2, 9, 9, 9]
    point[:, 0, 1, 1] = np.arange(9)
    assert np.allclose(travel(kept, point), [0.5, 0.0])
    assert np.allclose(travel(kept, point, horizontal=False), [0.5, 8.0])
    handle = np.zeros((9, 1, 2, 3))
    handle[7:, 0, 0, 2] = 1.5
    handle[3:6, 0, 0, 2] = 0.5
    person, frame, length, duration = strides(stances, handle, np.arange(9) / 10)
    assert (list(person), list(frame)) == ([0], [7])
    assert length == pytest.approx([1.0])
    assert duration == pytest.approx([0.4])


def test_landing_and_rising_heel_are_no_slide():
    time = np.arange(12) / 30
    contact = np.zeros((12, 1, 1), bool)
    contact[1:11] = True
    stances = find_stances(contact, np.ones((12, 1), bool))
    ankle = np.zeros((12, 1, 1, 3))
    # Toes first and lowest, then flat from frame 2 to 7 with 2 mm of creep, then the heel rises.
    ankle[:, 0, 0, 1] = [0.2, 0.09, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1001, 0.103, 0.11, 0.15, 0.3]
    ankle[:, 0, 0, 2] = [0.0, 0.01, 0.02, 0.021, 0.021, 0.021, 0.022, 0.022, 0.025, 0.05, 0.09, 0.4]
    assert flat_travel(stances, ankle, time, np.ones(1)) == pytest.approx([0.002])
    ankle[:, 0, 0, 1] += 0.002 * np.arange(12)  # never flat
    assert np.isnan(flat_travel(stances, ankle, time, np.ones(1))).all()
    both = find_stances(np.tile(contact, (1, 2, 1)), np.ones((12, 2), bool))
    pair = np.concatenate([ankle, ankle], 1)
    pair[:, 1, :, 1] = 0.1
    assert flat_travel(both, pair, time, np.ones(2)) == pytest.approx([np.nan, 0.08], nan_ok=True)


def test_whole_cycles():
    phase = (np.arange(50) / 20 % 1)[:, None]
    inside = np.ones((50, 1), bool)
    assert whole_cycles(phase, inside).sum() == 40
    inside[25:] = False
    assert whole_cycles(phase, inside).sum() == 20
    inside[19:] = False
    assert whole_cycles(phase, inside).sum() == 0
    assert whole_cycles(phase[:20], np.ones((20, 1), bool)).sum() == 20
    assert whole_cycles(np.full((50, 1), 0.3), np.ones((50, 1), bool)).sum() == 0


def test_blocks_and_disk_do_not_matter(made_result, tmp_path, monkeypatch):
    with Recorder(tmp_path / "r.zarr", made_result.scene) as recorder:
        for chunk in made_result.chunks(32):
            recorder.append(chunk)
    whole = measure(made_result)
    monkeypatch.setattr(metrics, "BLOCK_VALUES", 1)
    from_disk = measure(open_recording(tmp_path / "r.zarr"))
    assert [(row.herd, row.depth, row.quantity, row.n) for row in whole] == [
        (row.herd, row.depth, row.quantity, row.n) for row in from_disk
    ]
    assert np.allclose([row.mean for row in whole], [row.mean for row in from_disk], atol=2e-3)
    some = {row.quantity: row.n for row in measure(made_result, most=2) if (row.herd, row.depth) == ("ones", "all")}
    assert some["faults"] == 2


def test_table_on_disk_and_screen(made_result, tmp_path):
    from rich.console import Console

    rows = measure(made_result)
    path = write_metrics(rows, tmp_path / "metrics.csv")
    with path.open() as stream:
        lines = list(csv.DictReader(stream))
    assert len(lines) == len(rows)
    assert list(lines[0]) == ["herd", "depth", "quantity", "unit", "mean", "median", "p95", "max", "n"]
    assert float(lines[1]["n"]) == rows[1].n
    stream = StringIO()
    print_metrics(rows, Console(file=stream, width=100))
    assert "foot_slide_sole" in stream.getvalue()
