"""Times asked for, as whole steps and parts of a step."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.protocol import Array
from problems.errors import InputError

Counts = NDArray[np.int64]

COUNTABLE = 2.0**53


def plan(times: Array, bases: Array, h: float, low: Array | float = 0.0) -> tuple[Counts, Array]:
    """Split each distance from a base into whole steps and a part of one.

    Parameters
    ----------
    times, bases : ndarray, shape (m,)
        Times asked for and the times they are counted from.
    h : float
        Length of a step; negative backwards.
    low : float or ndarray, shape (m,)
        What the bases lack: they are ``bases + low``.

    Returns
    -------
    steps : ndarray of int, shape (m,)
        Whole steps that end at or before the time.
    parts : ndarray, shape (m,)
        What is left of ``times - bases - low - steps * h``, without the rounding of these
        operations; exactly 0 where the time is a step's end but for a few ulp.

    Raises
    ------
    problems.errors.InputError
        If h is so small that the steps cannot be counted.
    """
    if times.size == 1:  # in a tenth of the time
        count, part = _split(times.item(), bases.item(), h, np.asarray(low).item(), _OfOne)
        return np.array([int(count)]), np.array([part])
    counts, parts = _split(times, bases, h, low, _OfMany)
    return counts.astype(np.int64), parts


class _OfMany:
    """What `_split` does with arrays."""

    rint, spacing, maximum, where = np.rint, np.spacing, np.maximum, np.where

    @staticmethod
    def largest(counts: Array) -> float:
        return float(counts.max(initial=0.0))


class _OfOne:
    """The same with one number."""

    spacing, maximum, largest = math.ulp, max, float

    @staticmethod
    def rint(x: float) -> float:
        return float(round(x)) if abs(x) < COUNTABLE else x

    @staticmethod
    def where(condition: bool, yes: float, no: float) -> float:
        return yes if condition else no


def _check(count: float, h: float) -> None:
    if count > COUNTABLE:
        raise InputError(f"h={abs(h)!r} would need {count:.1e} steps; take a larger h.")


def _split(times: Any, bases: Any, h: float, low: Any, functions: Any) -> tuple[Any, Any]:
    """Return counts and parts of numbers or of arrays, with the functions ``of`` them."""
    count = functions.rint((times - bases) / h)
    _check(functions.largest(count), h)
    parts = rest(times, bases, count, h, low)
    close = abs(parts) <= 4.0 * functions.spacing(functions.maximum(abs(times), abs(bases)))
    count = functions.where(close | (parts * h >= 0.0), count, count - 1.0)
    return count, functions.where(close, 0.0, rest(times, bases, count, h, low))


def rest(times: Any, bases: Any, count: Any, h: float, low: Any = 0.0) -> Any:
    """Return times - bases - low - count * h, rounded once (Dekker's sum and product)."""
    gap = times - bases
    back = gap - times
    gap_error = (times - (gap - back)) - (bases + back)
    product = count * h
    split = 134217729.0  # 2^27 + 1
    high = split * count - (split * count - count)
    top = split * h - (split * h - h)
    rest_of_count, bottom = count - high, h - top
    product_error = ((high * top - product) + high * bottom + rest_of_count * top) + rest_of_count * bottom
    return ((gap - product) - product_error) + (gap_error - low)
