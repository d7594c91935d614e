"""Free numbers by name: found, read, replaced for all and for each character."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from crowd import build, scene
from crowd.params import Params
from crowd.tuning import parameters
from tests.crowd.scenes import herd, scenario


@pytest.fixture(scope="module")
def params() -> Params:
    return build.build(scene.load(scenario([herd("p", "human", 3), herd("d", "dog", 2)], 0.5)), 1, tile=4)[2]


@pytest.fixture(scope="module")
def known(params: Params) -> dict[str, tuple[str | int, ...]]:
    return parameters.names(params, ("p", "d"))


def test_names(known: dict[str, tuple[str | int, ...]]) -> None:
    for name in ("fluids.base_drag.a", "fluids.density[0]", "control.filter_time", "characters.p.gain_side",
                 "characters.mass"):  # fmt: skip
        assert name in known
    for name in ("fluids.flow", "events.impulse", "characters.offset", "fluids.density"):
        assert name not in known


@pytest.mark.parametrize("name", ["fluids.base_drag.a", "fluids.density[0]", "characters.d.mass", "characters.mass"])
def test_numbers_are_replaced(params: Params, known: dict[str, tuple[str | int, ...]], name: str) -> None:
    steps = known[name]
    changed = parameters.assign(params, {steps: 7.0})
    assert parameters.current(changed, steps) == 7.0
    other = known["control.filter_time"]
    assert parameters.current(changed, other) == parameters.current(params, other)
    if name == "characters.d.mass":
        assert (np.asarray(changed.characters[0].mass) == np.asarray(params.characters[0].mass)).all()


def test_each_character_has_its_own(params: Params, known: dict[str, tuple[str | int, ...]]) -> None:
    values = jnp.arange(4.0)
    names = ("fluids.base_drag.a", "fluids.density[0]", "control.filter_time")
    changed = parameters.put(params, {known[name]: values for name in names})
    np.testing.assert_array_equal(changed.fluids.base_drag.a, values)
    np.testing.assert_array_equal(changed.fluids.density, values[None])
    np.testing.assert_array_equal(changed.control.filter_time, values)


@pytest.mark.parametrize("log", [False, True])
def test_places(log: bool) -> None:
    free = parameters.Free("x", ("x",), 2.0, 50.0, 5.0, log)
    place = np.linspace(0, 1, 7)
    value = free.value(place)
    np.testing.assert_allclose([value[0], value[-1]], [2.0, 50.0])
    np.testing.assert_allclose([free.place(v) for v in value], place, atol=1e-12)
    step = 1e-6
    np.testing.assert_allclose(
        free.slope(place), (free.value(place + step) - free.value(place - step)) / 2 / step, 1e-6
    )


def test_unknown_names_say_the_nearest(known: dict[str, tuple[str | int, ...]]) -> None:
    assert "did you mean 'characters.gain_forward'" in str(
        parameters.unknown("characters.gain_foward", known, "t.yaml:3")
    )
