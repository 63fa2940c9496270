"""Three pendulums in a chain, from their Lagrangian; SciPy solves M(q) q'' = F at every step instead."""

import numpy as np
from scipy.integrate import solve_ivp
from side_by_side import clocked

import integrators
import problems

N = 3


def L(q, v, m):
    """Return kinetic minus potential energy, for masses, lengths and gravity of 1."""
    energy, x, y = 0.0, 0.0, 0.0
    for i in range(N):
        x, y = x + m.cos(q[i]) * v[i], y + m.sin(q[i]) * v[i]  # velocity of mass i
        energy = energy + (x**2 + y**2) / 2 + (N - i) * m.cos(q[i])
    return energy


def by_hand(t, y):
    """Return the derivative, with the mass matrix worked out on paper."""
    q, v = y[:N], y[N:]
    i = np.arange(N)
    below = N - np.maximum.outer(i, i)
    gap = q[:, None] - q[None, :]
    force = -(below * np.sin(gap)) @ v**2 - (N - i) * np.sin(q)
    return np.concatenate([v, np.linalg.solve(below * np.cos(gap), force)])


def main() -> None:
    """Integrate it, and compare with SciPy."""
    start = np.array([0.5, 0.8, -0.3])
    chain = problems.Problem(problems.Lagrangian(L, dof=N), q0=start, v0=np.zeros(N), t_end=10.0)
    method = integrators.HBVM()
    solution = clocked("HBVM()", lambda: integrators.integrate(chain, method))
    scipys = clocked(
        "SciPy's DOP853",
        lambda: solve_ivp(
            by_hand, (0.0, 10.0), np.append(start, np.zeros(N)), method="DOP853", rtol=1e-12, atol=1e-13
        ),
    )
    end = np.append(solution.q[-1], solution.v[-1])
    print(f"the same trajectory as SciPy's: {np.abs(end - scipys.y[:, -1]).max() < 1e-9}")
    print(f"energy kept: {solution.errors()['energy'].max() < 1e-14}")


if __name__ == "__main__":
    main()
