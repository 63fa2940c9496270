"""Two famous orbits of three bodies in the plane.

The figure eight: A. Chenciner, R. Montgomery, "A remarkable periodic solution of
the three-body problem in the case of equal masses", Annals of Mathematics 152
(2000) 881-901, with the start found by C. Simo. The Pythagorean problem: C.
Burrau, Astronomische Nachrichten 195 (1913) 113-118; V. Szebehely, C. F. Peters,
"Complete solution of a general problem of three bodies", Astronomical Journal 72
(1967) 876-883.
"""

from problems.catalogue import _given as given
from problems.catalogue import _gravity as gravity
from problems.problem import Problem
from problems.registry import changed

# The published eight digits (0.97000436, 0.24308753; 0.93240737, 0.86473146; 6.32591398) hold the
# positions; the velocity of the third body and the period are refined to them by Newton's method.
EIGHT_POSITION = (0.97000436, -0.24308753)
EIGHT_VELOCITY = (-0.93240736813907869742, -0.86473146183495370212)
EIGHT_PERIOD = 6.3259140097821386327


def figure_eight(*, t_end: float | None = None) -> Problem:
    """Return three equal masses that chase each other along a figure eight; G = 1.

    Tests a stable periodic orbit without a dominant mass: after a period every
    body is back.

    Parameters
    ----------
    t_end : float, optional
        End of the integration; 100 periods by default.

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
    span = 100 * EIGHT_PERIOD if t_end is None else t_end
    given.finite("figure_eight", t_end=span)
    (x, y), (u, v) = EIGHT_POSITION, EIGHT_VELOCITY
    return Problem(
        gravity.hamiltonian((1.0, 1.0, 1.0), name="figure_eight", dimension=2),
        q0=[x, y, -x, -y, 0.0, 0.0],
        p0=[-u / 2, -v / 2, -u / 2, -v / 2, u, v],
        t_end=span,
        name="figure_eight",
        title="the figure eight of three bodies",
        arguments=changed(figure_eight, t_end=t_end),
        references=(
            "A. Chenciner, R. Montgomery, A remarkable periodic solution of the three-body problem "
            "in the case of equal masses, Annals of Mathematics 152 (2000) 881-901",
        ),
        notes="A stable periodic orbit without a dominant mass.",
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
