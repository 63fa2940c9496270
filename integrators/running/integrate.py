"""Integrate a problem with a method: the one function most users need."""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from math import isfinite
from time import perf_counter
from typing import Annotated, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from integrators import registry
from integrators.caveats import Losses, lost_invariants
from integrators.events.event import Event, named
from integrators.events.finder import Ending, Finder, started_with_events
from integrators.options import Count
from integrators.protocol import (
    SAMPLINGS,
    Array,
    Checkpoints,
    Destination,
    DoubleDouble,
    Interruptible,
    KeptError,
    MethodBase,
    Program,
    Samples,
    SamplingName,
    Samplings,
    SharedSteps,
    Status,
    UserError,
    check_problem,
    offers,
)
from integrators.refusals import check_interval, check_times
from integrators.running.course import Course
from integrators.running.digits import check_digits, pairs
from integrators.running.variations import follow
from integrators.running.watch import SOON, Bar, Report, Watch, check_progress, files, identity
from integrators.solution.record import Solution, solution_of
from problems import limits
from problems.analysis.tables import check_tables
from problems.checks import File, Must, checked_arguments
from problems.errors import InputError, shown
from problems.problem import Problem, System
from problems.quantities import plain_numbers
from problems.systems.opaque import Opaque

DEFAULT_SAMPLES = 1001
SECONDS = 60.0  # from one file to the next
FIRST = 1e-5  # of the interval: the first piece, when nothing is known of its cost ...
UNSEEN = 1e-3  # ... and where nobody wants to know of it
UNLIMITED = 2**17  # numbers of a solution that are always allowed
PROGRAMS = 8  # kept with each system


NotNegative = Annotated[float, Must("a number of seconds, 0 or more", lambda x: x >= 0)]


