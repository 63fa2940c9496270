"""Integrate one problem from many starts, or with many values of its parameters."""

from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from time import perf_counter
from typing import Annotated, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from integrators import registry
from integrators.caveats import lost_invariants, of_losses, warnings
from integrators.events.event import Event, named
from integrators.events.finder import started_with_events
from integrators.events.members import follow
from integrators.options import Count
from integrators.protocol import (
    Array,
    Batches,
    MethodBase,
    PieceSize,
    Program,
    Status,
    Threads,
    Trajectories,
    UserError,
    check_problem,
    offers,
    telling,
)
from integrators.refusals import as_numbers, check_batch, check_times
from integrators.running.watch import SOON, Bar, Progress, Report
from integrators.solution import Occurrences
from problems.checks import NOTHING, Named, Word, checked_arguments
from problems.errors import InputError, shown, unknown
from problems.problem import Problem
from problems.systems.base import System

FIRST = 64  # trajectories for each thread, of the first piece


@dataclass(frozen=True, eq=False)
class Solutions(Trajectories):
    """Many trajectories of a problem; see `Trajectories` for ``t``, ``y``, ``status`` and the rest.

    Attributes
    ----------
    starts : ndarray, shape (n, dim)
        Where they start.
    par : ndarray, shape (n, n_par)
        Their parameters, as `System.unpack` takes them.
    compile_seconds : float
        Seconds spent compiling, before the first step.
    from_cache : bool or None
        Whether the compiled code came from a cache; ``None`` where nothing is compiled.
    problem, method
        What was integrated, and how.
    warnings : list of tuple of str
        What to know about each trajectory although it did not fail, as `Solution.warnings`.
    events : list of dict of str to Occurrences
        What happened in each trajectory, by the events' names: nothing in one that Ctrl-C has left out.
        Empty where none were looked for.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss, integrate_many
    >>> pendulum, method = problems.load("pendulum"), Gauss(s=4, h=0.1)
    >>> made = integrate_many(pendulum, method, starts=[[0, 1], [0, 1.5]], times=[5.0])
    >>> made.y.shape, [str(status) for status in made.status]
    ((2, 1, 2), ['finished', 'finished'])
    """

    starts: Array
    par: Array
    compile_seconds: float
    from_cache: bool | None
    problem: Problem
    method: MethodBase
    events: list[dict[str, Occurrences]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.status)

    @property
    def warnings(self) -> list[tuple[str, ...]]:
        """Of each trajectory, the sentences that `integrators.Solution.warnings` would have."""
        problem = self.problem
        caveat, conserved = self.method.caveat(problem), self.method.conserved(problem.system)
        lost = lost_invariants(problem.system, conserved, self.starts, self.t, self.y, self.par, self.steps)
        return [
            warnings(problem, start, par, end, caveat, self.extra.get(i, {})) + of_losses(losses)
            for i, (start, par, end, losses) in enumerate(
                zip(self.starts, self.par, self.y[:, -1], lost, strict=True)
            )
        ]

    @property
    def arrived(self) -> Any:
        """Which trajectories came to the last time: an array of n truth values."""
        return np.array([status is Status.FINISHED for status in self.status])


