"""Loads: who carries something leans, walks and is pushed as mechanics and physiology say."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from crowd import advance, posing, scene
from crowd.build import build
from crowd.compiler_options import options
from crowd.herd_responses import TRUNK_MASS, TRUNK_MIDDLE
from tests.crowd.scenes import beside, herd, run, scenario

Arrays = dict[str, dict[str, np.ndarray]]
RUCKSACK = {"mass_kg": 20.0, "behind_m": 0.25}


def carriers() -> dict[str, Any]:
    """Who carries what; `later` picks its rucksack up at 2 s and puts it down at 5 s."""
    return scenario(
        beside(
            herd("free", "human", 1),
            herd("rucksack", "human", 1, load=RUCKSACK),
            herd("on_head", "human", 1, load={"mass_kg": 20.0, "height_share": 1.1}),
            herd("in_arms", "human", 1, load={"mass_kg": 10.0, "forward_m": 0.35, "height_m": 1.2}),
            herd("dog", "dog", 1, 1.1, load={"mass_kg": 5.0, "behind_m": 0.2}),
            herd("later", "human", 1, load={**RUCKSACK, "carried": False}),
        ),
        events=[
            {"at_s": 2.0, "load": "pick_up", "herds": ["later"]},
            {"at_s": 5.0, "load": "put_down", "herds": ["later"]},
        ],
    )


@pytest.fixture(scope="module")
def carried() -> Arrays:
    return run(carriers(), 8.0)


def lean(arrays: dict[str, np.ndarray]) -> float:
    return float(arrays["pitch"][-30:, 0].mean())


def test_load_is_balanced_over_the_feet(carried: Arrays) -> None:
    """Lean against the closed form, from body measures of the literature and the place of the load."""
    person = scene.load(carriers()).herds[0]
    rig = person.archetype
    _, at = posing.world_transforms(rig.skeleton, posing.rest_motion(rig.skeleton))
    hips, height = float(at[[leg.hip for leg in rig.legs], 1].mean()), float(rig.mesh.vertices[:, 1].max())
    trunk = TRUNK_MASS * float(person.mass[0]) * TRUNK_MIDDLE * (height - hips)
    expected = np.arctan2(20.0 * 0.25, trunk + 20.0 * (0.72 * height - hips))
    assert np.radians(10) < expected < np.radians(16)
    assert lean(carried["rucksack"]) == pytest.approx(float(expected), abs=1e-3)
    expected = np.arctan2(-10.0 * 0.35, trunk + 10.0 * (1.2 - hips))
    assert lean(carried["in_arms"]) == pytest.approx(float(expected), abs=1e-3)
    assert abs(lean(carried["on_head"])) < 1e-4 and lean(carried["free"]) == 0.0


def test_load_tips_who_stands_on_four_legs(carried: Arrays) -> None:
    """By its torque over the controller's gain: the dog does not lean against it."""
    _, _, params, _ = build(scene.load(carriers()))
    dog = params.characters[4]
    load = dog.responses.load
    assert load is not None
    weight = 9.81 * float(load.mass[0, 0])
    stiffness = float(dog.pitch_gain[0, 0]) - weight * float(load.above[0, 0])
    expected = weight * float(load.ahead[0, 0]) / stiffness
    assert expected < -0.01
    assert lean(carried["dog"]) == pytest.approx(expected, rel=0.01)


def test_load_slows_by_equal_power(carried: Arrays) -> None:
    """Pandolf's metabolic power at the speed found is that of 1.3 m/s without the load."""
    for name, load in (("rucksack", 20.0), ("in_arms", 10.0)):
        speed = float(carried[name]["velocity"][-1, 0, 2])
        whole = 70.0 + load
        power = 1.5 * 70.0 + 2.0 * whole * (load / 70.0) ** 2 + 1.5 * whole * speed**2
        assert power == pytest.approx(70.0 * (1.5 + 1.5 * 1.3**2), rel=2e-3)
        assert carried[name]["desired_velocity"][-1, 0, 2] == pytest.approx(1.3)  # what was asked for stays


def test_load_is_picked_up_and_put_down(carried: Arrays) -> None:
    later, always, never = (carried[name]["pitch"][:, 0] for name in ("later", "rucksack", "free"))
    assert (later[:119] == never[:119]).all()
    np.testing.assert_allclose(later[240:299], always[-1], atol=2e-3)
    np.testing.assert_allclose(later[-1], 0.0, atol=2e-3)
    assert np.abs(np.diff(later)).max() < np.radians(2)  # nobody is thrown about


def test_load_makes_slower_to_push() -> None:
    """An impulse turns into velocity by the mass that is there (with the controller's own b): m and m + 20 kg."""
    push = [{"at_s": 0.5, "impulse_n_s": [60.0, 0.0, 0.0]}]
    herds = beside(herd("free", "human", 1, 0.0), herd("laden", "human", 1, 0.0, load={"mass_kg": 20.0}))
    arrays = run(scenario(herds, events=push), 0.6)
    gained = [float(arrays[name]["velocity"][30, 0, 0]) for name in ("free", "laden")]
    # within the frame the controller takes exp(-z) off an impulse spread over it
    expected = []
    for mass in (70.0, 90.0):
        z = 250.0 / (mass + 70.0) / 60.0
        expected.append(60.0 / (mass + 70.0) * (1.0 - np.exp(-z)) / z)
    np.testing.assert_allclose(gained, expected, rtol=1e-3)


def test_gradient_by_mass_and_place_of_a_load() -> None:
    """Forward mode against differences: lean and speed after 40 frames in water, with everything on."""
    responses = {"transitions": {}, "reaction_s": 0.3, "arms": {}}
    model = scenario([herd("p", "human", 1, load=RUCKSACK, responses=responses)], 1.1)
    layout, assets, params, states = build(scene.load(model), tile=2, walls=False)

    def ends(factor: jax.Array) -> jax.Array:
        one = params.characters[0]
        load = one.responses.load
        assert load is not None
        load = dataclasses.replace(load, mass=load.mass * factor[0], ahead=load.ahead * factor[1])
        one = dataclasses.replace(one, responses=dataclasses.replace(one.responses, load=load))
        changed = dataclasses.replace(params, characters=(one,))

        def frame(states: Any, _: Any) -> Any:
            return advance.one_frame(layout, assets, changed, states)[0], None

        at = jax.lax.scan(frame, states, None, length=40)[0][0]
        return jnp.stack([at.pitch.sum(), at.velocity[0, 1].sum()])

    @functools.partial(jax.jit, compiler_options=options(one_function=False))  # compiles sooner
    def slopes(at: jax.Array) -> tuple[jax.Array, jax.Array]:
        each = jnp.eye(2)
        forward = jax.lax.map(lambda t: jax.jvp(ends, (at,), (t,))[1], each)
        there = jax.lax.map(ends, jnp.concatenate([at + 0.02 * each, at - 0.02 * each]))
        return forward, (there[:2] - there[2:]) / 0.04

    forward, numeric = (np.asarray(x) for x in slopes(jnp.ones(2)))
    assert np.abs(numeric[:, 0]).min() > 0.05 and abs(numeric[0, 1]) > 0.02
    np.testing.assert_allclose(forward, numeric, rtol=0.1, atol=0.01)
