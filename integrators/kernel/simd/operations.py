"""Operations on a number, or on a row of numbers of which each belongs to a trajectory of its own.

A rule that uses these, ``+ - * /``, comparisons, ``&`` and ``|`` and nothing else is written once, as a plain
function without branches, see `integrators.kernel.native.jit.for_both_widths`. In Python its arguments are
rows under construction (`integrators.kernel.simd.values.Value`), and it writes LLVM's instructions. In
compiled code they are numbers, and `integrators.kernel.simd.lanes` says what the operations are.
"""

from typing import Any


def where(condition: Any, x: Any, y: Any) -> Any:
    """Return x where the condition holds, else y."""
    return condition.choose(x, y)


def opposite(condition: Any) -> Any:
    """Return where the condition does not hold."""
    return condition.opposite()


def least(x: Any, y: Any) -> Any:
    """Return the smaller of two; y if one is a NaN."""
    return where(x < y, x, y)


def greatest(x: Any, y: Any) -> Any:
    """Return the larger of two; y if one is a NaN."""
    return where(x > y, x, y)


def size(x: Any) -> Any:
    """Return the absolute value."""
    return x.absolute()


def binary_log(x: Any) -> Any:
    """Return log2(x) of a number x > 0, too small by up to 0.09: its bits read as an integer."""
    return x.bits() * 2.0**-52 - 1023.0


def fma(x: Any, y: Any, z: Any) -> Any:
    """Return ``x * y + z`` rounded once."""
    return x.fma(y, z)


def two_sum(x: Any, y: Any) -> Any:
    """Return s, e with s = fl(x + y) and s + e = x + y (Knuth)."""
    return x.two_sum(y)