@checked_arguments
def integrate(
    problem: Problem,
    method: MethodBase | None = None,
    times: ArrayLike | None = None,
    sample: SamplingName | None = None,
    events: Event | Callable[..., Any] | Sequence[Event | Callable[..., Any]] = (),
    *,
    variations: Any = None,
    start: Any = None,
    threads: Count = 1,
    progress: bool | Report = False,
    checkpoint: File | None = None,
    every_seconds: NotNegative = SECONDS,
    resume: File | None = None,
) -> Solution:
    """Integrate ``problem`` with ``method`` and return the states at ``times``.

    Ctrl-C ends the integration: the states computed so far are returned, with the status ``INTERRUPTED``.

    Parameters
    ----------
    problem : Problem
        The problem to integrate.
    method : MethodBase, optional
        The method: ``HBVM(k=8, s=4, h=0.1)``, ``Taylor(tol=1e-15)``, ... Default: ``HBVM()``, which chooses
        its order and step size automatically.
    times : array_like, shape (n,), or float, optional
        Output times, strictly monotone from the problem's ``t0`` on (forward or backward). One number is the
        end of 1001 equidistant times; where it is ``t0``, the only one. Default: the problem's ``times``, or
        else its ``t_end`` as one number.
    sample : {"partial", "steps", "stop", "dense"}, optional
        How states between the method's steps are computed; see `Stepper.advance`.
    events : Event or callable, or a sequence of them, optional
        Functions of time and state whose zeros are located: see `integrators.events.Event`. They do not
        affect the steps; a terminal event ends the integration. Zeros are located by partial steps, which
        ``stats.extra["event_search"]`` counts.
    variations : array_like, shape (dim, n), or str, or sequence of str, optional
        Initial tangent vectors, or the quantities with respect to which the trajectory is differentiated:
        ``"y0"`` (dim vectors), ``"t0"`` (one), names of parameters (one for each number; the initial state is
        fixed). ``solution.variations`` has them at the samples. They are the exact derivatives of the steps
        that are taken, with fixed step sizes; ``"t0"`` starts with minus the right-hand side at the initial
        state.
        `Solution.variations_at` has them at any time. For HBVM and Gauss, and problems with a formula.
    start : array_like, shape (dim,) or (dim, 2), optional
        The initial state with more digits than doubles have, for ``Gauss(..., precision="double-double")``:
        numbers of mpmath, or pairs of doubles. Rounded to doubles it must be that of the problem.
    threads : int
        Number of threads that share each step of HBVM and Gauss, for large systems: by components where the
        vector field is a loop over neighbours, else it is evaluated at eight stages by each (with sixteen
        stages, by two threads). The solution is bitwise the same with any number. Refused where it saves no
        time: other methods, small systems, right-hand sides in Python. For many trajectories use
        `integrate_many`.
    progress : bool or callable, optional
        True: show a progress bar on a terminal. A function: it is called about ten times a second with an
        `integrators.Progress`.
    checkpoint : path, optional
        Path of a checkpoint file, written every ``every_seconds`` seconds, at the end of the integration, and
        at Ctrl-C, with the samples computed so far. The file is replaced atomically.
    every_seconds : float
        Minimum time between two checkpoints, in seconds. If a file cannot be written, as on a full disk, the
        integration continues and the solution has a warning.
    resume : path, optional
        Continue from the checkpoint in this file, of the same problem, method, times, sampling and events:
        the solution is bitwise identical to one without an interruption. If there is no such file and
        ``checkpoint`` is the same path, start from the beginning. Only load files that you trust: a
        checkpoint is a pickle.

    Returns
    -------
    Solution

    Raises
    ------
    problems.errors.InputError
        If the method does not accept the problem, or for times, samplings, events,
        initial states and files that cannot be used; also where doubles near the times are further apart
        than 2**-26 of the interval.
    Exception
        An exception raised by an `problems.Opaque` field in the first step. Later exceptions, and those of an
        event's function, end the integration with the status ``USER_ERROR``; the trajectory up to there is
        returned.

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
    check_progress(progress)
    if progress is True:
        with Bar() as bar:
            return integrate(
                problem, method, times, sample, events, variations=variations, start=start, threads=threads,
                progress=bar, checkpoint=checkpoint, every_seconds=every_seconds, resume=resume,
            )  # fmt: skip

    program, known = prepared(method, problem.system)
    grid = _grid(problem, times)
    if grid.size:
        check_interval(problem.t0, grid.item(-1))
    wanted = wanted_events(events, sample)
    end = float(check_times(grid, problem.t0)[-1]) if grid.size or wanted else problem.t0
    check_tables(problem.system, problem.par, problem.t0, end)
    acting = bool(wanted) and any(event.then is not None for event in wanted.values())
    if acting and variations is not None:
        raise InputError("variations do not go on past an event with then=; leave out one of them.")
    begin = None
    if start is not None or method.precision != "double":
        check_digits(method, events=bool(wanted), variations=variations is not None)
        begin = pairs(problem.y0 if start is None else start, problem)
    watch, kept = None, None
    if progress or checkpoint is not None or resume is not None:
        belongs = identity(problem, method, grid, sample, wanted, variations, begin)
        path, kept = files(checkpoint, resume, belongs)
        watch = Watch(problem.t0, end, progress or None, path, every_seconds, belongs)

    if begin is None:
        stepper = started(program, method, problem, wanted, problem.y0, problem.par, problem.t0, end)
    else:
        stepper = cast("DoubleDouble", program).start_pairs(begin, problem.par, problem.t0)
    if threads > 1:
        _share(stepper, method, threads)
    if (checkpoint is not None or resume is not None) and not offers(stepper, Checkpoints):
        raise InputError(f"{method!r} has no checkpoints; leave out checkpoint= and resume=.")
    if grid.size and offers(stepper, Destination):
        stepper.destination = end
    directions = None if variations is None else follow(stepper, method, problem, variations, sample)
    course = Course(problem.t0, problem.system.dim, directions, begin is not None)
    if kept is not None:
        course.resume(kept, stepper)
        if wanted:
            stepper.search.load(kept["search"])
    conserves = sample != "dense" and not acting
    try:
        for samples in _pieces(course, stepper, grid, sample, end, watch):
            if watch is None:
                continue
            steps = course.stats(stepper).steps
            if conserves and watch.due and samples.t.size:
                course.losses = _lost(problem, method, samples, steps) | course.losses
            if watch.keeps:
                watch.keep(course.kept(stepper) | ({"search": stepper.search.save()} if wanted else {}))
            watch.look(course.here, steps)
        if wanted and grid.size and course.status is Status.FINISHED:
            stepper.look_to(end)
    except KeyboardInterrupt:
        course.status, course.reason = Status.INTERRUPTED, "Ctrl-C was pressed."
    if watch is not None:
        watch.write()
    failed = course.status not in (Status.FINISHED, Status.INTERRUPTED) and course.status.failed
    if failed and directions is None and stepper.t != problem.t0 and course.empty:
        course.replace(stepper.t, stepper.y)  # the last state that was reached

    error = stepper.error if failed and offers(stepper, KeptError) else None
    if course.status is Status.USER_ERROR and error is not None and stepper.t == problem.t0:
        raise error  # nothing is reached that could be kept
    stats = course.stats(stepper)
    extra: dict[str, Any] = {}
    if isinstance(problem.system, Opaque):
        extra["field"] = problem.system.written
    if watch is not None and watch.failure:
        extra["checkpoint"] = watch.failure
    if course.losses:
        extra["losses"] = course.losses
    if sample == "dense":  # the polynomials conserve nothing
        extra["sample"] = sample
    if extra:
        stats.extra = {**stats.extra, **extra}
    made = course.arrays()
    solution = solution_of(
        t=made["t"],
        y=made["y"],
        events={},
        variations=made.get("variations"),
        directions=directions,
        low=made.get("low"),
        start=begin,
        status=course.status,
        reason=course.reason,
        t_stop=float(made["t"][-1]) if course.status is Status.FINISHED and made["t"].size else course.here,
        stats=stats,
        compile_seconds=program.compile_seconds - (known or 0.0),
        from_cache=program.from_cache if known is None else program.from_cache is not None or None,
        problem=problem,
        method=method,
        error=error,
    )
    return _with_events(solution, stepper.search, keeps=grid.size > 0) if wanted else solution


def _share(stepper: Any, method: MethodBase, threads: int) -> None:
    """Let threads share the steps of a stepper."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if threads > cores:
        raise InputError(
            f"threads={threads} is more than the {cores} cores that this process may use; give fewer."
        )
    if not offers(stepper, SharedSteps):
        raise InputError(f"{method!r} integrates one trajectory in one thread; leave out threads=.")
    stepper.share(threads)


