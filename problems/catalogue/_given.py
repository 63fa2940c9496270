"""Checks of what a problem's function is called with, and start values that are the nearest doubles."""

import math
from collections.abc import Callable, Sequence
from decimal import Decimal, localcontext
from random import Random
from typing import Any

from problems import limits
from problems.errors import InputError, shown, unknown


def finite(problem: str, **values: Any) -> None:
    """Refuse values that are not finite numbers.

    Raises
    ------
    problems.errors.InputError
        Naming the first such value.
    """
    for name, value in values.items():
        if not _is_number(value):
            raise InputError(f"{name}={shown(value)} of {problem} must be a finite number.")


def positive(problem: str, **values: Any) -> None:
    """Refuse values that are not finite numbers above 0; see `finite`."""
    finite(problem, **values)
    for name, value in values.items():
        if value <= 0:
            raise InputError(f"{name}={shown(value)} of {problem} must be positive.")


def whole(problem: str, least: int, **values: Any) -> None:
    """Refuse values that are not whole numbers of at least ``least``; see `finite`."""
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise InputError(
                f"{name}={shown(value)} of {problem} must be a whole number of at least {least}."
            )


def size(problem: str, components: int, terms: int = 0, **values: Any) -> None:
    """Refuse values that make a state or a sum larger than `problems.limits` allow."""
    call = f"{problem}({', '.join(f'{name}={shown(value)}' for name, value in values.items())})"
    limits.check(call, "COMPONENTS", components)
    limits.check(call, "TERMS", terms)


def numbers(problem: str, name: str, value: Any, size: int) -> tuple[float, ...]:
    """Return a list of ``size`` finite numbers as a tuple; see `finite`."""
    if not isinstance(value, list | tuple) or len(value) != size or not all(map(_is_number, value)):
        raise InputError(f"{name}={shown(value)} of {problem} must be a list of {size} finite numbers.")
    return tuple(float(number) for number in value)


def choice(problem: str, name: str, value: Any, known: Sequence[str]) -> None:
    """Refuse a word that is not one of ``known``, with the nearest ones; see `finite`."""
    if not isinstance(value, str) or value not in known:
        raise unknown(f"{name} of {problem}", value, known)


def nearest(expression: Callable[[], Any]) -> float:
    """Return the double nearest to a number computed in mpmath at 50 digits.

    A start computed so is the same on every machine; the sines and logarithms
    of C libraries differ in the last bit.

    Parameters
    ----------
    expression : callable
        Returns an mpmath number; doubles enter it exactly.
    """
    import mpmath  # a tenth of a second that most problems do not need

    with mpmath.workdps(50):
        return float(expression())


def nearest_sqrt(value: Decimal) -> float:
    """Return the double nearest to the root of an exact decimal number."""
    with localcontext(prec=60):
        return float(value.sqrt())


def gaussians(seed: int, count: int) -> list[float]:
    """Return ``count`` random numbers of mean 0 and variance 1, the same on every machine.

    Each is the sum of 12 uniform numbers less 6 (Irwin and Hall's distribution,
    which is Gaussian but for its tails beyond 3): the uniform numbers are those
    of Python's Mersenne twister, whose sequence is guaranteed, and sums are
    rounded alike everywhere, while logarithms and sines are not.

    Parameters
    ----------
    seed, count : int
        Seed of `random.Random`, and how many numbers.
    """
    draw = Random(seed).random
    return [sum(draw() for _ in range(12)) - 6.0 for _ in range(count)]


def _is_number(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer that no double holds
        return False
