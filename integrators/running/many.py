"""Integrate one problem from many initial conditions, or with many values of its parameters."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from time import perf_counter
from typing import Annotated, Any, Literal, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators import registry
from integrators.events.event import Event, named
from integrators.events.finder import started_with_events
from integrators.options import Count
from integrators.protocol import (
    Array,
    MethodBase,
    PieceSize,
    Program,
    SamplingName,
    Trajectories,
    check_problem,
    offers,
)
from integrators.reduce import Reducer, Reduction
from integrators.refusals import check_batch, check_interval, check_times
from integrators.running.integrate import SECONDS
from integrators.running.pieces import (
    Gathered,
    Remote,
    Search,
    digest,
    find_in_piece,
    find_with,
    finds_in_batches,
    in_batches,
    integrate_piece,
    integrate_with,
)
from integrators.running.variations import check as check_vectors
from integrators.running.variations import directions_of_each
from integrators.running.watch import SOON, Bar, Progress, Report, Watch, check_progress, files, identity
from integrators.solution.ensemble import Solutions
from problems.analysis.tables import check_tables
from problems.checks import NOTHING, File, Named, at_least, checked_arguments
from problems.errors import InputError, shown, unknown
from problems.problem import Problem
from problems.quantities import plain_numbers
from problems.systems.base import System

FIRST = 64  # trajectories for each thread, of the first piece
SHARES, LARGEST_PIECE = 64, 4096  # pieces for an executor, and trajectories of one
NUMBERS = 2**22  # of the states of a piece that is reduced
# Seconds of a piece, about, where nobody is told of it: lanes are idle at its end, and Ctrl-C loses it.
UNWATCHED = 0.5


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
    backend: Literal["jax"] | None = None,
    sample: SamplingName | None = None,
    reduce: Named[Reduction] = NOTHING,
    variations: Any = None,
    executor: Any = None,
    piece: Annotated[int, at_least(1)] | None = None,
    checkpoint: File | None = None,
    resume: File | None = None,
) -> Solutions:
    """Integrate ``problem`` from many initial conditions, with parameters that may differ.

    HBVM and Gauss with up to 16 stages integrate one trajectory in each SIMD lane; heyoka uses its batch
    integrator; trajectories of other methods are integrated one after another. The result of a trajectory
    and its events depend neither on the others nor on their order or the number of threads; they agree with
    those of `integrate` up to rounding, or up to the tolerance with adaptive steps. Ctrl-C ends the
    integration: finished trajectories are returned, and the others have the status ``INTERRUPTED``.

    Parameters
    ----------
    problem : Problem
        The problem to integrate, with default values of the arguments that are not given here.
    method : MethodBase, optional
        The method; ``HBVM()`` by default.
    starts : array_like, shape (n, dim), optional
        Initial states: q then p for Hamiltonian problems. Default: that of the problem.
    parameters : mapping of str to array_like, optional
        Values by name: n numbers, or one for all; of a parameter that is a list, n lists, or one.
    times : array_like, shape (m,) or (n, m), optional
        Output times, strictly monotone from the problem's ``t0`` on (forward or backward), for all
        trajectories or for each: shorter rows end with NaN. Default: the end of the problem's interval.
        Trajectories with different times are integrated one after another, as by `integrate`, or one in each
        thread.
    threads : int
        Number of threads. Methods other than HBVM and Gauss use one.
    progress : bool or callable
        True: show a progress bar on a terminal. A function: it is called repeatedly, in this thread, with an
        `integrators.Progress`: the fraction of finished trajectories, and their steps.
    events : Event or callable, or a sequence of them, optional
        Events, as in `integrate`. A terminal event ends its trajectory; states at later times are NaN. With
        adaptive steps of HBVM and Gauss, trajectories with events are integrated in SIMD lanes too, also
        where events end them or change the state. A trajectory leaves its lane and is integrated by itself
        where more than 128 events happen in a step, where the search or an action fails, or where an action
        changes a parameter that velocities depend on. With a fixed step size trajectories with events are
        integrated one after another, or one in each thread.
    backend : {"jax"}, optional
        Integrate on JAX's default device, such as a GPU: HBVM and Gauss with a fixed step. Needs diffrax.
    sample : {"partial", "steps", "stop", "dense"}, optional
        As for `integrate`; trajectories are then integrated one after another. With ``"steps"``, the ends of
        the steps of each, up to the last time: ``t`` has the shape (n, m), and NaN after the last step of
        each.
    reduce : mapping of str to Reduction, optional
        Reductions to compute in place of the states, by name: see `integrators.reduce`. Only the last states
        are stored. With times of their own a reduction over trajectories takes the first of each
        trajectory's times together, the second, and so on; with events the samples until a terminal one. The
        last digits of a mean depend on ``piece``; the results do not depend on threads or workers.
    variations : array_like, shape (dim, k) or (n, dim, k), or str, or sequence of str, optional
        As for `integrate`, at the start of each trajectory, or tangent vectors of each: ``variations`` of
        the result has the shape (n, m, dim, k). With a fixed step size trajectories are integrated in SIMD
        lanes with their vectors, if the components of a trajectory and its vectors are at most 64 (half of
        them in second-order form); the result is that of `integrate` up to rounding. With an adaptive step
        size, where the errors of the vectors would change the steps, and for larger systems they are
        integrated one after another, or one in each thread.
    executor : concurrent.futures.Executor, optional
        Executor that runs the integrations: a ``ProcessPoolExecutor``,
        ``dask.distributed.Client().get_executor()``, ... A piece whose worker dies is submitted once more; if
        that fails, its trajectories have the status ``INTERRUPTED``. The functions of events are sent by
        name, so they must be those of a module.
    piece : int, optional
        Number of trajectories that are integrated together. Default: with ``executor`` a 64th of all, between
        1 and 4096; with ``reduce`` as many as have 2**22 numbers.
    checkpoint : path, optional
        Path of a checkpoint file, written every minute and at the end, with all trajectories computed so far.
    resume : path, optional
        Continue from the checkpoint in this file, of the same ensemble, method and times: its ``INTERRUPTED``
        trajectories are integrated, the others are taken from it. If there is no such file and ``checkpoint``
        is the same path, start from the beginning. Only load files that you trust: a checkpoint is a pickle.

    Returns
    -------
    Solutions
        A trajectory that fails has its status, reason and time, and does not affect the others.

    Raises
    ------
    problems.errors.InputError
        If the method does not accept the problem, or for initial states, parameters, times, threads or a
        backend that cannot be used.

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
    check_progress(progress)
    system = problem.system
    rows, par = members("integrate_many", problem, starts, parameters)
    n, grid = len(rows), _times(problem, times, len(rows))
    for end in {float(np.nanmin(grid)), float(np.nanmax(grid))}:
        check_tables(problem.system, problem.par, problem.t0, end)
    check_batch(rows, par, np.empty(min(grid.shape[-1], 1) if reduce else grid.shape[-1]), system)
    looked_for = named(events) if not isinstance(events, Sequence) or events else {}
    _check_together(method, backend, sample, reduce, executor, looked_for, grid)
    if variations is not None and (backend is not None or looked_for or reduce or sample == "steps"):
        raise InputError(
            "variations= needs integrate's own way; leave out backend, events, reduce and 'steps'."
        )
    program: Any = _program(system, method, backend)
    if method.precision != "double":
        raise InputError(f"{method!r} integrates one trajectory at a time: use integrate.")
    directions = None
    if variations is not None:  # what cannot be is said before anything is integrated
        check_vectors(program.start(problem.y0, problem.par, problem.t0), method, sample)
        directions = directions_of_each(problem, variations, rows, par)
    start = started_with_events(program, method, problem, looked_for) if looked_for else None
    reducer = Reducer(system, reduce) if reduce else None
    belongs = identity(problem, method, grid, sample, looked_for, variations) | {
        "start": digest(rows), "parameters": digest(par),
        "reduce": ", ".join(f"{name} {item.digest}" for name, item in reduce.items()),
    }  # fmt: skip
    gathered = Gathered(problem, method, rows, par, grid, sample, reducer, directions)
    path, kept = files(checkpoint, resume, belongs)
    if kept is not None:
        gathered.restore(kept)
    watch = Watch(problem.t0, 1.0, None, path, SECONDS, belongs)
    size = _fixed_size(piece, executor, reduce, n, grid.shape[-1] * system.dim)

    def given(numbers: NDArray[np.int64]) -> tuple[Array, Array, Array]:
        return rows[numbers], par[numbers], grid if grid.ndim == 1 else grid[numbers]

    def along(numbers: NDArray[np.int64]) -> tuple[Array, Array] | None:
        return None if directions is None else (directions[0][numbers], directions[1][numbers])

    def here(numbers: NDArray[np.int64]) -> tuple[Trajectories, Any]:
        if start is None:
            vectors = along(numbers)
            return integrate_with(program, *given(numbers), problem.t0, threads, sample, vectors), None
        return find_with(start, *given(numbers), problem.t0, threads)

    if executor is not None:
        pieces = [
            (numbers, (*given(numbers), problem.t0, threads, *(() if start else (sample, along(numbers)))))
            for numbers in gathered.missing(cast("int", size))
        ]
        task, more = (
            (find_in_piece, [Search(problem, method, looked_for)]) if start else (integrate_piece, [])
        )
        pieces_ = Remote(executor, problem, method, task, *more).run(pieces)
    else:
        if start is None:
            batches = in_batches(program, grid, sample, directions)
        else:
            batches = finds_in_batches(start, grid)
        few = program.piece if offers(program, PieceSize) else FIRST * threads
        soon = SOON if progress or checkpoint is not None else UNWATCHED
        pieces_ = _local(here, gathered, few if batches else threads, size, soon)
    began = perf_counter()
    with Bar() if progress is True else nullcontext(progress or None) as report, suppress(KeyboardInterrupt):
        for numbers, result, happened in pieces_:
            gathered.take(numbers, result, happened)
            if watch.keeps:
                watch.keep(gathered.checkpoint())
            if report is not None:
                share, steps, seconds = gathered.share, gathered.steps, perf_counter() - began
                left = seconds * (1.0 - share) / share if share else float("inf")
                report(Progress(float(np.nanmax(grid)), share, steps, seconds, left))
    watch.write()
    return gathered.solutions(program.compile_seconds, program.from_cache, events=start is not None)


