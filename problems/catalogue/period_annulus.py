"""A planar system of degree five around a centre, and the edge of its periodic orbits.

    H(q, p) = A(p) + B(p) q + C(p) q^2 + D(p) q^3
    A = p^2 (1/2 + c3 p + b3 p^2 + a3 p^3)     B = p^2 (c2 + b2 p + a2 p^2)
    C = 1/2 + c1 p + b1 p^2 + a1 p^3           D = c0 + b0 p + a0 p^2

In the paper's section on the period annulus a2 = b1 = b3 = c1 = c2 = 1 and all other
coefficients are 0: the periodic orbits around the origin end at a loop through the saddle P1.
"""

from collections.abc import Sequence
from typing import Annotated

from problems.checks import Must
from problems.entry import Expected, entry
from problems.picture import Phase
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian

# For the default coefficients, in the order (q, p); both are saddles.
P1 = (-0.6879526475540134, -0.5206527058470621)
P2 = (-1.179582379893681, 1.756351969248087)
H_STAR = 0.09050199350868576  # H at P1: the energy of the loop
C_STAR = 0.37570559292634522367  # where the loop crosses the positive p axis

Four = Annotated[Sequence[float], Must("a list of 4 finite numbers", lambda values: len(values) == 4)]


def _energy(q, p, par):
    x, y = q[0], p[0]
    a, b, c = par.a, par.b, par.c
    constant = y**2 * (0.5 + c[3] * y + b[3] * y**2 + a[3] * y**3)
    linear = y**2 * (c[2] + b[2] * y + a[2] * y**2)
    square = 0.5 + c[1] * y + b[1] * y**2 + a[1] * y**3
    cubic = c[0] + b[0] * y + a[0] * y**2
    return constant + linear * x + square * x**2 + cubic * x**3


@entry(
    title="the edge of a period annulus",
    references=(
        "L. Brugnano, F. Iavernaro, T. Susca, Numerical comparisons between Gauss-Legendre "
        "methods and Hamiltonian BVMs defined over Gauss points",
    ),
    notes="A polynomial energy of degree 5, not separable; k >= 5s/2 keeps it exactly.",
    shows=("start",),
    picture=Phase(span=30.0, points=4000),
    expected=Expected(h=0.2, energy=2e-15, default=1e-13),
)
def period_annulus(
    *,
    start: float = 0.375,
    a: Four = (0.0, 0.0, 1.0, 0.0),
    b: Four = (0.0, 1.0, 0.0, 1.0),
    c: Four = (0.0, 1.0, 1.0, 0.0),
    t_end: float = 2500.0,
) -> Problem:
    """Return the paper's planar system of degree five, from the point (q, p) = (0, start).

    Tests exact conservation of a polynomial energy: near the saddle loop the
    energy alone decides whether an orbit is periodic.

    Parameters
    ----------
    start : float
        The paper's c, the momentum at the start. With the default coefficients the
        orbit is periodic for 0 < start < 0.37570559292634522 (`C_STAR`).
    a, b, c : sequence of 4 float
        The coefficients.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State ``[q, p]``; parameters ``a``, ``b``, ``c``; invariant: energy. The
        equilibria `P1`, `P2` and the energy of the loop `H_STAR` belong to the
        default coefficients.
    """
    system = Hamiltonian(_energy, dof=1, parameters={"a": a, "b": b, "c": c}, name="period_annulus")
    return Problem(system, q0=[0.0], p0=[start], t_end=t_end)
