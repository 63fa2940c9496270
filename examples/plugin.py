"""A program that calls SciPy's solve_ivp, with HBVM as its method: only the argument `method` changes."""

from functools import partial

import numpy as np
from scipy.integrate import solve_ivp
from side_by_side import Comparison, tolerances

import problems
from integrators.plugins.scipy import HBVM, field
from problems.catalogue.pendulum import exact_state

END = 300.0


def compare() -> Comparison:
    """Let a pendulum swing 33 times, with a compiled right-hand side for both methods."""
    pendulum = problems.load("pendulum", t_end=END)
    fun, times = field(pendulum), np.linspace(0.0, END, 101)
    exact = np.array([exact_state(pendulum, t) for t in times])

    def run(method, tolerance: float) -> np.ndarray:
        return solve_ivp(fun, (0.0, END), pendulum.y0, method, times, rtol=tolerance, atol=tolerance).y.T

    made = Comparison("A plugin: HBVM inside SciPy's solve_ivp", "states at 101 times", 1e-8)

    def error(y: np.ndarray) -> float:
        return np.abs(y - exact).max()

    def energy(y: np.ndarray) -> float:
        return pendulum.errors(y)["energy"].max()

    made.add("HBVM", tolerances(partial(run, HBVM), 1e-12, 1e-11, 1e-10, 1e-9), error, energy)
    made.add("SciPy's DOP853", tolerances(partial(run, "DOP853"), 1e-13, 1e-12, 1e-11, 1e-10), error, energy)
    return made


if __name__ == "__main__":
    print(compare())
