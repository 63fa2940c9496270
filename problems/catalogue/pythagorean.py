"""The Pythagorean three-body problem."""

from problems.bodies import gravity
from problems.entry import Expected, entry
from problems.picture import Orbits
from problems.problem import Problem


@entry(
    title="the Pythagorean three-body problem",
    references=(
        "C. Burrau, Numerische Berechnung eines Spezialfalles des Dreikoerperproblems, "
        "Astronomische Nachrichten 195 (1913) 113-118",
        "V. Szebehely, C. F. Peters, Complete solution of a general problem of three bodies, "
        "Astronomical Journal 72 (1967) 876-883",
    ),
    notes="Close encounters and chaos; fixed steps fail.",
    picture=Orbits(span=66.0, points=6000, limits=(-6.0, 6.0, -6.0, 6.0)),
    # At t = 15.8 two bodies come within 4e-4. Coordinates of size 1 give that distance to 13 digits, and the
    # energy between the two is then thousands of times the total: 9e-11 of it is what doubles leave.
    expected=Expected(h=0.0005, energy=2e-16, default=1.3e-12, until=15.0),
)
def pythagorean(*, t_end: float = 70.0) -> Problem:
    """Return the Pythagorean three-body problem: masses 3, 4, 5 at rest in a 3-4-5 triangle; G = 1.

    Tests close encounters, down to a distance of 4e-4, that need steps many
    orders of magnitude smaller than the rest, and chaos: at t = 60 two bodies are bound and the
    third escapes.

    Parameters
    ----------
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State: positions in the plane body by body, then momenta. Invariants:
        energy, linear momentum (0), angular momentum (0).
    """
    return Problem(
        gravity.hamiltonian((3.0, 4.0, 5.0), name="pythagorean", dimension=2),
        q0=[1.0, 3.0, -2.0, -1.0, 1.0, -1.0],
        p0=[0.0] * 6,
        t_end=t_end,
    )
