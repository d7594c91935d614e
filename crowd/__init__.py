"""Crowds of walking characters wading through fluid, stepped by one jitted JAX program.

scene = crowd.load("configs/wade.yaml")
result = crowd.simulate(scene, seconds=5)
result.herds["people"]["velocity"]  # [time, character, 3] m/s
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from crowd.errors import InputError

if TYPE_CHECKING:
    from crowd.simulate import Result, Scene, load, simulate

__version__ = "0.1.0"
__all__ = ["InputError", "Result", "Scene", "__version__", "load", "simulate"]

_LAZY = {"load", "simulate", "Result", "Scene"}  # these bring JAX, which `import crowd` need not wait for


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        module = import_module("crowd.simulate")
        # The submodule takes the name `crowd.simulate` once imported; it can be called like its function.
        return module if name == "simulate" else getattr(module, name)
    raise AttributeError(f"module 'crowd' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(set(globals()) | _LAZY)
