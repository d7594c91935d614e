"""Walls between stages: keep XLA's CPU backend from fusing one stage into the next.

On a CPU, XLA fuses a gather, the arithmetic after it and the reduction after that into one loop that recomputes the
gather for every output: 10 to 30 times slower, and the rounding of one character then depends on what stands beside it.
A wall is a call that the compiler is told not to inline. A gate is a wall that leaves the stage out where its flag is
false: a conditional. Both work under scan, map, shard_map, vmap and both modes of differentiation. On a GPU kernels
are better large: no walls.

The rule: *gather | elementwise with one output | reduction* are never in one region.

A derivative of a wall is a wall that gets the arguments of the stage and runs it again. JAX's own conditional would
instead return what its derivative needs, each array an output of its own for which XLA computes the whole stage anew
and copies what it was given: three times the time of a backward pass.
"""

from __future__ import annotations

import functools
import typing
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.experimental.xla_metadata import set_xla_metadata
from jax.extend.core import ClosedJaxpr, Literal, Primitive, Var, jaxpr_as_fun
from jax.interpreters import ad, batching, mlir

from kernels import one_function

Kind = typing.Literal["apart", "gated", "function"]
Flat = Callable[..., Sequence[Any]]  # a stage on arrays instead of trees


@jax.tree_util.register_pytree_node_class
@dataclass(frozen=True)
class Wall:
    """Runs stages apart from whatever surrounds them (True), behind a gate (a flag), or as part of it (None)."""

    flag: Array | typing.Literal[True] | None

    def tree_flatten(self) -> tuple[tuple[Array, ...], typing.Literal[True] | None]:
        """Only the flag of a gate varies."""
        return ((), self.flag) if self.flag is None or self.flag is True else ((self.flag,), None)

    @classmethod
    def tree_unflatten(cls, kind: typing.Literal[True] | None, flags: Sequence[Array]) -> Wall:
        return cls(*flags) if flags else cls(kind)

    def gate(self, flag: Array) -> Wall:
        """Where there are walls, one that also leaves its stages out where `flag` is false: they give zeros."""
        if self.flag is None:
            return self
        return Wall(flag if self.flag is True else self.flag & flag)

    @property
    def _kind(self) -> Kind:
        return "apart" if self.flag is True else "gated"

    def __call__(self, stage: Callable[..., Any], *arguments: Any) -> Any:
        if self.flag is None:
            return stage(*arguments)
        return _stood(self.flag, self._kind, stage, arguments)

    def as_function(self, stage: Callable[..., Any], *arguments: Any) -> Any:
        """A large stage, walls in it included, that XLA compiles to one function instead of a kernel for each loop.

        Where it may be one (see `kernels.one_function`); otherwise, or behind a gate, it is a wall like others.
        """
        return _stood(True, "function", stage, arguments) if self.flag is True else self(stage, *arguments)

    def linear(
        self, stage: Callable[[Any, Any], Any], transpose: Callable[[Any, Any], Any], constants: Any, x: Any
    ) -> Any:
        """stage(constants, x), linear in x, where what JAX makes of its transpose would be slow or is not there.

        transpose(constants, cotangent): the cotangent of x. All are trees of arrays; what a stage needs is among the
        constants. Their derivatives are JAX's own.
        """
        if self.flag is None:
            return stage(constants, x)
        fixed, tree = jax.tree.flatten(constants)
        varied, form = jax.tree.flatten(x)
        count = len(fixed)

        def flat(*given: Any) -> Sequence[Any]:
            return jax.tree.leaves(stage(tree.unflatten(given[:count]), form.unflatten(given[count:])))

        def pulled(*given: Any) -> Sequence[Any]:
            return jax.tree.leaves(transpose(tree.unflatten(given[:count]), out.unflatten(given[count:])))

        closed, shapes = jax.make_jaxpr(stage, return_shape=True)(constants, x)
        out = jax.tree.structure(shapes)
        reach = _reach(closed.jaxpr, _inputs(closed.jaxpr))
        about = dict(shapes=tuple(closed.out_avals), reach=reach, kind=self._kind)
        outs = wall_p.bind(self.flag, *fixed, *varied, stage=flat, back=Back(pulled, count), **about)
        return out.unflatten(outs)


