"""Nonlinear wave equations on a periodic interval, discretised in space.

    H(q, p) = sum_i p_i^2/2 + (q_{i+1} - q_i)^2/(2 dx^2) + f(q_i),   q_n = q_0

which times dx is the energy of u_tt = u_xx - f'(u) with centred differences:
q_i = u(x_i), p_i = u_t(x_i). L. Brugnano, G. Frasca Caccia, F. Iavernaro, "Energy
conservation issues in the numerical solution of the semilinear wave equation",
Applied Mathematics and Computation 270 (2015) 842-870.
"""

from collections.abc import Callable
from typing import Any

from problems.systems.hamiltonian import Hamiltonian

REFERENCES = (
    "L. Brugnano, G. Frasca Caccia, F. Iavernaro, Energy conservation issues in the numerical solution "
    "of the semilinear wave equation, Applied Mathematics and Computation 270 (2015) 842-870",
)


def hamiltonian(
    n: int, potential: Callable[[Any, Any, Any], Any], name: str, **parameters: float
) -> Hamiltonian:
    """Return the system; its parameter ``stiffness`` is 1/dx^2, and ``potential(u, par, m)`` is f."""

    def energy(q, p, par, m):
        def link(i, j):
            rise = q[j] - q[i]
            return rise * rise

        neighbours = [(i, (i + 1) % n) for i in range(n)]
        kinetic = m.sum(lambda i: p[i] * p[i] / 2, range(n))
        bent = par.stiffness / 2 * m.sum(link, neighbours)
        return kinetic + (bent + m.sum(lambda i: potential(q[i], par, m), range(n)))

    return Hamiltonian(energy, dof=n, parameters=parameters, name=f"{name}_{n}")
