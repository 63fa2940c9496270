"""The order of a method with a fixed step, measured."""

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import ArrayLike

from integrators.protocol import MethodBase
from integrators.running.integrate import integrate
from problems import Problem
from problems.problem import check_is_problem

PLATEAU = 3e-13
"""Below this an error is rounding."""

ASYMPTOTIC = 1e-2
"""Above this the next term of an error still counts."""

LAST = 5
"""Points that the slope is taken from, at most."""


def measured_order(
    method_of: Callable[[float], MethodBase],
    problem: Problem,
    steps: Iterable[float],
    exact: ArrayLike | None = None,
    *,
    end: float | None = None,
    asymptotic: float = ASYMPTOTIC,
) -> float:
    """Return the slope of log(error) over log(h) at the end of a problem, which must not be linear.

    A linear problem tells little: Gauss conserves its energy, and all methods of one order
    look alike. Steps are changed a little, such that a whole number of them leads to the end.

    Parameters
    ----------
    method_of : callable
        The method with a step ``h``.
    problem : Problem
        What is integrated.
    steps : iterable of float
        Steps from long to short; those with an error at rounding end it.
    exact : array_like, shape (dim,), optional
        The solution at the end; by default what ``HBVM()`` finds.
    end : float, optional
        Where the error is measured; by default the problem's ``t_end``.
    asymptotic : float
        Errors above this are left out.

    Raises
    ------
    AssertionError
        If fewer than three errors lie between rounding and ``asymptotic``.
    """
    check_is_problem(problem)
    end = problem.t_end if end is None else end
    goal = integrate(problem, None, [end]).y[-1] if exact is None else np.asarray(exact)
    points: list[tuple[float, float]] = []
    for step in steps:
        h = abs(end - problem.t0) / round(abs(end - problem.t0) / step)
        solution = integrate(problem, method_of(h), [end])
        if solution.status.failed:  # a step too long for it
            continue
        error = float(np.abs(solution.y[-1] - goal).max())
        if error < PLATEAU:
            break
        if error < asymptotic:
            points.append((np.log(h), np.log(error)))
    if len(points) < 3:
        raise AssertionError(
            f"only {len(points)} errors lie between {PLATEAU} and {asymptotic}: give other steps"
        )
    h, error = np.array(points[-LAST:]).T
    return float(np.polyfit(h, error, 1)[0])
