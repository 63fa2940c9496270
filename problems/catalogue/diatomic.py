"""A diatomic molecule that vibrates and turns in the plane.

    H(q, p) = |p|^2/(2 m) + D (1 - exp(-a (|q| - r0)))^2

Here q is the place of one atom with respect to the other, and m their reduced mass.
"""

from problems.checks import Positive
from problems.entry import Expected, entry
from problems.picture import Plane
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian


def _energy(q, p, par, m):
    r = m.sqrt(q[0] * q[0] + q[1] * q[1])
    w = 1 - m.exp(-par.a * (r - par.r0))
    return (p[0] * p[0] + p[1] * p[1]) / (2 * par.m) + par.D * (w * w)


@entry(
    title="a diatomic molecule",
    references=(
        "P. M. Morse, Diatomic molecules according to the wave mechanics. II. Vibrational levels, "
        "Physical Review 34 (1929) 57-64",
    ),
    notes="A central force whose orbits do not close.",
    picture=Plane(span=60.0),
    expected=Expected(h=0.2, energy=5e-15, default=9e-15),
)
def diatomic(*, r: Positive = 1.0, vr: float = 0.5, vt: float = 0.5, t_end: float = 200.0) -> Problem:
    """Return a diatomic molecule that vibrates and turns in the plane, with a Morse bond of length 1.

    Tests a central force that is neither Kepler's nor a spring's: the orbit is a rosette.

    Parameters
    ----------
    r : float
        Distance of the atoms at the start, positive.
    vr, vt : float
        Velocity along and across the bond at the start.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State ``[q1, q2, p1, p2]`` of the relative motion; parameters ``D = 4``, ``a = 2``,
        ``r0 = 1``, ``m = 1``; invariants: energy, angular momentum.
    """
    system = Hamiltonian(
        _energy,
        dof=2,
        parameters={"D": 4.0, "a": 2.0, "r0": 1.0, "m": 1.0},
        invariants={"angular_momentum": lambda q, p: q[0] * p[1] - q[1] * p[0]},
        name="diatomic",
    )
    return Problem(system, q0=[r, 0.0], p0=[vr, vt], t_end=t_end)
