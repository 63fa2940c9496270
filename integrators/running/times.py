"""Times asked for, as whole steps and parts of a step."""

import numpy as np
from numpy.typing import NDArray

from integrators.protocol import Array
from problems.errors import InputError

Counts = NDArray[np.int64]

COUNTABLE = 2.0**53


def plan(times: Array, bases: Array, h: float) -> tuple[Counts, Array]:
    """Split each distance from a base into whole steps and a part of one.

    Parameters
    ----------
    times, bases : ndarray, shape (m,)
        Times asked for and the times they are counted from.
    h : float
        Length of a step; negative backwards.

    Returns
    -------
    steps : ndarray of int, shape (m,)
        Whole steps that end at or before the time.
    parts : ndarray, shape (m,)
        What is left of ``times - bases - steps * h``, without the rounding of these
        operations; exactly 0 where the time is a step's end but for a few ulp.

    Raises
    ------
    problems.errors.InputError
        If h is so small that the steps cannot be counted.
    """
    count = np.rint((times - bases) / h)
    if count.size and count.max() > COUNTABLE:
        raise InputError(f"h={abs(h)!r} would need {count.max():.1e} steps; take a larger h.")
    parts = _rest(times, bases, count, h)
    close = np.abs(parts) <= 4.0 * np.spacing(np.maximum(np.abs(times), np.abs(bases)))
    count = np.where(~close & (parts * h < 0.0), count - 1.0, count)
    parts = np.where(close, 0.0, _rest(times, bases, count, h))
    return count.astype(np.int64), parts


def _rest(times: Array, bases: Array, count: Array, h: float) -> Array:
    """Return times - bases - count * h, rounded once (Dekker's sum and product)."""
    gap = times - bases
    back = gap - times
    gap_error = (times - (gap - back)) - (bases + back)
    product = count * h
    split = 134217729.0  # 2^27 + 1
    high = split * count - (split * count - count)
    top = split * h - (split * h - h)
    low, bottom = count - high, h - top
    product_error = ((high * top - product) + high * bottom + low * top) + low * bottom
    return ((gap - product) - product_error) + gap_error
