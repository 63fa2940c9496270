"""Lyapunov exponents by HBVM's tangent vectors and by heyoka's variational equations, with times.

Both follow the same start to the same end, make all tangent vectors orthonormal equally often, and are
compiled before; their runs alternate in one process, on some systems with those of pynamicalsys.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hbvm_bench.measure import machine
from hbvm_bench.measure.timing import busy, interleaved, load_between, no_collection
from integrators.dynamics.lyapunov import Exponents, lyapunov
from integrators.dynamics.vectors import random_vectors
from integrators.methods.hbvm import HBVM
from integrators.protocol import Array, Status
from problems import Problem, targets
from problems.errors import InputError

from .beside_pynamicalsys import ON, ByPynamicalsys, installed
from .systems import SKIP, SYSTEMS

METHOD = HBVM()
TOLERANCE = 1e-15  # of heyoka, as in the race
SAMPLES = 3  # runs of each side that are timed


@dataclass(frozen=True, eq=False)
class Measured:
    """Results for one system.

    Attributes
    ----------
    exponents : ndarray, shape (dim,)
        Of HBVM(), in 1/time, the largest first.
    intervals : ndarray, shape (dim, 2)
        Each with 95 % confidence.
    sum : float
        Of these.
    time : float
        That they are averages over.
    heyoka : ndarray, shape (dim,)
        heyoka's.
    seconds, heyoka_seconds : list of float
        Of whole runs after compiling.
    others, stolen : float
        Time of other processes, and steal time, as shares of one core's time.
    divergence : float or None
        The mean divergence of the vector field along HBVM's trajectory; ``None`` in older results.
    pynamicalsys : ndarray or None, shape (dim,)
        pynamicalsys' exponents.
    pynamicalsys_seconds : list of float or None
        Of whole runs after compiling: none where it is not installed; ``None`` for systems that it does not
        run and in older results.
    """

    exponents: Array
    intervals: Array
    sum: float
    time: float
    heyoka: Array
    seconds: list[float]
    heyoka_seconds: list[float]
    others: float
    stolen: float
    divergence: float | None = None
    pynamicalsys: Array | None = None
    pynamicalsys_seconds: list[float] | None = None


def measured(name: str, share: float = 1.0, samples: int = SAMPLES) -> Measured:
    """Return the exponents of a system, by name, over a share of its time.

    Raises
    ------
    problems.errors.InputError
        If a side does not reach the end.
    """
    problem = SYSTEMS[name].problem(share)
    theirs = Variational(problem)
    results: dict[str, Any] = {}

    def sample(side: str, run: Callable[[], Any]) -> float:
        start = time.perf_counter()
        results[side] = run()
        return time.perf_counter() - start

    ours = partial(lyapunov, problem, METHOD, skip=SKIP)
    with machine.staying_on_a_core(), no_collection():
        runs = [("ours", ours), ("heyoka", partial(theirs.run, ours().rounds))]
        if takes_part := name in ON and installed():
            toolkit = ByPynamicalsys(problem)
            toolkit.compile()
            runs.append(("pynamicalsys", toolkit.run))
        before = busy()
        seconds = interleaved([partial(sample, *run) for run in runs], samples)
        load = load_between(before, busy())
    mine: Exponents = results["ours"]
    if mine.status is not Status.FINISHED:
        raise InputError(f"{METHOD!r} on {name} ended early: {mine.reason}")
    return Measured(
        exponents=mine.exponents,
        intervals=mine.intervals,
        sum=mine.sum,
        time=mine.time,
        heyoka=results["heyoka"],
        seconds=seconds[0],
        heyoka_seconds=seconds[1],
        others=load.others if load else 0.0,
        stolen=load.steal if load else 0.0,
        divergence=mine.divergence,
        pynamicalsys=results.get("pynamicalsys"),
        pynamicalsys_seconds=seconds[2] if takes_part else [] if name in ON else None,
    )


class Variational:
    """A problem with its variational equations of first order, compiled by heyoka.

    Parameters
    ----------
    problem : Problem
        Traced.
    """

    def __init__(self, problem: Problem):
        import heyoka as hy

        self._problem, self._dim = problem, problem.system.dim
        equations = hy.var_ode_sys(targets.heyoka(problem.system), hy.var_args.vars, order=1)
        self._taylor = hy.taylor_adaptive(equations, problem.y0.tolist(), tol=TOLERANCE)
        self._taylor.pars[:] = problem.par[: len(self._taylor.pars)]
        self._finished = hy.taylor_outcome.time_limit

    def run(self, rounds: int) -> Array:
        """Return the exponents, the largest first, of vectors that are made orthonormal so many times.

        Raises
        ------
        problems.errors.InputError
            If heyoka does not reach the end.
        """
        taylor, dim, problem = self._taylor, self._dim, self._problem
        taylor.time = problem.t0
        taylor.state[:dim] = problem.y0
        # unit vectors may lie in a subspace that the linearised flow leaves only by rounding
        taylor.state[dim:] = random_vectors(dim, dim).ravel()
        times = np.linspace(problem.t0, problem.t_end, rounds + 1)[1:]
        growth = np.zeros((times.size, dim))
        for i, t in enumerate(times.tolist()):
            if taylor.propagate_until(t)[0] != self._finished:
                raise InputError(f"heyoka ended at t = {taylor.time!r} of {problem.t_end!r}.")
            frame, triangle = np.linalg.qr(taylor.state[dim:].reshape(dim, dim))
            taylor.state[dim:] = frame.ravel()
            growth[i] = np.log(np.abs(np.diag(triangle)))
        first = int(np.searchsorted(times, problem.t0 + SKIP))
        mean = growth[first + 1 :].sum(axis=0) / (times[-1] - times[first])
        return np.sort(mean)[::-1]