@checked_arguments
def integrate_many(
    problem: Problem,
    method: MethodBase | None = None,
    *,
    starts: ArrayLike | None = None,
    parameters: Named[ArrayLike] = NOTHING,
    times: ArrayLike | None = None,
    threads: Count = 1,
    progress: bool | Report = False,
    events: Event | Callable[..., Any] | Sequence[Event | Callable[..., Any]] = (),
    backend: Annotated[str | None, Word("backend", ["jax"])] = None,
) -> Solutions:
    """Integrate ``problem`` from many starts, with parameters that may differ, to the same times.

    Trajectories of HBVM and Gauss with up to 16 stages go one in each lane of the vector unit; those
    of heyoka go through its batch integrator; all others one by one. What comes out for a
    trajectory depends neither on the others nor on their order or the number of threads; it is
    what `integrate` gives, up to rounding, or up to the tolerance where steps vary. Ctrl-C ends the
    integration: what was reached is returned, and the trajectories that are missing have the status
    ``INTERRUPTED``.

    Parameters
    ----------
    problem : Problem
        What to integrate, and the values of whatever is not given here.
    method : MethodBase, optional
        How; ``HBVM()`` by default.
    starts : array_like, shape (n, dim), optional
        States to start from: q then p for Hamiltonian problems. The problem's own by default.
    parameters : mapping of str to array_like, optional
        Values by name: n numbers, or one for all; of a parameter that is a list, n lists, or one.
    times : array_like, shape (m,), optional
        Strictly monotone times, from the problem's ``t0`` on (or back). The end of its span by default.
    threads : int
        Threads to share the work among. Other methods than HBVM and Gauss use one.
    progress : bool or callable
        Whether to show a bar on a terminal; or what is called now and then, in this thread, with an
        `integrators.Progress`: the part of the trajectories that are at their end, and their steps.
    events : Event or callable, or a sequence of them, optional
        What to look for, as in `integrate`. Trajectories then go one by one, or one in each thread, and a
        terminal event ends its own: what of ``times`` comes later is NaN.
    backend : {"jax"}, optional
        Integrate on JAX's default device, such as a GPU: HBVM and Gauss with a fixed step. Needs diffrax.

    Returns
    -------
    Solutions
        A trajectory that fails has its status, reason and time, and leaves the others alone.

    Raises
    ------
    problems.errors.InputError
        If the method does not accept the problem, or for starts, parameters, times, threads or a backend
        that cannot be used.

    Examples
    --------
    >>> import numpy as np, problems, integrators
    >>> kepler = problems.load("kepler", e=0.6)
    >>> starts = kepler.y0 * np.linspace(0.9, 1.1, 1000)[:, None]
    >>> made = integrators.integrate_many(kepler, integrators.Gauss(s=12, h=0.2), starts=starts, times=[10.0])
    >>> made.y.shape
    (1000, 1, 4)
    """
    if method is None:
        method = registry.create("HBVM")
    check_problem(problem, method)
    if not callable(progress) and not isinstance(progress, bool):
        raise InputError(f"progress={shown(progress)} must be True, False or a function of the progress.")
    system = problem.system
    rows, par = members("integrate_many", problem, starts, parameters)
    n, grid = len(rows), check_times([problem.t_end] if times is None else times, problem.t0)
    check_batch(rows, par, grid, system)
    program = _program(system, method, backend)
    looked_for = named(events) if not isinstance(events, Sequence) or events else {}
    if looked_for and backend is not None:
        raise InputError(f"events are not looked for with backend={backend!r}; leave it out.")
    start = started_with_events(program, method, problem, looked_for) if looked_for else None
    made = Solutions(
        t=grid,
        y=np.full((n, grid.size, system.dim), np.nan),
        status=[Status.INTERRUPTED] * n,
        reason=["Ctrl-C was pressed before it was at its end."] * n,
        t_stop=np.full(n, problem.t0),
        steps=np.zeros(n, dtype=np.int64),
        starts=rows,
        par=par,
        compile_seconds=program.compile_seconds,
        from_cache=program.from_cache,
        problem=problem,
        method=method,
    )
    with Bar() if progress is True else nullcontext(progress or None) as report, suppress(KeyboardInterrupt):
        _integrate(program, made, threads, report, start)
    if start is not None:
        made.events.extend({} for _ in range(n - len(made.events)))
    return replace(made, compile_seconds=program.compile_seconds, from_cache=program.from_cache)


def members(who: str, problem: Problem, starts: ArrayLike | None, parameters: Any) -> tuple[Array, Array]:
    """Return the starts, (n, dim), and the parameters, (n, n_par), that are given to a function.

    Raises
    ------
    problems.errors.InputError
        For starts or parameters of a wrong shape, and numbers of them that do not agree.
    """
    system = problem.system
    values = _values(system, parameters)
    first, n = _number(who, starts, values)
    rows = as_numbers("starts", np.tile(problem.y0, (n, 1)) if starts is None else starts)
    if rows.ndim != 2 or rows.shape[1] != system.dim or not n:
        raise InputError(f"starts must have shape (n, {system.dim}) with n >= 1, not {rows.shape}.")
    par = np.tile(problem.par, (n, 1))
    places = system.unpack(np.arange(system.n_par, dtype=np.float64))
    for name, value in values.items():
        if value.ndim > np.ndim(places[name]) and len(value) != n:
            raise InputError(f"parameter {name!r} has {len(value)} values, and {first} {n}; give as many.")
        par[:, np.asarray(places[name], dtype=int)] = value
    return rows, par


def _program(system: System, method: MethodBase, backend: str | None) -> Program:
    if backend is None:
        return method.compile(system)
    if backend != "jax":
        raise unknown("backend", backend, ["jax"])
    from integrators.plugins.diffrax.many import JaxProgram  # an optional library, and seconds to import

    return cast("Program", JaxProgram(system, method))


