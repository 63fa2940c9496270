"""The plane double pendulum: two point masses on two massless rods.

With the angles q1, q2 from the vertical, d = q1 - q2 and M = m1 + m2,

    H = (m2 l2^2 p1^2 + M l1^2 p2^2 - 2 m2 l1 l2 p1 p2 cos d) / (2 m2 l1^2 l2^2 (m1 + m2 sin^2 d))
        - M g l1 cos q1 - m2 g l2 cos q2

which is p^T K(q)^-1 p/2 + V(q) with the mass matrix
K = [[M l1^2, m2 l1 l2 cos d], [m2 l1 l2 cos d, m2 l2^2]]; Landau and Lifshitz have the
Lagrangian.
"""

from problems.checks import Positive
from problems.entry import Expected, entry
from problems.picture import Plane
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian


def _energy(q, p, par, m):
    m1, m2, l1, l2, g = par.m1, par.m2, par.l1, par.l2, par.g
    c, s = m.cos(q[0] - q[1]), m.sin(q[0] - q[1])
    both = m1 + m2
    inertia = m2 * l2**2 * p[0] ** 2 + both * l1**2 * p[1] ** 2 - 2 * m2 * l1 * l2 * (p[0] * p[1]) * c
    kinetic = inertia / (2 * m2 * l1**2 * l2**2 * (m1 + m2 * s**2))
    return kinetic - both * g * l1 * m.cos(q[0]) - m2 * g * l2 * m.cos(q[1])


@entry(
    title="the double pendulum",
    references=("L. D. Landau, E. M. Lifshitz, Mechanics, Pergamon 1960, section 5, problem 1",),
    notes="Neither separable nor polynomial; chaotic at larger energies.",
    shows=("q1", "q2"),
    picture=Plane(labels=("angle 1", "angle 2")),
    expected=Expected(h=0.1, energy=6e-16, default=2e-15),
)
def double_pendulum(
    *,
    q1: float = 1.0,
    q2: float = 1.5,
    p1: float = 0.0,
    p2: float = 0.0,
    m1: Positive = 1.0,
    m2: Positive = 1.0,
    l1: Positive = 1.0,
    l2: Positive = 1.0,
    g: float = 1.0,
    t_end: float = 100.0,
) -> Problem:
    """Return the double pendulum, by default with unit masses, lengths and gravity, from rest.

    Tests a Hamiltonian that is neither separable nor polynomial, with chaotic
    motion at larger energies.

    Parameters
    ----------
    q1, q2 : float
        Angles from the vertical, in radians, at the start.
    p1, p2 : float
        Their momenta at the start.
    m1, m2, l1, l2 : float
        Masses and lengths of the rods.
    g : float
        Gravity.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State ``[q1, q2, p1, p2]``; parameters as named; invariant: energy.
    """
    parameters = {"m1": m1, "m2": m2, "l1": l1, "l2": l2, "g": g}
    system = Hamiltonian(_energy, dof=2, parameters=parameters, name="double_pendulum")
    return Problem(system, q0=[q1, q2], p0=[p1, p2], t_end=t_end)
