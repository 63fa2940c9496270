"""The Lyapunov exponents of Lorenz's system, beside heyoka's variational equations.

And beside pynamicalsys, where it is installed: it is no dependency (``pip install pynamicalsys``).
"""

from functools import cache
from importlib.util import find_spec

import heyoka as hy
import numpy as np
from side_by_side import Comparison, tolerances

import integrators
import problems

END, SKIP, ROUND = 500.0, 20.0, 0.5
START = [1.0, 2.0, 20.0]
TOLERANCES = (1e-14, 1e-11, 1e-9, 1e-7)
KNOWN = 0.9056  # J. C. Sprott, Chaos and Time-Series Analysis, Oxford University Press 2003


def lorenz(y):
    """Return the derivative, for any library."""
    return [10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 * y[2] / 3]


@cache  # made once, as its users do
def heyokas(tol: float) -> hy.taylor_adaptive_dbl:
    """Return heyoka's integrator of the equations and of three tangent vectors."""
    variables = hy.make_vars("x", "y", "z")
    equations = list(zip(variables, lorenz(variables), strict=True))
    system = hy.var_ode_sys(equations, hy.var_args.vars, order=1)
    return hy.taylor_adaptive(system, np.array(START), tol=tol)


def by_heyoka(tol: float) -> np.ndarray:
    """Return the exponents; the vectors are made orthonormal again and again."""
    ta = heyokas(tol)
    ta.time, ta.state[:] = 0.0, [*START, *np.eye(3).ravel()]
    ta.propagate_until(SKIP)
    growth, rounds = np.zeros(3), round((END - SKIP) / ROUND)
    for i in range(1 + rounds):
        frame, triangle = np.linalg.qr(ta.state[3:].reshape(3, 3))
        growth += np.log(np.abs(np.diag(triangle))) * (i > 0)
        ta.state[3:] = frame.ravel()
        if i < rounds:
            ta.propagate_until(SKIP + (i + 1) * ROUND)
    return growth / (END - SKIP)


@cache
def pynamicalsyss(tol: float):
    """Return the system of pynamicalsys, which compiles a field and its Jacobian by numba."""
    import numba
    from pynamicalsys import ContinuousDynamicalSystem

    @numba.njit
    def field(time, u, parameters):
        return np.array([10 * (u[1] - u[0]), u[0] * (28 - u[2]) - u[1], u[0] * u[1] - 8 * u[2] / 3])

    @numba.njit
    def jacobian(time, u, parameters):
        return np.array([[-10.0, 10.0, 0.0], [28 - u[2], -1.0, -u[0]], [u[1], u[0], -8 / 3]])

    system = ContinuousDynamicalSystem(
        equations_of_motion=field, jacobian=jacobian, system_dimension=3, number_of_parameters=0
    )
    system.integrator("rk45", atol=tol, rtol=tol)
    return system


def by_pynamicalsys(tol: float) -> np.ndarray:
    """Return the exponents by pynamicalsys."""
    return pynamicalsyss(tol).lyapunov(START, END, transient_time=SKIP, parameters=np.empty(0))


def compare() -> Comparison:
    """Compute all three with both; the first one is known, and their sum is the divergence, -41/3."""
    problem = problems.Problem(problems.VectorField(lorenz, dim=3), y0=START, t_end=END)
    made = Comparison("Lyapunov exponents of Lorenz's system to t = 500", "largest exponent, and sum", 0.03)

    def error(found: np.ndarray) -> float:
        return max(abs(found[0] - KNOWN), abs(found.sum() + 41 / 3))

    def ours(tol: float) -> np.ndarray:
        return integrators.lyapunov(problem, integrators.HBVM(tol=tol), skip=SKIP).exponents

    made.add("integrators.lyapunov", tolerances(ours, *TOLERANCES), error)
    made.add("heyoka", tolerances(by_heyoka, *TOLERANCES), error)
    if find_spec("pynamicalsys"):
        made.add("pynamicalsys's RK45", tolerances(by_pynamicalsys, *TOLERANCES), error)
    return made


if __name__ == "__main__":
    print(compare())
