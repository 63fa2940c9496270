"""Loads, stores and sums over eight doubles at a time, for the kernel's own linear algebra.

Addresses are plain integers and indices count doubles, so that nothing is
reference-counted, bounds-checked or wrapped; the one who calls is trusted.
Every row of stage memory goes through the same operations in the same order,
which is what keeps mirrored bodies mirrored.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import signature

from integrators.kernel.simd.lanes import ALIGNMENT, DOUBLE, Lanes, intrinsic, llvm_call, splat, vector

WIDTH = 8
INTEGER = ir.IntType(64)
EIGHT = Lanes(WIDTH)

address = types.int64


def _at(builder: Any, base: Any, index: Any, kind: Any) -> Any:
    pointer = builder.inttoptr(base, DOUBLE.as_pointer())
    return builder.bitcast(builder.gep(pointer, [index]), kind.as_pointer())


def _loader(kind: Any, result: Any, align: int | None = None) -> Any:
    @intrinsic
    def load(typing, base, index):
        def generate(context, builder, sig, args):
            return builder.load(_at(builder, args[0], args[1], kind), align=align)

        return signature(result, address, types.int64), generate

    return load


def _storer(kind: Any, value: Any, align: int | None = None) -> Any:
    @intrinsic
    def store(typing, base, index, item):
        def generate(context, builder, sig, args):
            builder.store(args[2], _at(builder, args[0], args[1], kind), align=align)
            return context.get_dummy_value()

        return signature(types.void, address, types.int64, value), generate

    return store


get_int = _loader(INTEGER, types.int64)
get_float = _loader(DOUBLE, types.float64)
get = _loader(vector(WIDTH), EIGHT, ALIGNMENT)
put_int = _storer(INTEGER, types.int64)
put_float = _storer(DOUBLE, types.float64)
put = _storer(vector(WIDTH), EIGHT, ALIGNMENT)


@intrinsic
def spread(typing, base, index):
    """Return one double of memory in all eight lanes."""

    def generate(context, builder, sig, args):
        return splat(builder, builder.load(_at(builder, args[0], args[1], DOUBLE)), WIDTH)

    return signature(EIGHT, address, types.int64), generate


@intrinsic
def splat8(typing, value):
    """Return a double in all eight lanes."""

    def generate(context, builder, sig, args):
        return splat(builder, args[0], WIDTH)

    return signature(EIGHT, types.float64), generate


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
            values.append(builder.load(_at(builder, args[0], offset, vector(WIDTH)), align=ALIGNMENT))
        return context.make_tuple(builder, result, values)

    return signature(result, address, types.int64, count), generate


@intrinsic
def combine(typing, vectors, base, index, start):
    """Return ``start + sum_j vectors[j] * memory[index + j]``: one fused multiply-add per vector.

    The products run in two chains (four from sixteen vectors on), which hides
    the latency of the multiply-add; the chains are added pairwise.
    """
    count = vectors.count

    def generate(context, builder, sig, args):
        return _combined(builder, args[0], args[1], args[2], count, args[3])

    return signature(EIGHT, vectors, address, types.int64, EIGHT), generate


@intrinsic
def combine_only(typing, vectors, base, index):
    """Return ``sum_j vectors[j] * memory[index + j]``, as `combine` but from nothing."""
    count = vectors.count

    def generate(context, builder, sig, args):
        return _combined(builder, args[0], args[1], args[2], count, None)

    return signature(EIGHT, vectors, address, types.int64), generate


def _combined(builder: Any, vectors: Any, base: Any, index: Any, count: int, start: Any) -> Any:
    chains = Chains(builder, count, start)
    for j in range(count):
        offset = builder.add(index, ir.Constant(INTEGER, j))
        factor = splat(builder, builder.load(_at(builder, base, offset, DOUBLE)), WIDTH)
        chains.add(builder.extract_value(vectors, j), factor)
    return chains.total()


class Chains:
    """A sum of ``count`` products in two chains, four from sixteen on, as `combine` forms it.

    Parameters
    ----------
    builder : llvmlite.ir.IRBuilder
        Where to emit.
    count : int
        Products.
    start : llvmlite.ir.Value or None
        What they are added to, if anything.
    """

    def __init__(self, builder: Any, count: int, start: Any):
        self._builder = builder
        self._chains: list[Any] = [start] + [None] * (3 if count >= 16 else 1)
        self._next = 0

    def add(self, column: Any, factor: Any) -> None:
        """Add the next product."""
        chain = self._chains[self._next]
        self._chains[self._next] = (
            self._builder.fmul(column, factor)
            if chain is None
            else llvm_call(self._builder, "fma", column, factor, chain)
        )
        self._next = (self._next + 1) % len(self._chains)

    def total(self) -> Any:
        """Return the sum, the chains added pairwise."""
        sums = self._chains
        while len(sums) > 1:
            sums = [self._builder.fadd(x, y) for x, y in zip(sums[::2], sums[1::2], strict=True)]
        return sums[0]


def _indices(*lanes: int) -> Any:
    return ir.Constant(ir.VectorType(ir.IntType(32), len(lanes)), list(lanes))


@intrinsic
def sums(typing, v0, v1, v2, v3, v4, v5, v6, v7):
    """Return the sums over the lanes of eight vectors, as one vector.

    Each sum is ``((0+4)+(2+6))+((1+5)+(3+7))`` of its lanes, the same for all
    eight: the transposition is done by adding halves, seven additions in all.
    """

    def generate(context, builder, sig, args):
        def fold(x: Any, y: Any, low: Any, high: Any) -> Any:
            return builder.fadd(builder.shuffle_vector(x, y, low), builder.shuffle_vector(x, y, high))

        halves = [
            fold(
                args[i], args[i + 4], _indices(0, 1, 2, 3, 8, 9, 10, 11), _indices(4, 5, 6, 7, 12, 13, 14, 15)
            )
            for i in range(4)
        ]
        quarters = [
            fold(
                halves[i],
                halves[i + 2],
                _indices(0, 1, 8, 9, 4, 5, 12, 13),
                _indices(2, 3, 10, 11, 6, 7, 14, 15),
            )
            for i in range(2)
        ]
        return fold(
            quarters[0], quarters[1], _indices(0, 8, 2, 10, 4, 12, 6, 14), _indices(1, 9, 3, 11, 5, 13, 7, 15)
        )

    return signature(EIGHT, *[EIGHT] * 8), generate


@intrinsic
def swap(typing, x):
    """Exchange the lower and the upper four lanes."""

    def generate(context, builder, sig, args):
        return builder.shuffle_vector(args[0], args[0], _indices(4, 5, 6, 7, 0, 1, 2, 3))

    return signature(EIGHT, EIGHT), generate


def _half(first: int) -> Any:
    @intrinsic
    def put_half(typing, base, index, item):
        def generate(context, builder, sig, args):
            part = builder.shuffle_vector(args[2], args[2], _indices(*range(first, first + 4)))
            builder.store(part, _at(builder, args[0], args[1], part.type), align=32)
            return context.get_dummy_value()

        return signature(types.void, address, types.int64, EIGHT), generate

    return put_half


put_lower = _half(0)
put_upper = _half(4)


@intrinsic
def upper(typing, x):
    """Keep the upper four lanes and set the lower ones to zero."""

    def generate(context, builder, sig, args):
        zero = ir.Constant(vector(WIDTH), [0.0] * WIDTH)
        return builder.shuffle_vector(zero, args[0], _indices(0, 1, 2, 3, 12, 13, 14, 15))

    return signature(EIGHT, EIGHT), generate


def larger_of(builder: Any, x: Any, y: Any) -> Any:
    """Return the larger of non-negative numbers by their bits: a NaN is larger than all and so is kept."""
    kind = ir.VectorType(INTEGER, WIDTH)
    bits = [builder.bitcast(value, kind) for value in (x, y)]
    return builder.bitcast(llvm_call(builder, "umax", *bits), x.type)


@intrinsic
def larger(typing, x, y):
    """Lane by lane the larger of two vectors that are not negative; NaN where either is."""

    def generate(context, builder, sig, args):
        return larger_of(builder, *args)

    return signature(EIGHT, EIGHT, EIGHT), generate


def _reduced(builder: Any, pick: Any, value: Any) -> Any:
    for step in (4, 2, 1):
        other = builder.shuffle_vector(value, value, _indices(*[(i + step) % WIDTH for i in range(WIDTH)]))
        value = pick(builder, value, other)
    return builder.extract_element(value, ir.Constant(ir.IntType(32), 0))


def largest_of(builder: Any, value: Any) -> Any:
    """Return the largest lane of a vector that is not negative; NaN if any lane is."""
    return _reduced(builder, larger_of, value)


def _reduce(pick: Any) -> Any:
    @intrinsic
    def reduce(typing, x):
        def generate(context, builder, sig, args):
            return _reduced(builder, pick, args[0])

        return signature(types.float64, EIGHT), generate

    return reduce


largest = _reduce(larger_of)
total = _reduce(lambda builder, x, y: builder.fadd(x, y))


@intrinsic
def call_sweeps(typing, function, ctx, count, tested):
    """Call the fused sweeps at address ``function``; see `integrators.kernel.step.fused`."""

    def generate(context, builder, sig, args):
        kind = ir.FunctionType(ir.VoidType(), [INTEGER] * 3)
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), list(args[1:]))
        return context.get_dummy_value()

    return signature(types.void, address, address, types.int64, types.int64), generate


@intrinsic
def call_field(typing, field, t, y, par, out):
    """Call the vector field at address ``field`` on one block of stages."""

    def generate(context, builder, sig, args):
        kind = ir.FunctionType(ir.VoidType(), [INTEGER] * 4)
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), list(args[1:]))
        return context.get_dummy_value()

    return signature(types.void, *[address] * 5), generate
