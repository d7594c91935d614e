"""Styles and clips from YAML: what a herd brings to the scene, and the tables of its events."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from crowd import build, check, scene
from crowd.characters.builtin import build as built_in
from crowd.errors import InputError
from crowd.layout import SMALL_TILE
from crowd.scene import HerdScene
from tests.crowd import glb_writer
from tests.crowd.scenes import herd, scenario


def names(herd_scene: HerdScene) -> list[tuple[str, list[str]]]:
    return [(style.name, [clip.name for clip, _ in style.clips]) for style in herd_scene.styles]


def refused(model: dict[str, Any]) -> str:
    with pytest.raises(InputError) as caught:
        scene.load(model)
    return str(caught.value)


def test_a_herd_without_styles_brings_its_idle_and_all_its_gaits_and_steps() -> None:
    loaded = scene.load(scenario([herd("p", "human", 2)])).herds[0]
    assert names(loaded) == [("normal", ["idle", "walk", "jog", "walk_backwards", "side_left", "side_right"])]
    roles = [clip.role for clip, _ in loaded.styles[0].clips]
    assert roles == ["idle", "walk", "run", "step", "step", "step"]
    assert (loaded.style, loaded.extras, loaded.plays) == (0, (), ())
    assert [gait.name for gait in loaded.gaits] == ["walk", "jog"]


def test_only_styles_in_use_are_brought_and_channels_count_styles_then_clips() -> None:
    events = [
        {"at_s": 1.0, "herds": ["p"], "style": "crouch", "fade_s": 0.5},
        {"at_s": 2.0, "clip": "wave"},
        {"at_s": 2.5, "velocity_m_s": [0.0, 1.0]},
        {"at_s": 3.0, "herds": ["p"], "characters": [1], "clip": "jump", "hold_s": 0.4, "fade_s": 0.0},
        {"at_s": 4.0, "clip": "wave"},
        {"at_s": 5.0, "herds": ["p"], "style": "normal"},
        {"at_s": 6.0, "herds": ["p"], "impulse_n_s": [1.0, 0.0, 0.0]},
    ]
    loaded = scene.load(scenario([herd("p", "human", 3), herd("d", "dog", 2)], events=events))
    people, dogs = loaded.herds
    assert [name for name, _ in names(people)] == ["normal", "crouch"]
    assert names(people)[1] == ("crouch", ["crouch_idle", "crouch_walk"])
    assert [clip.role for clip, _ in people.styles[1].clips] == ["idle", "walk"]
    assert [clip.name for clip in people.extras] == ["wave", "jump"]
    assert [play.channel for play in people.plays] == [1, 2, 3, 2, 0]
    assert dogs.plays == () and [name for name, _ in names(dogs)] == ["normal"]  # dogs have no wave: no event of theirs
    layout, _, params, _ = build.build(loaded)
    assert layout.turns == 1 and params.events.impulse_frame.shape == (1,)
    table = params.styles[0]
    np.testing.assert_array_equal(table.frame, [60, 120, 180, 240, 300])
    np.testing.assert_array_equal(table.target, [1, 2, 3, 2, 0])
    np.testing.assert_allclose(table.fade, [0.5, 0.1, 0.0, 0.1, 0.3], rtol=1e-6)
    wave = next(clip for clip in people.extras if clip.name == "wave").duration
    np.testing.assert_allclose(table.hold, [np.inf, wave, 0.4, wave, np.inf], rtol=1e-6)
    mask = np.asarray(params.characters[0].style)
    assert mask.shape == (1, 5, SMALL_TILE)
    np.testing.assert_array_equal(mask[0, :, :3], [[1, 1, 1], [1, 1, 1], [0, 1, 0], [1, 1, 1], [1, 1, 1]])
    assert params.styles[1].frame.shape == (0,) and params.characters[1].style.shape == (1, 0, SMALL_TILE)
    assert params.characters[0].turn.shape[1] == params.characters[0].impulse.shape[1] == 1


def test_styles_made_in_the_scenario() -> None:
    """Of a built-in's clips, with the role each has there; the normal idle stands in, and a note says so."""
    ready = {"walk": "crouch_walk", "step": ["side_left"]}
    model = scenario([herd("p", "human", 2, style="ready", styles={"ready": ready}), herd("q", "human", 1)])
    loaded = scene.load(model)
    first, second = loaded.herds
    assert names(first) == [("ready", ["idle", "crouch_walk", "side_left"])]
    assert [clip.role for clip, _ in first.styles[0].clips] == ["idle", "walk", "step"]
    assert names(second)[0][0] == "normal"  # another herd's style is none of its own
    assert any("style 'ready' has no idle clip; 'idle' of style normal" in note for note in check.needs(loaded).notes)


