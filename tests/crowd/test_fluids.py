"""Fluid that is layered, in waves, flowing or turbulent, and the weight on the feet: short runs end to end."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from crowd import advance, fluid_build, scene
from crowd.build import build
from crowd.compiler_options import options
from crowd.errors import InputError
from crowd.scenario_fluid import Spectrum
from crowd.scenario_world import FluidRegion
from crowd.wave_components import mean_depth, trains
from tests.crowd.scenes import herd, run, scenario

WAVE = {"amplitude_m": 0.15, "wavelength_m": 5.0, "toward_deg": 0}
FLAT = np.zeros((1, 2))


def water(surface: float = 0.9, **more: Any) -> dict[str, Any]:
    return {"fluid": "water", "surface_m": surface, **more}


def wading(*regions: dict[str, Any], count: int = 1, speed: float = 1.2, **more: Any) -> dict[str, Any]:
    """People in fluid regions."""
    model = scenario([herd("p", "human", count, speed, **more.pop("herd", {}))], **more)
    model["world"]["fluids"] = list(regions)
    return model


def even(x: Any, z: Any) -> Any:
    return 0.0 * np.asarray(x)


# --- components on the host ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("peakedness", [1.0, 3.3])
def test_spectrum_has_the_height_and_period_asked_for(peakedness: float) -> None:
    sea = Spectrum(height_m=1.2, period_s=6.0, components=256, peakedness=peakedness, toward_deg=30.0, spread_deg=15.0)
    region = FluidRegion(fluid="water", surface_m=20.0, spectrum=sea)
    found = trains(region, even, FLAT, 4)
    assert found is not None
    np.testing.assert_allclose(4 * np.sqrt((found.amplitude**2).sum() / 2), 1.2, rtol=1e-9)
    times = np.linspace(0, 3600, 20_000)
    level = np.array([found.rise(np.array(3.0), np.array(5.0), t) for t in times])
    np.testing.assert_allclose(4 * level.std(), 1.2, rtol=0.05)
    density = np.histogram(found.frequency, np.linspace(0.5, 2.5, 41))[0]
    peak = np.linspace(0.525, 2.475, 40)[density.argmax()]
    np.testing.assert_allclose(peak, 2 * np.pi / 6.0, rtol=0.12)
    toward = np.degrees(np.arctan2(*found.number))
    np.testing.assert_allclose(toward.mean(), 30.0, atol=4)
    np.testing.assert_allclose(toward.std(), 15.0, rtol=0.2)
    again = trains(region, even, FLAT, 4)
    assert again is not None and (again.phase == found.phase).all()


def test_waves_are_carried_by_the_current() -> None:
    model = FluidRegion.model_validate(water(flow_m_s=(0.0, 0.0, 0.7), waves=[WAVE]))
    found = trains(model, even, FLAT, 0)
    assert found is not None
    assert found.depth == pytest.approx(0.9)
    k = 2 * np.pi / 5.0
    np.testing.assert_allclose(found.frequency, np.sqrt(9.81 * k * np.tanh(k * 0.9)))
    np.testing.assert_allclose(found.apparent, found.frequency + 0.7 * k)


def test_depth_of_a_region_is_its_mean_where_it_is_wet() -> None:
    region = FluidRegion.model_validate(water(0.0, area_m={"x": [0, 1], "z": [-4, 4]}))
    assert mean_depth(region, lambda x, z: -0.5 * np.maximum(z, 0.0), FLAT) == pytest.approx(1.0, rel=0.1)


def test_a_surface_under_the_ground_is_refused() -> None:
    with pytest.raises(
        InputError, match=r"world.fluids\[0\].surface_m: -0.5: below the ground, which is nowhere under 0"
    ):
        scene.load(wading(water(-0.5)))


# --- runs ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mesh", ["skinned", "rigid"])
def test_waves_are_where_linear_theory_says(mesh: str) -> None:
    """The depth that is recorded follows the crest that passes; drag swings with the water's velocity."""
    model = wading(water(waves=[WAVE]), speed=0.0, drag={"mesh": mesh})
    arrays = run(model, 6.0)["p"]
    found = scene.load(model).trains()[0]
    assert found is not None
    time = (1 + np.arange(len(arrays["depth"]))) / 60
    x, _, z = np.concatenate([arrays["position"][:1], arrays["position"][:-1]])[:, 0].T
    expected = 0.9 + np.array([found.rise(a, b, t) for a, b, t in zip(x, z, time, strict=True)])
    np.testing.assert_allclose(arrays["depth"][1:, 0], expected[1:], atol=2e-4)
    force = arrays["drag_force"][30:, 0, 2]
    # crests push along the waves, troughs pull back
    assert np.corrcoef(force, expected[30:])[0, 1] > 0.8
    assert force.max() > 30 and force.min() < -10
    assert not arrays["fault"].any()


