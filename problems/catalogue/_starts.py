"""Start values that are the same on every machine."""

from collections.abc import Callable, Sequence
from random import Random
from typing import Any


def nearest(expression: Callable[[Any], Sequence[Any]]) -> list[float]:
    """Return the doubles nearest to numbers computed in mpmath at 50 digits.

    A start computed so is the same on every machine; the sines and logarithms
    of C libraries differ in the last bit.

    Parameters
    ----------
    expression : callable
        Called with the module mpmath, returns a list of its numbers; doubles enter them exactly.
    """
    import mpmath  # a tenth of a second that most problems do not need

    with mpmath.workdps(50):
        return [float(number) for number in expression(mpmath)]


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
