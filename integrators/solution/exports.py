"""States as what other libraries work with."""

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.protocol import Array
from problems.errors import MissingLibraryError

EXACT_BITS = 2200  # of the sum of any two doubles


def as_mpmath(pairs: Array) -> NDArray[Any]:
    """Return pairs, shape (..., 2), as numbers of mpmath, exactly."""
    import mpmath  # for those who need it

    numbers = np.empty(pairs.shape[:-1], dtype=object)
    with mpmath.workprec(EXACT_BITS):
        for place in np.ndindex(numbers.shape):
            high, low = pairs[place].tolist()
            numbers[place] = mpmath.mpf(high) + low
    return numbers


def library(name: str) -> Any:
    """Import an optional library that tables are made with.

    Raises
    ------
    problems.errors.MissingLibraryError
        If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError:
        raise MissingLibraryError(f"{name} is not installed; install it with: pip install {name}.") from None
