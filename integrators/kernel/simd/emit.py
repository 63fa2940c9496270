"""LLVM instructions on vectors of doubles, for whoever writes LLVM's text; numba is not needed."""

from typing import Any

from llvmlite import ir

DOUBLE = ir.DoubleType()
INTEGER = ir.IntType(64)
ALIGNMENT = 64
WIDTH = 8


def vector(count: int) -> ir.VectorType:
    """Return LLVM's type of ``count`` doubles."""
    return ir.VectorType(DOUBLE, count)


def indices(*lanes: int) -> Any:
    """Return the lanes that a shuffle takes."""
    return ir.Constant(ir.VectorType(ir.IntType(32), len(lanes)), list(lanes))


def splat(builder: Any, scalar: Any, count: int) -> Any:
    """Return ``scalar`` in every lane."""
    none = ir.Constant(vector(count), ir.Undefined)
    first = builder.insert_element(none, scalar, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, none, indices(*[0] * count))


def llvm_call(builder: Any, name: str, *values: Any) -> Any:
    """Call LLVM's intrinsic of that name on numbers of 64 bits or vectors of them."""
    kind = values[0].type
    count = f"v{kind.count}" if isinstance(kind, ir.VectorType) else ""
    item = kind.element if count else kind
    full = f"llvm.{name}.{count}{'f' if item == DOUBLE else 'i'}64"
    function = builder.module.globals.get(full)
    if function is None:
        function = ir.Function(builder.module, ir.FunctionType(kind, [kind] * len(values)), full)
    return builder.call(function, values)


class Chains:
    """A sum of ``count`` products in two chains, four from sixteen on, which hides the latency of the fma.

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
        self._builder, self._count = builder, count
        self._chains: list[Any] = [start] + [None] * (3 if count >= 16 else 1)

    def in_order(self) -> list[int]:
        """Return the numbers of the products, chain by chain: few sums are in registers then."""
        chains = len(self._chains)
        return [j for chain in range(chains) for j in range(chain, self._count, chains)]

    def add(self, j: int, column: Any, factor: Any) -> None:
        """Add product j."""
        chain = self._chains[j % len(self._chains)]
        self._chains[j % len(self._chains)] = (
            self._builder.fmul(column, factor)
            if chain is None
            else llvm_call(self._builder, "fma", column, factor, chain)
        )

    def total(self) -> Any:
        """Return the sum, the chains added pairwise."""
        sums = self._chains
        while len(sums) > 1:
            sums = [self._builder.fadd(x, y) for x, y in zip(sums[::2], sums[1::2], strict=True)]
        return sums[0]


def larger_of(builder: Any, x: Any, y: Any) -> Any:
    """Return the larger of non-negative numbers by their bits: a NaN is larger than all and so is kept."""
    kind = ir.VectorType(INTEGER, x.type.count)
    bits = [builder.bitcast(value, kind) for value in (x, y)]
    return builder.bitcast(llvm_call(builder, "smax", *bits), x.type)


def reduced(builder: Any, pick: Any, value: Any) -> Any:
    """Return what ``pick`` makes of the eight lanes of a vector, by halves."""
    for step in (4, 2, 1):
        other = builder.shuffle_vector(value, value, indices(*[(i + step) % WIDTH for i in range(WIDTH)]))
        value = pick(builder, value, other)
    return builder.extract_element(value, ir.Constant(ir.IntType(32), 0))