def _check_together(
    method: MethodBase, backend: str | None, sample: str | None, reduce: Any, executor: Any,
    events: Mapping[str, Event], grid: Array,
) -> None:  # fmt: skip
    """Refuse what cannot be asked for together.

    Raises
    ------
    problems.errors.InputError
        With the name of what to leave out.
    """
    for name, given, others in (
        ("sample", sample, {"backend": backend is not None, "events": bool(events)}),
        ("executor", executor, {"backend": backend is not None}),
    ):
        if given is not None and any(others.values()):
            other = next(other for other, is_given in others.items() if is_given)
            raise InputError(f"{name}= and {other}= do not go together; leave one of them out.")
    if events and backend is not None:
        raise InputError(f"events are not looked for with backend={backend!r}; leave it out.")
    if backend is not None and grid.ndim == 2:
        raise InputError("backend='jax' takes times of shape (m,), the same for all.")
    if sample == "steps":
        for name, reduction in reduce.items():
            if isinstance(reduction, Reduction) and reduction.over != "times":
                raise InputError(
                    f"reduce={{{name!r}: ...}} over trajectories needs as many states of each, which "
                    "sample='steps' has not; give it over='times', or leave out sample=."
                )


def _times(problem: Problem, times: ArrayLike | None, n: int) -> Array:
    """Return the times of all, (m,), or those of each, (n, m), checked."""
    given = plain_numbers("times", [problem.t_end] if times is None else times)
    if given.ndim != 2:
        if given.size:
            check_interval(problem.t0, given.item(-1))
        return check_times(given, problem.t0)
    if len(given) != n:
        raise InputError(f"times of shape {given.shape} are those of {len(given)} trajectories, not of {n}.")
    for row in given:
        there = ~np.isnan(row)
        if not there.any() or not there[: int(there.sum())].all():
            raise InputError("a row of times must be numbers, with NaN at its end only.")
        check_interval(problem.t0, row[there].item(-1))
        check_times(row[there], problem.t0)
    return given


