"""A stiff system: HIRES, eight reactions that light sets off in a plant, with rates from 0.0007 to 280.

The equations and the state at the end are those of F. Mazzia, C. Magherini, Test Set for Initial Value
Problem Solvers, release 2.4.
"""

import numpy as np
from side_by_side import Comparison, settings

import integrators
import problems

END = 321.8122
START = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057])
EXACT = np.array([
    7.371312573325668e-4, 1.442485726316185e-4, 5.888729740967575e-5, 1.175651343283149e-3,
    2.386356198831331e-3, 6.238968252742796e-3, 2.849998395185769e-3, 2.850001604814231e-3,
])  # fmt: skip


def reactions(y):
    """Return the derivative of the eight concentrations, for any library."""
    fast = 280.0 * y[5] * y[7]
    return [
        -1.71 * y[0] + 0.43 * y[1] + 8.32 * y[2] + 0.0007,
        1.71 * y[0] - 8.75 * y[1],
        -10.03 * y[2] + 0.43 * y[3] + 0.035 * y[4],
        8.32 * y[1] + 1.71 * y[2] - 1.12 * y[3],
        -1.745 * y[4] + 0.43 * y[5] + 0.43 * y[6],
        -fast + 0.69 * y[3] + 1.71 * y[4] - 0.43 * y[5] + 0.69 * y[6],
        fast - 1.81 * y[6],
        -fast + 1.81 * y[6],
    ]


def compare() -> Comparison:
    """Integrate it with ours and with methods for stiff systems, whose Jacobian is compiled too."""
    problem = problems.Problem(problems.VectorField(reactions, dim=8), y0=START, t_end=END)
    made = Comparison("A stiff system: HIRES", "end, relative to each concentration", 1e-8)

    def run(method) -> integrators.Solution:
        return integrators.integrate(problem, method, [END])

    made.add(
        "HBVM", settings(run, *(integrators.HBVM(tol=tol) for tol in (1e-12, 1e-10, 1e-9, 1e-8))),
        lambda solution: np.abs(solution.y[-1] / EXACT - 1.0).max(),
    )  # fmt: skip
    for library, method, tolerances in (
        ("SciPy's Radau", integrators.Radau, (1e-9, 1e-8, 1e-7, 1e-6)),
        ("SciPy's LSODA", integrators.LSODA, (1e-11, 1e-10, 3e-10, 1e-9)),
        ("SUNDIALS' CVODE", integrators.CVODE, (1e-11, 3e-11, 1e-10, 3e-10)),
    ):
        methods = [method(rtol=tol, atol=float(f"{tol / 1000:.0e}")) for tol in tolerances]
        made.add(
            library, settings(run, *methods),
            lambda solution: np.abs(solution.y[-1] / EXACT - 1.0).max(),
        )  # fmt: skip
    return made


if __name__ == "__main__":
    print(compare())
