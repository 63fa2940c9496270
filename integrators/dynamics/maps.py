"""Indicators of chaos over many starts or parameters."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from integrators import registry
from integrators.dynamics.indicators import SAMPLES, Indicator, finite_time_exponent, gali, megno, sali
from integrators.options import Count
from integrators.protocol import Array, MethodBase, Status, check_problem
from integrators.running.integrate import SECONDS, NotNegative
from integrators.running.many import members
from integrators.running.watch import Bar, Report, Watch, identity, read
from problems.checks import NOTHING, File, Named, Word, at_least, checked_arguments
from problems.errors import InputError, shown, unknown
from problems.problem import Problem

INDICATORS: dict[str, Callable[..., Indicator]] = {
    "megno": megno,
    "sali": sali,
    "gali": gali,
    "finite_time_exponent": finite_time_exponent,
}


@dataclass(frozen=True, eq=False)
class IndicatorMap:
    """An indicator of many trajectories.

    Attributes
    ----------
    values : ndarray, shape (n,)
        The indicator at the end of each; NaN where it did not arrive there.
    status : list of Status
        How each ended.
    reason : list of str
        A sentence on each failure, else empty.
    starts : ndarray, shape (n, dim)
        Their starts.
    par : ndarray, shape (n, n_par)
        Their parameters.
    warning : str
        Why the last checkpoint was not written, if it was not.
    """

    values: Array
    status: list[Status]
    reason: list[str]
    starts: Array
    par: Array
    warning: str


@checked_arguments
def indicator_map(
    problem: Problem,
    indicator: Annotated[str, Word("indicator", tuple(INDICATORS))],
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
    """Return an indicator of chaos for many starts, or values of parameters.

    Every trajectory is integrated by itself, as many at once as there are threads. Compiled steps run in
    parallel; what Python does between them does not, so threads gain less where trajectories are short.

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
        ``checkpoint`` is the same path, start from the beginning. Only give a file that you made: it is a
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
    method = registry.create("HBVM") if method is None else method
    check_problem(problem, method)
    if indicator not in INDICATORS:
        raise unknown("indicator", indicator, tuple(INDICATORS))
    if k is not None and indicator != "gali":
        raise InputError(f"k={k} is the order of indicator='gali'; leave it out for {indicator!r}.")
    if not callable(progress) and not isinstance(progress, bool):
        raise InputError(f"progress={shown(progress)} must be True, False or a function of the progress.")
    rows, par = members("indicator_map", problem, starts, parameters)
    options: dict[str, Any] = {"t_end": t_end, "samples": samples} | ({} if k is None else {"k": k})
    n = len(rows)
    state: dict[str, Any] = {
        "values": np.full(n, np.nan),
        "status": [Status.INTERRUPTED] * n,
        "reason": ["Ctrl-C was pressed before it was at its end."] * n,
        "made": 0,
        "steps": 0,
    }
    told = np.concatenate([rows.ravel(), par.ravel()])
    belongs = identity(problem, method, told, f"{indicator} {options}", {})
    path = None if checkpoint is None else Path(checkpoint)
    earlier = None if resume is None else Path(resume)
    if earlier is not None and (earlier != path or earlier.exists()):
        state = read(earlier, belongs)
    value = partial(_value, problem, INDICATORS[indicator], method, options)
    with Bar() if progress is True else nullcontext(progress or None) as report:
        watch = Watch(0.0, float(n), report, path, every_seconds, belongs)
        try:
            with ThreadPoolExecutor(threads) as pool:
                while (first := state["made"]) < n:
                    count = threads if first else 1  # the first compiles what all need
                    here = slice(first, first + count)
                    results = list(pool.map(value, rows[here], par[here]))
                    state["values"][here] = [
                        each.value if not each.status.failed else np.nan for each in results
                    ]
                    state["status"][here] = [each.status for each in results]
                    state["reason"][here] = [each.reason for each in results]
                    state["made"] = first + len(results)
                    state["steps"] += sum(each.steps for each in results)
                    watch.keep(state)
                    watch.look(float(state["made"]), state["steps"])
        except KeyboardInterrupt:
            pass
        watch.write()
    return IndicatorMap(state["values"], state["status"], state["reason"], rows, par, watch.failure)


def _value(
    problem: Problem,
    function: Callable[..., Indicator],
    method: MethodBase,
    options: Any,
    y0: Array,
    par: Array,
) -> Indicator:
    """Return the indicator of one trajectory."""
    parameters: Any = problem.system.unpack(par)
    return function(problem.replace(y0=y0, parameters=parameters), method, **options)
