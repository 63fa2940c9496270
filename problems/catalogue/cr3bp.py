"""The plane circular restricted three-body problem in the rotating frame.

    H(q, p) = (p1^2 + p2^2)/2 + q2 p1 - q1 p2 - (1 - mu)/r1 - mu/r2

with r1 the distance from (-mu, 0), r2 from (1 - mu, 0), and p = q' + (-q2, q1).
The Jacobi integral is C = -2 H. Periodic orbits around Earth and Moon of R. F.
Arenstorf (1963): those of 4 and 3 loops as in Hairer, Norsett and Wanner's book, that
of 2 loops, with another mass of the Moon, as in Shampine and Gordon's.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

from problems.checks import Must
from problems.entry import Expected, entry
from problems.picture import Plane
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian

MOON = 0.012277471


@dataclass(frozen=True)
class Orbit:
    """A periodic orbit: it starts at (x, 0) with the velocity (0, speed)."""

    x: float
    speed: float
    period: float
    mu: float


# By their number of loops.
ORBITS = {
    4: Orbit(0.994, -2.00158510637908252240537862224, 17.0652165601579625588917206249, MOON),
    3: Orbit(0.994, -2.0317326295573368357302057924, 11.124340337266085134999734047, MOON),
    2: Orbit(1.2, -1.04935750983031990726, 6.19216933131963970674, 1 / 82.45),
}


def _energy(q, p, par, m):
    x, y = q[0], q[1]
    r1 = m.sqrt((x + par.mu) ** 2 + y**2)
    r2 = m.sqrt((x - (1 - par.mu)) ** 2 + y**2)
    return (p[0] ** 2 + p[1] ** 2) / 2 + (y * p[0] - x * p[1]) - ((1 - par.mu) / r1 + par.mu / r2)


@entry(
    title="the restricted three-body problem",
    references=(
        "V. Szebehely, Theory of Orbits, Academic Press 1967",
        "E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, "
        "2nd edition, Springer 1993, section II.0",
        "L. F. Shampine, M. K. Gordon, Computer Solution of Ordinary Differential Equations, Freeman 1975",
    ),
    notes="Not separable; close passages; unstable periodic orbits that return to their start.",
    shows=("loops",),
    picture=Plane(points=4000),
    expected=Expected(h=0.0005, energy=4e-15, default=9e-15),
)
def cr3bp(
    *,
    loops: Literal[4, 3, 2] = 4,
    speed: float | None = None,
    mu: Annotated[float, Must("a number between 0 and 1", lambda mu: 0 < mu < 1)] | None = None,
    t_end: float | None = None,
) -> Problem:
    """Return the restricted three-body problem on one of Arenstorf's orbits.

    Tests steps that must shrink at close passages, in a system that is not
    separable; the orbits are unstable, so the return to the start is a test of
    accuracy.

    Parameters
    ----------
    loops : {4, 3, 2}
        Which orbit.
    speed : float, optional
        Velocity at the start, perpendicular to the axis; by default that of the periodic orbit. Others
        may pass the Moon much more closely.
    mu : float, optional
        The Moon's share of the mass, 0 < mu < 1; by default the one for which
        the orbit is periodic: 0.012277471, and 1/82.45 for 2 loops.
    t_end : float, optional
        End of the integration; the orbit's period by default.

    Returns
    -------
    Problem
        State ``[q1, q2, p1, p2]``; parameter ``mu``; invariants: energy, Jacobi integral.
    """
    orbit = ORBITS[loops]
    system = Hamiltonian(
        _energy,
        dof=2,
        parameters={"mu": orbit.mu if mu is None else mu},
        invariants={"jacobi": lambda q, p, par, m: -2 * _energy(q, p, par, m)},
        name="cr3bp",
    )
    return Problem(
        system,
        q0=[orbit.x, 0.0],
        p0=[0.0, (orbit.speed if speed is None else speed) + orbit.x],
        t_end=orbit.period if t_end is None else t_end,
    )
