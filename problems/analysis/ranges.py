"""Ranges of functions over intervals, by interval arithmetic.

See R. E. Moore, R. B. Kearfott and M. J. Cloud, *Introduction to Interval Analysis*, SIAM 2009. A range
contains every value that a function has on an interval, so where it excludes 0 there is no zero. Ends are
not rounded outwards: a zero that rounding decides on may be missed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from problems.evaluate.evaluator import Numbers
from problems.graph.functions import FUNCTIONS
from problems.graph.tables import Table

Array = NDArray[np.float64]

_DECREASING = ("acos", "erfc")


@dataclass(frozen=True)
class Range:
    """Arrays of intervals, and of a number inside each, by which a choice on the interval is made.

    Absolute values, signs, rounded numbers, tables and choices are taken to be on one side all along the
    interval, that of ``middle``: whoever uses them divides intervals where sides change.

    Attributes
    ----------
    low, high, middle : ndarray
        The ends, and the values in the middle of the interval of times, of one shape.
    """

    low: Any
    high: Any
    middle: Any

    __array_ufunc__ = None  # so that an array leaves an operation to this class

    @classmethod
    def of(cls, values: Any) -> "Range":
        """Return intervals of no length."""
        if isinstance(values, Range):
            return values
        values = np.asarray(values, dtype=np.float64)
        return cls(values, values, values)

    def __getitem__(self, place: Any) -> "Range":
        return Range(self.low[place], self.high[place], self.middle[place])

    def __add__(self, other: Any) -> "Range":
        b = Range.of(other)
        return Range(self.low + b.low, self.high + b.high, self.middle + b.middle)

    def __neg__(self) -> "Range":
        return Range(-self.high, -self.low, -self.middle)

    def __sub__(self, other: Any) -> "Range":
        return self + -Range.of(other)

    def __mul__(self, other: Any) -> "Range":
        if other is self:
            return _power(self, 2)
        b = Range.of(other)
        if b.low is b.high:  # a number: most products are by one
            ends = [self.low * b.low, self.high * b.low]
            return Range(np.fmin(*ends), np.fmax(*ends), self.middle * b.middle)
        if self.low is self.high:
            return b * self
        ends = [x * y for x in (self.low, self.high) for y in (b.low, b.high)]
        ends = [np.where(np.isnan(end), 0.0, end) for end in ends]  # 0 times infinity
        low = np.minimum(np.minimum(ends[0], ends[1]), np.minimum(ends[2], ends[3]))
        high = np.maximum(np.maximum(ends[0], ends[1]), np.maximum(ends[2], ends[3]))
        return Range(low, high, self.middle * b.middle)

    def __truediv__(self, other: Any) -> "Range":
        b = Range.of(other)
        if b.low is b.high:
            return self * Range.of(1.0 / b.low)
        pole = (b.low <= 0.0) & (b.high >= 0.0)
        inverse = Range(
            np.where(pole, -np.inf, 1.0 / b.high), np.where(pole, np.inf, 1.0 / b.low), 1.0 / b.middle
        )
        return self * inverse


def _monotonic(name: str) -> Callable[[Range], Range]:
    """Return an elementary function that rises, or falls, all over its domain."""
    first, last = FUNCTIONS[name].domain

    def ranges(x: Range) -> Range:
        function = getattr(np, name, None)
        if function is None:
            import scipy.special  # few problems have it in a condition, and every process would load it

            function = getattr(scipy.special, name)
        low, high, middle = (function(np.clip(end, first, last)) for end in (x.low, x.high, x.middle))
        return Range(high, low, middle) if name in _DECREASING else Range(low, high, middle)

    return ranges


def _size(x: Range) -> Range:
    """Return the absolute value, where x may have both signs."""
    low, high = np.abs(x.low), np.abs(x.high)
    least = np.where((x.low <= 0.0) & (x.high >= 0.0), 0.0, np.minimum(low, high))
    return Range(least, np.maximum(low, high), np.abs(x.middle))


def _power(x: Range, n: int) -> Range:
    if n < 0:
        return Range.of(1.0) / _power(x, -n)
    base = _size(x) if n % 2 == 0 else x
    return Range(base.low**n, base.high**n, x.middle**n)


def _wave(function: Callable[[Any], Any], top: float) -> Callable[[Range], Range]:
    """Return a sine or cosine, whose largest values are at ``top`` and every period from there."""

    def has(x: Range, place: float) -> Any:
        return np.ceil((x.low - place) / (2.0 * np.pi)) <= np.floor((x.high - place) / (2.0 * np.pi))

    def ranges(x: Range) -> Range:
        a, b = function(x.low), function(x.high)
        low = np.where(has(x, top + np.pi), -1.0, np.minimum(a, b))
        high = np.where(has(x, top), 1.0, np.maximum(a, b))
        unknown = ~(np.isfinite(x.low) & np.isfinite(x.high))
        return Range(np.where(unknown, -1.0, low), np.where(unknown, 1.0, high), function(x.middle))

    return ranges


def _tan(x: Range) -> Range:
    whole = np.floor(x.low / np.pi + 0.5) == np.floor(x.high / np.pi + 0.5)
    low, high = np.where(whole, np.tan(x.low), -np.inf), np.where(whole, np.tan(x.high), np.inf)
    return Range(low, high, np.tan(x.middle))


def _cosh(x: Range) -> Range:
    size = _size(x)
    return Range(np.cosh(size.low), np.cosh(size.high), np.cosh(x.middle))


def _atan2(y: Range, x: Range) -> Range:
    corners = [np.atan2(b, a) for b in (y.low, y.high) for a in (x.low, x.high)]
    low, high = np.minimum.reduce(corners), np.maximum.reduce(corners)
    cut = (x.low <= 0.0) & (y.low <= 0.0) & (y.high >= 0.0)
    return Range(np.where(cut, -np.pi, low), np.where(cut, np.pi, high), np.atan2(y.middle, x.middle))


def _chosen(condition: Range, a: Range, b: Range) -> Range:
    above = condition.middle > 0.0
    return Range(*(np.where(above, getattr(a, end), getattr(b, end)) for end in ("low", "high", "middle")))


def _piece(table: Table, x: Range) -> Range:
    place = np.clip(np.searchsorted(table.knots, x.middle, side="right") - 1, 0, len(table.rows) - 1)
    rest = x - np.array(table.knots)[place]
    first, *others = np.array(table.rows).T
    value = Range.of(first[place])
    for coefficient in others:
        value = value * rest + coefficient[place]
    return value


class _Ranges(Numbers):
    """Of the operations of a graph, one on ranges each."""

    def value(self, node: Any, *args: Any) -> Any:
        return _piece(node.data, args[0]) if node.op == "table" else super().value(node, *args)


_OF_ONE_SIDE: dict[str, Callable[..., Range]] = {
    "abs": lambda x: _chosen(x, x, -x),
    "sign": lambda x: Range.of(np.sign(x.middle)),
    "round": lambda x: Range.of(np.rint(x.middle)),
    "floor": lambda x: Range.of(np.floor(x.middle)),
    "where": _chosen,
}
_OTHERS: dict[str, Callable[..., Range]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "pow": _power,
    "sin": _wave(np.sin, np.pi / 2.0),
    "cos": _wave(np.cos, 0.0),
    "tan": _tan,
    "cosh": _cosh,
    "atan2": _atan2,
}


def _joined(parts: list[Range], join: Callable[[list[Any]], Any]) -> Range:
    return Range(*(join([getattr(part, end) for part in parts]) for end in ("low", "high", "middle")))


def _rows(values: Range, n: int, columns: int) -> Range:
    return _joined([values], lambda ends: np.broadcast_to(ends[0], (n, columns)))


RANGES = _Ranges(
    of=Range.of,
    operations={name: _monotonic(name) for name in FUNCTIONS if name not in _OTHERS | _OF_ONE_SIDE}
    | _OTHERS
    | _OF_ONE_SIDE,
    rows=_rows,
    total=lambda terms: _joined([terms], lambda ends: np.sum(ends[0], axis=0)),
    stacked=lambda parts: _joined(parts, lambda ends: np.stack(np.broadcast_arrays(*ends))),
)
"""Ranges; every function of `FUNCTIONS` that has no place of its own here must be monotonic."""
