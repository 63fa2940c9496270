"""Integrate one problem from many starts, or with many values of its parameters."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from integrators import registry
from integrators.options import Count
from integrators.protocol import (
    Array,
    MethodBase,
    Program,
    Status,
    Trajectories,
    UserError,
    as_numbers,
    check_batch,
    check_problem,
    check_times,
)
from problems.checks import NOTHING, Named, checked
from problems.errors import InputError, shown, unknown
from problems.problem import Problem
from problems.systems.base import System

Progress = Callable[[int, int], None]


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
    """

    starts: Array
    par: Array
    compile_seconds: float
    from_cache: bool | None
    problem: Problem
    method: MethodBase

    def __len__(self) -> int:
        return len(self.status)

    @property
    def arrived(self) -> Any:
        """Which trajectories came to the last time: an array of n truth values."""
        return np.array([status is Status.FINISHED for status in self.status])


def integrate_many(
    problem: Problem,
    method: MethodBase | None = None,
    *,
    starts: ArrayLike | None = None,
    parameters: Named[ArrayLike] = NOTHING,
    times: ArrayLike | None = None,
    threads: int = 1,
    progress: Progress | None = None,
) -> Solutions:
    """Integrate ``problem`` from many starts, with parameters that may differ, to the same times.

    Trajectories of HBVM and Gauss with a fixed step and up to 16 stages go one in each lane of
    the vector unit; those of heyoka go through its batch integrator; all others one by one. What
    comes out for a trajectory depends neither on the others nor on their order or the number of
    threads; it is what `integrate` gives, up to rounding.

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
    progress : callable, optional
        Called now and then, in this thread, with the number of trajectories that are at their
        end, and of all: ``progress(done, n)``.

    Returns
    -------
    Solutions
        A trajectory that fails has its status, reason and time, and leaves the others alone.

    Raises
    ------
    problems.errors.InputError
        If the method does not accept the problem, or for starts, parameters, times or threads that cannot
        be used.
    KeyboardInterrupt
        At Ctrl-C, within a fraction of a second.

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
    system = problem.system
    threads = checked("integrate_many", "threads", threads, Count)
    given = checked("integrate_many", "parameters", parameters, Named[ArrayLike])
    values = _values(system, given)
    first, n = _number(starts, values)
    grid = check_times([problem.t_end] if times is None else times, problem.t0)
    if starts is None:
        starts = np.tile(problem.y0, (n, 1))
    rows = as_numbers("starts", starts)
    if rows.ndim != 2 or rows.shape[1] != system.dim or not n:
        raise InputError(f"starts must have shape (n, {system.dim}) with n >= 1, not {rows.shape}.")
    par = np.tile(problem.par, (n, 1))
    places = system.unpack(np.arange(system.n_par, dtype=np.float64))
    for name, value in values.items():
        if value.ndim > np.ndim(places[name]) and len(value) != n:
            raise InputError(f"parameter {name!r} has {len(value)} values, and {first} {n}; give as many.")
        par[:, np.asarray(places[name], dtype=int)] = value
    check_batch(rows, par, grid, system)
    program = method.compile(system)
    batch: Any = getattr(program, "batch", None)
    if batch is None:
        made = _one_by_one(program, rows, par, grid, problem.t0, progress)
    else:
        made = batch(rows, par, times=grid, t0=problem.t0, threads=threads, progress=progress)
    return Solutions(
        made.t, made.y, made.status, made.reason, made.t_stop, made.steps, rows, par,
        program.compile_seconds, program.from_cache, problem, method,
    )  # fmt: skip


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


def _number(starts: ArrayLike | None, values: dict[str, Array]) -> tuple[str, int]:
    """Return what says how many trajectories there are, in words, and how many."""
    if starts is not None:
        return "starts", len(np.atleast_1d(as_numbers("starts", starts)))
    counts = {name: len(value) for name, value in values.items() if value.ndim}
    if not counts:
        raise InputError("integrate_many needs starts=, an array (n, dim), or parameters= with n values.")
    name = max(counts, key=lambda name: (values[name].ndim, counts[name]))
    return f"parameter {name!r}", counts[name]


def _one_by_one(
    program: Program, starts: Array, par: Array, times: Array, t0: float, progress: Progress | None
) -> Trajectories:
    """Integrate one trajectory after the other, by a method that has no better way."""
    n = len(starts)
    y = np.full((n, times.size, starts.shape[1]), np.nan)
    status, reason, t_stop = [Status.FINISHED] * n, [""] * n, np.full(n, times[-1])
    steps = np.zeros(n, dtype=np.int64)
    for i in range(n):
        try:
            stepper = program.start(starts[i], par[i], t0)
        except UserError as raised:
            status[i], t_stop[i] = Status.USER_ERROR, t0
            reason[i] = f"{raised} at the start, t = {t0!r}."
        else:
            samples = stepper.advance(times)
            y[i, : samples.t.size] = samples.y
            status[i], reason[i], steps[i] = samples.status, samples.reason, stepper.stats.steps
            if status[i] is not Status.FINISHED:
                t_stop[i] = stepper.t
        if progress is not None:
            progress(i + 1, n)
    return Trajectories(times, y, status, reason, t_stop, steps)
