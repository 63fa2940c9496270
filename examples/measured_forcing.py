"""A pendulum in a wind measured every quarter of an hour: a table in time, on whose knots steps land."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from side_by_side import clocked

import integrators
import problems

HOURS = np.linspace(0.0, 10.0, 41)
WIND = np.random.default_rng(1).uniform(-0.3, 0.3, HOURS.size)


def f(t, y, m):
    """Return the velocity, and the pull of the pendulum's weight and of a wind that its sail saturates in."""
    return [y[1], -m.sin(y[0]) + m.tanh(m.table(t, HOURS, WIND) - y[1])]


def main() -> None:
    """Integrate it, and compare with SciPy."""
    sail = problems.Problem(problems.VectorField(f, dim=2), y0=[1.0, 0.0], t_end=10.0)
    method = integrators.HBVM(tol=1e-15)
    steps = integrators.integrate(sail, method, times=[10.0], sample="steps")
    landed = np.isin(HOURS[1:], steps.t).sum()
    print(f"steps that end at a knot: {landed} of {HOURS.size - 1}")

    solution = clocked("HBVM(tol=1e-15)", lambda: integrators.integrate(sail, method, times=[10.0]))
    wind = CubicSpline(HOURS, WIND)
    scipys = clocked(
        "SciPy's DOP853",
        lambda: solve_ivp(
            lambda t, y: [y[1], -np.sin(y[0]) + np.tanh(wind(t) - y[1])],
            (0.0, 10.0), [1.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-14,
        ),
    )  # fmt: skip
    print("difference from SciPy's DOP853 at the end:", np.abs(solution.y[-1] - scipys.y[:, -1]).max())


if __name__ == "__main__":
    main()
