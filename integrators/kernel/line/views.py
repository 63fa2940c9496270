"""A trajectory's arrays by name, calls through addresses, error-free sums: what numba is taught."""

from typing import Any, cast

import numba
from llvmlite import ir
from numba import types
from numba.core.datamodel.models import PrimitiveModel
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, register_model
from numba.np import arrayobj

from integrators.kernel.line.layout import ARRAYS, INTEGERS, SIZES

# No reference counts: machine code that needs nothing of numba once it is compiled.
compiled = cast(Any, numba.njit)(
    error_model="numpy", _nrt=False, no_cpython_wrapper=True, no_cfunc_wrapper=True
)

_word = ir.IntType(64)


class MemoryType(types.Type):
    """The type of a trajectory: the address of its array of integers."""

    def __init__(self) -> None:
        super().__init__(name="LineMemory")


_memory_type = MemoryType()


@register_model(MemoryType)
class MemoryModel(PrimitiveModel):
    """An address."""

    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _word)


@infer_getattr
class MemoryAttributes(AttributeTemplate):
    """The types of sizes and arrays."""

    key = MemoryType

    def generic_resolve(self, typ: Any, attr: str) -> Any:
        if attr in SIZES:
            return types.int64
        if attr in ARRAYS:
            return types.Array(types.int64 if attr in INTEGERS else types.float64, len(ARRAYS[attr]), "C")
        return None


def _load(builder: Any, memory: Any, place: int) -> Any:
    base = builder.inttoptr(memory, _word.as_pointer())
    return builder.load(builder.gep(base, [ir.Constant(_word, place)]))


@lower_getattr_generic(MemoryType)
def _attribute(context: Any, builder: Any, typ: Any, value: Any, attr: str) -> Any:
    if attr in SIZES:
        return _load(builder, value, SIZES.index(attr))
    kind = MemoryAttributes.generic_resolve(MemoryAttributes, typ, attr)  # type: ignore[arg-type]
    place = len(SIZES) + list(ARRAYS).index(attr)
    shape = [_load(builder, value, SIZES.index(size)) for size in ARRAYS[attr]]
    return _view(context, builder, kind, _load(builder, value, place), shape)


def _view(context: Any, builder: Any, kind: Any, address: Any, shape: list[Any]) -> Any:
    made = context.make_array(kind)(context, builder)
    item = ir.Constant(_word, 8)
    strides = [builder.mul(shape[-1], item), item] if kind.ndim == 2 else [item]
    data = builder.inttoptr(address, context.get_data_type(kind.dtype).as_pointer())
    arrayobj.populate_array(made, data, shape, strides, item, meminfo=None)
    return made._getvalue()


def _of_shape(kind: Any) -> Any:
    def typed(typingctx: Any, address: Any, *shape: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return _view(context, builder, kind, arguments[0], list(arguments[1:]))

        return kind(*[types.int64] * (1 + kind.ndim)), codegen

    return typed


def _numbers(typingctx: Any, address: Any, n: Any) -> Any:
    return _of_shape(types.Array(types.float64, 1, "C"))(typingctx, address, n)


def _table(typingctx: Any, address: Any, rows: Any, columns: Any) -> Any:
    return _of_shape(types.Array(types.float64, 2, "C"))(typingctx, address, rows, columns)


def _integers(typingctx: Any, address: Any, n: Any) -> Any:
    return _of_shape(types.Array(types.int64, 1, "C"))(typingctx, address, n)


def _memory(typingctx: Any, address: Any) -> Any:
    return _memory_type(types.int64), lambda context, builder, signature, arguments: arguments[0]


def _address(typingctx: Any, array: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        made = context.make_array(signature.args[0])(context, builder, arguments[0])
        return builder.ptrtoint(made.data, _word)

    return types.int64(array), codegen


def _fma(typingctx: Any, a: Any, b: Any, c: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), codegen


def _call(typingctx: Any, function: Any, t: Any, y: Any, par: Any, out: Any) -> Any:
    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = ir.FunctionType(ir.VoidType(), [_word] * 4)
        builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])
        return context.get_dummy_value()

    return types.void(*[types.int64] * 5), codegen


memory: Any = intrinsic(_memory)
"""``memory(address)``: a trajectory, its sizes and arrays as attributes."""
numbers: Any = intrinsic(_numbers)
"""``numbers(address, n)``: n doubles as an array."""
table: Any = intrinsic(_table)
"""``table(address, rows, columns)``: doubles as a matrix."""
integers: Any = intrinsic(_integers)
"""``integers(address, n)``: n integers as an array."""
address: Any = intrinsic(_address)
"""``address(array)``: where an array's numbers are."""
fma: Any = intrinsic(_fma)
"""``fma(a, b, c)``: a b + c, rounded once."""
call: Any = intrinsic(_call)
"""``call(function, t, y, par, out)``: call a C function of four addresses."""


@compiled
def two_sum(a, b):
    """Return s, e with s = fl(a + b) and s + e = a + b (Knuth)."""
    s = a + b
    part = s - a
    return s, (a - (s - part)) + (b - part)
