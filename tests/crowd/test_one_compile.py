"""A crowd on several devices is compiled once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import jax
import numpy as np
import pytest
from jax._src import cache_key
from jax.experimental.compilation_cache import compilation_cache

from crowd.one_compile import compiled_once

Arrays = tuple[dict[str, jax.Array], tuple[jax.Array, ...]]
NUMBERS = np.arange(3, dtype=np.float32)


@pytest.fixture
def told(tmp_path: Path) -> Iterator[list[str]]:
    """What JAX says of an empty cache for everything."""
    given = {"jax_compilation_cache_dir": str(tmp_path), "jax_persistent_cache_min_compile_time_secs": 0.0}
    before = {name: getattr(jax.config, name) for name in given}
    events: list[str] = []

    def listen(event: str, **more: str | int) -> None:
        events.append(event.rsplit("/")[-1])

    def use(values: dict[str, object]) -> None:
        for name, value in values.items():
            jax.config.update(name, value)
        compilation_cache.reset_cache()

    use({**given})
    jax.monitoring.register_event_listener(listen)
    yield events
    jax.monitoring.unregister_event_listener(listen)
    use(before)


def arrays_on(device: object) -> Arrays:
    return jax.device_put(({"step": NUMBERS}, (NUMBERS, NUMBERS + 1.0)), device)


def programs() -> list[jax.stages.Compiled]:
    def added(shared: dict[str, jax.Array], states: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
        return tuple(state + shared["step"] for state in states)

    run = jax.jit(added, donate_argnums=(1,))
    return compiled_once([run.lower(*arrays_on(device)) for device in jax.devices()[:2]])


def works(made: list[jax.stages.Compiled]) -> None:
    assert len(made) == 2, "tests run with two host devices"
    for device, program in zip(jax.devices(), made, strict=False):
        shared, states = arrays_on(device)
        out = program(shared, states)
        assert [leaf.devices() for leaf in out] == [{device}] * 2
        assert all(state.is_deleted() for state in states)  # donated there, too
        np.testing.assert_array_equal(out[1], 2.0 * NUMBERS + 1.0)


def test_the_compiler_runs_once(told: list[str]) -> None:
    works(programs())
    assert (told.count("cache_misses"), told.count("cache_hits")) == (1, 1)
    works(programs())  # a later run
    assert (told.count("cache_misses"), told.count("cache_hits")) == (1, 3)


def test_keys_are_those_of_jax_again() -> None:
    before = cache_key._hash_serialized_compile_options
    programs()
    assert cache_key._hash_serialized_compile_options is before


def test_another_jax_compiles_for_each(told: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def own(hash_obj: object, options: object, strip_device_assignment: bool = False) -> None:
        """As `hash_obj.update(...)` of a JAX that does not know the trick."""
        return inner(hash_obj, options, strip_device_assignment=False)

    inner = cache_key._hash_serialized_compile_options
    monkeypatch.setattr(cache_key, "_hash_serialized_compile_options", own)
    works(programs())
    assert told.count("cache_misses") == 2


def test_without_a_cache(told: list[str]) -> None:
    jax.config.update("jax_compilation_cache_dir", None)
    compilation_cache.reset_cache()
    works(programs())
    assert told.count("cache_hits") == 0
