"""The Henon-Heiles problem: motion in a plane well with three saddles.

    H(q, p) = (p1^2 + p2^2)/2 + (q1^2 + q2^2)/2 + q1^2 q2 - q2^3/3

Cubic, so HBVM(k, s) conserves the energy exactly for k >= 3s/2. Below the energy 1/6 an
orbit that starts in the triangle of the saddles never leaves it.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from problems.catalogue import _starts as starts
from problems.entry import Expected, entry
from problems.errors import InputError
from problems.picture import Plane
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian

ESCAPE = 1 / 6
SADDLES = ((0.0, 1.0), (-math.sqrt(3) / 2, -0.5), (math.sqrt(3) / 2, -0.5))


def _energy(q, p):
    kinetic = (p[0] ** 2 + p[1] ** 2) / 2
    return kinetic + ((q[0] ** 2 + q[1] ** 2) / 2 + (q[0] ** 2 * q[1] - q[1] ** 3 / 3))


@entry(
    title="the Henon-Heiles problem",
    references=(
        "M. Henon, C. Heiles, The applicability of the third integral of motion: some numerical "
        "experiments, Astronomical Journal 69 (1964) 73-79",
    ),
    notes="A cubic energy, and a bounded region that an energy error opens.",
    shows=("energy",),
    picture=Plane(span=400.0, points=3000, outline=(*SADDLES, SADDLES[0]), width=0.4),
    expected=Expected(h=0.5, energy=1e-15, default=3e-14),
)
def henon_heiles(
    *,
    energy: float = 1 / 6 - 1e-3,
    q1: float = 0.0,
    q2: float = 0.5,
    direction: float = 0.5,
    t_end: float = 5e4,
) -> Problem:
    """Return the Henon-Heiles problem from a point, a direction and an energy.

    Tests whether a method keeps an orbit in a bounded region near its escape
    energy: an energy error of 1e-3 lets it out. The default orbit is chaotic: when a
    method that does not conserve the energy lets it out depends on the last bit.

    Parameters
    ----------
    energy : float
        Value of H; escape is possible from 1/6 on.
    q1, q2 : float
        Where the orbit starts.
    direction : float
        Angle of the momentum with the q1 axis, in radians.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State ``[q1, q2, p1, p2]``; invariant: energy. Below the energy 1/6 the motion stays in
        the triangle of the saddles (`beyond_triangle`): by its energy, not by a symmetry.

    Raises
    ------
    problems.errors.InputError
        If the potential at the start exceeds the energy.
    """

    def momentum(mp):
        x, y = mp.mpf(q1), mp.mpf(q2)
        kinetic = energy - ((x * x + y * y) / 2 + x * x * y - y**3 / 3)
        if kinetic < 0:
            raise InputError(
                f"energy={energy!r} of henon_heiles is less than the potential at ({q1!r}, {q2!r}); "
                "raise it or start nearer to the origin."
            )
        speed = mp.sqrt(2 * kinetic)
        return [speed * mp.cos(direction), speed * mp.sin(direction)]

    system = Hamiltonian(_energy, dof=2, name="henon_heiles")
    return Problem(system, q0=[q1, q2], p0=starts.nearest(momentum), t_end=t_end)


def beyond_triangle(q: ArrayLike) -> NDArray[np.float64]:
    """Return how far positions lie beyond the sides of the triangle of the three saddles, added up.

    0 inside: below the energy 1/6 an orbit from inside stays there.

    Parameters
    ----------
    q : array_like, shape (n, 2) or (n, 4)
        Positions, or whole states.

    Returns
    -------
    ndarray, shape (n,)
    """
    points = np.atleast_2d(np.asarray(q, dtype=np.float64))
    slanted = math.sqrt(3) * np.abs(points[:, 0]) + points[:, 1] - 1
    return np.maximum(-0.5 - points[:, 1], 0.0) + np.maximum(slanted, 0.0)


def inside_triangle(q: ArrayLike) -> NDArray[np.bool_]:
    """Return whether positions lie in the closed triangle of the three saddles.

    Parameters
    ----------
    q : array_like, shape (n, 2) or (n, 4)
        Positions, or whole states.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    return beyond_triangle(q) == 0.0