def _fixed_size(piece: int | None, executor: Any, reduce: Any, n: int, numbers: int) -> int | None:
    """Return how many trajectories are integrated together; ``None`` where that may follow the clock."""
    if piece is not None:
        return piece
    if executor is not None:
        return max(1, min(-(-n // SHARES), LARGEST_PIECE))
    return max(1, NUMBERS // numbers) if reduce else None


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
    rows = plain_numbers("starts", np.tile(problem.y0, (n, 1)) if starts is None else starts)
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
    from integrators.plugins.diffrax.many import JaxProgram  # an optional library, and seconds to import

    return cast("Program", JaxProgram(system, method))


def _local(
    integrate: Callable[..., tuple[Trajectories, Any]],
    gathered: Gathered,
    first: int,
    size: int | None,
    soon: float,
) -> Iterator[tuple[NDArray[np.int64], Trajectories, Any]]:
    """Integrate what is missing: ``size`` at a time, or ``first`` and then what takes ``soon`` seconds."""
    (missing,) = gathered.missing(len(gathered)) or [np.empty(0, dtype=np.int64)]
    count = first if size is None else size
    while missing.size:
        before = perf_counter()
        numbers, missing = missing[:count], missing[count:]
        yield (numbers, *integrate(numbers))
        if size is None and perf_counter() - before < soon / 2.0:
            count *= 2


def _values(system: System, parameters: Any) -> dict[str, Array]:
    """Return parameters as arrays: of all trajectories along the first axis, or those of all."""
    own = system.unpack(system.pack())
    by_name: dict[str, Array] = {}
    for name, given in parameters.items():
        if name not in own:
            raise unknown(f"parameter of {system.name}", name, own)
        value = plain_numbers(f"values of parameter {name!r}", given)
        shape = np.shape(own[name])
        if value.ndim not in (len(shape), len(shape) + 1) or value.shape[value.ndim - len(shape) :] != shape:
            wanted = f"(n, {shape[0]})" if shape else "(n,)"
            raise InputError(f"parameter {name!r} must have shape {wanted}, not {value.shape}.")
        if not np.isfinite(value).all():
            raise InputError(f"parameter {name!r} must be finite numbers; got {shown(value.tolist())}.")
        by_name[name] = value
    return by_name


def _number(who: str, starts: ArrayLike | None, values: dict[str, Array]) -> tuple[str, int]:
    """Return what says how many trajectories there are, in words, and how many."""
    if starts is not None:
        return "starts", len(np.atleast_1d(plain_numbers("starts", starts)))
    counts = {name: len(value) for name, value in values.items() if value.ndim}
    if not counts:
        raise InputError(f"{who} needs starts=, an array (n, dim), or parameters= with n values.")
    name = max(counts, key=lambda name: (values[name].ndim, counts[name]))
    return f"parameter {name!r}", counts[name]
