"""Your own system, from its energy: a swinging Atwood machine; SciPy needs its equations by hand."""

import numba
import numpy as np
from scipy.integrate import solve_ivp
from side_by_side import Comparison, settings, tolerances

import integrators
import problems

END, START = 100.0, np.array([1.0, 1.2, 0.0, 0.0])  # length, angle and their momenta
TIMES = np.linspace(0.0, END, 501)
HEAVY = 3.0  # mass of the counterweight; the other mass and gravity are 1


def H(q, p, m, par):
    """Return the energy."""
    kinetic = p[0] ** 2 / (2 * (1 + par.heavy)) + p[1] ** 2 / (2 * q[0] ** 2)
    return kinetic + q[0] * (par.heavy - m.cos(q[1]))


@numba.njit
def by_hand(t, y):
    """Return the derivative, as it is worked out on paper."""
    length, angle, p, spin = y
    return np.array([
        p / (1 + HEAVY), spin / length**2,
        spin**2 / length**3 - HEAVY + np.cos(angle), -length * np.sin(angle),
    ])  # fmt: skip


def by_scipy(tol: float) -> np.ndarray:
    """Return the states at `TIMES` by SciPy."""
    return solve_ivp(by_hand, (0.0, END), START, "DOP853", TIMES, rtol=tol, atol=tol).y.T


def compare() -> Comparison:
    """Integrate it with ours, with SciPy and with heyoka."""
    machine = problems.Hamiltonian(H, dof=2, parameters={"heavy": HEAVY})
    problem = problems.Problem(machine, q0=START[:2], p0=START[2:], t_end=END)
    exact = integrators.integrate(problem, integrators.Gauss(s=8, h=0.01), TIMES).y

    def run(method) -> integrators.Solution:
        return integrators.integrate(problem, method, TIMES)

    def error(y) -> float:
        return np.abs(y - exact).max()

    def energy(y) -> float:
        return problem.errors(y)["energy"].max()

    made = Comparison("Your own system: a swinging Atwood machine", "state at 501 times", 1e-8)
    hbvm = [integrators.HBVM(), *(integrators.HBVM(tol=tol) for tol in (1e-12, 1e-10, 1e-8))]
    taylor = [integrators.Taylor(tol=tol, fast_math=True) for tol in (1e-15, 1e-13, 1e-11, 1e-10)]
    for library, methods in (("HBVM", hbvm), ("heyoka", taylor)):
        made.add(library, settings(run, *methods), lambda s: error(s.y), lambda s: energy(s.y))
    made.add("SciPy's DOP853", tolerances(by_scipy, 1e-13, 1e-12, 1e-11, 1e-10), error, energy)
    return made


if __name__ == "__main__":
    print(compare())
