"""A charged particle in a magnetic field: the momentum is not the velocity.

    H(q, p) = |p - A(q)|^2/2 + phi(q),   unit mass and charge

In the plane, with the growing field B = r (A = r/3 (-y, x)) and the repelling
potential phi = 1/(100 r).
"""

from problems.catalogue import _starts as starts
from problems.entry import Expected, entry
from problems.errors import InputError
from problems.picture import Plane
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian


def _energy(q, p, par, m):
    x, y = q[0], q[1]
    r = m.sqrt(x * x + y * y)
    u, v = p[0] + r * y / 3, p[1] - r * x / 3
    return (u * u + v * v) / 2 + par.charge / r


@entry(
    title="a charged particle in a magnetic field",
    references=("H. Qin et al., Why is Boris algorithm so good?, Physics of Plasmas 20 (2013) 084503",),
    notes="Not separable: momenta are not velocities. Gyration and drift.",
    picture=Plane(span=300.0),
    expected=Expected(h=0.2, energy=1e-15, default=7e-15),
)
def charged_particle(
    *,
    x: float = 0.0,
    y: float = -1.0,
    vx: float = 0.1,
    vy: float = 0.01,
    charge: float = 0.01,
    t_end: float = 1000.0,
) -> Problem:
    """Return a charged particle in the plane, in a field that grows with the radius.

    Tests a Hamiltonian that is not separable: fast gyration, slow drift around the centre.

    Parameters
    ----------
    x, y, vx, vy : float
        Place and velocity at the start.
    charge : float
        Strength of the repelling centre.
    t_end : float
        End of the integration; a gyration at r = 1 takes 2 pi.

    Returns
    -------
    Problem
        State ``[x, y, p_x, p_y]``, canonical momenta p = v + A; parameter ``charge``;
        invariants: energy, canonical angular momentum.

    Raises
    ------
    problems.errors.InputError
        For a start in the centre.
    """
    if x == 0 and y == 0:
        raise InputError("x=0 and y=0 of charged_particle are the singular centre; start elsewhere.")

    def momentum(mp):
        third = mp.sqrt(mp.mpf(x) ** 2 + mp.mpf(y) ** 2) / 3
        return [vx - third * y, vy + third * x]

    system = Hamiltonian(
        _energy,
        dof=2,
        parameters={"charge": charge},
        invariants={"angular_momentum": lambda q, p: q[0] * p[1] - q[1] * p[0]},
        name="charged_particle",
    )
    return Problem(system, q0=[x, y], p0=starts.nearest(momentum), t_end=t_end)
