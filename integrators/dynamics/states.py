"""States of trajectories at given times as a function that other libraries differentiate in reverse."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from integrators.dynamics.recorded import Recorded, finished, start_of_recorded
from integrators.protocol import Array, MethodBase, check_problem
from integrators.refusals import check_times
from integrators.running.integrate import prepared
from problems.problem import Problem


class StatesAt:
    """The states of trajectories at times, as a function of starts and parameters, and its adjoint.

    Both take arrays with any leading axes, which are broadcast; trajectories run in threads. Derivatives are
    those of the steps that were taken, to rounding: the backward pass takes the same steps again, and records
    them.

    Parameters
    ----------
    problem : Problem
        What to integrate; traced.
    method : MethodBase
        `Gauss` or `HBVM`.
    times : array_like, shape (m,)
        Strictly monotone from the problem's ``t0`` on.
    threads : int
        How many trajectories at once.

    Raises
    ------
    problems.errors.InputError
        For a problem that the method does not accept, and times that cannot be.
    """

    def __init__(self, problem: Problem, method: MethodBase, times: ArrayLike, threads: int):
        check_problem(problem, method)
        self.problem, self.times, self._threads = problem, check_times(times, problem.t0), threads
        self._program = prepared(method, problem.system)[0]

    def values(self, y0: ArrayLike, par: ArrayLike) -> Array:
        """Return the states, shape (..., m, dim), of starts (..., dim) and parameters (..., n_par).

        Raises
        ------
        problems.errors.InputError
            If a trajectory does not reach the last time, or the method has no adjoint.
        """
        rows, values, batch = self._rows(y0, par)
        made = self._each(lambda i: self._states(rows[i], values[i]), len(rows))
        return np.array(made).reshape(*batch, self.times.size, self.problem.system.dim)

    def pulled_back(self, y0: ArrayLike, par: ArrayLike, gradient: ArrayLike) -> tuple[Array, Array]:
        """Return derivatives by starts, (..., dim), and parameters, (..., n_par), from those by the states.

        Those of what was broadcast are not added up.

        Raises
        ------
        problems.errors.InputError
            As `values`.
        """
        rows, values, batch = self._rows(y0, par)
        slopes = np.asarray(gradient, dtype=np.float64)
        slopes = np.broadcast_to(slopes, (*batch, *slopes.shape[-2:])).reshape(-1, *slopes.shape[-2:])
        n_par = values.shape[1]

        def one(i: int) -> tuple[Array, Array]:
            return self._recorded(rows[i], values[i]).pulled_back(slopes[i], parameters=n_par > 0)

        made = self._each(one, len(rows))
        back, by_par = (np.array(part) for part in zip(*made, strict=True))
        return back.reshape(*batch, -1), by_par.reshape(*batch, n_par)

    def _rows(self, y0: ArrayLike, par: ArrayLike) -> tuple[Array, Array, tuple[int, ...]]:
        """Return starts and parameters, one of each a trajectory, and the leading axes."""
        y0, par = np.asarray(y0, dtype=np.float64), np.asarray(par, dtype=np.float64)
        batch = np.broadcast_shapes(y0.shape[:-1], par.shape[:-1])
        rows, values = (
            np.broadcast_to(part, (*batch, part.shape[-1])).reshape(-1, part.shape[-1])
            if part.shape[-1]
            else np.empty((int(np.prod(batch)), 0))
            for part in (y0, par)
        )
        return rows, values, batch

    def _states(self, y0: Array, par: Array) -> Array:
        t0, times = self.problem.t0, self.times
        stepper = start_of_recorded(self._program, y0.copy(), par.copy(), t0, float(times[-1]))
        return finished(stepper.advance(times)).y

    def _recorded(self, y0: Array, par: Array) -> Recorded:
        return Recorded(self._program, self.problem, self.times, y0=y0.copy(), par=par.copy())

    def _each(self, function: Callable[[int], Any], n: int) -> list[Any]:
        if n == 1 or self._threads == 1:
            return [function(i) for i in range(n)]
        first = function(0)  # it compiles what all need
        with ThreadPoolExecutor(self._threads) as pool:
            return [first, *pool.map(function, range(1, n))]
