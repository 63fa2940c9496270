"""A thousand particles in a ring of nonlinear springs, with a fast localised wave; sums stay loops.

Masses, springs and distances are 1: times are in units of sqrt(mass/stiffness).
"""

import numba
import numpy as np
from scipy.integrate import solve_ivp
from side_by_side import Comparison, settings, tolerances

import integrators
import problems

N, ALPHA, BETA, END = 1000, 0.25, 1.0, 100.0
TIMES = np.linspace(0.0, END, 11)


def H(q, p, par, m):
    """Return the energy: kinetic, and that of springs with a cubic and a quartic term."""
    kinetic = m.sum(lambda i: p[i] ** 2 / 2, range(N))

    def spring(i, j):
        d = q[j] - q[i]
        return d**2 / 2 + par.alpha * d**3 / 3 + par.beta * d**4 / 4

    return kinetic + m.sum(spring, [(i, (i + 1) % N) for i in range(N)])


@numba.njit
def by_hand(t, y):
    """Return the derivative."""
    dy = np.empty_like(y)
    d = y[0] - y[N - 1]
    before = d + ALPHA * d**2 + BETA * d**3
    for i in range(N):
        d = y[(i + 1) % N] - y[i]
        pull = d + ALPHA * d**2 + BETA * d**3
        dy[i], dy[N + i], before = y[N + i], pull - before, pull
    return dy


def compare() -> Comparison:
    """Integrate it with fixed steps, with heyoka, with REBOUND's leapfrog of order 8 and with SciPy."""
    ring = problems.Hamiltonian(
        H, dof=N, parameters={"alpha": ALPHA, "beta": BETA},
        invariants={"momentum": lambda p, m: m.sum(lambda i: p[i], range(N))},
    )  # fmt: skip
    place = np.arange(N) - N / 2
    pulse = problems.Problem(ring, q0=0 * place, p0=0.5 / np.cosh(place / 3) ** 2, t_end=END)

    def run(method) -> np.ndarray:
        return integrators.integrate(pulse, method, TIMES).y

    def by_scipy(tol: float) -> np.ndarray:
        return solve_ivp(by_hand, (0.0, END), pulse.y0, "DOP853", TIMES, rtol=tol, atol=1e-2 * tol).y.T

    exact = run(integrators.Gauss(s=8, h=0.1))

    def error(y: np.ndarray) -> float:
        return np.abs(y - exact).max()

    def energy(y: np.ndarray) -> float:
        return pulse.errors(y)["energy"].max()

    made = Comparison("A lattice: a ring of 1,000 masses", "states at 11 times", 1e-7)
    for library, methods in (
        ("HBVM", [integrators.HBVM(k=8, s=4, h=h) for h in (0.25, 0.35, 0.5, 0.7)]),
        ("Gauss", [integrators.Gauss(s=4, h=h) for h in (0.25, 0.35, 0.5, 0.7)]),
        ("heyoka", [integrators.Taylor(tol=tol, compact_mode=True) for tol in (1e-8, 1e-7, 1e-6, 1e-5)]),
        ("REBOUND's leapfrog", [integrators.Leapfrog(order=8, h=h) for h in (0.1, 0.2, 0.25, 0.3)]),
    ):
        made.add(library, settings(run, *methods), error, energy)
    made.add("SciPy's DOP853", tolerances(by_scipy, 3e-9, 1e-9, 1e-10, 1e-11), error, energy)
    return made


if __name__ == "__main__":
    print(compare())