def _pieces(
    course: Course, stepper: Any, grid: Array, sample: str | None, end: float, watch: Watch | None
) -> Iterator[Samples]:
    """Advance to all times in pieces, as long as nothing ends that; yield the samples of each."""
    by_steps = watch is not None and watch.looks and _goes_by_steps(stepper, sample)
    length = abs(end - course.start) * (FIRST if watch is not None and watch.looks else UNSEEN)
    if watch is None and sample != "steps" and offers(stepper, Interruptible):
        stepper.time_limit, length = SOON, np.inf
    while course.made < grid.size and course.status is Status.FINISHED:
        piece, how, count = grid[course.made :], sample, grid.size - course.made
        if length < np.inf:
            piece, how, count = _next_piece(grid, course.made, course.here, length, sample, by_steps)
        began = perf_counter()
        samples = stepper.advance(piece, sample=how)
        if length < np.inf:
            length *= _growth(perf_counter() - began)
        course.status, course.reason = samples.status, samples.reason
        in_time = how == "steps" or samples.t.size == piece.size
        reached = (piece if in_time else samples.t)[-1] if course.status is Status.FINISHED else stepper.t
        course.here = float(reached)
        if how == sample:
            course.add(samples, stepper)
            course.made += count if sample == "steps" else samples.t.size
        yield samples


def _lost(problem: Problem, method: MethodBase, samples: Samples, steps: int) -> Losses:
    """Return what the method conserves and has lost at the last of some states."""
    return lost_invariants(
        problem.system, method.conserved(problem.system), problem.y0[None], samples.t[-1:],
        samples.y[None, -1:], problem.par[None], np.array([steps]),
    )[0]  # fmt: skip


def prepared(method: MethodBase, system: System) -> tuple[Program, float | None]:
    """Return the method compiled for the system, and the seconds it took if that was for an earlier call.

    The last programs of a system are kept with it, and end with it.
    """
    programs = vars(system).setdefault("_programs", {})
    if (program := programs.get(method)) is not None:
        return program, program.compile_seconds
    program = method.compile(system)
    if len(programs) >= PROGRAMS:
        programs.pop(next(iter(programs)), None)
    programs[method] = program
    return program, None


