"""Compiled programs kept between runs, so that only the first run of a scenario waits for the compiler."""

from __future__ import annotations

import os
from pathlib import Path

from crowd.cache_folder import user_cache


def folder() -> Path:
    """`JAX_COMPILATION_CACHE_DIR`, or crowd/jax in the user's cache folder."""
    given = os.environ.get("JAX_COMPILATION_CACHE_DIR")
    if given:
        return Path(given)
    return user_cache("jax")


def enable() -> Path | None:
    """Turns the cache on for this process; None where its folder cannot be written. Call before JAX's first array.

    Also tells XLA what it reads once for the whole process.
    """
    import jax

    from crowd import compiler_options

    compiler_options.prepare()
    path = folder()
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    jax.config.update("jax_compilation_cache_dir", str(path))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.3)
    return path


def size() -> int:
    """Bytes in the cache."""
    path = folder()
    return sum(file.stat().st_size for file in path.rglob("*") if file.is_file()) if path.is_dir() else 0
