"""Poincaré sections."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from integrators.events.event import Event
from integrators.options import Count
from integrators.protocol import MethodBase, check_problem
from integrators.running.integrate import integrate
from integrators.running.watch import Report
from integrators.solution import Solution
from problems import Problem
from problems.checks import checked_arguments
from problems.errors import InputError


@checked_arguments
def section(
    problem: Problem,
    method: MethodBase,
    g: Callable[..., Any],
    *,
    direction: int = 1,
    count: Count | None = None,
    t_end: float | None = None,
    progress: bool | Report = False,
) -> Solution:
    """Return the states at which a trajectory passes through the surface g = 0: a Poincaré section.

    Parameters
    ----------
    problem : Problem
        What to integrate.
    method : MethodBase
        How; see `Event` for what is required.
    g : callable
        Its arguments are among ``t, q, p, y, par, m``.
    direction : {1, -1, 0}
        Whether g must rise, or fall, or either.
    count : int, optional
        Passages after which to stop.
    t_end : float, optional
        The latest time; the problem's own by default.
    progress : bool or callable, optional
        As for `integrate`.

    Returns
    -------
    Solution
        ``t`` and ``y`` are the passages; ``y[0]`` is the first, not the start.

    Raises
    ------
    problems.errors.InputError
        For a method without states between its steps, or values that cannot be used.

    Examples
    --------
    >>> import problems
    >>> from integrators import HBVM, section
    >>> made = section(problems.load("henon_heiles"), HBVM(k=6, s=4, h=0.5), lambda q: q[0], count=3)
    >>> made.y.shape
    (3, 4)
    """
    check_problem(problem, method)
    end = problem.t_end if t_end is None else float(t_end)
    if end == problem.t0:
        raise InputError(f"t_end={end!r} of a section must be another time than t0={problem.t0!r}.")
    event = Event(g, direction=direction, terminal=count or 0, name="section")
    solution = integrate(problem, method, [end], events=event, progress=progress)
    passages = solution.events["section"]
    return replace(solution, t=passages.t, y=passages.y)
