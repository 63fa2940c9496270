"""A numba value of K doubles: code that looks scalar runs on all stages at once.

``Lanes(K)`` is LLVM's ``<K x double>``. On a machine whose vectors are shorter
LLVM splits it, so K = 8 and K = 16 are correct everywhere and merely fastest
where a vector holds eight doubles. Every operator is one IEEE operation per
lane in the order written: nothing is contracted or reordered, because the
symmetry of a problem may hang on the last bit. The one fused operation,
`fma`, is explicit and meant for the linear algebra, not for vector fields.

A vector field reads and writes them through the views of `integrators.kernel.simd.views`.
"""

import math
import operator
from collections.abc import Callable
from inspect import signature
from itertools import product
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.extending import models, register_model

from integrators.kernel.simd import operations
from integrators.kernel.simd.emit import DOUBLE, INTEGER, llvm_call, splat, vector
from integrators.kernel.simd.operations import fma, two_sum
from problems.targets.called import where

# What numba makes of a decorated function has another signature than the function.
intrinsic = cast(Any, extending.intrinsic)
type_callable = cast(Any, extending.type_callable)
lower_builtin = cast(Any, extending.lower_builtin)


class Lanes(types.Type):
    """K doubles side by side."""

    def __init__(self, count: int):
        self.count = count
        super().__init__(name=f"Lanes({count})")


class Mask(types.Type):
    """In which of K lanes something holds."""

    def __init__(self, count: int):
        self.count = count
        super().__init__(name=f"Mask({count})")


def represent(kinds: Any, by: Callable[[Any], Any]) -> None:
    """Have values of a class of numba types be what ``by`` makes of such a type, a type of LLVM's."""

    class Model(models.PrimitiveModel):
        def __init__(self, manager: Any, kind: Any):
            super().__init__(manager, kind, by(kind))

    register_model(kinds)(Model)


represent(Lanes, lambda kind: vector(kind.count))
represent(Mask, lambda kind: ir.VectorType(ir.IntType(1), kind.count))


# --- values in and out of vectors ---------------------------------------------------------------


def _count(*kinds: Any) -> int | None:
    """Return the number of lanes if all of ``kinds`` are lanes of one width or numbers, and one is lanes."""
    counts = {kind.count for kind in kinds if isinstance(kind, Lanes)}
    rest = [kind for kind in kinds if not isinstance(kind, Lanes)]
    if len(counts) != 1 or not all(isinstance(kind, types.Number) for kind in rest):
        return None
    return counts.pop()


def arguments_for(kinds: Any) -> list[Any]:
    """Lanes stay lanes; every other number is converted to a double before it is spread."""
    return [kind if isinstance(kind, Lanes) else types.float64 for kind in kinds]


def spread_to(builder: Any, kinds: Any, values: Any, count: int) -> list[Any]:
    """Return values of these kinds as lanes: numbers in all of them."""
    return [
        v if isinstance(kind, Lanes) else splat(builder, v, count)
        for kind, v in zip(kinds, values, strict=True)
    ]


def register(function: Any, arity: int, result: Any, emit: Any) -> None:
    """Give ``function`` a meaning on lanes: its typing, and one lowering per mixture with scalars."""

    def resolve(*args: Any) -> Any:
        count = _count(*args)
        return None if count is None else result(count)(*arguments_for(args))

    # numba asks the function that types a call how many arguments it takes.
    typed: Any = (lambda x: resolve(x), lambda x, y: resolve(x, y), lambda x, y, z: resolve(x, y, z))
    type_callable(function)(lambda context: typed[arity - 1])

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        count = _count(*sig.args)
        assert count is not None
        return emit(builder, *spread_to(builder, sig.args, args, count))

    for kinds in product((Lanes, types.Float), repeat=arity):
        if Lanes in kinds:
            lower_builtin(function, *kinds)(lower)


def intrinsic_call(name: str) -> Any:
    """Return what emits LLVM's intrinsic of that name, for `register`."""
    return lambda builder, *values: llvm_call(builder, name, *values)


