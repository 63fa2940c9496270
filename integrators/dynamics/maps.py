"""Indicators of chaos, and Lyapunov exponents, over many initial conditions or parameters."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from integrators.dynamics.divergence import Divergence
from integrators.dynamics.indicators import (
    SAMPLES,
    Indicator,
    MeanGrowth,
    finite_time_exponent,
    gali,
    megno,
    sali,
)
from integrators.dynamics.lyapunov import (
    WAVES,
    NoAveragesError,
    averaged,
    canonical_frame,
    checked_span,
    exponents_of,
    interval_ends,
)
from integrators.dynamics.many import Many, OnTheWay, Outcome, Outcomes
from integrators.dynamics.together import Together
from integrators.dynamics.vectors import random_vectors, sampling_times
from integrators.options import Count
from integrators.protocol import Array, MethodBase, Status
from integrators.running.integrate import SECONDS, NotNegative
from integrators.running.watch import Report
from problems.checks import NOTHING, File, Named, at_least, checked_arguments
from problems.errors import InputError, unknown
from problems.problem import Problem

INDICATORS: dict[str, Callable[..., Indicator]] = {
    "megno": megno,
    "sali": sali,
    "gali": gali,
    "finite_time_exponent": finite_time_exponent,
}


@dataclass(frozen=True, eq=False, kw_only=True)
class _Map:
    """What maps have in common: how the trajectories ended, and a picture."""

    status: list[Status]
    reason: list[str]
    starts: Array
    par: Array
    warning: str

    @property
    def _drawn(self) -> Array:
        """One value of each trajectory."""
        raise NotImplementedError

    def draw(self, x: ArrayLike, y: ArrayLike, axes: Any = None, **options: Any) -> Any:
        """Draw the values, or the largest exponents, over a grid with matplotlib.

        Parameters
        ----------
        x, y : array_like, shapes (n_x,), (n_y,)
            The grid, whose points are the trajectories in this order: all of y for each x, as
            `problems.bodies.starts` has them for ``Orbit(a=x[:, np.newaxis], e=y)``.
        axes : matplotlib.axes.Axes, optional
            By default the current ones.
        **options
            For ``pcolormesh``, such as ``vmin`` and ``cmap``.

        Returns
        -------
        matplotlib.collections.QuadMesh

        Raises
        ------
        problems.errors.InputError
            If the grid has another number of points.
        """
        across, up = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        if across.ndim != 1 or up.ndim != 1 or across.size * up.size != len(self.status):
            raise InputError(
                f"a grid of shapes {across.shape} and {up.shape} does not have the {len(self.status)} points "
                "of the map."
            )
        import matplotlib.pyplot as plt  # only who draws waits for it

        axes = plt.gca() if axes is None else axes
        grid = self._drawn.reshape(across.size, up.size).T
        return axes.pcolormesh(across, up, grid, **{"shading": "nearest", "rasterized": True, **options})


@dataclass(frozen=True, eq=False, kw_only=True)
class IndicatorMap(_Map):
    """An indicator of many trajectories.

    Attributes
    ----------
    values : ndarray, shape (n,)
        The indicator at the end of each; NaN if the integration failed.
    status : list of Status
        How each ended.
    reason : list of str
        A sentence on each failure, else empty.
    starts : ndarray, shape (n, dim)
        Their initial conditions.
    par : ndarray, shape (n, n_par)
        Their parameters.
    warning : str
        Why the last checkpoint was not written, if it was not.
    """

    values: Array

    @property
    def _drawn(self) -> Array:
        return self.values


@dataclass(frozen=True, eq=False, kw_only=True)
class ExponentMap(_Map):
    """Lyapunov exponents of many trajectories.

    Attributes
    ----------
    exponents : ndarray, shape (n, count)
        Of each, in 1/time, the largest first; NaN if the integration failed.
    intervals : ndarray, shape (n, count, 2)
        Each with 95 % confidence, or a bound of convergence, as in `Exponents`.
    sum, divergence, pairs : ndarray, shape (n,)
        As in `Exponents`; NaN where that has ``None``.
    status, reason, starts, par, warning
        As in `IndicatorMap`.
    """

    exponents: Array
    intervals: Array
    sum: Array
    divergence: Array
    pairs: Array

    @property
    def _drawn(self) -> Array:
        return self.exponents[:, 0]


@checked_arguments
def indicator_map(
    problem: Problem,
    indicator: str,
    method: MethodBase | None = None,
    *,
    starts: ArrayLike | None = None,
    parameters: Named[ArrayLike] = NOTHING,
    t_end: float | None = None,
    samples: Annotated[int, at_least(2)] = SAMPLES,
    k: Annotated[int, at_least(2)] | None = None,
    threads: Count = 1,
    progress: bool | Report = False,
    checkpoint: File | None = None,
    every_seconds: NotNegative = SECONDS,
    resume: File | None = None,
) -> IndicatorMap:
    """Return an indicator of chaos for many initial conditions, or values of parameters.

    With a fixed step size ``"megno"`` is computed in SIMD lanes, if the components of a trajectory and its
    vector are at most 64 (half of them in second-order form): see `megno_map`. Otherwise every trajectory is
    integrated by itself, as many at once as there are threads. Compiled steps run in parallel; what Python
    does between them does not, so threads gain less where trajectories are short.

    Parameters
    ----------
    problem : Problem
        What to integrate; traced.
    indicator : {"megno", "sali", "gali", "finite_time_exponent"}
        Which; see the functions of these names in `integrators.dynamics`.
    method : MethodBase, optional
        `Gauss` or `HBVM`; by default ``HBVM()``.
    starts, parameters
        As in `integrators.integrate_many`.
    t_end : float, optional
        The end; by default the problem's.
    samples : int
        At which the vectors are looked at on the way.
    k : int, optional
        Order of ``"gali"``, 2 by default.
    threads : int
        How many trajectories at once.
    progress : bool or callable
        Whether to show a bar on a terminal, or what is called with an `integrators.Progress`, whose ``t`` is
        the number of trajectories that are at their end.
    checkpoint : path, optional
        A file that is written every so many seconds, at the end and at Ctrl-C.
    every_seconds : float
        Seconds from one file to the next, at least.
    resume : path, optional
        Go on from the checkpoint in this file, of the same arguments. If there is no such file and
        ``checkpoint`` is the same path, start from the beginning. Only load files that you trust: it is a
        pickle.

    Returns
    -------
    IndicatorMap
        After Ctrl-C, which waits for the trajectories under way, with the status ``INTERRUPTED`` for the
        others.

    Raises
    ------
    problems.errors.InputError
        For a method or a system without variations, and starts, parameters, times or files that cannot be
        used.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss
    >>> from integrators.dynamics import indicator_map
    >>> starts = [[0.0, 0.1, 0.1, 0.0], [0.0, 0.5, 0.35611546, 0.19454676]]
    >>> henon_heiles = problems.load("henon_heiles")
    >>> found = indicator_map(henon_heiles, "sali", Gauss(s=6, h=0.25), starts=starts, t_end=500.0)
    >>> (found.values > 1e-6).tolist()
    [True, False]
    """
    if indicator not in INDICATORS:
        raise unknown("indicator", indicator, tuple(INDICATORS))
    if k is not None and indicator != "gali":
        raise InputError(f"k={k} is the order of indicator='gali'; leave it out for {indicator!r}.")
    options: dict[str, Any] = {"t_end": t_end, "samples": samples} | ({} if k is None else {"k": k})
    many = Many.of("indicator_map", problem, method, starts, parameters, threads)
    in_lanes = partial(_megno, many, t_end) if indicator == "megno" else None
    state, warning = many.followed(
        f"{indicator} {options}", (), random_vectors(problem.system.dim, 1), in_lanes,
        partial(_indicator, INDICATORS[indicator], many.method, options),
        OnTheWay(progress, checkpoint, every_seconds, resume),
    )  # fmt: skip
    return IndicatorMap(values=state["values"], **many.ends(state), warning=warning)


@checked_arguments
def megno_map(
    problem: Problem,
    method: MethodBase | None = None,
    *,
    starts: ArrayLike | None = None,
    parameters: Named[ArrayLike] = NOTHING,
    t_end: float | None = None,
    threads: Count = 1,
    progress: bool | Report = False,
    checkpoint: File | None = None,
    every_seconds: NotNegative = SECONDS,
    resume: File | None = None,
) -> IndicatorMap:
    """Return MEGNO for many initial conditions, or values of parameters, of a problem with any forces.

    It is ``indicator_map(problem, "megno", ...)``; see there for parameters, returns and errors.

    Examples
    --------
    >>> import numpy as np
    >>> from integrators import Gauss
    >>> from integrators.dynamics import megno_map
    >>> from problems import nbody
    >>> from problems.bodies import J2, Orbit, starts
    >>> orbits, flat = [Orbit(a=1.0), Orbit(a=0.6)], J2(1e-3, 0.01)
    >>> sun = nbody([1.0, 1e-3], orbits=orbits, massless=1, forces=[flat], t_end=99.0)
    >>> a, e = np.array([0.5, 0.85]), np.array([0.0, 0.1])
    >>> grid = starts(sun, -1, Orbit(a=a[:, np.newaxis], e=e))
    >>> found = megno_map(sun, Gauss(s=6, h=0.2), starts=grid)
    >>> found.values.reshape(2, 2).shape
    (2, 2)
    """
    return indicator_map(
        problem, "megno", method, starts=starts, parameters=parameters, t_end=t_end, threads=threads,
        progress=progress, checkpoint=checkpoint, every_seconds=every_seconds, resume=resume,
    )  # fmt: skip


@checked_arguments
def lyapunov_map(
    problem: Problem,
    method: MethodBase | None = None,
    *,
    starts: ArrayLike | None = None,
    parameters: Named[ArrayLike] = NOTHING,
    count: Annotated[int, at_least(1)] | None = None,
    t_end: float | None = None,
    skip: float = 0.0,
    threads: Count = 1,
    progress: bool | Report = False,
    checkpoint: File | None = None,
    every_seconds: NotNegative = SECONDS,
    resume: File | None = None,
) -> ExponentMap:
    """Return Lyapunov exponents with intervals for many initial conditions or parameters.

    With a fixed step size, and fewer exponents than components, trajectories are integrated in SIMD lanes, if
    the components of a trajectory and its vectors are at most 64 (half of them in second-order form).
    Otherwise every trajectory is integrated by itself, as many at once as there are threads. A grid is a list
    of its points here, such as `problems.bodies.starts` returns.

    Parameters
    ----------
    problem : Problem
        What to integrate; traced.
    method : MethodBase, optional
        `Gauss` or `HBVM`; by default ``HBVM()``.
    starts, parameters
        As in `integrators.integrate_many`.
    count, t_end, skip
        As in `integrators.lyapunov`.
    threads, progress, checkpoint, every_seconds, resume
        As in `indicator_map`.

    Returns
    -------
    ExponentMap
        After Ctrl-C, which waits for the trajectories under way, with the status ``INTERRUPTED`` for the
        others.

    Raises
    ------
    problems.errors.InputError
        For a method or a system without variations, more exponents than components, and starts, parameters,
        times or files that cannot be used.

    Examples
    --------
    >>> import problems
    >>> from integrators import Gauss
    >>> from integrators.dynamics import lyapunov_map
    >>> starts = [[0.0, 0.1, 0.1, 0.0], [0.0, 0.5, 0.35611546, 0.19454676]]
    >>> henon_heiles, method = problems.load("henon_heiles"), Gauss(s=6, h=0.25)
    >>> found = lyapunov_map(henon_heiles, method, starts=starts, count=1, t_end=1000.0)
    >>> (found.intervals[:, 0, 0] > 0.0).tolist()
    [False, True]
    """
    many = Many.of("lyapunov_map", problem, method, starts, parameters, threads)
    n, end = checked_span(problem, count, t_end, skip)
    in_lanes = partial(_largest, many, end, skip, n) if n < problem.system.dim else None
    state, warning = many.followed(
        f"lyapunov {(n, end, skip)}", (3 * n + 3,),
        canonical_frame(problem.system.dim, problem.system.dof)[:, :n], in_lanes,
        partial(_exponents, many.method, n, end, skip), OnTheWay(progress, checkpoint, every_seconds, resume),
    )  # fmt: skip
    exponents, low, high, checks = np.split(state["values"], [n, 2 * n, 3 * n], axis=1)
    return ExponentMap(
        exponents=exponents,
        intervals=np.stack([low, high], axis=2),
        sum=checks[:, 0],
        divergence=checks[:, 1],
        pairs=checks[:, 2],
        **many.ends(state),
        warning=warning,
    )


def _all_steps(problem: Problem, method: MethodBase, t_end: float | None) -> Array:
    """Return the ends of the steps up to the last one that `sampling_times` has."""
    h = method.options(defaults=True)["h"]
    last = round((sampling_times(problem, method, t_end, 2)[-1] - problem.t0) / h)
    return problem.t0 + h * np.arange(1, last + 1)


def _megno(many: Many, t_end: float | None, together: Together, rows: Array, par: Array) -> Outcomes:
    """Return MEGNO of several trajectories in lanes."""
    t0, times = many.problem.t0, _all_steps(many.problem, many.method, t_end)
    followed, mean = together.follow(rows, par, times), MeanGrowth(len(rows))
    before, values = np.zeros((len(rows), 1)), np.full(len(rows), np.nan)
    for part, _, growth in followed:
        lengths = before + growth[:, :, 0]
        before = lengths[:, -1:]
        values = mean.after(times[part] - t0, lengths)[:, -1]
    failed = np.array([status.failed for status in followed.status])
    return np.where(failed, np.nan, values), followed.status, followed.reason, followed.steps


def _largest(
    many: Many, end: float, skip: float, n: int, together: Together, rows: Array, par: Array
) -> Outcomes:
    """Return the largest exponents of several trajectories in lanes, as `_exponents` does of one."""
    problem = many.problem
    times = together.steps_until(interval_ends(problem, end))
    followed, values = together.follow(rows, par, times), np.full((len(rows), 3 * n + 3), np.nan)
    if np.count_nonzero(times >= problem.t0 + skip) <= 2 * WAVES:
        raise InputError(f"there are too few steps after skip={skip!r}: give a later t_end or shorter steps.")
    grown = np.full((len(rows), times.size, n), np.nan)
    states = np.full((len(rows), times.size, problem.system.dim), np.nan)
    for part, there, growth in followed:
        grown[:, part], states[:, part] = np.diff(growth, axis=1, prepend=0.0), there
    first = int(np.searchsorted(times, problem.t0 + skip))
    for i, status in enumerate(followed.status):
        if not status.failed:
            exponents, intervals, _, _ = averaged(problem.t0 + skip, times, grown[i], False)
            parameters: Any = problem.system.unpack(par[i])
            known = Divergence(problem.replace(parameters=parameters))
            divergence = known.mean(times[first:], states[i, first:])
            checks = [exponents.sum(), divergence]
            values[i, : 3 * n + 2] = np.concatenate([exponents, *intervals.T, checks])
    return values, followed.status, followed.reason, followed.steps


def _indicator(
    function: Callable[..., Indicator], method: MethodBase, options: Any, problem: Problem
) -> Outcome:
    """Return the indicator of one trajectory."""
    found = function(problem, method, **options)
    return np.nan if found.status.failed else found.value, found.status, found.reason, found.steps


def _exponents(method: MethodBase, n: int, end: float, skip: float, problem: Problem) -> Outcome:
    """Return the exponents, both ends of their intervals, sum, divergence and pairs of one trajectory."""
    nothing = np.full(3 * n + 3, np.nan)
    try:
        found = exponents_of(problem, method, n, end, skip)
    except NoAveragesError as error:
        return nothing, error.status, str(error), error.steps
    if found.status.failed:
        return nothing, found.status, found.reason, found.steps
    checks = [np.nan if check is None else check for check in (found.sum, found.divergence, found.pairs)]
    values = np.concatenate([found.exponents, *found.intervals.T, checks])
    return values, found.status, found.reason, found.steps