def wanted_events(events: Any, sample: str | None) -> dict[str, Event]:
    """Return the events to look for, by name."""
    if isinstance(events, tuple | list) and not events:
        return {}
    if sample == "stop":
        raise InputError(
            "events are located on the method's steps, which sample='stop' changes; use 'partial'."
        )
    return named(events)


def started(
    program: Program, method: MethodBase, problem: Problem, events: dict[str, Event],
    y: Array, par: Array, t: float, end: float,
) -> Any:  # fmt: skip
    """Return a stepper at a start; what a function of the user raises there is raised."""
    try:
        if events:
            return started_with_events(program, method, problem, events)(y, par, t, end)
        return program.start(y, par, t)
    except UserError as raised:
        raise raised.error from None


def _goes_by_steps(stepper: Any, sample: str | None) -> bool:
    """Whether steps can be taken between two samples, and change nothing of the samples."""
    ways = stepper.samplings if offers(stepper, Samplings) else SAMPLINGS
    return "steps" in ways and (sample or ways[0]) != "stop"


def _next_piece(
    grid: Array, taken: int, here: float, length: float, sample: str | None, by_steps: bool
) -> tuple[Array, str | None, int]:
    """Return the times of the next piece, how to sample them, and how many of the grid they serve.

    A piece goes on for about ``length``: to the samples that lie there, or else by steps, or else to
    the next sample. So pieces give the bits of one call of ``advance``.
    """
    sign = 1.0 if grid[-1] >= here else -1.0
    if taken == grid.size - 1 and sample != "steps" and not by_steps:
        return grid[taken:], sample, grid.size - taken
    goal = here + sign * length
    count = int(np.count_nonzero(sign * (grid[taken:] - goal) <= 0.0))
    if sample == "steps":
        done = sign * (goal - grid[-1]) >= 0.0
        last = grid[-1] if done else goal
        piece = np.array([here, last] if grid[0] == here != last else [last])
        return piece, sample, grid.size if done else 0
    if count == 0 and by_steps and goal != here:
        return np.array([goal]), "steps", 0
    count = max(count, 1)
    return grid[taken : taken + count], sample, count


def _growth(seconds: float) -> float:
    """Return by what factor the next piece is longer, after one that took so long."""
    return 4.0 if seconds < SOON / 4.0 else 0.5 if seconds > 2.0 * SOON else 1.0


def _with_events(solution: Solution, search: Finder, *, keeps: bool) -> Solution:
    """Return the solution with what a search for events has found, up to where it ended.

    A terminal event before all samples leaves its own state, if one is to be kept.
    """
    end = Ending.from_search(search, solution.status, solution.reason, solution.problem.t0, solution.t_stop)
    n = end.count(solution.t, search)
    t, y = solution.t[:n], solution.y[:n]
    vectors = None if solution.variations is None else solution.variations[:n]
    if keeps and not n and end.status is Status.EVENT:
        stop, last = search.hits.last()
        t, y = np.array([stop]), last[np.newaxis]
        if vectors is not None:
            ended = replace(solution, t=solution.t[:0], y=solution.y[:0], variations=vectors, t_stop=stop)
            vectors = ended.variations_at(t)
    found = {
        "t": t, "y": y, "status": end.status, "reason": end.reason, "t_stop": end.stop,
        "events": search.hits.occurrences(), "error": end.error or solution.error, "variations": vectors,
    }  # fmt: skip
    solution.stats.extra = {**solution.stats.extra, "event_search": search.work()}
    return solution_of(**(vars(solution) | found))


def _grid(problem: Problem, times: ArrayLike | None) -> Array:
    """Return the times to sample at: the user's, the problem's, or the default."""
    if times is None:
        times = problem.times
    grid = plain_numbers("times", problem.t_end if times is None else times)
    if grid.ndim == 0:
        if not isfinite(grid):
            raise InputError(f"times={shown(times)} is no end; give a finite time.")
        grid = _equidistant(problem.t0, float(grid))
    size = grid.size * problem.system.dim
    if size > UNLIMITED:
        limits.check(
            f"a solution of {grid.size} times and {problem.system.dim} components", "GIB", 8 * size / 2**30
        )
    return grid


@lru_cache(maxsize=64)
def _equidistant(t0: float, end: float) -> Array:
    return np.linspace(t0, end, 1 if end == t0 else DEFAULT_SAMPLES)