def _pick(symbol: str) -> Any:
    """Python's ``min``/``max``: the first argument unless the second is strictly smaller/larger."""

    def emit(builder: Any, x: Any, y: Any) -> Any:
        return builder.select(builder.fcmp_ordered(symbol, y, x), y, x)

    return emit


for _operator, _in_place, _name in (
    (operator.add, operator.iadd, "fadd"),
    (operator.sub, operator.isub, "fsub"),
    (operator.mul, operator.imul, "fmul"),
    (operator.truediv, operator.itruediv, "fdiv"),
):
    for _function in (_operator, _in_place):
        register(_function, 2, Lanes, lambda b, x, y, name=_name: getattr(b, name)(x, y))
register(operator.neg, 1, Lanes, lambda b, x: b.fneg(x))
register(operator.pos, 1, Lanes, lambda b, x: x)
register(min, 2, Lanes, _pick("<"))
register(max, 2, Lanes, _pick(">"))
for _function, _name in (
    (math.sqrt, "sqrt"),
    (abs, "fabs"),
    (math.fabs, "fabs"),
):
    register(_function, 1, Lanes, intrinsic_call(_name))


def _sign(builder: Any, x: Any) -> Any:
    zero, one, minus = (ir.Constant(DOUBLE, value) for value in (0.0, 1.0, -1.0))
    if x.type != DOUBLE:
        zero, one, minus = (splat(builder, value, x.type.count) for value in (zero, one, minus))
    below = builder.select(builder.fcmp_ordered("<", x, zero), minus, builder.fadd(x, zero))  # -0.0 to 0.0
    return builder.select(builder.fcmp_ordered(">", x, zero), one, below)


# NumPy's own functions have no meaning on numbers here, where formulas with branches need one.
for _function, _emit in ((np.floor, intrinsic_call("floor")), (np.sign, _sign)):
    register(_function, 1, Lanes, _emit)
    type_callable(_function)(
        lambda context: lambda x: types.float64(types.float64) if x == types.float64 else None
    )
    lower_builtin(_function, types.float64)(
        lambda context, builder, sig, args, emit=_emit: emit(builder, *args)
    )


def _where(builder: Any, condition: Any, a: Any, b: Any) -> Any:
    zero = splat(builder, ir.Constant(DOUBLE, 0.0), condition.type.count)
    return builder.select(builder.fcmp_ordered(">", condition, zero), a, b)


register(where, 3, Lanes, _where)


# --- explicit operations --------------------------------------------------------------------------


@type_callable(fma)
def _type_fma(context):
    def typed(x, y, z):
        count = _count(x, y, z)
        return (types.float64 if count is None else Lanes(count))(*arguments_for([x, y, z]))

    return typed


@lower_builtin(fma, types.VarArg(types.Any))
def _fma(context, builder, sig, args):
    count = _count(*sig.args)
    return llvm_call(builder, "fma", *(args if count is None else spread_to(builder, sig.args, args, count)))