def test_still_waves_are_still_water() -> None:
    """Waves of hardly any height change nothing that can be felt."""
    plain = run(wading(water()), 2.0)["p"]
    tiny = run(wading(water(waves=[{**WAVE, "amplitude_m": 1e-6}])), 2.0)["p"]
    np.testing.assert_allclose(tiny["position"], plain["position"], atol=1e-4)


def test_waves_stay_in_their_region() -> None:
    area = {"x": [-1, 1], "z": [-50, 50]}
    other = {"x": [1, 50], "z": [-50, 50]}
    model = wading(water(area_m=other), water(area_m=area, waves=[WAVE]), count=2, speed=0.0)
    arrays = run(model, 2.0)["p"]
    assert np.ptp(arrays["depth"][:, 0]) > 0.1
    assert np.ptp(arrays["depth"][:, 1]) < 1e-5


def test_layers_of_one_fluid_are_that_fluid_and_mud_is_slower() -> None:
    plain = run(wading(water()), 4.0)["p"]
    same = run(wading(water(layers=[{"fluid": "water", "top_m": 0.4}])), 4.0)["p"]
    np.testing.assert_allclose(same["position"], plain["position"], atol=0.03)
    speeds = [
        run(wading(water(layers=[{"fluid": "mud", "top_m": top}])), 4.0)["p"]["velocity"][120:, 0, 2].mean()
        for top in (0.02, 0.3, 0.85)
    ]
    mud = run(wading({"fluid": "mud", "surface_m": 0.9}), 4.0)["p"]["velocity"][120:, 0, 2].mean()
    water_only = plain["velocity"][120:, 0, 2].mean()
    assert water_only > speeds[0] - 0.01 > speeds[1] > speeds[2] > mud - 0.01
    np.testing.assert_allclose([speeds[0], speeds[2]], [water_only, mud], atol=0.04)


def test_a_river_pushes_downstream_and_reversed_it_pushes_back() -> None:
    river = {"speed_m_s": 0.8, "width_m": 8.0, "toward_deg": 90, "through_m": [0, 0]}
    model = wading(water(river=river), speed=0.0)
    there, back = run(model, 3.0)["p"], run(wading(water(river={**river, "toward_deg": -90}), speed=0.0), 3.0)["p"]
    force = there["drag_force"][60:, 0].mean(0), back["drag_force"][60:, 0].mean(0)
    assert force[0][0] > 50
    np.testing.assert_allclose(force[1][0], -force[0][0], rtol=0.1)  # a body is not quite the same from both sides
    assert there["position"][-1, 0, 0] > 0.1
    banks = run(wading(water(river={**river, "through_m": [0, 4.0]}), speed=0.0), 1.0)["p"]
    assert np.abs(banks["drag_force"]).max() < 0.25 * force[0][0]


def test_who_drifts_with_the_flow_feels_nothing() -> None:
    """Hardly any mean drag on who walks as fast as the water, in a constant flow or in a river's middle."""
    flows: list[dict[str, Any]] = [{"flow_m_s": [0, 0, 1.0]}, {"river": {"speed_m_s": 1.0, "width_m": 1e4}}]
    for more in flows:
        arrays = run(wading(water(**more), speed=1.0), 3.0)["p"]
        still = run(wading(water(), speed=1.0), 3.0)["p"]
        # the trunk feels next to nothing (1 N of 13). Legs do: a planted one is pushed on (40 N), a swinging one, up to
        # four times as fast as the body, held back more (90 N), since drag goes with the square
        assert np.abs(arrays["drag_force"][120:, 0, 2].mean()) < 0.25 * np.abs(still["drag_force"][120:, 0, 2].mean())


