"""A function at one state with 36 digits and exponents without bounds: where doubles under- or overflow.

`problems.evaluate.pairs` calculates with pairs of doubles, whose products vanish below 1e-308 and are
lost above 1e308, although the states that they come from are ordinary doubles: an oscillator of amplitude
1e-170 has an energy of 1e-340. This is slow and is asked only there.
"""

import math
import operator
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from problems.derive.function import Function
from problems.evaluate.evaluator import Evaluator, Numbers
from problems.graph.arithmetic import ARITHMETIC
from problems.graph.functions import CALLED

_DIGITS = 36
_WIDE = mpmath.MPContext()  # of its own: the precision of mpmath.mp belongs to the user
_WIDE.dps = _DIGITS


def _guarded(function: Callable[..., Any], arguments: int) -> Callable[..., Any]:
    """Return a function on arrays of numbers; nan where it has no value."""

    def guarded(*args: Any) -> Any:
        try:
            value = function(*args)
        except (ArithmeticError, ValueError):  # a pole, or outside of a function's domain
            return _WIDE.nan
        return _WIDE.nan if isinstance(value, _WIDE.mpc) else _WIDE.mpf(value)  # a root of a negative number

    return np.frompyfunc(guarded, arguments, 1)


_OPERATIONS: dict[str, tuple[Callable[..., Any], int]] = {
    **{name: (getattr(_WIDE, f.mpmath, f.value), f.arity) for name, f in CALLED.items()},
    **{name: (record.value, record.arity) for name, record in ARITHMETIC.items()},
    "pow": (operator.pow, 2),
}


WIDE = Numbers(
    of=np.frompyfunc(_WIDE.mpf, 1, 1),
    operations={name: _guarded(function, n) for name, (function, n) in _OPERATIONS.items()},
    rows=lambda values, n, columns: np.broadcast_to(np.asarray(values, dtype=object), (n, columns)),
    total=lambda terms: np.add.reduce(terms, axis=0),
    stacked=np.stack,
)
"""Numbers of mpmath with 36 digits."""


def evaluate(function: Function, t: float, y: NDArray[np.float64], par: NDArray[np.float64]) -> list[Any]:
    """Return the outputs at one state, numbers of mpmath; nan where one is not defined.

    The arguments may be numbers of mpmath themselves, whose digits are then used.
    """
    t, y, par = (WIDE.of(np.asarray(values, dtype=object).reshape(-1, 1)) for values in (t, y, par))
    return [values[0] for values in Evaluator(WIDE, t, y, par, 1).outputs(function)]


def norm(values: list[Any]) -> Any:
    """Return the 2-norm of numbers."""
    return _WIDE.norm(values)


def quotient(value: Any, size: Any) -> float:
    """Return the nearest double of ``value/size``, of ``value`` where ``size`` is 0."""
    try:
        return float(value / size if size != 0 else value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf
