"""Responses of a herd as arrays: loads, transitions, arms, reaction; and what they remember at the start."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from crowd import posing
from crowd.leg_responses import leg_responses, near_legs
from crowd.params import ArmResponse, Load, Loads, Responses, Transitions
from crowd.scenario_herd import Event
from crowd.scenario_responses import Load as LoadModel
from crowd.scene import HerdScene, Scene
from crowd.state import Responded
from crowd.types import Archetype

PERSON_SIZE = 1.70  # m
HEIGHT_SHARE = 0.72  # of the stature: a rucksack's middle
# Head, arms and trunk (Winter 2009): 0.678 of the mass; their middle 0.626 of the way from hip to shoulder, which are
# 0.288 of the stature apart; 0.470 of it is above the hips
TRUNK_MASS, TRUNK_MIDDLE = 0.678, 0.626 * 0.288 / 0.470
SHORT_ARM = 0.2  # of the shoulders' height: shorter arms are not raised where limits of arms are asked for


def chosen_responses(herd: HerdScene) -> tuple[str, ...]:
    """Names of the fields of `Responses` that the herd has."""
    own = herd.model.responses
    asked = dict(
        load=herd.model.load is not None,
        transitions=own.transitions is not None,
        arms=own.arms is not None and bool(herd.archetype.arms) and not short_arms(herd),
        reaction=own.reaction_s is not None,
        high_step=own.high_step is not None and bool(herd.archetype.legs),
        clearance=own.leg_clearance is not None and bool(near_legs(herd)),
    )
    return tuple(name for name, there in asked.items() if there)


def short_arms(herd: HerdScene) -> bool:
    """Whether no arm reaches far enough to be worth raising."""
    at = _at_rest(herd.archetype)
    longest = max((_reach(at, arm.shoulder, arm.elbow, arm.hand) for arm in herd.archetype.arms), default=0.0)
    return longest < SHORT_ARM * max((float(at[arm.shoulder, 1]) for arm in herd.archetype.arms), default=0.0)


def responses(scene: Scene, herd: HerdScene, size: np.ndarray) -> Responses:
    """Numbers [n] of a herd's responses, not yet in tiles. size [n]: over a person's."""
    own, names = herd.model.responses, chosen_responses(herd)
    full = _host(np.ones(herd.count))
    arms = own.arms
    return Responses(
        load=_load(scene, herd, herd.model.load, size) if herd.model.load is not None else None,
        transitions=_transitions(herd, size) if own.transitions is not None else None,
        arms=ArmResponse(
            band=_host(arms.hysteresis_m * size),
            time=arms.time_s * full,
            cos_bent=np.cos(np.radians(arms.least_elbow_deg)) * full,
            cos_stretched=np.cos(np.radians(arms.most_elbow_deg)) * full,
            tan_back=np.tan(np.radians(arms.back_deg)) * full,
        )
        if arms is not None and "arms" in names
        else None,
        reaction=own.reaction_s * full if own.reaction_s is not None else None,
        **leg_responses(herd, size) if names else {},
    )


def _transitions(herd: HerdScene, size: np.ndarray) -> Transitions:
    own = herd.model.responses.transitions
    assert own is not None
    full, root = _host(np.ones(herd.count)), _host(np.sqrt(size))  # equal Froude number
    return Transitions(
        walk_below=own.walk_below_m_s * root,
        stop_below=own.stop_below_m_s * root,
        hysteresis=own.hysteresis * full,
        react_time=own.react_s * full,
        rest_time=own.rest_s * full,
        height=_host(_height(herd.archetype) * herd.scale),
    )


def _load(scene: Scene, herd: HerdScene, own: LoadModel, size: np.ndarray) -> Load:
    rig, scale, height = herd.archetype, herd.scale, _height(herd.archetype)
    hips = max(float(_at_rest(rig)[[leg.hip for leg in rig.legs], 1].mean()), 0.05)
    above, ahead = load_place(herd)
    trunk = TRUNK_MASS * herd.mass * TRUNK_MIDDLE * max(height - hips, 0.0) * scale
    full = _host(np.ones(herd.count))
    events = [event for event in scene.scenario.events if event.load is not None]
    return Load(
        mass=own.mass_kg * full,
        ahead=_host(ahead * scale),
        above=_host((above - hips) * scale),
        trunk=_host(trunk),
        balances=full if len(rig.legs) <= 2 else 0.0 * full,
        size=_host(size),
        starts=float(own.carried) * full,
        event=_host(np.array([_meets(event, herd) for event in events]).reshape(-1, herd.count)),
    )


def load_place(herd: HerdScene) -> tuple[float, float]:
    """m at the archetype's own size: height of the load's middle above the ground, and how far it is ahead."""
    own = herd.model.load
    assert own is not None
    height = own.height_m if own.height_m is not None else (own.height_share or HEIGHT_SHARE) * _height(herd.archetype)
    return height, (own.forward_m or 0.0) - (own.behind_m or 0.0)


def _meets(event: Event, herd: HerdScene) -> np.ndarray:
    """[n] 1 where an event meets a character."""
    row = np.zeros(herd.count)
    if event.herds is None or herd.name in event.herds:
        row[slice(None) if event.characters == "all" else list(event.characters)] = 1.0
    return row


def load_events(scene: Scene) -> Loads | None:
    """Times at which loads are picked up and put down, in the order of time; None without any."""
    events = [event for event in scene.scenario.events if event.load is not None]
    if not events:
        return None
    return Loads(
        frame=_host(np.array([round(event.at_s * scene.scenario.rate_hz) for event in events], np.int32)),
        carried=_host(np.array([event.load == "pick_up" for event in events], np.float32)),
    )


def remembered(herd: HerdScene) -> Responded:
    """What a herd's responses remember at the start: nothing was felt, arms hang; not yet in tiles."""
    names, count = chosen_responses(herd), herd.count
    there = "transitions" in names
    return Responded(
        gear=_host(np.zeros(count, np.int32)) if there else None,
        width=_host(np.zeros(count)) if there else None,
        rested=_host(np.zeros(count)) if there else None,
        raised=_host(np.zeros((len(herd.archetype.arms), count))) if "arms" in names else None,
    )


def _host(values: np.ndarray) -> Any:
    """On the host: `build` sends everything to the device at once."""
    return values


def _at_rest(rig: Archetype) -> np.ndarray:
    """[J, 3] m, joints in the rest pose."""
    return posing.world_transforms(rig.skeleton, posing.rest_motion(rig.skeleton))[1]


def _height(rig: Archetype) -> float:
    """m, of the body, from the ground."""
    return max(float(rig.mesh.vertices[:, 1].max()), 0.05)


def _reach(at: np.ndarray, *joints: int) -> float:
    return float(sum(np.linalg.norm(at[a] - at[b]) for a, b in itertools.pairwise(joints)))
