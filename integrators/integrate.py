"""Integrate a problem with a method: the one function most users need."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from integrators import registry
from integrators.caveats import unseen
from integrators.protocol import (
    Array,
    MethodBase,
    Samples,
    Stats,
    Status,
    UserError,
    as_numbers,
    check_times,
)
from problems import limits
from problems.errors import InputError, shown
from problems.problem import Problem
from problems.systems.untraced import Foreign

if TYPE_CHECKING:
    from integrators.events import Event, Occurrences
    from integrators.events.search import Found

DEFAULT_SAMPLES = 1001


@dataclass(frozen=True, eq=False)
class Solution:
    """A trajectory and what it cost.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times reached; all that were asked for if ``status`` is ``FINISHED``.
    y : ndarray, shape (n, dim)
        States: q then p for Hamiltonian problems.
    status : Status
        How the integration ended; a failure is a value, not an exception.
    reason : str
        One sentence on a failure; empty otherwise.
    t_stop : float
        Where the method stopped: the last time asked for, or the time of the failure.
    stats : Stats
        Counters of the work done.
    compile_seconds : float
        Seconds spent compiling, before the first step.
    from_cache : bool or None
        Whether the compiled code came from a cache; ``None`` where nothing is compiled.
    problem, method
        What was integrated, and how.
    events : dict of str to Occurrences
        Times, states and directions of the events that were asked for, by name.
    error : Exception or None
        What a function of the user raised, or why that of an event could not be followed, where
        ``status`` is ``USER_ERROR``.
    """

    t: Array
    y: Array
    status: Status
    reason: str
    t_stop: float
    stats: Stats
    compile_seconds: float
    from_cache: bool | None
    problem: Problem
    method: MethodBase
    events: "Mapping[str, Occurrences]" = field(default_factory=dict)
    error: Exception | None = None

    @property
    def v(self) -> Array | None:
        """Velocities (n, dof) of a Hamiltonian problem with constant masses, else ``None``."""
        return self.problem.velocity(self.y)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on what a user should know about a solution although it did not fail."""
        caveat = self.method.caveat(self.problem)
        kinks, implicit = (self.stats.extra.get(name) for name in ("kinks", "implicit"))
        if caveat is None and not kinks and implicit and implicit["steps"]:
            caveat = unseen(self.problem, f"kinks are not looked for in its {implicit['steps']} Newton steps")
        said = () if caveat is None else (caveat,)
        if not kinks:
            return said
        t, h = kinks[0]
        return (
            *said,
            f"the field jumps or has a kink (places kept: {len(kinks)}, the first between t = {t!r} "
            f"and {t + h!r}): steps were cut there, and what lies between two nodes may have been missed; "
            "give breakpoints where the times are known.",
        )

    def invariants(self) -> dict[str, Array]:
        """Return the problem's invariants along the trajectory, by name."""
        return self.problem.invariants(self.y, self.t)

    def errors(self) -> dict[str, Array]:
        """Return the errors of the invariants along the trajectory, relative where that has a meaning."""
        return self.problem.errors(self.y, self.t)

    def guards(self) -> dict[str, Array]:
        """Return the quantities that a symmetry keeps at exactly zero, by name."""
        return self.problem.guards(self.y, self.t)


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
    check(problem, method)
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
        if found.terminal:
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


def check(problem: Problem, method: MethodBase) -> None:
    """Raise `problems.errors.InputError` unless ``method`` can integrate ``problem``."""
    if not isinstance(problem, Problem):
        raise InputError(
            f"problem must be a Problem, not {shown(problem)}; "
            "make one with problems.load or problems.Problem."
        )
    if not isinstance(method, MethodBase):
        raise InputError(f"method must be a method such as HBVM(k=8, s=4, h=0.1), not {shown(method)}.")
    reason = method.accepts(problem)
    if reason is not None:
        raise InputError(f"{method!r} cannot integrate {problem!r}: {reason}")


def _with_events(solution: Solution, found: "Found") -> Solution:
    """Return the solution with what a search for events has found."""
    work = {name: getattr(found.stats, name) for name in ("steps", "evaluations", "iterations")}
    stats = replace(solution.stats, extra={**solution.stats.extra, "event_search": work})
    solution = replace(solution, stats=stats, events=found.events)
    if found.status is Status.FINISHED or solution.status.failed:
        return solution
    stop = found.t_stop if found.terminal else solution.t_stop
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
