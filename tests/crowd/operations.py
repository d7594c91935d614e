"""Counts elementary operations of a function in its jaxpr: what counts by hand in `benchmarks.roofline` are held
against. It knows nothing of stages but the named scopes of the step.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from math import prod
from typing import Any

import jax
from jax.extend.core import ClosedJaxpr, Jaxpr

# one operation an element; what only moves, compares integers or makes indices is none
ARITHMETIC = {
    "add", "sub", "mul", "div", "neg", "abs", "sign", "max", "min", "sqrt", "floor", "round", "exp", "expm1", "clamp",
    "select_n", "lt", "le", "gt", "ge", "add_any", "square", "integer_pow", "is_finite", "rsqrt",
}  # fmt: skip
SUMS = {"reduce_sum", "reduce_max", "reduce_min", "cumsum", "reduce"}


def operations(function: Callable[..., Any], *arguments: Any) -> Counter[str]:
    """Operations by the innermost named scope ("" outside all) of one call. A product and its sum count as two."""
    total: Counter[str] = Counter()
    closed = jax.make_jaxpr(function)(*arguments)
    _walk(closed.jaxpr, "", 1, total)
    return total


def _walk(jaxpr: Jaxpr, scope: str, times: int, total: Counter[str]) -> None:
    for eqn in jaxpr.eqns:
        own = str(eqn.source_info.name_stack).split("/")[-1] or scope
        name = eqn.primitive.name
        given: list[Any] = [v.aval for v in eqn.invars]
        out: Any = eqn.outvars[0].aval
        floats = bool(given) and jax.numpy.issubdtype(given[-1].dtype, jax.numpy.floating)
        if name in ARITHMETIC and floats:
            total[own] += times * prod(out.shape)
        elif name in SUMS and floats:
            total[own] += times * prod(given[0].shape) * len(eqn.outvars)
        elif name == "dot_general":
            (contracted, _), _ = eqn.params["dimension_numbers"]
            total[own] += times * 2 * prod(given[0].shape[axis] for axis in contracted) * prod(out.shape)
        else:
            inner = times * eqn.params.get("length", 1) if name == "scan" else times
            for value in eqn.params.values():
                if isinstance(value, ClosedJaxpr):
                    _walk(value.jaxpr, own, inner, total)
                elif isinstance(value, Jaxpr):
                    _walk(value, own, inner, total)
