"""Integrate a problem with a method: the one function most users need."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from integrators import registry
from integrators.events.event import Event, named
from integrators.events.finder import Ending, Finder, started_with_events
from integrators.protocol import (
    SAMPLINGS,
    Array,
    MethodBase,
    Samples,
    Stats,
    Status,
    UserError,
    as_numbers,
    check_problem,
    check_times,
)
from integrators.running.watch import Bar, Pieces, Report, Watch, identity, read
from integrators.solution import Solution
from problems import limits
from problems.calls import readable
from problems.checks import Must, checked
from problems.errors import InputError, shown, unknown
from problems.problem import Problem
from problems.systems.untraced import Foreign

DEFAULT_SAMPLES = 1001
NotNegative = Annotated[float, Must("a number of seconds, 0 or more", lambda x: x >= 0)]


@readable
def integrate(
    problem: Problem,
    method: MethodBase | None = None,
    times: ArrayLike | None = None,
    sample: str | None = None,
    events: Event | Callable[..., Any] | Sequence[Event | Callable[..., Any]] = (),
    *,
    progress: bool | Report = False,
    checkpoint: str | os.PathLike[str] | None = None,
    every_seconds: float = 60.0,
    resume: str | os.PathLike[str] | None = None,
) -> Solution:
    """Integrate ``problem`` with ``method`` and return the states at ``times``.

    Ctrl-C ends the integration: what was reached is returned, with the status ``INTERRUPTED``.

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
        terminal event ends them. They are looked for in the steps themselves;
        ``stats.extra["event_search"]`` counts the partial steps that they take.
    progress : bool or callable, optional
        True: a bar on the terminal, if there is one. A function: it is called about ten times a second
        with an `integrators.Progress`.
    checkpoint : path, optional
        A file that is written every so many seconds, when the integration ends, and at Ctrl-C: what the
        continuation depends on, and the samples until then. It is always whole, whenever the process ends.
    every_seconds : float
        Seconds from one file to the next, at least. A file that cannot be written, as on a full disk,
        ends nothing: the solution warns of it.
    resume : path, optional
        Go on from the checkpoint in this file, of the same problem, method, times, sampling and events: the
        solution has the same bits as without the break. If there is no such file and ``checkpoint`` is
        the same path, begin at the beginning. Only give a file that you made: it is a pickle.

    Returns
    -------
    Solution

    Raises
    ------
    problems.errors.InputError
        If the method does not accept the problem, or for times, samplings, events,
        initial states and files that cannot be used.
    Exception
        What a `problems.Foreign` field raises in the very first step. Later errors, and those of an event's
        function, end the integration as ``USER_ERROR``, with the trajectory up to there.

    Examples
    --------
    >>> import problems
    >>> from integrators import HBVM, integrate
    >>> solution = integrate(problems.load("kepler", e=0.6), HBVM(k=8, s=4, h=0.05), [0.0, 10.0, 20.0])
    >>> solution.y.shape, bool(solution.errors()["energy"].max() < 1e-13)
    ((3, 4), True)
    """
    if method is None:
        method = registry.create("HBVM")
    check_problem(problem, method)
    if not isinstance(sample, str | None):
        raise unknown("sampling", sample, SAMPLINGS)
    if not callable(progress) and not isinstance(progress, bool):
        raise InputError(f"progress={shown(progress)} must be True, False or a function of the progress.")
    seconds = checked("integrate", "every_seconds", every_seconds, NotNegative)
    if progress is True:
        with Bar() as bar:
            return integrate(
                problem, method, times, sample, events,
                progress=bar, checkpoint=checkpoint, every_seconds=seconds, resume=resume,
            )  # fmt: skip
    program = method.compile(problem.system)
    grid = _grid(problem, times)
    looked_for: dict[str, Event] = {}
    if not isinstance(events, Sequence) or events:
        if sample == "land":
            raise InputError(
                "events are those of the method's own steps, which sample='land' changes; use 'side'."
            )
        looked_for = named(events)
    end = float(check_times(grid, problem.t0)[-1]) if grid.size or looked_for else problem.t0
    path = None if checkpoint is None else Path(checkpoint)
    kept, belongs = {}, {}
    if path is not None or resume is not None:
        belongs = identity(problem, method, grid, sample, looked_for)
    if resume is not None and (Path(resume) != path or Path(resume).exists()):
        kept = read(resume, belongs)
    report = progress or None
    watch = Watch(problem.t0, end, report, path, seconds, belongs)
    try:
        if looked_for:
            stepper: Any = started_with_events(program, problem, looked_for)(
                problem.y0, problem.par, problem.t0, end
            )
        else:
            stepper = program.start(problem.y0, problem.par, problem.t0)
    except UserError as raised:
        raise raised.error from None
    way = _Way(stepper, grid, sample, kept.get("way"))
    way.go(watch)
    watch.write()
    samples, stats = way.samples, way.stats
    error: Exception | None = getattr(stepper, "error", None)
    if error is not None and stepper.t == problem.t0:  # nothing is reached that could be kept
        raise error
    finished = samples.status is Status.FINISHED
    if isinstance(problem.system, Foreign):
        stats.extra = {**stats.extra, "field": problem.system.written}
    if watch.failure:
        stats.extra = {**stats.extra, "checkpoint": watch.failure}
    if sample == "dense":  # the polynomials conserve nothing
        stats.extra = {**stats.extra, "sample": sample}
    solution = Solution(
        t=samples.t,
        y=samples.y,
        status=samples.status,
        reason=samples.reason,
        t_stop=float(samples.t[-1]) if finished and samples.t.size else way.t,
        stats=stats,
        compile_seconds=program.compile_seconds,
        from_cache=program.from_cache,
        problem=problem,
        method=method,
        error=error,
    )
    return _with_events(solution, stepper.search) if looked_for else solution


class _Way:
    """The samples of a trajectory, made piece by piece, with the very bits of one call of ``advance``.

    Parameters
    ----------
    stepper : Stepper
        At the start.
    grid : ndarray, shape (n,)
        Times asked for.
    sample : str or None
        The sampling.
    kept : mapping, optional
        What `save` returned, of the same integration: it goes on from there.
    """

    def __init__(self, stepper: Any, grid: Array, sample: str | None, kept: Mapping[str, Any] | None):
        self._stepper, self._grid, self._sample = stepper, grid, sample
        self._t, self._y = [grid[:0]], [np.empty((0, stepper.y.size))]
        self._made, self._before = 0, Stats()
        self._status, self._reason = Status.FINISHED, ""
        self.t = stepper.t
        self._search: Finder | None = getattr(stepper, "search", None)
        if grid.size:
            stepper.destination = float(grid[-1])  # collapsed steps are judged by the whole way
        if kept is not None:
            stepper.restore(kept["stepper"])
            self._t, self._y, self._made, self._before = [kept["t"]], [kept["y"]], kept["made"], kept["stats"]
            self._status, self._reason, self.t = kept["status"], kept["reason"], kept["here"]
            if "search" in kept:
                stepper.search.load(kept["search"])

    @property
    def samples(self) -> Samples:
        """All until now."""
        return Samples(np.concatenate(self._t), np.concatenate(self._y), self._status, self._reason)

    @property
    def stats(self) -> Stats:
        """Counters of all the work, that before a break too."""
        now, before = replace(self._stepper.stats), self._before
        if not before.steps:
            return now
        for name in ("steps", "rejections", "evaluations", "iterations"):
            counts = [count for count in (getattr(now, name), getattr(before, name)) if count is not None]
            setattr(now, name, sum(counts) if counts else None)
        names = [name for solver in (before.solver, now.solver) if solver for name in solver.split(", ")]
        now.solver = ", ".join(dict.fromkeys(names)) or None
        now.extra = _with_those_before(now.extra, before.extra)
        return now

    def save(self) -> dict[str, Any]:
        """Return what the continuation depends on."""
        samples = self.samples
        self._t, self._y = [samples.t], [samples.y]
        return {
            "stepper": self._stepper.checkpoint(), "t": samples.t, "y": samples.y, "made": self._made,
            "stats": self.stats, "status": self._status, "reason": self._reason, "here": self.t,
            **({} if self._search is None else {"search": self._search.save()}),
        }  # fmt: skip

    def go(self, watch: Watch) -> None:
        """Go to the end, a failure or Ctrl-C; ``watch`` looks after each piece."""
        grid, ways = self._grid, getattr(self._stepper, "samplings", SAMPLINGS)
        walks = watch.looks and "steps" in ways and self._sample != "land"
        walks = walks and (self._sample is not None or ways[0] != "land")
        pieces = Pieces(grid[-1] - self._stepper.t, watch) if grid.size else None
        try:
            while pieces is not None and self._made < grid.size and self._status is Status.FINISHED:
                with pieces:
                    self._piece(pieces.length, walks)
                watch.look(self.t, lambda: self.stats.steps, lambda: {"way": self.save()})
            if self._search is not None and grid.size and self._status is Status.FINISHED:
                self._stepper.look_to(float(grid[-1]))
        except KeyboardInterrupt:
            self._status = Status.INTERRUPTED
            self._reason = "Ctrl-C was pressed."

    def _piece(self, length: float, walks: bool) -> None:
        """Go on for a length of time: to its samples, or else by own steps, or else to the next sample."""
        stepper, grid, made = self._stepper, self._grid, self._made
        sign = 1.0 if grid[-1] >= self.t else -1.0
        goal = self.t + sign * length
        ahead = sign * (grid[made:] - goal) <= 0.0
        n = int(np.count_nonzero(ahead))
        how = self._sample
        if how == "steps":
            done = sign * (goal - grid[-1]) >= 0.0
            part = np.array([grid[-1] if done else goal])
            part = np.append(grid[:1], part) if grid[0] == self.t != part[0] else part
            n = grid.size if done else 0
        elif n or not walks or goal == self.t:
            n = n or 1
            part = grid[made : made + n]
        else:
            part, how = np.array([goal]), "steps"
        reached = stepper.advance(part, sample=how)
        if how == self._sample:
            self._t.append(reached.t)
            self._y.append(reached.y)
            self._made += n if self._sample == "steps" else reached.t.size
        self._status, self._reason = reached.status, reached.reason
        self.t = float(part[-1]) if reached.status is Status.FINISHED else stepper.t


_SETTINGS = ("k", "s")  # whole numbers in ``Stats.extra`` that count nothing


def _with_those_before(now: Mapping[str, Any], before: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is told of an integration beside its counters, with what was told before a break."""
    joined = {**before, **now}
    for key in before.keys() & now.keys():
        match before[key], now[key]:
            case dict() as first, dict() as second:
                joined[key] = _with_those_before(second, first)
            case bool(), _:
                pass
            case (int() | float()) as first, (int() | float()) as second if key not in _SETTINGS:
                joined[key] = first + second
            case list() as first, list() as second if key == "kinks":
                known = second[: len(first)] == first  # a stepper that was restored knows them
                joined[key] = second if known else first + second
            case _:
                pass
    return joined


def _with_events(solution: Solution, search: Finder) -> Solution:
    """Return the solution with what a search for events has found, up to where it ended."""
    end = Ending.of(search, solution.status, solution.reason, solution.problem.t0, solution.t_stop)
    n = end.count(solution.t, search)
    stats = replace(solution.stats, extra={**solution.stats.extra, "event_search": search.work()})
    return replace(
        solution, t=solution.t[:n], y=solution.y[:n], status=end.status, reason=end.reason, t_stop=end.stop,
        stats=stats, events=search.hits.occurrences(), error=end.error or solution.error,
    )  # fmt: skip


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