class Back(NamedTuple):
    """How to go back through a stage that is linear in all operands but the first `count`."""

    transpose: Flat  # the first operands, then cotangents of the outputs, to cotangents of the others
    count: int


no_wall = Wall(None)
apart = Wall(True)


def _stood(flag: Any, kind: Kind, stage: Callable[..., Any], arguments: Any) -> Any:
    """Binds the primitive: what a stage neither reads nor makes passes by it."""
    leaves, tree = jax.tree.flatten(arguments)
    closed, shapes = jax.make_jaxpr(lambda *leaves: stage(*tree.unflatten(leaves)), return_shape=True)(*leaves)
    operands = (*closed.consts, *leaves)  # the first: what the stage got from its surroundings, not by argument
    jaxpr, given = closed.jaxpr, dict(zip(_inputs(closed.jaxpr), operands, strict=True))
    # what is handed through is no result of a wall; behind a gate it is, as it becomes zero where that is closed
    own = kind == "gated"
    made = [k for k, v in enumerate(jaxpr.outvars) if own or isinstance(v, Literal) or v not in given]
    ends = [jaxpr.outvars[k] for k in made]
    read = {v for v in (*ends, *(v for eqn in jaxpr.eqns for v in eqn.invars)) if not isinstance(v, Literal)}
    # constants are part of a function: XLA puts them where they are used, and an operand that nothing uses stops it
    known = {v: x for v, x in given.items() if kind == "function" and not isinstance(x, Tracer)}
    used = [v for v in given if v in read and v not in known]

    def flat(*operands: Any) -> Sequence[Any]:
        there = known | dict(zip(used, operands, strict=True))
        consts, arguments = ([there.get(v) for v in each] for each in (jaxpr.constvars, jaxpr.invars))
        outs = jaxpr_as_fun(ClosedJaxpr(jaxpr, consts))(*arguments)
        return [outs[k] for k in made]

    flat.jaxpr = jaxpr

    reach = _reach(jaxpr, used)
    about = dict(shapes=tuple(closed.out_avals[k] for k in made), reach=tuple(reach[k] for k in made))
    outs = wall_p.bind(flag, *(given[v] for v in used), stage=flat, kind=kind, **about)
    found = dict(zip(made, outs, strict=True))
    every = (found[k] if k in found else given[v] for k, v in enumerate(jaxpr.outvars))
    return jax.tree.unflatten(jax.tree.structure(shapes), every)


def _inputs(jaxpr: Any) -> tuple[Var, ...]:
    return (*jaxpr.constvars, *jaxpr.invars)


def _reach(jaxpr: Any, operands: Sequence[Var]) -> tuple[frozenset[int], ...]:
    """For each output, the operands that its derivative may depend on."""
    none: frozenset[int] = frozenset()
    reach = dict.fromkeys(_inputs(jaxpr), none)
    reach |= {v: frozenset([i] if _differs(v.aval) else []) for i, v in enumerate(operands)}
    for eqn in jaxpr.eqns:
        felt = none.union(*(reach[v] for v in eqn.invars if not isinstance(v, Literal)))
        reach.update((v, felt if _differs(v.aval) else none) for v in eqn.outvars)
    return tuple(none if isinstance(v, Literal) else reach[v] for v in jaxpr.outvars)


def _differs(aval: Any) -> bool:
    return jnp.issubdtype(aval.dtype, np.inexact)


# Operands: the flag (of use if gated), then those of `stage`, a function of arrays. shapes: of its outputs. reach: as
# `_reach` says.
# back: of a stage whose transpose is told (see `Wall.linear`).
wall_p = Primitive("wall")
wall_p.multiple_results = True


