"""The options that several methods have: checked, and refused with one sentence."""

import math
import operator
from typing import Any

import numpy as np

from problems import limits
from problems.errors import InputError, shown

SMALLEST = 2.0**-52
"""The smallest tolerance of a step: a smaller error cannot be told from rounding."""

SHORTEST = 2.0**-48
"""Of the time: a shorter step cannot be told from none; as in `integrators.kernel.step.control`."""


def whole(method: str, name: str, value: Any) -> int:
    """Return an option as an int >= 1, or refuse it."""
    try:
        number = 0 if isinstance(value, bool) else operator.index(value)
    except TypeError:
        number = 0
    if number < 1:
        raise InputError(f"{method} needs a whole number {name} >= 1, not {name}={shown(value)}.")
    if name in ("k", "s"):
        limits.check(f"{method} with {name}={shown(value)}", "STAGES", number)
    return number


def length(method: str, h: Any, name: str = "h") -> float:
    """Return a step as a float > 0, or refuse it."""
    value = _number(h)
    if not (value > 0.0 and math.isfinite(value)):
        raise InputError(
            f"{method} needs a finite step {name} > 0, not {name}={shown(h)}; "
            "the sign of time is that of the times."
        )
    return value


def tolerance(method: str, tol: Any) -> float:
    """Return a tolerance as a float, or refuse it."""
    value = _number(tol)
    if not SMALLEST <= value < 1.0:
        raise InputError(
            f"{method} needs a tolerance {SMALLEST:.1e} <= tol < 1, not tol={shown(tol)}: "
            "an error smaller than this cannot be told from rounding."
        )
    return value


def landings(method: str, breakpoints: Any) -> tuple[float, ...]:
    """Return breakpoints, a list or array of times, as ascending floats, or refuse them.

    Of those that are so close that no step between them could be told from none, the first.
    """
    if isinstance(breakpoints, np.ndarray):
        breakpoints = breakpoints.tolist()
    values = [_number(t) for t in breakpoints] if isinstance(breakpoints, list | tuple) else [math.nan]
    if not all(math.isfinite(t) for t in values):
        raise InputError(
            f"{method} needs breakpoints as a list of finite times, not breakpoints={shown(breakpoints)}; "
            "such as breakpoints=[1.0, 2.5]."
        )
    kept: list[float] = []
    for t in sorted(values):
        if not kept or t - kept[-1] > SHORTEST * max(abs(t), abs(kept[-1])):
            kept.append(t)
    return tuple(kept)


def _number(value: Any) -> float:
    try:
        return math.nan if isinstance(value, (bool, str)) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan
