"""MEGNO and the largest Lyapunov exponent of a case, by the derivatives of its own method's steps.

The series are::

    chaos.megno       MEGNO at the end, shape (1,)
    chaos.exponent    the largest exponent in 1/time, and both ends of its 95 % interval, shape (3,)
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from integrators.dynamics.indicators import megno
from integrators.dynamics.lyapunov import lyapunov
from integrators.protocol import MethodBase, Status
from problems.errors import InputError
from problems.problem import Problem

Array = NDArray[np.float64]


def beside(problem: Problem, method: MethodBase) -> tuple[dict[str, str], dict[str, Array]]:
    """Return the series, and why one is missing, by the names ``megno`` and ``exponent``."""
    reasons: dict[str, str] = {}
    series: dict[str, Array] = {}
    found: dict[str, Callable[[Problem, MethodBase], tuple[list[float], Status]]] = {
        "megno": _megno,
        "exponent": _exponent,
    }
    for name, values_of in found.items():
        try:
            values, status = values_of(problem, method)
        except InputError as error:  # a method or a system without derivatives, or too few steps
            reasons[name] = str(error)
            continue
        if status.failed or not np.isfinite(values).all():
            reasons[name] = f"the tangent vectors ended as {status.value.replace('_', ' ')}"
        else:
            series[f"chaos.{name}"] = np.array(values)
    return reasons, series


def _megno(problem: Problem, method: MethodBase) -> tuple[list[float], Status]:
    found = megno(problem, method)
    return [found.value], found.status


def _exponent(problem: Problem, method: MethodBase) -> tuple[list[float], Status]:
    found = lyapunov(problem, method, count=1)
    return [float(found.exponents[0]), *found.intervals[0].tolist()], found.status