def _integrate(
    program: Any, made: Solutions, threads: int, report: Report | None, start: Callable[..., Any] | None
) -> None:
    """Integrate piece by piece, each of which takes about `SOON`; ``start`` where events are looked for."""
    batch: Any = program.batch if offers(program, Batches) else None
    if start is not None:
        batch = partial(_with_events, start, made)
    options = {"times": made.t, "t0": made.problem.t0}
    if offers(program, Threads) and program.threaded:
        options["threads"] = threads
    few = program.piece if offers(program, PieceSize) else FIRST * threads
    size = 1 if batch is None else threads if start is not None else few
    first, began, n = 0, perf_counter(), len(made)
    while first < n:
        before = perf_counter()
        here = slice(first, first + size)
        starts, par = made.starts[here], made.par[here]
        piece = (
            _one(program, starts[0], par[0], **options) if batch is None else batch(starts, par, **options)
        )
        for name in ("y", "status", "reason", "t_stop", "steps"):
            getattr(made, name)[here] = getattr(piece, name)
        made.extra.update({first + i: extra for i, extra in piece.extra.items() if extra})
        first = min(first + size, n)
        now = perf_counter()
        if batch is not None and now - before < SOON / 2.0:
            size *= 2
        if report is not None:
            steps, seconds = int(made.steps.sum()), now - began
            report(Progress(float(made.t[-1]), first / n, steps, seconds, seconds * (n - first) / first))


def _with_events(
    start: Callable[..., Any], made: Solutions, starts: Array, par: Array, **options: Any
) -> Trajectories:
    """Integrate some trajectories, and add what has happened in them to ``made``."""
    members = follow(start, starts, par, **options)
    made.events.extend(happened for _, happened in members)
    pieces = [piece for piece, _ in members]
    return Trajectories(
        t=made.t,
        y=np.concatenate([piece.y for piece in pieces]),
        status=[piece.status[0] for piece in pieces],
        reason=[piece.reason[0] for piece in pieces],
        t_stop=np.concatenate([piece.t_stop for piece in pieces]),
        steps=np.concatenate([piece.steps for piece in pieces]),
        extra={i: extra for i, piece in enumerate(pieces) for extra in piece.extra.values()},
    )


def _values(system: System, parameters: Any) -> dict[str, Array]:
    """Return parameters as arrays: of all trajectories along the first axis, or those of all."""
    own = system.unpack(system.pack())
    found: dict[str, Array] = {}
    for name, given in parameters.items():
        if name not in own:
            raise unknown(f"parameter of {system.name}", name, own)
        value = as_numbers(f"values of parameter {name!r}", given)
        one = np.shape(own[name])
        if value.ndim not in (len(one), len(one) + 1) or value.shape[value.ndim - len(one) :] != one:
            wanted = f"(n, {one[0]})" if one else "(n,)"
            raise InputError(f"parameter {name!r} must have shape {wanted}, not {value.shape}.")
        if not np.isfinite(value).all():
            raise InputError(f"parameter {name!r} must be finite numbers; got {shown(value.tolist())}.")
        found[name] = value
    return found


def _number(who: str, starts: ArrayLike | None, values: dict[str, Array]) -> tuple[str, int]:
    """Return what says how many trajectories there are, in words, and how many."""
    if starts is not None:
        return "starts", len(np.atleast_1d(as_numbers("starts", starts)))
    counts = {name: len(value) for name, value in values.items() if value.ndim}
    if not counts:
        raise InputError(f"{who} needs starts=, an array (n, dim), or parameters= with n values.")
    name = max(counts, key=lambda name: (values[name].ndim, counts[name]))
    return f"parameter {name!r}", counts[name]


def _one(program: Program, start: Array, par: Array, times: Array, t0: float) -> Trajectories:
    """Integrate one trajectory, by a method that has no better way."""
    y, steps = np.full((1, times.size, start.size), np.nan), np.zeros(1, dtype=np.int64)
    try:
        stepper = program.start(start, par, t0)
    except UserError as raised:
        reason = f"{raised} at the start, t = {t0!r}."
        return Trajectories(times, y, [Status.USER_ERROR], [reason], np.array([t0]), steps)
    samples = stepper.advance(times)
    y[0, : samples.t.size], steps[0] = samples.y, stepper.stats.steps
    stop = times[-1] if samples.status is Status.FINISHED else stepper.t
    made = Trajectories(times, y, [samples.status], [samples.reason], np.array([stop]), steps)
    made.extra[0] = telling(stepper.stats)
    return made
