"""Arms kept above the surface as joints allow: reach, elbows, own side of the body; late, and calm in waves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from crowd import herd_responses, posing, scene, simulate
from crowd.build import build
from crowd.types import Clip
from tests.crowd.scenes import herd, run, scenario

CALM: dict[str, Any] = {"arms": {}}
DEPTHS = (0.6, 0.75, 0.95, 1.22, 1.5, 1.9)  # hips to over the head


def pools(depths: tuple[float, ...], names: dict[str, Any], speed: float, **more: Any) -> dict[str, Any]:
    """A person of every herd of `names` (with its responses) in a pool of each depth."""
    spots = {"kind": "list", "points_m": [[20.0 * i, 0.0] for i in range(len(depths))]}
    herds = [{**herd(name, "human", len(depths), speed, **own), "place": spots} for name, own in names.items()]
    model = scenario(herds, record={"rate_hz": 60, "pose": True})
    model["world"]["fluids"] = [
        {"fluid": "water", "surface_m": depth, "area_m": {"x": [20.0 * i - 9, 20.0 * i + 9], "z": [-50, 90]}, **more}
        for i, depth in enumerate(depths)
    ]
    return model


def places(loaded: scene.Scene, arrays: dict[str, np.ndarray], person: int) -> np.ndarray:
    """[time, J, 3] m, joints in the axes of the trunk."""
    pose = Clip("", "other", 1.0, arrays["joint_rotation"][:, person], arrays["joint_translation"][:, person])
    return posing.world_transforms(loaded.herds[0].archetype.skeleton, posing.clip_motion(pose))[1]


def arms(loaded: scene.Scene, arrays: dict[str, np.ndarray], person: int) -> Iterator[tuple[np.ndarray, ...]]:
    """Per arm [time, 3] elbow and hand from the shoulder, with x out of the body."""
    at = places(loaded, arrays, person)
    for arm in loaded.herds[0].archetype.arms:
        out = np.array([arm.side, 1.0, 1.0])
        yield (at[:, arm.elbow] - at[:, arm.shoulder]) * out, (at[:, arm.hand] - at[:, arm.shoulder]) * out


@pytest.fixture(scope="module")
def deep() -> simulate.Result:
    return simulate.simulate(scene.load(pools(DEPTHS, {"plain": {}, "calm": {"responses": CALM}}, 1.3)), seconds=6.0)


@pytest.mark.parametrize("person", range(1, len(DEPTHS)), ids=[str(depth) for depth in DEPTHS[1:]])
def test_raised_arms_stay_where_joints_let_them(deep: simulate.Result, person: int) -> None:
    """Elbows between their limits, hands and elbows outside the trunk on their own side, not far behind it."""
    for elbow, hand in arms(deep.scene, deep.herds["calm"], person):
        elbow, hand = elbow[120:], hand[120:]
        upper, lower = np.linalg.norm(elbow, axis=1), np.linalg.norm(hand - elbow, axis=1)
        cos = (upper**2 + lower**2 - (hand**2).sum(1)) / (2 * upper * lower)
        angle = np.degrees(np.arccos(np.clip(cos, -1, 1)))
        assert angle.min() > 35.0 - 0.5 and angle.max() < 168.5
        assert hand[:, 0].min() > 0 and elbow[:, 0].min() > 0
        back = np.degrees(np.arctan2(-hand[:, 2], np.hypot(hand[:, 0], hand[:, 1])))
        assert back.max() < 20.5


def test_hands_are_above_the_surface_where_arms_are_long_enough(deep: simulate.Result) -> None:
    for person in (1, 2, 3, 4):
        at = places(deep.scene, deep.herds["calm"], person)[120:]
        for arm in deep.scene.herds[0].archetype.arms:
            assert at[:, arm.hand, 1].min() > DEPTHS[person]


def test_without_limits_arms_stretch_further(deep: simulate.Result) -> None:
    """The limit is needed: over one's head in water, arms would be quite straight."""
    reach = {}
    for name in ("plain", "calm"):
        _, hand = next(arms(deep.scene, deep.herds[name], DEPTHS.index(1.9)))
        reach[name] = np.linalg.norm(hand[120:], axis=1).min()
    assert reach["plain"] > reach["calm"] + 0.003


def test_arms_up_still_make_faster(deep: simulate.Result) -> None:
    """Fig. 8 of the character-fluid paper: at least 1.5 points of the speed asked for, chest-deep."""
    down = run(pools((1.22,), {"down": {"arms_up": False}}, 1.3), 6.0)["down"]["velocity"][180:, 0, 2].mean()
    up = deep.herds["calm"]["velocity"][180:, DEPTHS.index(1.22), 2].mean()
    assert up > down + 0.015 * 1.3


def travel(result: simulate.Result, name: str, person: int) -> float:
    """m per second that the left hand moves about its shoulder."""
    _, hand = next(arms(result.scene, result.herds[name], person))
    hand = hand[240:]
    return float(np.linalg.norm(np.diff(hand, axis=0), axis=1).sum() / (len(hand) / 60.0))


def test_waves_at_hand_height_do_not_make_arms_flap() -> None:
    waves = [{"amplitude_m": 0.08, "period_s": 2.0, "toward_deg": 180}]
    model = pools((0.62, 0.7), {"plain": {}, "calm": {"responses": CALM}}, 0.0, waves=waves)
    result = simulate.simulate(scene.load(model), seconds=10.0)
    for person in (0, 1):
        assert travel(result, "calm", person) < 0.4 * travel(result, "plain", person)


def test_arms_come_down_in_less_deep_water_than_they_went_up_in() -> None:
    """Down a beach and up again: a band apart, where they were less than 0.03 m apart."""
    stretches = [{"length_m": 14.0, "angle_deg": angle} for angle in (-4.0, 4.0)]
    herds = [{**herd(name, "human", 1), **own} for name, own in (("plain", {}), ("calm", {"responses": CALM}))]
    ground = {"kind": "slopes", "start_m": 2.0, "stretches": stretches}
    record = {"rate_hz": 30, "pose": True}
    result = simulate.simulate(scene.load(scenario(herds, 0.0, ground=ground, rate_hz=30, record=record)), seconds=34.0)
    apart = {}
    for name, arrays in result.herds.items():
        _, hand = next(arms(result.scene, arrays, 0))
        aside = np.convolve(np.pad(hand[:, 0], 10, mode="edge"), np.ones(21) / 21, "valid") > 0.25  # over a cycle
        depth = arrays["depth"][:, 0]
        raised = np.flatnonzero(aside & (depth > 0.2))
        assert (np.diff(raised) == 1).all()  # up once, down once
        apart[name] = depth[raised[0]] - depth[raised[-1]]
        assert depth[-1] == 0.0 and not aside[-1]
    assert apart["plain"] < 0.03 and 0.08 < apart["calm"] < 0.25


def test_short_arms_and_none_are_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing of it is in the program of a dog, nor of who has arms not worth raising."""

    def built(archetype: str) -> tuple[Any, Any]:
        layout, _, params, states = build(scene.load(scenario([herd("p", archetype, 1, 1.1, responses=CALM)], 0.9)))
        return layout, (params.characters[0].responses.arms, states[0].responded.raised)

    layout, there = built("human")
    assert layout.herds[0].responses == ("arms",) and layout.arms_up == (True,)
    assert there[0] is not None and there[1].shape[1] == 2
    assert built("dog")[1] == (None, None)
    monkeypatch.setattr(herd_responses, "SHORT_ARM", 0.9)
    layout, there = built("human")
    assert layout.herds[0].responses == () and layout.arms_up == (False,) and there == (None, None)
