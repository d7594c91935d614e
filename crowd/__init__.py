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
    from crowd.footfalls import foot_events
    from crowd.live import Stepper, stepper
    from crowd.rollouts import Rollout, rollout
    from crowd.scene import Scene, load
    from crowd.simulate import Result, simulate

__version__ = "0.1.0"
__all__ = [
    "InputError",
    "Result",
    "Rollout",
    "Scene",
    "Stepper",
    "__version__",
    "foot_events",
    "load",
    "rollout",
    "simulate",
    "stepper",
]

# What brings JAX, which `import crowd` need not wait for: name -> module.
_LAZY = {
    "load": "crowd.scene",
    "Scene": "crowd.scene",
    "simulate": "crowd.simulate",
    "Result": "crowd.simulate",
    "rollout": "crowd.rollouts",
    "Rollout": "crowd.rollouts",
    "foot_events": "crowd.footfalls",
    "stepper": "crowd.live",
    "Stepper": "crowd.live",
}


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module 'crowd' has no attribute '{name}'")
    module = import_module(_LAZY[name])
    # The submodule takes the name `crowd.simulate` once imported; it can be called like its function.
    return module if name == "simulate" else getattr(module, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY})
