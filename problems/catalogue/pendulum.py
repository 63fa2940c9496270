"""The mathematical pendulum, with its exact solution in elliptic functions.

H(q, p) = p^2/2 - cos q
"""

from typing import Any

from problems.entry import Expected, entry
from problems.errors import InputError
from problems.picture import Phase
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian


def _energy(q, p, m):
    return p[0] ** 2 / 2 - m.cos(q[0])


@entry(
    title="the pendulum",
    references=(
        "E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, 2nd edition, "
        "Springer 2006, section I.1",
    ),
    notes="Not polynomial; an exact solution in elliptic functions for swings from below.",
    shows=("q", "p"),
    picture=Phase(span=11.0, points=600),
    expected=Expected(h=0.2, energy=2e-15, default=4e-15),
)
def pendulum(*, q: float = 0.0, p: float = 1.9, t_end: float = 1000.0) -> Problem:
    """Return the pendulum of unit length, mass and gravity.

    Tests the smallest system that is not polynomial. It swings over the top for
    an energy above 1; ``p = 1.9`` from below is a wide swing near that separatrix.

    Parameters
    ----------
    q, p : float
        Angle from the vertical, in radians, and momentum at the start.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State ``[q, p]``; invariant: energy.
    """
    return Problem(Hamiltonian(_energy, dof=1, name="pendulum"), q0=[q], p0=[p], t_end=t_end)


def exact_state(problem: Problem, t: Any) -> list[Any]:
    """Return the exact state of a pendulum that starts at the bottom and does not turn over.

    ``sin(q/2) = k sn(t, k)`` and ``p = 2 k cn(t, k)`` with ``k = p0/2``. mpmath numbers
    at mpmath's present precision.

    Raises
    ------
    problems.errors.InputError
        If it starts elsewhere, or turns over.
    """
    import mpmath

    q0, p0 = problem.y0.tolist()
    if q0 != 0.0 or not 0.0 < abs(p0) < 2.0:
        raise InputError(f"{problem!r} has no simple exact solution; start at q=0 with 0 < |p| < 2.")
    k = mpmath.mpf(p0) / 2
    since = mpmath.mpf(t) - mpmath.mpf(problem.t0)
    sn = mpmath.ellipfun("sn", since, k=abs(k))
    return [2 * mpmath.asin(k * sn), 2 * k * mpmath.ellipfun("cn", since, k=abs(k))]
