"""Arrays on the host, typed as what they become: `build` sends everything to the device at once."""

from __future__ import annotations

from typing import Any

import numpy as np


def f32(values: np.ndarray | float) -> Any:
    """As float32."""
    return np.asarray(values, np.float32)


def i32(values: np.ndarray | list[int]) -> Any:
    """As int32."""
    return np.asarray(values, np.int32)