@wall_p.def_impl
def _run(flag: Any, *operands: Any, stage: Flat, shapes: tuple[Any, ...], kind: Kind, **_: Any) -> list[Any]:
    marked = kind == "function" and one_function.fits(stage, operands)

    def wall(*operands: Any) -> tuple[list[Any], Sequence[Any]]:
        with set_xla_metadata(**dict.fromkeys(("inlineable", one_function.MARK))):  # what a stage calls is part of it
            return list(stage(*operands)), operands if marked else ()

    if kind != "gated":
        with set_xla_metadata(inlineable="false", **({one_function.MARK: "true"} if marked else {})):
            return jax.jit(wall)(*operands)[0]

    def nothing(*_: Any) -> list[Any]:
        return [jnp.zeros(shape.shape, shape.dtype) for shape in shapes]

    return jax.lax.cond(flag, lambda *operands: list(stage(*operands)), nothing, *operands)


mlir.register_lowering(wall_p, mlir.lower_fun(_run, multiple_results=True))


@wall_p.def_abstract_eval
def _shapes(*_: Any, shapes: tuple[Any, ...], **__: Any) -> tuple[Any, ...]:
    return shapes


def _jvp(
    primals: Any, tangents: Any, *, stage: Flat, shapes: Any, reach: Any, kind: Kind, back: Back | None = None
) -> tuple[list[Any], list[Any]]:
    """The stage, and behind another wall its derivative along those tangents that are not zero."""
    flag, *operands = primals
    felt: frozenset[int] = frozenset().union(*reach)
    along = [i for i, tangent in enumerate(tangents[1:]) if i in felt and not isinstance(tangent, ad.Zero)]
    moved = [k for k, own in enumerate(reach) if own.intersection(along)]
    bind = functools.partial(wall_p.bind, flag, kind=kind)
    outs = bind(*operands, stage=stage, shapes=shapes, reach=reach, back=back)
    if back is not None and along and along[0] >= back.count:
        varied = [ad.instantiate_zeros(tangent) for tangent in tangents[1 + back.count :]]
        return outs, bind(*operands[: back.count], *varied, stage=stage, shapes=shapes, reach=reach, back=back)
    changes = [ad.Zero(out.to_tangent_aval()) for out in shapes]
    if moved:
        derivative = functools.partial(_derivative, stage, len(operands), tuple(along), tuple(moved))
        place = {i: len(operands) + j for j, i in enumerate(along)}
        after = tuple(frozenset(reach[k]) | {place[i] for i in reach[k] if i in place} for k in moved)
        given = (*operands, *(tangents[1 + i] for i in along))
        changed = bind(*given, stage=derivative, shapes=tuple(shapes[k] for k in moved), reach=after)
        for k, change in zip(moved, changed, strict=True):
            changes[k] = change
    return outs, changes


def _derivative(stage: Flat, count: int, along: tuple[int, ...], moved: tuple[int, ...], *given: Any) -> list[Any]:
    """Change of the outputs `moved` with the operands `along`; given: all `count` operands, then their tangents."""
    operands, tangents = given[:count], given[count:]

    def part(*varied: Any) -> list[Any]:
        own = dict(zip(along, varied, strict=True))
        outs = stage(*(own.get(i, operand) for i, operand in enumerate(operands)))
        return [outs[k] for k in moved]

    return jax.jvp(part, tuple(operands[i] for i in along), tangents)[1]


def _transpose(
    cotangents: Any,
    flag: Any,
    *operands: Any,
    stage: Flat,
    shapes: Any,
    reach: Any,
    kind: Kind,
    back: Back | None = None,
) -> list[Any]:
    """Cotangents of the operands in which the stage is linear, behind a wall."""
    unknown = [i for i, operand in enumerate(operands) if ad.is_undefined_primal(operand)]
    felt = tuple(k for k, cotangent in enumerate(cotangents) if not isinstance(cotangent, ad.Zero))
    reached: frozenset[int] = frozenset().union(*(reach[k] for k in felt))
    linear = tuple(i for i in unknown if i in reached)
    avals = tuple(operands[i].aval for i in linear)
    known = [operand for i, operand in enumerate(operands) if i not in unknown]
    given = (*known, *(cotangents[k] for k in felt))
    about = dict(shapes=avals, reach=(frozenset(range(len(given))),) * len(linear), kind=kind)
    if back is not None and unknown[0] >= back.count:
        every = [ad.instantiate_zeros(cotangent) for cotangent in cotangents]
        return [None, *_told(flag, operands[: back.count], every, operands[back.count :], back, stage, kind)]
    zeros = {i: ad.Zero(operands[i].aval) for i in unknown}
    if not linear:
        return [None, *(zeros.get(i) for i in range(len(operands)))]
    still = {i: operands[i].aval for i in unknown if i not in linear}
    pull = functools.partial(_pulled, stage, len(operands), linear, still, felt, avals)
    outs = wall_p.bind(flag, *given, stage=pull, **about)
    pulled = zeros | dict(zip(linear, outs, strict=True))
    return [None, *(pulled.get(i) for i in range(len(operands)))]


