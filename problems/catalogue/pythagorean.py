"""The Pythagorean three-body problem.

C. Burrau, Astronomische Nachrichten 195 (1913) 113-118; V. Szebehely, C. F.
Peters, "Complete solution of a general problem of three bodies", Astronomical
Journal 72 (1967) 876-883.
"""

from problems.catalogue import _given as given
from problems.catalogue import _gravity as gravity
from problems.problem import Problem
from problems.registry import changed


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

    Raises
    ------
    problems.errors.InputError
        If ``t_end`` is not finite.
    """
    given.finite("pythagorean", t_end=t_end)
    return Problem(
        gravity.hamiltonian((3.0, 4.0, 5.0), name="pythagorean", dimension=2),
        q0=[1.0, 3.0, -2.0, -1.0, 1.0, -1.0],
        p0=[0.0] * 6,
        t_end=t_end,
        name="pythagorean",
        title="the Pythagorean three-body problem",
        arguments=changed(pythagorean, t_end=t_end),
        references=(
            "C. Burrau, Numerische Berechnung eines Spezialfalles des Dreikoerperproblems, "
            "Astronomische Nachrichten 195 (1913) 113-118",
            "V. Szebehely, C. F. Peters, Complete solution of a general problem of three bodies, "
            "Astronomical Journal 72 (1967) 876-883",
        ),
        notes="Close encounters and chaos; fixed steps fail.",
    )
