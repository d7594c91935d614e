"""Pytrees as frozen dataclasses, and static arrays that can be hashed."""

from __future__ import annotations

import dataclasses
import hashlib
from typing import TypeVar, dataclass_transform

import jax
import numpy as np

T = TypeVar("T")


@dataclass_transform(frozen_default=True)
def pytree(cls: type[T]) -> type[T]:
    """A frozen dataclass whose every field is a pytree child. No validation: JAX calls it on every unflatten."""
    frozen = dataclasses.dataclass(frozen=True)(cls)
    names = [field.name for field in dataclasses.fields(frozen)]  # pyright: ignore[reportArgumentType]
    jax.tree_util.register_dataclass(frozen, data_fields=names, meta_fields=[])
    return frozen


class StaticArray:
    """An index table that is part of the program: hashed and compared by content."""

    def __init__(self, values: np.ndarray):
        self.values = np.ascontiguousarray(values)
        self.values.setflags(write=False)
        self._digest = hashlib.sha1(self.values.tobytes() + str((values.shape, values.dtype)).encode()).digest()

    def __hash__(self) -> int:
        return hash(self._digest)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, StaticArray) and self._digest == other._digest
