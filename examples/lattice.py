"""A thousand particles in a ring of nonlinear springs, with a fast localised wave; sums stay loops.

Masses, springs and distances are 1: times are in units of sqrt(mass/stiffness).
"""

import numpy as np
from side_by_side import clocked

import integrators
import problems

N = 1000


def H(q, p, par, m):
    """Return the energy: kinetic, and that of springs with a cubic and a quartic term."""
    kinetic = m.sum(lambda i: p[i] ** 2 / 2, range(N))

    def spring(i, j):
        d = q[j] - q[i]
        return d**2 / 2 + par.alpha * d**3 / 3 + par.beta * d**4 / 4

    return kinetic + m.sum(spring, [(i, (i + 1) % N) for i in range(N)])


def momentum(p, m):
    """Return the total momentum."""
    return m.sum(lambda i: p[i], range(N))


def main() -> None:
    """Integrate it with steps of a twelfth of the fastest period, and with heyoka."""
    ring = problems.Hamiltonian(
        H, dof=N, parameters={"alpha": 0.25, "beta": 1.0}, invariants={"momentum": momentum}
    )
    place = np.arange(N) - N / 2
    pulse = problems.Problem(ring, q0=0 * place, p0=0.5 / np.cosh(place / 3) ** 2, t_end=100.0)
    times = np.linspace(0.0, 100.0, 11)
    method = integrators.HBVM(k=8, s=4, h=0.25)
    ours = clocked(f"{method}", lambda: integrators.integrate(pulse, method, times))
    taylor = integrators.Taylor(compact_mode=True)
    heyokas = clocked("heyoka", lambda: integrators.integrate(pulse, taylor, times))
    print(f"largest difference of a place: {np.abs(ours.q[-1] - heyokas.q[-1]).max():.1e}")
    for name, solution in (("ours", ours), ("heyoka", heyokas)):
        print(name, *(f"{key} {error.max():.1e}" for key, error in solution.errors().items()))
    print("energy kept:", bool(ours.errors()["energy"].max() < 1e-13))


if __name__ == "__main__":
    main()
