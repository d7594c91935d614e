"""Free parameters by dotted name: numbers anywhere in `Params`, given to every character separately."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from crowd.errors import Problem, nearest
from crowd.params import Params

# what the step reads per character wherever it reads it: a number may then differ from character to character
ROOTS = ("fluids", "control", "strides", "characters")
OF_FLUIDS = ("base_drag", "offset_force", "density", "drag_override", "offset_override", "surface")


class Free(NamedTuple):
    """A free parameter."""

    name: str
    steps: tuple[str | int, ...]  # attributes and numbers from `Params` to it
    low: float
    high: float
    start: float
    log: bool

    def value(self, place: np.ndarray) -> np.ndarray:
        """Values at places between the bounds: 0 low, 1 high."""
        if self.log:
            return self.low * (self.high / self.low) ** place
        return self.low + (self.high - self.low) * place

    def place(self, value: float) -> float:
        """Inverse of `value`."""
        if self.log:
            return float(np.log(value / self.low) / np.log(self.high / self.low))
        return (value - self.low) / (self.high - self.low)

    def slope(self, place: np.ndarray) -> np.ndarray:
        """d value / d place."""
        return (
            self.value(place) * np.log(self.high / self.low) if self.log else np.full_like(place, self.high - self.low)
        )


def names(params: Params, herds: tuple[str, ...]) -> dict[str, tuple[str | int, ...]]:
    """Every name that may be free, and the way to it. `characters.NAME` is that number of all herds."""
    found: dict[str, tuple[str | int, ...]] = {}
    for path, leaf in jax.tree_util.tree_leaves_with_path(params):
        steps: Any = tuple(getattr(key, "name", getattr(key, "idx", None)) for key in path)
        if steps[0] not in ROOTS or leaf.dtype != np.float32:
            continue
        if steps[0] in ("strides", "characters"):
            if steps[0] == "characters" and leaf.ndim != 2:
                continue
            rest = ".".join(map(str, steps[2:]))
            found[f"{steps[0]}.{herds[steps[1]]}.{rest}"] = steps
            found[f"{steps[0]}.{rest}"] = (steps[0], "*", *steps[2:])
            continue
        name = ".".join(map(str, steps))
        if steps[0] == "fluids" and steps[1] not in OF_FLUIDS:
            continue
        for index in range(leaf.size) if leaf.ndim else (None,):
            found[name if index is None else f"{name}[{index}]"] = steps if index is None else (*steps, index)
    return found


def unknown(name: str, known: Mapping[str, Any], where: str) -> Problem:
    """What to say of a name that is none."""
    return Problem(where, f"no parameter '{name}'{nearest(name, list(known))}; it is one of Params' numbers")


def current(params: Params, steps: tuple[str | int, ...]) -> float:
    """The number as the program has it; of the first character where it differs."""
    here: Any = params
    for step in steps:
        named = isinstance(step, str) and step != "*"
        here = getattr(here, str(step)) if named else here[0 if step == "*" else step]
    return float(np.asarray(here).reshape(-1)[0])


def assign(params: Params, numbers: Mapping[tuple[str | int, ...], float]) -> Params:
    """Params with numbers replaced, the same for all characters; shapes stay."""
    for steps, value in numbers.items():
        params = _assign(params, steps, value)
    return params


def _assign(here: Any, steps: tuple[str | int, ...], value: float) -> Any:
    if not steps:
        return jnp.full_like(here, value)
    step, rest = steps[0], steps[1:]
    if step == "*":
        return tuple(_assign(item, rest, value) for item in here)
    if isinstance(step, str):
        return dataclasses.replace(here, **{step: _assign(getattr(here, step), rest, value)})
    if isinstance(here, tuple):
        return (*here[:step], _assign(here[step], rest, value), *here[step + 1 :])
    return here.at[step].set(value)


def put(params: Params, free: Mapping[tuple[str | int, ...], Array]) -> Params:
    """Params with numbers replaced by arrays [n], one value for each character."""
    for steps, value in free.items():
        params = _put(params, steps, value)
    return params


def _put(here: Any, steps: tuple[str | int, ...], value: Array) -> Any:
    if not steps:
        return jnp.broadcast_to(value, (*here.shape[: here.ndim - 1], value.shape[0])) if here.ndim else value
    step, rest = steps[0], steps[1:]
    if step == "*":
        return tuple(_put(item, rest, value) for item in here)
    if isinstance(step, str):
        return dataclasses.replace(here, **{step: _put(getattr(here, step), rest, value)})
    if isinstance(here, tuple):
        return (*here[:step], _put(here[step], rest, value), *here[step + 1 :])
    wide = here if here.ndim == 2 else jnp.broadcast_to(here[:, None], (here.shape[0], value.shape[0]))
    return wide.at[step].set(value)
