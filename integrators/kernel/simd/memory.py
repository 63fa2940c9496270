"""Loads, stores and sums over eight doubles at a time, for the kernel's own linear algebra.

Indices count doubles. Every row of stage memory goes through the same operations in the
same order, which is what keeps mirrored bodies mirrored.
"""

from typing import Any

from llvmlite import ir
from numba import types

from integrators.kernel.simd.emit import (
    ALIGNMENT,
    DOUBLE,
    INTEGER,
    WIDTH,
    Chains,
    indices,
    larger_of,
    reduced,
    splat,
    vector,
)
from integrators.kernel.simd.lanes import Lanes, added, intrinsic
from integrators.kernel.simd.views import DOUBLES, element

EIGHT = Lanes(WIDTH)


@intrinsic
def get(typing, base, index):
    """Load eight doubles, from number ``index`` on, a multiple of eight."""

    def generate(context, builder, sig, args):
        return builder.load(element(builder, args[0], args[1], 1, vector(WIDTH)), align=ALIGNMENT)

    return EIGHT(DOUBLES, types.int64), generate


@intrinsic
def put(typing, base, index, item):
    """Store eight doubles, from number ``index`` on."""

    def generate(context, builder, sig, args):
        builder.store(args[2], element(builder, args[0], args[1], 1, vector(WIDTH)), align=ALIGNMENT)
        return context.get_dummy_value()

    return types.void(DOUBLES, types.int64, EIGHT), generate


@intrinsic
def spread(typing, base, index):
    """Return one double of memory in all eight lanes."""

    def generate(context, builder, sig, args):
        return splat(builder, builder.load(element(builder, args[0], args[1], 1, DOUBLE)), WIDTH)

    return EIGHT(DOUBLES, types.int64), generate


@intrinsic
def splat8(typing, value):
    """Return a double in all eight lanes."""

    def generate(context, builder, sig, args):
        return splat(builder, args[0], WIDTH)

    return EIGHT(types.float64), generate


@intrinsic(prefer_literal=True)
def columns(typing, base, index, count):
    """Load ``count`` (a literal) vectors that follow each other in memory."""
    if not isinstance(count, types.IntegerLiteral):
        return None
    result = types.UniTuple(EIGHT, count.literal_value)

    def generate(context, builder, sig, args):
        values = []
        for j in range(count.literal_value):
            offset = builder.add(args[1], ir.Constant(INTEGER, WIDTH * j))
            values.append(builder.load(element(builder, args[0], offset, 1, vector(WIDTH)), align=ALIGNMENT))
        return context.make_tuple(builder, result, values)

    return result(DOUBLES, types.int64, count), generate


@intrinsic
def combine(typing, vectors, base, index, start):
    """Return ``start + sum_j vectors[j] * memory[index + j]``: one fused multiply-add per vector.

    The products run in two chains (four from sixteen vectors on), which hides
    the latency of the multiply-add; the chains are added pairwise.
    """
    count = vectors.count

    def generate(context, builder, sig, args):
        return _combined(builder, args[0], args[1], args[2], count, args[3])

    return EIGHT(vectors, DOUBLES, types.int64, EIGHT), generate


@intrinsic
def combine_only(typing, vectors, base, index):
    """Return ``sum_j vectors[j] * memory[index + j]``, as `combine` but from nothing."""
    count = vectors.count

    def generate(context, builder, sig, args):
        return _combined(builder, args[0], args[1], args[2], count, None)

    return EIGHT(vectors, DOUBLES, types.int64), generate


def _combined(builder: Any, vectors: Any, base: Any, index: Any, count: int, start: Any) -> Any:
    chains = Chains(builder, count, start)
    for j in range(count):
        offset = builder.add(index, ir.Constant(INTEGER, j))
        factor = splat(builder, builder.load(element(builder, base, offset, 1, DOUBLE)), WIDTH)
        chains.add(j, builder.extract_value(vectors, j), factor)
    return chains.total()


@intrinsic(prefer_literal=True)
def combine_rows(typing, table, first, count, base, index, stride, starts):
    """Return what `combine` makes of ``count`` (a literal) columns in memory, for several rows at once.

    Row r has its factors at ``index + stride * r`` and its start in ``starts[r]``. Each column is loaded once
    for all rows, chain by chain, so that few sums are in registers at a time.
    """
    if not isinstance(count, types.IntegerLiteral):
        return None

    def generate(context, builder, sig, args):
        rows = range(starts.count)
        sums = [Chains(builder, count.literal_value, builder.extract_value(args[6], r)) for r in rows]
        places = [builder.add(args[4], builder.mul(args[5], ir.Constant(INTEGER, r))) for r in rows]
        for j in sums[0].in_order():
            offset = builder.add(args[1], ir.Constant(INTEGER, WIDTH * j))
            column = builder.load(element(builder, args[0], offset, 1, vector(WIDTH)), align=ALIGNMENT)
            for r in rows:
                place = builder.add(places[r], ir.Constant(INTEGER, j))
                factor = builder.load(element(builder, args[3], place, 1, DOUBLE))
                sums[r].add(j, column, splat(builder, factor, WIDTH))
        return context.make_tuple(builder, starts, [chains.total() for chains in sums])

    return starts(DOUBLES, types.int64, count, DOUBLES, types.int64, types.int64, starts), generate


FOLDS = [
    (4, indices(0, 1, 2, 3, 8, 9, 10, 11), indices(4, 5, 6, 7, 12, 13, 14, 15)),
    (2, indices(0, 1, 8, 9, 4, 5, 12, 13), indices(2, 3, 10, 11, 6, 7, 14, 15)),
    (1, indices(0, 8, 2, 10, 4, 12, 6, 14), indices(1, 9, 3, 11, 5, 13, 7, 15)),
]
"""How eight vectors become four, two and one, by adding halves: their number, and which lanes of two."""


