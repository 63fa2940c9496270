"""Numbers of lanes read as integers of 64 bits: exponents, signs, multiples kept in the lowest bits.

``Words(K)`` is LLVM's ``<K x i64>``. Operators take words, or an integer for
all lanes; ``>>`` keeps the sign.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import types

from integrators.kernel.simd.emit import INTEGER, vector
from integrators.kernel.simd.lanes import Lanes, Mask, intrinsic, lower_builtin, represent, type_callable


class Words(types.Type):
    """K integers side by side."""

    def __init__(self, count: int):
        self.count = count
        super().__init__(name=f"Words({count})")


represent(Words, lambda kind: ir.VectorType(INTEGER, kind.count))


@intrinsic
def words(typing, x):
    """Return the bits of lanes."""
    result = Words(x.count)
    return result(x), lambda context, builder, sig, args: builder.bitcast(
        args[0], context.get_value_type(result)
    )


@intrinsic
def lanes(typing, x):
    """Return the numbers that have these bits."""
    return Lanes(x.count)(x), lambda context, builder, sig, args: builder.bitcast(args[0], vector(x.count))


def _register(function: Any, result: Any, emit: Any) -> None:
    def typed(context: Any) -> Any:
        def of(x: Any, y: Any) -> Any:
            if not isinstance(x, Words) or not (y == x or isinstance(y, types.Integer)):
                return None
            return result(x.count)(x, y if y == x else types.int64)

        return of

    type_callable(function)(typed)
    lower_builtin(function, Words, Words)(lambda context, builder, sig, args: emit(builder, *args))

    @lower_builtin(function, Words, types.Integer)
    def with_one(context, builder, sig, args):
        kind = args[0].type
        first = builder.insert_element(ir.Constant(kind, ir.Undefined), args[1], ir.Constant(INTEGER, 0))
        none = ir.Constant(ir.VectorType(ir.IntType(32), kind.count), [0] * kind.count)
        return emit(builder, args[0], builder.shuffle_vector(first, first, none))


for _operator, _name in (
    (operator.add, "add"),
    (operator.sub, "sub"),
    (operator.and_, "and_"),
    (operator.xor, "xor"),
    (operator.lshift, "shl"),
    (operator.rshift, "ashr"),
):
    _register(_operator, Words, lambda b, x, y, name=_name: getattr(b, name)(x, y))
_register(operator.ne, Mask, lambda b, x, y: b.icmp_signed("!=", x, y))