def added(builder: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Write the instructions of `two_sum`."""
    s = builder.fadd(x, y)
    part = builder.fsub(s, x)
    return s, builder.fadd(builder.fsub(x, builder.fsub(s, part)), builder.fsub(y, part))


@type_callable(two_sum)
def _type_two_sum(context):
    def typed(x, y):
        kinds = arguments_for([x, y])
        return types.UniTuple(kinds[0], 2)(*kinds)

    return typed


@lower_builtin(two_sum, types.VarArg(types.Any))
def _two_sum(context, builder, sig, args):
    return context.make_tuple(builder, sig.return_type, added(builder, *args))


# --- operations of `integrators.kernel.simd.operations`, on numbers and on lanes ----------------------


def _on_numbers(operation: Any, kinds: list[Any], result: Any, emit: Any) -> None:
    """Give an operation a meaning on numbers."""

    def typed(*args: Any) -> Any:
        return None if any(isinstance(kind, Lanes | Mask) for kind in args) else result(*kinds)

    typed.__signature__ = signature(operation)  # type: ignore[attr-defined]
    type_callable(operation)(lambda context: typed)
    lower_builtin(operation, *kinds)(lambda context, builder, sig, args: emit(builder, *args))


def _choice(symbol: str) -> Any:
    return lambda b, x, y: b.select(b.fcmp_ordered(symbol, x, y), x, y)


def _log(builder: Any, x: Any) -> Any:
    lanes = isinstance(x.type, ir.VectorType)
    kind = ir.VectorType(INTEGER, x.type.count) if lanes else INTEGER
    # Of a number > 0 either is right. AVX2 has neither for lanes, and takes longer for the one with a sign.
    bits = (builder.uitofp if lanes else builder.sitofp)(builder.bitcast(x, kind), x.type)
    factor, bias = (
        ir.Constant(x.type, [number] * x.type.count if lanes else number) for number in (2.0**-52, 1023.0)
    )
    return builder.fsub(builder.fmul(bits, factor), bias)


_ONE, _TWO = [types.float64], [types.float64] * 2
for _operation, _kinds, _emit in (
    (operations.least, _TWO, _choice("<")),
    (operations.greatest, _TWO, _choice(">")),
    (operations.size, _ONE, intrinsic_call("fabs")),
    (operations.binary_log, _ONE, _log),
):
    _on_numbers(_operation, _kinds, types.float64, _emit)
    register(_operation, len(_kinds), Lanes, _emit)
_on_numbers(operations.where, [types.boolean, *_TWO], types.float64, lambda b, c, x, y: b.select(c, x, y))
_on_numbers(operations.opposite, [types.boolean], types.boolean, lambda b, c: b.not_(c))

for _operator, _symbol in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
):
    register(_operator, 2, Mask, lambda b, x, y, symbol=_symbol: b.fcmp_ordered(symbol, x, y))


@type_callable(operations.where)
def _type_where(context):
    def typed(condition, x, y):
        if not isinstance(condition, Mask) or _count(x, y) not in (None, condition.count):
            return None
        return Lanes(condition.count)(condition, *arguments_for([x, y]))

    return typed


@lower_builtin(operations.where, Mask, types.Any, types.Any)
def _where_mask(context, builder, sig, args):
    return builder.select(args[0], *spread_to(builder, sig.args[1:], args[1:], sig.args[0].count))


@type_callable(operations.opposite)
def _type_opposite(context):
    return lambda condition: condition(condition) if isinstance(condition, Mask) else None


@lower_builtin(operations.opposite, Mask)
def _opposite(context, builder, sig, args):
    return builder.not_(args[0])


for _operator, _name in ((operator.and_, "and_"), (operator.or_, "or_")):
    for _function in (_operator, getattr(operator, f"i{_name}"[:-1])):
        type_callable(_function)(
            lambda context: lambda x, y: x(x, y) if isinstance(x, Mask) and x == y else None
        )
        lower_builtin(_function, Mask, Mask)(
            lambda context, builder, sig, args, name=_name: getattr(builder, name)(*args)
        )


@intrinsic
def everywhere(typing, number, like):
    """Return a number in as many lanes as ``like`` has."""

    def generate(context, builder, sig, args):
        return splat(builder, args[0], sig.return_type.count)

    return like(types.float64, like), generate


@intrinsic
def somewhere(typing, mask):
    """Whether a mask holds in any lane."""

    def generate(context, builder, sig, args):
        bits = builder.bitcast(args[0], ir.IntType(sig.args[0].count))
        return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))

    return types.boolean(mask), generate


@intrinsic
def rarely(typing, condition):
    """Return a condition that rarely holds: what is called then is not inlined."""

    def generate(context, builder, sig, args):
        kind, name = ir.IntType(1), "llvm.expect.i1"
        expect = builder.module.globals.get(name) or ir.Function(
            builder.module, ir.FunctionType(kind, [kind] * 2), name
        )
        return builder.call(expect, [args[0], ir.Constant(kind, 0)])

    return types.boolean(types.boolean), generate
