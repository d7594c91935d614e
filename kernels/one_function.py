"""What XLA's CPU backend can compile to one function.

Otherwise it runs a program kernel by kernel, and starting one costs as much as 128 characters' arithmetic in it. A call
that carries `MARK` is one function with everything it calls, conditionals and loops included. XLA stops the process
where such a call has an operand that it finds no use for, so these calls return their operands, too, and have their
constants inside. It refuses scatters, sorts, matrix products, Fourier transforms and calls of libraries, so a call is
marked only where all it does is among `ALLOWED`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import jax

MARK = "xla_cpu_small_call"

# Names of JAX's operations.
ALLOWED = frozenset((
    "abs", "add", "and", "argmax", "argmin", "broadcast_in_dim", "ceil", "clamp", "concatenate", "cond",
    "convert_element_type", "copy", "custom_jvp_call", "custom_vjp_call", "div", "dynamic_slice",
    "dynamic_update_slice", "eq", "exp", "expm1", "floor", "gather", "ge", "gt", "integer_pow", "iota",
    "is_finite", "jit", "le", "log", "log1p", "lt", "max", "min", "mul", "name", "ne", "neg", "not", "or",
    "pad", "reduce_and", "reduce_max", "reduce_min", "reduce_or", "reduce_sum", "rem", "reshape", "rev",
    "round", "rsqrt", "scan", "select_n", "sign", "slice", "split", "sqrt", "square", "squeeze", "stack",
    "stop_gradient", "sub", "tanh", "transpose", "unstack", "wall", "while", "xor",
))  # fmt: skip


def fits(stage: Any, operands: Any) -> bool:
    """Whether a function of arrays [...] does nothing but what one compiled function can."""
    return _allowed(_program(stage, operands))


def _program(stage: Any, operands: Any) -> Any:
    """What a stage does, as a jaxpr: the wall it came through may have it."""
    if hasattr(stage, "jaxpr"):
        return stage.jaxpr
    return jax.make_jaxpr(stage)(*(jax.ShapeDtypeStruct(x.shape, x.dtype) for x in operands)).jaxpr


def _allowed(jaxpr: Any) -> bool:
    return all(eqn.primitive.name in ALLOWED and all(map(_allowed, _inside(eqn))) for eqn in jaxpr.eqns)


def _inside(eqn: Any) -> Iterator[Any]:
    """What an operation runs: loops, branches, calls, the stage of a wall."""
    if "stage" in eqn.params:
        yield _program(eqn.params["stage"], [v.aval for v in eqn.invars[1:]])
    for value in eqn.params.values():
        for each in value if isinstance(value, (tuple, list)) else (value,):
            if hasattr(each, "eqns") or hasattr(each, "jaxpr"):
                yield getattr(each, "jaxpr", each)
