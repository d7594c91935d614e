"""A character's bits depend on nothing but itself: not on the batch, the herds beside it, the chunks or the devices."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from crowd import build, scene, simulate
from crowd.layout import SMALL_TILE, TILE
from tests.crowd.scenes import herd, run, scenario

SECONDS = 1.0
BEACH = {"kind": "ramp", "start_m": 0.2, "end_m": 2.0, "drop_m": 0.7}


GAITS = {"rigid": "footsteps", "skinned": "semi_procedural"}  # each of both once


def beach(herds: list[dict[str, Any]], mesh: str) -> dict[str, Any]:
    record = {"rate_hz": 60, "pose": True}
    return scenario(herds, 0.1, ground=BEACH, drag={"mesh": mesh}, record=record, gait=GAITS[mesh])


def people(count: int) -> dict[str, Any]:
    return herd("people", "human", count, variation={"height": {"kind": "uniform", "min": 0.9, "max": 1.1}})


@pytest.fixture(scope="module", params=["rigid", "skinned"])
def alone(request: pytest.FixtureRequest) -> tuple[str, dict[str, np.ndarray]]:
    """Five people by themselves."""
    return request.param, run(beach([people(5)], request.param), SECONDS)["people"]


def assert_equal(expected: dict[str, np.ndarray], found: dict[str, np.ndarray]) -> None:
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name][:, : values.shape[1]], values, err_msg=name)


def test_the_run_is_alive(alone: tuple[str, dict[str, np.ndarray]]) -> None:
    _, arrays = alone
    assert np.abs(arrays["drag_force"][-1]).max() > 1.0
    assert np.ptp(arrays["joint_rotation"], axis=0).max() > 0.1


def test_batch_size(alone: tuple[str, dict[str, np.ndarray]]) -> None:
    mesh, expected = alone
    assert_equal(expected, run(beach([people(130)], mesh), SECONDS)["people"])


def test_narrow_tiles() -> None:
    """A small herd is stepped in a narrower tile, with the same bits: legs on rubble, wet to the belly."""
    dogs = {"ground": {"kind": "rubble", "amplitude_m": 0.15, "cell_m": 0.4}, "gait": "semi_procedural"}
    few, many = (
        run(scenario([herd("dogs", "dog", count, 1.0)], 0.3, record={"rate_hz": 60, "pose": True}, **dogs), SECONDS)
        for count in (SMALL_TILE, SMALL_TILE + 1)
    )
    assert_equal(few["dogs"], many["dogs"])


def test_herds_beside(alone: tuple[str, dict[str, np.ndarray]]) -> None:
    mesh, expected = alone
    found = run(beach([herd("ants", "hexapod", 3, 0.5), people(5)], mesh), SECONDS)["people"]
    assert_equal(expected, found)


def test_chunks(alone: tuple[str, dict[str, np.ndarray]]) -> None:
    mesh, expected = alone
    assert_equal(expected, run(beach([people(5)], mesh), SECONDS, chunk=7)["people"])


def test_two_devices(alone: tuple[str, dict[str, np.ndarray]]) -> None:
    mesh, expected = alone
    assert len(jax.devices()) >= 2, "tests run with two host devices"
    assert_equal(expected, run(beach([people(130)], mesh), SECONDS, devices=2)["people"])


def test_order() -> None:
    """The same characters in another order, across tiles, keep their bits."""
    loaded = scene.load(beach([people(200)], "rigid") | {"gait": "semi_procedural"})
    layout, assets, params, states = build.build(loaded)
    plain = simulate.simulate(loaded, frames=60, devices=1).herds["people"]
    order = np.random.default_rng(0).permutation(200)
    every = np.concatenate([order, np.arange(200, 2 * TILE)])

    def shuffled(leaf: Any) -> Any:
        flat = np.moveaxis(np.asarray(leaf), 0, -2).reshape(*leaf.shape[1:-1], 2 * TILE)[..., every]
        return jnp.asarray(np.moveaxis(flat.reshape(*leaf.shape[1:-1], 2, TILE), -2, 0))

    mixed_params = dataclasses.replace(params, characters=jax.tree.map(shuffled, params.characters))
    program = (layout, assets, mixed_params, jax.tree.map(shuffled, states))
    mixed = simulate.simulate(loaded, frames=60, devices=1, program=program).herds["people"]
    for name, values in plain.items():
        np.testing.assert_array_equal(mixed[name], values[:, order], err_msg=name)
