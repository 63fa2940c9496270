"""States with twice the digits of a double: what a user gives, and what does not go together with them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.protocol import Array, MethodBase
from problems.double_double import two_sum
from problems.errors import InputError, shown
from problems.problem import Problem

BITS = 300  # in which the difference of a number and its nearest double is exact enough


def pairs(start: Any, problem: Problem) -> Array:
    """Return a start as pairs, shape (dim, 2): the problem's doubles, and what these leave out.

    Parameters
    ----------
    start : array_like
        Numbers of mpmath, or doubles, (dim,); or pairs of doubles, (dim, 2).
    problem : Problem
        Whose start they are, with more digits.

    Raises
    ------
    problems.errors.InputError
        For anything else, and where the problem does not start at the nearest doubles.
    """
    rows = as_pairs(start, problem.system.dim)
    high = rows[:, 0]
    if (different := np.flatnonzero(high != problem.y0)).size:
        i = int(different[0])
        raise InputError(
            f"start[{i}] rounds to {float(high[i])!r}, but the problem starts at {float(problem.y0[i])!r}; "
            "make the problem with the same numbers."
        )
    return rows


def as_pairs(state: Any, dim: int, *, label: str = "start") -> Array:
    """Return a state as pairs, shape (dim, 2).

    Parameters
    ----------
    state : array_like
        Numbers of mpmath, or doubles, (dim,); or pairs of doubles, (dim, 2).
    dim : int
        How many components it has.
    label : str
        What it is called, for a message.

    Raises
    ------
    problems.errors.InputError
        For anything else.
    """
    try:
        numbers: NDArray[Any] = np.array(state, dtype=object)
        if numbers.shape == (dim, 2):
            high, low = two_sum(*numbers.astype(np.float64).T)
        else:
            high = numbers.astype(np.float64)
            low = np.array([_left_out(x, double) for x, double in zip(numbers, high.tolist(), strict=True)])
    except (TypeError, ValueError, OverflowError):
        high, low = np.empty(0), np.empty(0)
    if high.shape != (dim,) or not np.isfinite(high + low).all():
        raise InputError(
            f"{label} must be {dim} finite numbers, of mpmath or doubles, or {dim} pairs of doubles, "
            f"not {shown(state)}."
        )
    return np.stack([high, low], axis=1)


def _left_out(number: Any, nearest: float) -> float:
    """Return a number minus the nearest double."""
    import mpmath  # for those who need it

    with mpmath.workprec(BITS):
        return float(mpmath.mpf(number) - nearest)


def check_digits(method: MethodBase, *, events: bool, variations: bool) -> None:
    """Refuse what does not go together with states of so many digits, or needs them.

    Raises
    ------
    problems.errors.InputError
        With the name of what to leave out.
    """
    if method.precision == "double":
        raise InputError(
            f"{method!r} calculates with doubles; leave out start=, or use Gauss(s=, h=, "
            "precision='double-double')."
        )
    for name, given in (("events", events), ("variations", variations)):
        if given:
            raise InputError(f"{method!r} has no {name}; leave out {name}= or precision=.")
