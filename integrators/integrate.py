"""Integrate a problem with a method: the one function most users need."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from integrators import registry
from integrators.protocol import (
    Array,
    MethodBase,
    Samples,
    Status,
    UserError,
    as_numbers,
    check_problem,
    check_times,
)
from integrators.solution import Solution
from problems import limits
from problems.errors import InputError
from problems.problem import Problem
from problems.systems.untraced import Foreign

if TYPE_CHECKING:
    from integrators.events import Event
    from integrators.events.search import Found

DEFAULT_SAMPLES = 1001


def integrate(
    problem: Problem,
    method: MethodBase | None = None,
    times: ArrayLike | None = None,
    sample: str | None = None,
    events: "Event | Callable[..., Any] | Sequence[Event | Callable[..., Any]]" = (),
) -> Solution:
    """Integrate ``problem`` with ``method`` and return the states at ``times``.

    Parameters
    ----------
    problem : Problem
        What to integrate.
    method : MethodBase, optional
        How: ``HBVM(k=8, s=4, h=0.1)``, ``Taylor(tol=1e-15)``, ... Default: ``HBVM()``, which
        chooses everything itself.
    times : array_like, shape (n,), optional
        Strictly monotone times, from the problem's ``t0`` on (or back). Default:
        the problem's own grid, or else 1001 equidistant times to ``t_end``.
    sample : {"side", "steps", "land", "dense"}, optional
        How states between the method's steps are made; see `Stepper.advance`.
    events : Event or callable, or a sequence of them, optional
        Functions of time and state, and what happens where they vanish: see
        `integrators.events.Event`. They change nothing of the steps and samples, but a
        terminal event ends them. Finding them takes every step once more (twice where
        the steps vary); ``stats.extra["event_search"]`` counts that work.

    Returns
    -------
    Solution

    Raises
    ------
    problems.errors.InputError
        If the method does not accept the problem, or for times, samplings, events and
        initial states that cannot be used.
    Exception
        What a `problems.Foreign` field raises in the very first step. Later errors, and those of an event's
        function, end the integration as ``USER_ERROR``, with the trajectory up to there.
    """
    if method is None:
        method = registry.create("HBVM")
    check_problem(problem, method)
    program = method.compile(problem.system)
    grid = _grid(problem, times)
    found = None
    if not isinstance(events, Sequence) or events:
        from integrators.events.event import named
        from integrators.events.search import search

        if sample == "land":
            raise InputError(
                "events are those of the method's own steps, which sample='land' changes; use 'side'."
            )
        found = search(problem, method, program, named(events), float(check_times(grid, problem.t0)[-1]))
        if found.status is Status.EVENT:
            grid = grid[(grid - found.t_stop) * np.sign(found.t_stop - problem.t0) <= 0.0]
    try:
        stepper = program.start(problem.y0, problem.par, problem.t0)
    except UserError as raised:
        raise raised.error from None
    samples = Samples(grid, np.empty((0, problem.system.dim)), Status.FINISHED)
    error: Exception | None = None
    if grid.size:
        samples = stepper.advance(grid, sample=sample)
        error = getattr(stepper, "error", None)
        if error is not None and stepper.t == problem.t0:  # nothing is reached that could be kept
            raise error
    finished = samples.status is Status.FINISHED
    stats = replace(stepper.stats)
    if isinstance(problem.system, Foreign):
        stats.extra = {**stats.extra, "field": problem.system.written}
    solution = Solution(
        t=samples.t,
        y=samples.y,
        status=samples.status,
        reason=samples.reason,
        t_stop=float(samples.t[-1]) if finished and samples.t.size else stepper.t,
        stats=stats,
        compile_seconds=program.compile_seconds,
        from_cache=program.from_cache,
        problem=problem,
        method=method,
        error=error,
    )
    return solution if found is None else _with_events(solution, found)


def _with_events(solution: Solution, found: "Found") -> Solution:
    """Return the solution with what a search for events has found."""
    work = {name: getattr(found.stats, name) for name in ("steps", "evaluations", "iterations")}
    stats = replace(solution.stats, extra={**solution.stats.extra, "event_search": work})
    solution = replace(solution, stats=stats, events=found.events)
    if found.status is Status.FINISHED or solution.status.failed:
        return solution
    stop = found.t_stop if found.status is Status.EVENT else solution.t_stop
    return replace(solution, status=found.status, reason=found.reason, t_stop=stop, error=found.error)


def _grid(problem: Problem, times: ArrayLike | None) -> Array:
    """Return the times to sample at: the user's, the problem's, or the default."""
    if times is None:
        times = problem.times
    if times is None:
        times = np.linspace(problem.t0, problem.t_end, DEFAULT_SAMPLES)
    grid = as_numbers("times", times)
    gib = 8 * grid.size * problem.system.dim / 2**30
    limits.check(f"a solution of {grid.size} times and {problem.system.dim} components", "GIB", gib)
    return grid