def test_turbulence_buffets() -> None:
    calm = run(wading(water(), speed=0.0), 3.0)["p"]
    rough = run(wading(water(turbulence={"intensity_m_s": 0.4, "length_m": 2.0}), speed=0.0), 3.0)["p"]
    assert np.abs(calm["drag_force"][60:]).max() < 1.0 < np.std(rough["drag_force"][60:, 0, 0])
    assert not rough["fault"].any()


def test_rain_strikes_each_by_its_own_numbers() -> None:
    """Mean rate and strength as asked for; the first two of five are struck as the only two are."""
    rain = {"at_s": 0.5, "rain": {"rate_hz": 4.0, "impulse_n_s": 20.0, "for_s": 2.0}}

    def pushed(count: int, *before: dict[str, Any]) -> np.ndarray:
        model = scenario([*before, herd("p", "human", count, 0.0)], events=[rain])
        return run(model, 3.0)["p"]["velocity"]

    alone, many = pushed(2), pushed(5, herd("dogs", "dog", 3, 0.0))
    assert (alone == many[:, :2]).all()
    assert (alone[:29] == 0).all() and np.abs(alone[31:150]).max() > 0.05
    assert not (alone[:, 0] == alone[:, 1]).all()


# --- buoyancy --------------------------------------------------------------------------------------------------------

# Share of body weight on the feet of standing people (shared reference numbers, section 1): mean of women and men, at
# the height of the back of the knee, the hip bone, the lower end of the breastbone and its upper end, over stature.
MEASURED = {0.285: 0.874, 0.56: 0.558, 0.70: 0.335, 0.815: 0.110}


def weights(depths: list[float], **more: Any) -> np.ndarray:
    """Weight on the feet of people standing in water of each depth, arms down."""
    regions = [water(depth, area_m={"x": [9.0 * i - 4, 9.0 * i + 4], "z": [-5, 5]}) for i, depth in enumerate(depths)]
    model = wading(*regions, count=len(depths), speed=0.0, herd={"arms_up": False}, **more)
    model["herds"][0]["place"]["points_m"] = [[9.0 * i, 0.0] for i in range(len(depths))]
    model["world"]["buoyancy"] = True
    return run(model, 0.2)["p"]["apparent_weight"][-1]


def test_weight_on_the_feet_against_measured_people() -> None:
    """Within 0.045 of body weight at every level."""
    found = weights([1.7 * level for level in MEASURED], drag={"mesh": "skinned"})
    np.testing.assert_allclose(found, list(MEASURED.values()), atol=0.045)


def test_weight_falls_with_depth_from_all_to_next_to_nothing() -> None:
    depths = [0.0, 0.005, 0.2, 0.6, 1.0, 1.4, 1.8, 3.0]
    found = weights(depths, drag={"mesh": "skinned"})
    assert found[0] == 1.0
    assert (np.diff(found[1:]) < 1e-6).all()
    np.testing.assert_allclose(found[-1], 1 - 1000 / 985, atol=0.03)
    np.testing.assert_allclose(found[-1], found[-2], atol=1e-3)


def test_layers_lift_by_their_own_density() -> None:
    """Fully in mud of 1.84 times the density, 1.84 times the lift; in both, in between."""
    both = []
    for region in (water(3.0), water(3.0, layers=[{"fluid": "mud", "top_m": 0.7}]), {"fluid": "mud", "surface_m": 3.0}):
        model = wading(region, speed=0.0)
        model["world"]["buoyancy"] = True
        both.append(1 - run(model, 0.1)["p"]["apparent_weight"][-1, 0])
    assert both[0] < both[1] < both[2]
    np.testing.assert_allclose(both[2] / both[0], 1.84, rtol=1e-4)


