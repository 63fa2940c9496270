"""The chain of Fermi, Pasta, Ulam and Tsingou: n masses, nonlinear springs, fixed ends.

    H(q, p) = sum_{i=1..n} p_i^2/2 + sum_{i=0..n} V(q_{i+1} - q_i),   q_0 = q_{n+1} = 0
    V(r) = r^2/2 + alpha r^3/3 + beta r^4/4

By default as in the report: n = 32, alpha = 1/4, the lowest mode.
"""

import math
from typing import Annotated, Literal

from problems import limits
from problems.catalogue import _starts as starts
from problems.checks import Positive, at_least
from problems.entry import Expected, entry
from problems.picture import Lattice
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian


@entry(
    title="the Fermi-Pasta-Ulam-Tsingou chain",
    references=(
        "E. Fermi, J. Pasta, S. Ulam, Studies of nonlinear problems, Los Alamos report LA-1940 (1955)",
        "T. Dauxois, Fermi, Pasta, Ulam, and a mysterious lady, Physics Today 61 (2008) 55-57",
    ),
    notes="A polynomial energy of degree 3 or 4 in many degrees of freedom.",
    shows=("n", "alpha", "beta"),
    picture=Lattice(points=400),
    expected=Expected(h=0.5, energy=2e-16, default=2e-16, small={"n": 8, "beta": 0.5}),
)
def fput(
    *,
    n: Annotated[int, at_least(2)] = 32,
    alpha: float = 0.25,
    beta: float = 0.0,
    start: Literal["mode", "thermal"] = "mode",
    amplitude: float = 1.0,
    temperature: Positive = 0.1,
    seed: Annotated[int, at_least(0)] = 1,
    t_end: float | None = None,
) -> Problem:
    """Return the chain, from its lowest mode or from a thermal start.

    Tests a polynomial energy in many degrees of freedom; the lowest mode returns
    to itself almost (recurrence), a thermal start excites every frequency up to 2.

    Parameters
    ----------
    n : int
        Number of moving masses, at least 2; large chains are compiled as a loop.
    alpha, beta : float
        Cubic and quartic strength of the springs.
    start : {"mode", "thermal"}
        ``"mode"``: q_i = amplitude sin(pi i/(n + 1)), at rest.
        ``"thermal"``: q = 0 and independent momenta of variance ``2 temperature`` (so
        that half of the kinetic energy, about ``n temperature/2``, is left after
        equipartition), the same on every machine.
    amplitude : float
        Of the lowest mode.
    temperature : float
        Of the thermal start. With beta = 0 a spring breaks at the energy
        1/(6 alpha^2); stay well below, or give beta >= 2 alpha^2/9.
    seed : int
        Of the thermal start.
    t_end : float, optional
        End of the integration; by default 960 from the mode, 240 from the thermal start.

    Returns
    -------
    Problem
        State ``[q_1 .. q_n, p_1 .. p_n]``; parameters ``alpha``, ``beta``; invariant: energy.
    """
    limits.check_problem("fput", 2 * n, n=n)

    def energy(q, p, par, m):
        def spring(r):
            return r * r / 2 + par.alpha * r**3 / 3 + par.beta * r**4 / 4

        kinetic = m.sum(lambda i: p[i] * p[i] / 2, range(n))
        inner = m.sum(lambda i: spring(q[i + 1] - q[i]), range(n - 1))
        return kinetic + (spring(q[0]) + inner + spring(-q[n - 1]))

    if start == "mode":
        q0 = starts.nearest(lambda mp: [amplitude * mp.sin(mp.pi * i / (n + 1)) for i in range(1, n + 1)])
        p0 = [0.0] * n
    else:
        q0 = [0.0] * n
        p0 = [math.sqrt(2 * temperature) * draw for draw in starts.gaussians(seed, n)]
    if t_end is None:
        t_end = 960.0 if start == "mode" else 240.0
    system = Hamiltonian(energy, dof=n, parameters={"alpha": alpha, "beta": beta}, name=f"fput_{n}")
    return Problem(system, q0=q0, p0=p0, t_end=t_end)
