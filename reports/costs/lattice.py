"""A lattice whose rows are blocks of their own: the discrete nonlinear Schroedinger equation."""

import numpy as np

from problems import Hamiltonian, Problem


def lattice(n: int, t_end: float = 10.0) -> Problem:
    """Return the discrete nonlinear Schroedinger equation on a ring of n places, from a rough start."""

    def energy(q, p, m):
        hops = m.sum(lambda i: q[i] * q[i + 1] + p[i] * p[i + 1], range(n - 1))
        squares = m.sum(lambda i: (q[i] ** 2 + p[i] ** 2) ** 2, range(n))
        return hops + q[n - 1] * q[0] + p[n - 1] * p[0] - squares / 4

    return Problem(
        Hamiltonian(energy, dof=n, name=f"lattice_{n}"),
        y0=0.5 * np.random.default_rng(1).standard_normal(2 * n),
        t_end=t_end,
        title=f"lattice of {n} places",
    )