def test_styles_made_in_the_scenario_for_a_file(tmp_path: Path) -> None:
    """Clips named as gaits are prepared as such and leave style normal; the herd's rig keys hold beside them."""
    rig = glb_writer.biped()
    duration, rotations, _ = rig.clips["one"]
    low = {rig.names.index("j1"): glb_writer.turn((1, 0, 0), 0.5 + 0 * rotations[next(iter(rotations))][:, 0])}
    rig.clips["stoop"] = (duration, rotations | low, {})
    glb_writer.build(rig).write(tmp_path / "a.glb")
    given = {"walk": "stoop", "run": ["three"]}
    extra = {"styles": {"sad": given}, "style": "sad", "rig": {"clips": {"also_backwards": "stoop"}}}
    loaded = scene.load(scenario([herd("p", str(tmp_path / "a.glb"), 1, 0.5, **extra)])).herds[0]
    assert names(loaded) == [("sad", ["two", "stoop", "three"])]
    assert [back for _, back in loaded.styles[0].clips] == [False, True, False]
    assert [gait.name for gait in loaded.gaits] == ["one"]
    wrong = herd("p", str(tmp_path / "a.glb"), 1, 0.5, styles={"sad": {"walk": "stop"}})
    assert "herds[0].styles.sad.walk: no clip 'stop' (did you mean 'stoop'?); clips: two, one" in refused(
        scenario([wrong])
    )


@pytest.mark.parametrize(
    ("more", "event", "says"),
    [
        (
            {"style": "crouhc"},
            None,
            "herds[0].style: 'human' has no style 'crouhc' (did you mean 'crouch'?)",
        ),
        ({"styles": {"x": {"walk": "wlk"}}}, None, "herds[0].styles.x.walk: no clip 'wlk' (did you mean 'walk'?)"),
        ({"styles": {"x": {"walk": "jump"}}}, None, "herds[0].styles.x.walk: clip 'jump' does not loop, so it is no w"),
        ({}, {"herds": ["p"], "style": "x"}, "events[0].style: herd 'p' has no style 'x'; styles: normal, crouch"),
        ({}, {"style": "croch"}, "events[0].style: no herd has it: no style 'croch' (did you mean 'crouch'?)"),
        ({}, {"herds": ["p"], "clip": "jmp"}, "events[0].clip: herd 'p' has no clip 'jmp' (did you mean 'jump'?)"),
        ({}, {"clip": "wvae"}, "events[0].clip: no herd has it: no clip 'wvae' (did you mean 'wave'?); clips: idle"),
    ],
)
def test_bad_names(more: dict[str, Any], event: dict[str, Any] | None, says: str) -> None:
    events = [] if event is None else [{"at_s": 1.0, **event}]
    assert says in refused(scenario([herd("p", "human", 1, **more)], events=events))


def test_every_bad_name_of_a_herd_at_once() -> None:
    events = [{"at_s": 1.0, "herds": ["p"], "style": "x"}, {"at_s": 1.0, "herds": ["p"], "clip": "y"}]
    told = refused(scenario([herd("p", "human", 1, style="z")], events=events))
    assert all(place in told for place in ("herds[0].style", "events[0].style", "events[1].clip"))


def test_playing_a_gait_as_a_clip_is_noted() -> None:
    events = [{"at_s": 1.0, "clip": "jog"}, {"at_s": 2.0, "clip": "jog"}]
    loaded = scene.load(scenario([herd("p", "human", 1)], events=events))
    told = [note for note in check.needs(loaded).notes if "'jog'" in note]
    assert told == ["p: 'jog' is a run; played by name it stays on the spot and feet are not adjusted"]


def test_moves_of_the_built_in_person() -> None:
    """The clips of style crouch are none of style normal."""
    person = built_in("human")
    crouched = {name for style in person.styles for name, _ in style.clips}
    assert crouched == {"crouch_idle", "crouch_walk"}
    assert all(clip.role == "other" for clip in person.clips if clip.name in crouched)
