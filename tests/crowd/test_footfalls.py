"""Foot events: every transition of a foot's phase, in order, from memory and from disk."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import crowd
from crowd import footfalls
from crowd.errors import InputError
from crowd.footfalls import EVENTS, foot_events, transitions
from crowd.recorded import open_recording
from crowd.recording import Recorder
from tests.crowd.made_strides import striding


def test_events_of_a_known_walk(made_result):
    events = crowd.foot_events(striding(made_result), "ones")
    left = events[(events["character"] == 1) & (events["leg"] == 0)]
    # Planted from 0 to 0.6 s of every second with the stance at 0.3 s: lift at 0.5, liftoff 0.6, strike 1.0, land 1.1.
    expected = [(0.1, "land")] + [
        (second + at, name)
        for second in range(4)
        for at, name in ((0.5, "lift"), (0.6, "liftoff"), (1.0, "strike"), (1.1, "land"))
        if second + at < 3.99
    ]
    assert list(left["event"]) == [name for _, name in expected]
    assert left["time"] == pytest.approx([time for time, _ in expected])
    assert np.all(np.diff(events["time"]) >= 0)
    assert set(events["character"]) == {0, 1, 2}


def test_skipped_transitions_are_filled_in_order():
    phase = np.array([[0, 2, 3], [3, 2, 3], [3, 1, 3], [0, 1, 2]], np.int8)[:, None]
    rows = transitions(phase)
    names = [(frame, leg, EVENTS[event]) for frame, _, leg, event in rows.tolist()]
    assert names == [
        (1, 0, "lift"), (1, 0, "liftoff"), (1, 0, "strike"),
        (2, 1, "strike"), (2, 1, "land"), (2, 1, "lift"),
        (3, 0, "land"),
        (3, 2, "land"), (3, 2, "lift"), (3, 2, "liftoff"),
    ]  # fmt: skip


def test_random_phases_follow_the_events():
    rng = np.random.default_rng(5)
    phase = np.cumsum(rng.integers(0, 4, (40, 3, 4)), 0) % 4
    rows = transitions(phase.astype(np.int8))
    at = phase[0].copy()
    for frame in range(1, 40):
        for _, character, leg, event in rows[rows[:, 0] == frame].tolist():
            assert event == at[character, leg]  # the event that ends the phase the foot is in
            at[character, leg] = (event + 1) % 4
        assert (at == phase[frame]).all()


def test_blocks_and_disk_do_not_matter(made_result, tmp_path, monkeypatch):
    made = striding(made_result)
    with Recorder(tmp_path / "r.zarr", made.scene) as recorder:
        for chunk in made.chunks(32):
            recorder.append(chunk)
    whole = foot_events(made, "ones")
    monkeypatch.setattr(footfalls, "BLOCK_VALUES", 1)
    assert (foot_events(open_recording(tmp_path / "r.zarr"), "ones") == whole).all()


def test_herds_without_events(made_result):
    made = striding(made_result)
    with pytest.raises(InputError, match=r"'onse': no such herd.*did you mean 'ones'"):
        foot_events(made, "onse")
    with pytest.raises(InputError, match="semi_procedural"):
        foot_events(made, "twos")
    for frames in (0, 1):
        arrays = {name: value[:frames] for name, value in made.herds["ones"].items()}
        short = dataclasses.replace(made, time=made.time[:frames], herds={"ones": arrays})
        assert len(foot_events(short, "ones")) == 0
