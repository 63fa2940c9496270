"""Gauss collocation in double-double arithmetic, with steps that it chooses: a second opinion on references.

Nothing is shared with the Taylor method that makes the references but the traced
vector field: other method, other arithmetic, other code. The step follows the
Legendre coefficients of the field: the last of s is of the size h^{s-1}, the
error of the step about its square.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import NumbaError, njit
from numpy.typing import NDArray

from integrators.extended.arithmetic import Numbers, minus, plus, times
from integrators.extended.step import SOLVED, ends_of_projection, field_of, solver, tables, weighted
from problems.errors import InputError
from problems.problem import Problem
from problems.systems.base import System

Array = NDArray[np.float64]

STAGES = 16
DECAY = 1e-17  # of the last Legendre coefficient; its square is the size of the error


def integrate(problem: Problem, at: Array, *, decay: float = DECAY) -> Numbers:
    """Return the solution at given times as double-double numbers.

    Parameters
    ----------
    problem : Problem
        What to integrate; every number enters as the exact double.
    at : ndarray, shape (n,)
        Increasing (or, backwards, decreasing) times, from ``t0`` on.
    decay : float
        Wanted size of the last Legendre coefficient relative to the first.

    Returns
    -------
    ndarray of complex, shape (n, dim)
        Each number is the sum of its real and its imaginary part.

    Raises
    ------
    problems.errors.InputError
        If the iteration does not converge, or the step shrinks to nothing; for functions that
        double-double arithmetic does not have.
    """
    advance, numbers = _program(problem.system), (*tables(STAGES), ends_of_projection(STAGES))
    y, par = problem.y0.astype(complex), problem.par.astype(complex)
    out = np.empty((len(at), y.size), complex)
    t, h = float(problem.t0), 0.0
    for i, end in enumerate(np.asarray(at, dtype=np.float64).tolist()):
        try:
            code, h = advance(t, end, h, y, par, *numbers, decay)
        except NumbaError:
            raise InputError(
                f"the field of {problem!r} has a function or a table that is not available in double-double."
            ) from None
        if code:
            raise InputError(f"{problem!r} could not be integrated beyond t = {t!r} in double-double.")
        t = end
        out[i] = y
    return out


_programs: dict[str, Callable[..., Any]] = {}


def _program(system: System) -> Callable[..., Any]:
    """Return the compiled integrator of a system."""
    key, field = field_of(system)
    if key not in _programs:
        _programs[key] = _integrator(field)
    return _programs[key]


def _integrator(field: Any) -> Any:
    solve = solver(field)

    @njit
    def advance(t, end, h, y, par, nodes, weights, matrix, projection, decay):
        s, dim = len(nodes), len(y)
        slope = np.zeros((s, dim), np.complex128)
        new = np.zeros((s, dim), np.complex128)
        direction = 1.0 if end > t else -1.0
        if h == 0.0:
            h = direction * 1e-3 * abs(end - t)
        while (end - t) * direction > 0.0:
            last = abs(h) >= abs(end - t)
            step = end - t if last else h
            if t + step == t:
                return 2, h
            after = end if last else t + step
            step = after - t
            exact = minus(after, t)  # from one double to the next
            _, change = solve(complex(t), y, par, exact, nodes, matrix, slope, new)
            if not change < SOLVED:
                if abs(step) < 1e-12 * abs(end):
                    return 1, h
                h = 0.25 * step
                continue
            ratio = _decay(slope, projection)
            factor = 0.9 * (decay / max(ratio, 1e-300)) ** (1.0 / (s - 1))
            factor = min(2.0, max(0.1, factor))
            if ratio > 30.0 * decay:
                h = step * factor
                continue
            for d in range(dim):
                y[d] = plus(y[d], times(weighted(weights, slope[:, d]), exact))
            t = after
            if not last:
                h = step * factor
        return 0, h

    return advance


@njit
def _decay(slope, projection):
    """Return the largest of the last two Legendre coefficients relative to the largest of the first."""
    top, tail = 1e-300, 0.0
    for d in range(slope.shape[1]):
        top = max(top, abs(weighted(projection[0], slope[:, d]).real))
        for j in range(1, 3):
            tail = max(tail, abs(weighted(projection[j], slope[:, d]).real))
    return tail / top