def _told(flag: Any, fixed: Any, cotangents: Any, varied: Any, back: Back, stage: Flat, kind: Kind) -> Sequence[Any]:
    """Cotangents of all operands, as `back` has them; of those that are known nobody asks."""
    avals = tuple(x.aval if ad.is_undefined_primal(x) else jax.typeof(x) for x in varied)
    about = dict(shapes=avals, reach=(frozenset(range(len(fixed) + len(cotangents))),) * len(avals), kind=kind)
    outs = wall_p.bind(flag, *fixed, *cotangents, stage=back.transpose, back=Back(stage, back.count), **about)
    asked = [out if ad.is_undefined_primal(x) else None for out, x in zip(outs, varied, strict=True)]
    return [*(None for _ in fixed), *asked]


def _pulled(
    stage: Flat,
    count: int,
    linear: tuple[int, ...],
    still: dict[int, Any],
    felt: tuple[int, ...],
    avals: tuple[Any, ...],
    *given: Any,
) -> Sequence[Any]:
    """The transpose of a stage in its operands `linear`; given: the other operands, then cotangents of `felt`.

    still: operands, and their kind, of which the outputs `felt` depend on none.
    """
    known = count - len(linear) - len(still)
    none = {i: jnp.zeros(aval.shape, aval.dtype) for i, aval in still.items()}

    def part(*varied: Any) -> list[Any]:
        own, rest = none | dict(zip(linear, varied, strict=True)), iter(given[:known])
        outs = stage(*(own[i] if i in own else next(rest) for i in range(count)))
        return [outs[k] for k in felt]

    return jax.linear_transpose(part, *avals)(list(given[known:]))


def _batched(
    operands: Any, axes: Any, *, stage: Flat, shapes: Any, reach: Any, kind: Kind, back: Back | None = None
) -> tuple[list[Any], list[int]]:
    size = next(x.shape[axis] for x, axis in zip(operands, axes, strict=True) if axis is not None)
    if back is not None:  # what varies is mapped along its first axis, and so will be its cotangents
        fixed, varied = 1 + back.count, zip(operands[1 + back.count :], axes[1 + back.count :], strict=True)
        operands = (*operands[:fixed], *(batching.bdim_at_front(x, axis, size) for x, axis in varied))
        axes = (*axes[:fixed], *(0 for _ in operands[fixed:]))
        there = (*axes[1:fixed], *(0 for _ in shapes))
        back = back._replace(transpose=jax.vmap(back.transpose, in_axes=there, axis_size=size))
    mapped = jax.vmap(stage, in_axes=tuple(axes[1:]), axis_size=size)
    if axes[0] is not None:  # a wall no longer, as a conditional would be none
        flags = jnp.moveaxis(operands[0], axes[0], 0)
        outs = [jnp.where(flags.reshape(-1, *(1,) * (x.ndim - 1)), x, jnp.zeros_like(x)) for x in mapped(*operands[1:])]
        return outs, [0] * len(shapes)
    wider = tuple(out.update(shape=(size, *out.shape)) for out in shapes)
    about = dict(shapes=wider, reach=reach, kind=kind, back=back)
    return wall_p.bind(*operands, stage=mapped, **about), [0] * len(shapes)


ad.primitive_jvps[wall_p] = _jvp
ad.primitive_transposes[wall_p] = _transpose
batching.primitive_batchers[wall_p] = _batched
