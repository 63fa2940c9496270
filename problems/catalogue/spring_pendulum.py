"""The swinging spring: a mass on an elastic spring, in space.

    H(q, p) = |p|^2/(2 m) + k (|q| - l0)^2/2 + m g q3

In the paper: m = 1, g = pi^2, k = 4 pi^2 and the length 1 at rest (so l0 = 3/4), with
which the spring oscillates twice as fast as it swings.
"""

import math

from problems.checks import Positive
from problems.entry import Expected, entry
from problems.picture import Plane
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian

PI_SQUARED = math.pi * math.pi


def _energy(q, p, par, m):
    stretch = m.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]) - par.l0
    kinetic = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) / (2 * par.m)
    return kinetic + (par.k * (stretch * stretch) / 2 + par.m * par.g * q[2])


@entry(
    title="the swinging spring",
    references=(
        "P. Lynch, C. Houghton, Pulsation and precession of the resonant swinging spring, "
        "Physica D 190 (2004) 38-62",
    ),
    notes="Resonance; the plane of the swing precesses in steps.",
    shows=("x", "z", "vy"),
    picture=Plane(labels=("x", "y"), span=40.0, points=2000),
    expected=Expected(h=0.05, energy=2e-16, default=1e-15),
)
def spring_pendulum(
    *,
    x: float = 0.04,
    z: float = 0.08,
    vy: float = 0.03,
    k: Positive = 4 * PI_SQUARED,
    l0: Positive = 0.75,
    g: float = PI_SQUARED,
    m: Positive = 1.0,
    t_end: float = 200.0,
) -> Problem:
    """Return the swinging spring at its 2:1 resonance.

    Tests a resonant exchange of energy between two modes and the stepwise
    precession of the swing plane; separable, not polynomial.

    Parameters
    ----------
    x, z : float
        Displacement from the rest point, sideways and upwards, at the start.
    vy : float
        Velocity across, at the start.
    k, l0, g, m : float
        Stiffness, length without load, gravity, mass.
    t_end : float
        End of the integration; an exchange of energy takes some 13.

    Returns
    -------
    Problem
        State ``[q1, q2, q3, p1, p2, p3]``, q3 upwards from the support; parameters
        ``m``, ``k``, ``l0``, ``g``; invariants: energy, angular momentum about the vertical.
    """
    parameters = {"m": m, "k": k, "l0": l0, "g": g}
    kept = {"angular_momentum": lambda q, p: q[0] * p[1] - q[1] * p[0]}
    system = Hamiltonian(_energy, dof=3, parameters=parameters, invariants=kept, name="spring_pendulum")
    return Problem(system, q0=[x, 0.0, z - (l0 + m * g / k)], p0=[0.0, m * vy, 0.0], t_end=t_end)
