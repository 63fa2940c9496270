"""A chain of alternating stiff linear and soft nonlinear springs.

    H(q, p) = sum_i p_i^2/2 + omega^2/2 sum_{i=1..m} x_{m+i}^2
              + 1/4 ((x_1 - x_{m+1})^4 + sum_{i=1..m-1} (x_{i+1} - x_{m+i+1} - x_i - x_{m+i})^4
                     + (x_m + x_{2m})^4)

with q = x: x_1..x_m the (scaled) positions of the stiff springs and x_{m+1}..x_{2m}
their (scaled) lengths. In the book: m = 3, omega = 50.
"""

from typing import Annotated

from problems import limits
from problems.checks import Positive, at_least
from problems.entry import Expected, entry
from problems.picture import Curves
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian


@entry(
    title="stiff and soft springs",
    references=(
        "L. Galgani, A. Giorgilli, A. Martinoli, S. Vanzini, Physica D 59 (1992) 334-348",
        "E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, 2nd edition, "
        "Springer 2006, section I.5.1",
    ),
    notes="Highly oscillatory: a polynomial energy of degree 4 with one large frequency.",
    shows=("omega",),
    picture=Curves(curves=((3, "x₄"), (4, "x₅"), (5, "x₆")), span=200.0, points=3000),
    expected=Expected(h=0.02, energy=5e-15, default=3e-14),
)
def stiff_chain(
    *, springs: Annotated[int, at_least(2)] = 3, omega: Positive = 50.0, t_end: float = 200.0
) -> Problem:
    """Return the chain with fixed ends, as in the book.

    Tests highly oscillatory motion: a method should step over the fast
    oscillations without spoiling the slow exchange of energy among the stiff springs, whose
    total oscillatory energy is an adiabatic invariant.

    Parameters
    ----------
    springs : int
        Number m of stiff springs, at least 2; 2 m degrees of freedom.
    omega : float
        Frequency of the stiff springs, positive.
    t_end : float
        End of the integration; the exchange takes a time of the order of omega.

    Returns
    -------
    Problem
        State ``[x_1 .. x_2m, y_1 .. y_2m]``, from x_1 = y_1 = y_{m+1} = 1, x_{m+1} = 1/omega
        and 0 elsewhere; parameter ``omega``; invariant: energy.
    """
    limits.check_problem("stiff_chain", 4 * springs, springs=springs)
    k = springs

    def energy(q, p, par, m):
        kinetic = m.sum(lambda i: p[i] * p[i] / 2, range(2 * k))
        stiff = par.omega * par.omega / 2 * m.sum(lambda i: q[k + i] * q[k + i], range(k))
        inner = m.sum(lambda i: (q[i + 1] - q[k + i + 1] - q[i] - q[k + i]) ** 4, range(k - 1))
        return kinetic + (stiff + ((q[0] - q[k]) ** 4 + inner + (q[k - 1] + q[2 * k - 1]) ** 4) / 4)

    q0, p0 = [0.0] * (2 * k), [0.0] * (2 * k)
    q0[0] = p0[0] = p0[k] = 1.0
    q0[k] = 1.0 / omega
    system = Hamiltonian(energy, dof=2 * k, parameters={"omega": omega}, name=f"stiff_chain_{k}")
    return Problem(system, q0=q0, p0=p0, t_end=t_end)
