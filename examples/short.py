"""A short run of a general system: Lorenz's equations over ten time units, to eight digits."""

import numba
import numpy as np
from scipy.integrate import solve_ivp
from side_by_side import Comparison, settings, tolerances

import integrators
import problems

END, START = 10.0, np.array([1.0, 1.0, 1.0])
TOLERANCES = (1e-11, 1e-9, 1e-8, 1e-7)


def lorenz(y):
    """Return the derivative, for any library."""
    return [10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]]


def compare() -> Comparison:
    """Integrate it with ours, with heyoka and with SciPy."""
    problem = problems.Problem(problems.VectorField(lorenz, dim=3), y0=START, t_end=END)

    def run(method) -> np.ndarray:
        return integrators.integrate(problem, method, [END])

    equations = numba.njit(lorenz)

    @numba.njit
    def compiled(t, y):
        return np.array(equations(y))

    def by_scipy(tol: float) -> np.ndarray:
        return solve_ivp(compiled, (0.0, END), START, "DOP853", rtol=tol, atol=tol).y[:, -1]

    exact = run(integrators.Gauss(s=12, h=0.005)).y[-1]
    made = Comparison("A short general system: Lorenz's equations to t = 10", "end", 1e-6)
    for library, methods in (
        ("HBVM", [integrators.HBVM(tol=tol) for tol in TOLERANCES]),
        ("heyoka", [integrators.Taylor(tol=tol, fast_math=True) for tol in TOLERANCES]),
    ):
        made.add(library, settings(run, *methods), lambda made: np.abs(made.y[-1] - exact).max())
    made.add("SciPy's DOP853", tolerances(by_scipy, *TOLERANCES), lambda end: np.abs(end - exact).max())
    return made


if __name__ == "__main__":
    print(compare())
