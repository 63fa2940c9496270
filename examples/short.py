"""A short run of a general system: Lorenz's equations over ten time units, to eight digits."""

import numpy as np
from scipy.integrate import solve_ivp
from side_by_side import Comparison

import integrators
import problems

END, START = 10.0, np.array([1.0, 1.0, 1.0])


def lorenz(y):
    """Return the derivative, for any library."""
    return [10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]]


def compare() -> Comparison:
    """Integrate it with ours, with heyoka and with SciPy."""
    problem = problems.Problem(problems.VectorField(lorenz, dim=3), y0=START, t_end=END)

    def run(method) -> np.ndarray:
        return integrators.integrate(problem, method, [END])

    def by_scipy() -> np.ndarray:
        return solve_ivp(lambda t, y: lorenz(y), (0.0, END), START, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]

    exact = run(integrators.Gauss(s=12, h=0.005)).y[-1]
    made = Comparison("A short general system: Lorenz's equations to t = 10", "end", 1e-6)
    for name, method in (
        ("HBVM(tol=1e-12)", integrators.HBVM(tol=1e-12)),
        ("heyoka", integrators.Taylor(tol=1e-13)),
    ):
        made.add(name, lambda method=method: run(method), lambda made: np.abs(made.y[-1] - exact).max())
    made.add("SciPy's DOP853", by_scipy, lambda end: np.abs(end - exact).max(), calls=0)
    return made


if __name__ == "__main__":
    print(compare())
