"""Views of memory for vector fields: structure-of-arrays rows of lanes, and strided numbers.

A vector field is called with `Rows`, the view ``y[i] -> Lanes`` of
structure-of-arrays memory, and `Strided`, the view ``par[i] -> float`` that
also serves one stage at a time where a field cannot run on lanes.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, signature
from numba.extending import models, register_model

from integrators.kernel.simd.lanes import (
    ALIGNMENT,
    DOUBLE,
    Lanes,
    arguments_for,
    infer_global,
    intrinsic,
    lower_builtin,
    spread_to,
    vector,
)


class Rows(types.Type):
    """Memory of K doubles per row: ``rows[i]`` is a `Lanes(K)`."""

    def __init__(self, count: int):
        self.count = count
        super().__init__(name=f"Rows({count})")


class Strided(types.Type):
    """Memory with K doubles from one item to the next: ``view[i]`` is a float."""

    def __init__(self, stride: int):
        self.stride = stride
        super().__init__(name=f"Strided({stride})")


@register_model(Rows)
@register_model(Strided)
class _PointerModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any):
        super().__init__(manager, kind, DOUBLE.as_pointer())


def _aligned(stride: int) -> int:
    return min(ALIGNMENT, 8 * stride)


def _element(builder: Any, pointer: Any, index: Any, stride: int, kind: Any) -> Any:
    """Return the address of item ``index`` as a pointer to ``kind``."""
    if stride != 1:
        index = builder.mul(index, ir.Constant(index.type, stride))
    return builder.bitcast(builder.gep(pointer, [index]), kind.as_pointer())


@infer_global(operator.getitem)
class _GetItem(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        view, index = args
        if not isinstance(index, types.Integer):
            return None
        if isinstance(view, Rows):
            return signature(Lanes(view.count), view, types.intp)
        return signature(types.float64, view, types.intp) if isinstance(view, Strided) else None


@infer_global(operator.setitem)
class _SetItem(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        view, index, value = args
        if not isinstance(index, types.Integer):
            return None
        if isinstance(view, Rows) and isinstance(value, Lanes | types.Number):
            return signature(types.none, view, types.intp, *arguments_for([value]))
        if isinstance(view, Strided) and isinstance(value, types.Number):
            return signature(types.none, view, types.intp, types.float64)
        return None


@lower_builtin(operator.getitem, Rows, types.Integer)
def _get_row(context, builder, sig, args):
    count = sig.args[0].count
    return builder.load(_element(builder, args[0], args[1], count, vector(count)), align=_aligned(count))


@lower_builtin(operator.setitem, Rows, types.Integer, Lanes)
@lower_builtin(operator.setitem, Rows, types.Integer, types.Float)
def _set_row(context, builder, sig, args):
    count = sig.args[0].count
    (value,) = spread_to(builder, sig.args[2:], args[2:], count)
    builder.store(value, _element(builder, args[0], args[1], count, vector(count)), align=_aligned(count))


@lower_builtin(operator.getitem, Strided, types.Integer)
def _get_scalar(context, builder, sig, args):
    return builder.load(_element(builder, args[0], args[1], sig.args[0].stride, DOUBLE))


@lower_builtin(operator.setitem, Strided, types.Integer, types.Float)
def _set_scalar(context, builder, sig, args):
    builder.store(args[2], _element(builder, args[0], args[1], sig.args[0].stride, DOUBLE))


def _view(kind: Any) -> Any:
    """Make the conversion of an address (intp) to a view of type ``kind(width)``."""

    @intrinsic(prefer_literal=True)
    def view(typing, address, width):
        if not isinstance(width, types.IntegerLiteral):
            return None

        def generate(context, builder, sig, args):
            return builder.inttoptr(args[0], DOUBLE.as_pointer())

        return signature(kind(width.literal_value), types.intp, width), generate

    return view


rows = _view(Rows)
strided = _view(Strided)
