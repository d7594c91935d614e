"""What this machine offers: versions, devices, caches."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform

import crowd
from crowd import compile_cache
from crowd.analysis import clip_cache
from crowd.scenario import configs_folder

_PACKAGES = (
    "jax", "jaxlib", "numpy", "scipy", "optax", "trimesh", "pydantic", "ruamel.yaml", "zarr", "matplotlib", "xarray",
)  # fmt: skip


def findings() -> list[tuple[str, str]]:
    """(what, value) pairs, in the order to print them."""
    rows = [("crowd", crowd.__version__), ("python", f"{platform.python_version()} ({platform.platform()})")]
    rows += [(name, _version(name)) for name in _PACKAGES]
    rows += [("processor", f"{_cores()} cores usable of {os.cpu_count()}"), ("memory", _memory())]
    rows += _devices()
    cache = compile_cache.folder()
    state = f"{compile_cache.size() / 1e6:.1f} MB" if cache.is_dir() else "made by the first run"
    rows.append(("compile cache", f"{cache} ({state})"))
    rows.append(("motion cache", str(clip_cache.cache_folder() or "off")))
    rows.append(("scenarios", str(configs_folder())))
    return rows


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _memory() -> str:
    try:
        return f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30:.1f} GiB"
    except (ValueError, OSError, AttributeError):
        return "unknown"


def _devices() -> list[tuple[str, str]]:
    try:
        import jax

        devices = jax.devices()
    except Exception as error:  # a broken driver is what this command is there to tell
        return [("devices", f"JAX cannot start: {error}")]
    rows = [("device", f"{device.platform} {device.id}: {device.device_kind}") for device in devices]
    if devices[0].platform == "cpu":
        rows.append(("cpu devices", f"up to {_cores()} with --devices"))
    return rows
