"""Operations on a number, or on a row of numbers of which each belongs to a trajectory of its own.

A rule that uses these, ``+ - * /``, comparisons, ``&`` and ``|`` and nothing else is written once, as a
compiled function without branches, and is compiled for numbers and for lanes.
`integrators.kernel.simd.lanes` says what the operations are.
"""

from typing import Any


def where(condition: Any, x: Any, y: Any) -> Any:
    """Return x where the condition holds, else y."""


def opposite(condition: Any) -> Any:
    """Return where the condition does not hold."""


def least(x: Any, y: Any) -> Any:
    """Return the smaller of two; y if one is a NaN."""


def greatest(x: Any, y: Any) -> Any:
    """Return the larger of two; y if one is a NaN."""


def size(x: Any) -> Any:
    """Return the absolute value."""


def binary_log(x: Any) -> Any:
    """Return log2(x) of a number x > 0, too small by up to 0.09: its bits read as an integer."""


def fma(x: Any, y: Any, z: Any) -> Any:
    """Return ``x * y + z`` rounded once."""


def two_sum(x: Any, y: Any) -> Any:
    """Return s, e with s = fl(x + y) and s + e = x + y (Knuth)."""