def test_surface_tension_carries_the_small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its share of the weight goes with the square of the size: 1/9 at three times the size; none from 0.1 m on."""

    def share(size: float) -> float:
        variation = {"height": {"kind": "constant", "value": size}}
        lifted = []
        for tension in (0.0, 0.073):
            model = scenario([herd("ants", "hexapod", 1, 0.0, variation=variation)])
            region = water(0.1 * size, surface_tension_n_m=tension)
            model["world"] |= {"fluids": [region], "buoyancy": True}
            lifted.append(1.0 - float(run(model, 0.02)["ants"]["apparent_weight"][0, 0]))
        return lifted[1] - lifted[0]

    assert share(0.2) == 0
    monkeypatch.setattr(fluid_build, "SMALL", 10.0)
    small, large = share(0.1), share(0.3)
    assert small > 1e-3
    np.testing.assert_allclose(small / large, 9.0, rtol=0.05)


# --- the program -----------------------------------------------------------------------------------------------------

EVERYTHING = water(
    waves=[WAVE],
    spectrum={"height_m": 0.1, "period_s": 2.0, "components": 3},
    layers=[{"fluid": "mud", "top_m": 0.2}],
    river={"speed_m_s": 0.4, "width_m": 9.0, "over_depth": "log"},
    turbulence={"intensity_m_s": 0.1, "modes": 4},
)


def program(*regions: dict[str, Any], walls: bool = True, **more: Any) -> Any:
    model = wading(*regions, **more)
    model["world"]["buoyancy"] = any("layers" in region for region in regions)
    return build(scene.load(model), tile=2, walls=walls)


def test_what_is_off_is_not_in_the_program() -> None:
    """Level steady water: nothing of the rest in the layout or the arrays."""
    layout, _, params, _ = program(water())
    assert not layout.fluid.moving and layout.fluid.layers == 0 and not layout.fluid.buoyancy
    more = (params.fluids.trains, params.fluids.layers, params.fluids.rivers, params.fluids.turbulence)
    assert all(part is None for part in (*more, params.fluids.tension, params.events.rain))
    assert all(part is None for part in (params.characters[0].displaced, params.characters[0].number))


@pytest.mark.parametrize("mesh", ["skinned", "rigid"])
def test_everything_at_once_with_and_without_walls(mesh: str) -> None:
    """The same run to rounding."""
    ends = []
    for walls in (True, False):
        layout, assets, params, states = program(EVERYTHING, walls=walls, drag={"mesh": mesh})
        run = jax.jit(lambda a, p, s, layout=layout: advance.rollout(layout, 8, a, p, s, jnp.int32(8)))
        states, shown = run(assets, params, states)
        ends.append((np.asarray(states[0].force), np.asarray(shown[0][1].apparent_weight)))
    assert np.abs(ends[0][0]).max() > 10
    for one, other in zip(*ends, strict=True):
        np.testing.assert_allclose(one, other, rtol=2e-3, atol=0.05)


def test_gradient_through_waves() -> None:
    """Forward mode against differences: of the speed gained in 12 frames, by the height of the waves."""
    layout, assets, params, states = program(EVERYTHING, drag={"mesh": "rigid"})
    trains = params.fluids.trains

    def gained(factor: jax.Array) -> jax.Array:
        waves = trains.waves._replace(amplitude=trains.waves.amplitude * factor)
        fluids = dataclasses.replace(params.fluids, trains=dataclasses.replace(trains, waves=waves))
        changed = dataclasses.replace(params, fluids=fluids)

        def frame(states: Any, _: Any) -> Any:
            return advance.one_frame(layout, assets, changed, states)[0], None

        at, _ = jax.lax.scan(frame, states, None, length=12)
        return at[0].velocity[1].sum() if at[0].velocity.ndim == 2 else at[0].velocity[:, 1].sum()

    @functools.partial(jax.jit, compiler_options=options(one_function=False))  # compiles sooner
    def slopes(factor: jax.Array) -> tuple[jax.Array, jax.Array]:
        forward = jax.jvp(gained, (factor,), (jnp.float32(1.0),))[1]
        return forward, (gained(factor + 0.05) - gained(factor - 0.05)) / 0.1

    forward, numeric = (float(x) for x in slopes(jnp.float32(1.0)))
    assert abs(numeric) > 1e-3
    np.testing.assert_allclose(forward, numeric, rtol=0.1)
