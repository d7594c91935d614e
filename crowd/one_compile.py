"""A program for several devices of one kind: compiled once, then read from the compile cache for each of the others."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Lock

import jax
from jax.stages import Compiled, Lowered

_ONE_AT_A_TIME = Lock()  # two runs would put back each other's keys


def compiled_once(lowered: Sequence[Lowered]) -> list[Compiled]:
    """lowered: the same program with arguments on each device. All are compiled, at once, where there is no cache."""
    with _ONE_AT_A_TIME, _keys_without_devices(), ThreadPoolExecutor(len(lowered)) as pool:
        first = [lowered[0].compile()] if _cached() else []
        return [*first, *pool.map(lambda one: one.compile(), lowered[len(first) :])]


def _cached() -> bool:
    return all(getattr(jax.config, f"jax_{name}") for name in ("enable_compilation_cache", "compilation_cache_dir"))


@contextmanager
def _keys_without_devices() -> Iterator[None]:
    """JAX names programs in the cache after their devices, too, except on GPUs; but XLA loads them on any of a kind."""
    from jax._src import cache_key

    inner = getattr(cache_key, "_hash_serialized_compile_options", None)
    if inner is None:  # another JAX: compiles again for each device, as it would by itself
        yield
        return

    @functools.wraps(inner)
    def hashed(*arguments: object, **keywords: object) -> object:
        return inner(*arguments, **keywords | {"strip_device_assignment": True})

    cache_key._hash_serialized_compile_options = hashed
    try:
        yield
    finally:
        cache_key._hash_serialized_compile_options = inner