def _halves(builder: Any, first: Any, second: Any, halves: Any) -> list[Any]:
    return [builder.shuffle_vector(first, second, half) for half in halves]


@intrinsic
def sums(typing, v0, v1, v2, v3, v4, v5, v6, v7):
    """Return the sums over the lanes of eight vectors, as one vector.

    Each sum is ``((0+4)+(2+6))+((1+5)+(3+7))`` of its lanes, the same for all
    eight: the transposition is done by adding halves, seven additions in all.
    """

    def generate(context, builder, sig, args):
        for n, *halves in FOLDS:
            args = [builder.fadd(*_halves(builder, args[i], args[i + n], halves)) for i in range(n)]
        return args[0]

    return EIGHT(*[EIGHT] * 8), generate


@intrinsic
def sums_and_errors(typing, v0, v1, v2, v3, v4, v5, v6, v7):
    """Return `sums` of eight vectors, and what the last two additions of each round away."""

    def generate(context, builder, sig, args):
        first, second, last = FOLDS
        four = [builder.fadd(*_halves(builder, args[i], args[i + 4], first[1:])) for i in range(4)]
        two = [added(builder, *_halves(builder, four[i], four[i + 2], second[1:])) for i in range(2)]
        (high, low), (other, more) = two
        total, error = added(builder, *_halves(builder, high, other, last[1:]))
        less = builder.fadd(*_halves(builder, low, more, last[1:]))
        return context.make_tuple(builder, sig.return_type, [total, builder.fadd(error, less)])

    return types.UniTuple(EIGHT, 2)(*[EIGHT] * 8), generate


@intrinsic
def swap(typing, x):
    """Exchange the lower and the upper four lanes."""

    def generate(context, builder, sig, args):
        return builder.shuffle_vector(args[0], args[0], indices(4, 5, 6, 7, 0, 1, 2, 3))

    return EIGHT(EIGHT), generate


def _half(first: int) -> Any:
    @intrinsic
    def put_half(typing, base, index, item):
        def generate(context, builder, sig, args):
            part = builder.shuffle_vector(args[2], args[2], indices(*range(first, first + 4)))
            builder.store(part, element(builder, args[0], args[1], 1, part.type), align=32)
            return context.get_dummy_value()

        return types.void(DOUBLES, types.int64, EIGHT), generate

    return put_half


put_lower = _half(0)
put_upper = _half(4)


@intrinsic
def larger(typing, x, y):
    """Lane by lane the larger of two vectors that are not negative; NaN where either is."""

    def generate(context, builder, sig, args):
        return larger_of(builder, *args)

    return x(x, x), generate


def _reduce(pick: Any) -> Any:
    @intrinsic
    def reduce(typing, x):
        def generate(context, builder, sig, args):
            return reduced(builder, pick, args[0])

        return types.float64(EIGHT), generate

    return reduce


largest = _reduce(larger_of)
total = _reduce(lambda builder, x, y: builder.fadd(x, y))


def _caller(arguments: int, returns: Any = types.void) -> Any:
    """Make the call of a C function of so many words, at an address."""

    def generate(context, builder, sig, args):
        result = ir.VoidType() if returns == types.void else INTEGER
        kind = ir.FunctionType(result, [value.type for value in args[1:]])
        returned = builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])
        return context.get_dummy_value() if returns == types.void else returned

    def none(typing, function):
        return returns(types.int64), generate

    def two(typing, function, a, b):
        return returns(types.int64, a, b), generate

    def three(typing, function, a, b, c):
        return returns(types.int64, a, b, c), generate

    def four(typing, function, a, b, c, d):
        return returns(types.int64, a, b, c, d), generate

    def six(typing, function, a, b, c, d, e, f):
        return returns(types.int64, a, b, c, d, e, f), generate

    def eleven(typing, function, a, b, c, d, e, f, g, h, i, j, k):
        return returns(types.int64, a, b, c, d, e, f, g, h, i, j, k), generate

    return intrinsic({0: none, 2: two, 3: three, 4: four, 6: six, 11: eleven}[arguments])


call_field = _caller(4)
"""``call_field(field, times, stages, par, values)``: the vector field, on one block of stages."""
call_iterations = _caller(3)
"""``call_iterations(fused, ctx, count, after)``: see `integrators.kernel.step.fused`."""
call_solver = _caller(3, types.int64)
"""``call_solver(solver, ctx, memory, started)``: the implicit solver."""
call_part = _caller(6)
"""``call_part(part, times, stages, par, values, first, last)``: some rows of the field."""
call_nothing = _caller(0)
"""``call_nothing(function)``: a function without arguments."""
call_work = _caller(2, types.int64)
"""``call_work(work, team, helper)``: see `integrators.kernel.step.work`."""
call_line = _caller(2, types.int64)
"""``call_line(line, what, ctx)``: a line integral, see `integrators.kernel.context.Context.line`."""
call_look = _caller(2, types.int64)
"""``call_look(look, ctx, memory)``: the search for events, see `integrators.kernel.inside`."""
call_follow = _caller(3, types.int64)
"""``call_follow(follow, what, ctx, memory)``: vectors along a trajectory, `integrators.kernel.tangent`."""
call_factors = _caller(2, types.int64)
"""``call_factors(factors, what, which)``: whoever keeps the factors of large matrices."""
call_entry = _caller(11, types.int64)
"""``call_entry(entry, operation, ctx, ...)``: see `integrators.kernel.trajectory.entry`."""
call_steps = _caller(2)
"""``call_steps(code, group, count)``: steps of a group of trajectories, see `integrators.kernel.ensemble`."""
