"""Views of memory: rows of lanes, and numbers one after another or with gaps.

Views are addresses and nothing else: nothing is reference-counted, bounds-checked or
wrapped; the one who calls is trusted.

``rows[i]``, of `Rows`, is a `Lanes`: what a vector field is called with. ``x[i]``, of
`Numbers`, is one number, and ``x + n`` the view from number n on: the arrays of a
trajectory, the parameters, and one stage at a time where a field cannot run on lanes.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import types

from integrators.kernel.simd.emit import ALIGNMENT, DOUBLE, INTEGER, vector
from integrators.kernel.simd.lanes import (
    Lanes,
    arguments_for,
    intrinsic,
    lower_builtin,
    represent,
    spread_to,
    type_callable,
)
from problems.targets.called import release, room


class Rows(types.Type):
    """Memory of K doubles per row, a row every ``stride`` of them: ``rows[i]`` is a `Lanes(K)`."""

    def __init__(self, count: int, stride: int | None = None):
        self.count, self.stride = count, stride or count
        super().__init__(name=f"Rows({count}, {self.stride})")


class Numbers(types.Type):
    """Memory with a number every ``stride`` words: ``view[i]`` is a double, or an integer."""

    def __init__(self, stride: int = 1, kind: Any = types.float64):
        self.stride, self.dtype = stride, kind
        super().__init__(name=f"Numbers({stride}, {kind})")


ON_STACK = 2**14
"""Bytes of an array that a function keeps on the stack, of which a thread may have half a megabyte."""

BYTES: Any = ir.IntType(8).as_pointer()
DOUBLES = Numbers()
INTEGERS = Numbers(kind=types.int64)


def _item(view: Any) -> Any:
    return DOUBLE if view.dtype == types.float64 else INTEGER


represent(Rows, lambda kind: DOUBLE.as_pointer())
represent(Numbers, lambda kind: _item(kind).as_pointer())


def _aligned(stride: int) -> int:
    return min(ALIGNMENT, 8 * stride)


def element(builder: Any, pointer: Any, index: Any, stride: int, kind: Any) -> Any:
    """Return the address of item ``index`` as a pointer to ``kind``."""
    if stride != 1:
        index = builder.mul(index, ir.Constant(index.type, stride))
    return builder.bitcast(builder.gep(pointer, [index]), kind.as_pointer())


@type_callable(operator.getitem)
def _type_get(context):
    def typed(view, index):
        if not isinstance(index, types.Integer):
            return None
        if isinstance(view, Rows):
            return Lanes(view.count)(view, types.intp)
        return view.dtype(view, types.intp) if isinstance(view, Numbers) else None

    return typed


@type_callable(operator.setitem)
def _type_set(context):
    def typed(view, index, value):
        if not isinstance(index, types.Integer):
            return None
        if isinstance(view, Rows) and isinstance(value, Lanes | types.Number):
            return types.none(view, types.intp, *arguments_for([value]))
        if isinstance(view, Numbers) and isinstance(value, types.Number):
            return types.none(view, types.intp, view.dtype)
        return None

    return typed


@type_callable(operator.add)
def _type_shifted(context):
    def typed(view, count):
        if isinstance(view, Numbers) and isinstance(count, types.Integer):
            return view(view, types.intp)
        return None

    return typed


@lower_builtin(operator.getitem, Rows, types.Integer)
def _get_row(context, builder, sig, args):
    rows = sig.args[0]
    place = element(builder, args[0], args[1], rows.stride, vector(rows.count))
    return builder.load(place, align=_aligned(rows.count))


@lower_builtin(operator.setitem, Rows, types.Integer, Lanes)
@lower_builtin(operator.setitem, Rows, types.Integer, types.Float)
def _set_row(context, builder, sig, args):
    rows = sig.args[0]
    (value,) = spread_to(builder, sig.args[2:], args[2:], rows.count)
    place = element(builder, args[0], args[1], rows.stride, vector(rows.count))
    builder.store(value, place, align=_aligned(rows.count))


@lower_builtin(operator.getitem, Numbers, types.Integer)
def _get_number(context, builder, sig, args):
    view = sig.args[0]
    return builder.load(element(builder, args[0], args[1], view.stride, _item(view)))


@lower_builtin(operator.setitem, Numbers, types.Integer, types.Number)
def _set_number(context, builder, sig, args):
    view = sig.args[0]
    builder.store(args[2], element(builder, args[0], args[1], view.stride, _item(view)))


@lower_builtin(operator.add, Numbers, types.Integer)
def _shifted(context, builder, sig, args):
    view = sig.args[0]
    return element(builder, args[0], args[1], view.stride, _item(view))


@type_callable(room)
def _type_room(context):
    def typed(like, n):
        if not isinstance(n, types.IntegerLiteral):
            return None
        if isinstance(like, Rows):
            return Rows(like.count)(like, n)
        return DOUBLES(like, n) if isinstance(like, Numbers) else None

    return typed


@lower_builtin(room, Rows, types.IntegerLiteral)
@lower_builtin(room, Numbers, types.IntegerLiteral)
def _room(context, builder, sig, args):
    like, n = sig.args
    count = like.count if isinstance(like, Rows) else 1
    size = 8 * count * n.literal_value
    if size > ON_STACK:
        return builder.inttoptr(_allocated(builder, size), DOUBLE.as_pointer())
    kind = vector(count) if count > 1 else DOUBLE
    with builder.goto_entry_block():  # once, also in a loop
        memory = builder.alloca(kind, size=ir.Constant(INTEGER, n.literal_value))
    memory.align = _aligned(count)
    return builder.bitcast(memory, DOUBLE.as_pointer())


def _of_library(builder: Any, name: str, result: Any, argument: Any) -> Any:
    known = builder.module.globals.get(name)
    return known or ir.Function(builder.module, ir.FunctionType(result, [argument]), name)


def _allocated(builder: Any, size: int) -> Any:
    """Return the address of aligned memory, in front of which stands what the C library has returned."""
    room = ir.Constant(INTEGER, size + ALIGNMENT)
    pointer = builder.call(_of_library(builder, "malloc", BYTES, INTEGER), [room])
    first = builder.add(builder.ptrtoint(pointer, INTEGER), ir.Constant(INTEGER, ALIGNMENT))
    address = builder.and_(first, ir.Constant(INTEGER, -ALIGNMENT))
    builder.store(pointer, _before(builder, address))
    return address


def _before(builder: Any, address: Any) -> Any:
    return builder.inttoptr(builder.sub(address, ir.Constant(INTEGER, 8)), BYTES.as_pointer())


@type_callable(release)
def _type_release(context):
    def typed(memory, n):
        is_ours = isinstance(memory, Rows | Numbers) and isinstance(n, types.IntegerLiteral)
        return types.none(memory, n) if is_ours else None

    return typed


@lower_builtin(release, Rows, types.IntegerLiteral)
@lower_builtin(release, Numbers, types.IntegerLiteral)
def _release(context, builder, sig, args):
    memory, n = sig.args
    if 8 * (memory.count if isinstance(memory, Rows) else 1) * n.literal_value > ON_STACK:
        pointer = builder.load(_before(builder, builder.ptrtoint(args[0], INTEGER)))
        builder.call(_of_library(builder, "free", ir.VoidType(), BYTES), [pointer])
    return context.get_dummy_value()


@intrinsic
def rows_on_stack(typing, like, n):
    """Return room for n rows, a number that is a constant once the code is linked; not to be used in a loop.

    It is no ``room`` of another type of n: numba tries types before literals, and would take it for all.
    """

    def generate(context, builder, sig, args):
        memory = builder.alloca(vector(like.count), size=args[1])
        memory.align = _aligned(like.count)
        return builder.bitcast(memory, DOUBLE.as_pointer())

    return Rows(like.count)(like, types.intp), generate


@intrinsic(prefer_literal=True)
def strided(typing, address, stride):
    """Return the doubles at an address (intp) that are ``stride`` (a literal) words apart."""
    if not isinstance(stride, types.IntegerLiteral):
        return None

    def generate(context, builder, sig, args):
        return builder.inttoptr(args[0], DOUBLE.as_pointer())

    return Numbers(stride.literal_value)(types.intp, stride), generate


@intrinsic(prefer_literal=True)
def as_rows(typing, numbers, lanes):
    """Return memory of doubles as rows of ``lanes`` (a literal)."""
    if not isinstance(lanes, types.IntegerLiteral):
        return None
    return Rows(lanes.literal_value)(DOUBLES, lanes), lambda context, builder, sig, args: args[0]


@intrinsic(prefer_literal=True)
def as_parts(typing, numbers, count, lanes):
    """Return memory of rows of ``lanes`` as rows of the first ``count`` of each (literals)."""
    if not (isinstance(count, types.IntegerLiteral) and isinstance(lanes, types.IntegerLiteral)):
        return None
    kind = Rows(count.literal_value, lanes.literal_value)
    return kind(DOUBLES, count, lanes), lambda context, builder, sig, args: args[0]


@intrinsic
def as_numbers(typing, rows):
    """Return memory of rows as doubles."""
    return DOUBLES(rows), lambda context, builder, sig, args: args[0]


def _view(kind: Numbers) -> Any:
    @intrinsic
    def view(typing, address):
        def generate(context, builder, sig, args):
            return builder.inttoptr(args[0], _item(kind).as_pointer())

        return kind(types.intp), generate

    return view


doubles = _view(DOUBLES)
"""``doubles(address)``: the doubles there."""
integers = _view(INTEGERS)
"""``integers(address)``: the integers there."""
