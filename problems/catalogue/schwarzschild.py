"""A particle around a black hole: geodesics of the Schwarzschild metric in the equatorial plane.

    H(q, p) = (|p|^2 - 2 (q.p)^2/r^3 - E^2/(1 - 2/r))/2,   r = |q|

in units of the hole's mass, G = c = M = 1: q = r (cos phi, sin phi) with Schwarzschild's
own r and phi, E the particle's energy at infinity, and the particle's proper time as t. It
is g^{ab} p_a p_b/2 with p_t = -E, as (1 - 2/r) p_r^2 + L^2/r^2 = |p|^2 - 2 p_r^2/r; on
a particle's path its value is -1/2. An ellipse's semi-latus rectum and eccentricity
give E and L as in the second source.
"""

from decimal import Decimal, localcontext
from typing import Annotated

from problems.checks import Must
from problems.entry import Expected, entry
from problems.errors import InputError, shown
from problems.picture import Plane
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian


def _energy(q, p, par, m):
    r = m.sqrt(q[0] * q[0] + q[1] * q[1])
    inwards = (q[0] * p[0] + q[1] * p[1]) / r
    flat = p[0] * p[0] + p[1] * p[1]
    return (flat - 2 * (inwards * inwards) / r - par.E * par.E / (1 - 2 / r)) / 2


@entry(
    title="a particle around a black hole",
    references=(
        "C. W. Misner, K. S. Thorne, J. A. Wheeler, Gravitation, Freeman 1973, chapter 25",
        "C. Cutler, D. Kennefick, E. Poisson, Gravitational radiation reaction for bound motion around "
        "a Schwarzschild black hole, Physical Review D 50 (1994) 3816-3835",
    ),
    notes="Not separable: the metric couples momenta to places. The pericentre advances.",
    shows=("e", "p"),
    picture=Plane(labels=("x", "y"), span=3500.0, points=3000),
    expected=Expected(h=2.0, energy=1e-16, default=6e-16),
)
def schwarzschild(
    *,
    e: Annotated[float, Must("an eccentricity, 0 <= e < 1", lambda e: 0 <= e < 1)] = 0.6,
    p: float = 10.0,
    t_end: float = 1e4,
) -> Problem:
    """Return a bound geodesic around a black hole of mass 1, from its pericentre.

    Tests a kinetic energy that depends on the place: the pericentre of the default orbit advances
    by 219 degrees a revolution.

    Parameters
    ----------
    e : float
        Eccentricity, 0 <= e < 1: r lies between p/(1 + e) and p/(1 - e).
    p : float
        Semi-latus rectum, in masses of the hole; above 6 + 2 e, or the orbit falls in.
    t_end : float
        End of the integration, in proper time; a revolution of the default orbit takes 464.

    Returns
    -------
    Problem
        State ``[x, y, p_x, p_y]``; parameter ``E``; invariants: energy (H, which is -1/2),
        angular momentum.

    Raises
    ------
    problems.errors.InputError
        For an orbit that is not bound and stable.
    """
    if p <= 6 + 2 * e:
        raise InputError(
            f"p={shown(p)} of schwarzschild is no bound orbit; it must exceed 6 + 2*e = {6 + 2 * e:g}."
        )
    with localcontext(prec=60):
        size, shape = Decimal(p), Decimal(e)
        rest = size - 3 - shape * shape
        energy = (((size - 2) ** 2 - 4 * shape * shape) / (size * rest)).sqrt()
        near = size / (1 + shape)
        momentum = size / rest.sqrt() / near
    system = Hamiltonian(
        _energy,
        dof=2,
        parameters={"E": float(energy)},
        invariants={"angular_momentum": lambda q, p: q[0] * p[1] - q[1] * p[0]},
        name="schwarzschild",
    )
    return Problem(system, q0=[float(near), 0.0], p0=[0.0, float(momentum)], t_end=t_end)
