"""Lyapunov exponents by pynamicalsys, which is no dependency: ``pip install pynamicalsys``."""

from importlib.util import find_spec

import numpy as np

from integrators.protocol import Array
from problems import Problem, targets
from problems.errors import InputError

from .systems import SKIP

ON = ("lorenz", "rossler", "chen", "henon_heiles")
ATOL, RTOL = 1e-10, 1e-8  # those of the example in its documentation of rk45


def installed() -> bool:
    """Whether there is a pynamicalsys to run."""
    return find_spec("pynamicalsys") is not None


class ByPynamicalsys:
    """A problem with its Jacobian, for pynamicalsys.

    Parameters
    ----------
    problem : Problem
        Traced, from t = 0.
    """

    def __init__(self, problem: Problem):
        import numba
        from pynamicalsys import ContinuousDynamicalSystem  # type: ignore

        dim, jacobian = problem.system.dim, problem.system.jacobian()
        if jacobian is None:
            raise InputError(f"{problem.system.name} has a Jacobian with too many entries.")
        field, entries = targets.numba(problem.system, "field"), targets.numba(problem.system, jacobian)
        rows, columns = np.asarray(jacobian.rows), np.asarray(jacobian.columns)

        @numba.njit
        def slope(time: float, y: Array, par: Array) -> Array:
            out = np.empty(dim)
            field(time, y, par, out)
            return out

        @numba.njit
        def matrix(time: float, y: Array, par: Array) -> Array:
            values, full = np.empty(rows.size), np.zeros((dim, dim))
            entries(time, y, par, values)
            for i in range(rows.size):
                full[rows[i], columns[i]] = values[i]
            return full

        self._problem = problem
        self._system = ContinuousDynamicalSystem(
            equations_of_motion=slope,
            jacobian=matrix,
            system_dimension=dim,
            number_of_parameters=problem.par.size,
        )
        self._system.integrator("rk45", atol=ATOL, rtol=RTOL)

    def compile(self) -> None:
        """Compile, by a run over an interval in which nothing is learned."""
        self._exponents(SKIP + 1.0)

    def run(self) -> Array:
        """Return the exponents, the largest first; its vectors are made orthonormal after every step."""
        return self._exponents(self._problem.t_end)

    def _exponents(self, t_end: float) -> Array:
        y0, par = self._problem.y0, self._problem.par
        return np.sort(self._system.lyapunov(y0, t_end, transient_time=SKIP, parameters=par))[::-1]
