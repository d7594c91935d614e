"""Shared fixtures: where the real rigs are, and no surprises from the machine the tests run on."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import jax
import pytest
from jaxtyping import install_import_hook

import tests.typechecker  # noqa: F401  (the hook below finds it by name)

os.environ.setdefault("CROWD_ANALYSIS_CACHE", "0")  # what is tested is computed
jax.config.update("jax_num_cpu_devices", 2)  # before the first array

REPOSITORY = Path(__file__).resolve().parents[1]
# JAX fills its trees with whatever it carries through a transformation (shapes, shardings), not with arrays only.
TREES = {"assets", "params", "state"}
CHECKED = sorted({path.stem for path in (REPOSITORY / "crowd").iterdir() if path.suffix in (".py", "")} - TREES)

# Shapes and types are checked under pytest only.
install_import_hook(["kernels", *(f"crowd.{name}" for name in CHECKED)], "tests.typechecker.check")

from crowd import compiler_options  # noqa: E402  (checked, too)

compiler_options.prepare()  # programs are those of the commands

MUCH = 3e9  # bytes


def _resident() -> float:
    """Bytes that this process holds; infinity where the system does not say."""
    path = Path("/proc/self/statm")
    return int(path.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") if path.is_file() else float("inf")


@pytest.fixture(scope="module", autouse=True)
def _forget_programs() -> Iterator[None]:
    """Compiled programs go with the module that made them once a process holds MUCH: all together they need 7 GB, and
    compiling ends in an abort. Before that they stay: forgetting costs tracing what later modules share."""
    yield
    if _resident() < MUCH:
        return
    for name in ("crowd.simulate", "crowd.tuning.rollout"):
        module = sys.modules.get(name)
        for held in ("compiled", "_jitted"):
            if module is not None and hasattr(getattr(module, held, None), "cache_clear"):
                getattr(module, held).cache_clear()
        getattr(module, "_programs", {}).clear()
    jax.clear_caches()
    gc.collect()


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real characters, mocap and terrain beside the repository; tests that need it skip without it."""
    folder = REPOSITORY.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("real rigs are not beside this checkout (../shared/data)")
    return folder
