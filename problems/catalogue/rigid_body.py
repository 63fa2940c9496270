"""The free rigid body in body axes, a Poisson system."""

import numpy as np

from problems.catalogue import _starts as starts
from problems.entry import Expected, entry
from problems.picture import Plane
from problems.problem import Problem
from problems.systems.poisson import Poisson

AROUND = np.linspace(0.0, 2.0 * np.pi, 200)
CIRCLE = np.column_stack([np.cos(AROUND), np.sin(AROUND)])  # both invariants' sphere, seen from y2


def _energy(y, par):
    squares = [y[i] * y[i] for i in range(3)]
    turning = sum(squares[i] / (2 * par.inertia[i]) for i in range(3))
    return turning + par.quartic / 4 * sum(square * square for square in squares)


def _structure(y):
    return [[0, -y[2], y[1]], [y[2], 0, -y[0]], [-y[1], y[0], 0]]


def _casimir(y):
    return (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]) / 2


@entry(
    title="the free rigid body",
    references=(
        "E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, 2nd edition, "
        "Springer 2006, section VII.5",
    ),
    notes="A Poisson system with a quadratic Casimir; a quartic energy on request.",
    shows=("quartic",),
    picture=Plane(places=(0, 2), labels=("y₁", "y₃"), outline=CIRCLE, span=40.0, points=600),
    expected=Expected(h=0.2, energy=2e-16, default=3e-15, small={"quartic": 0.5}),
)
def rigid_body(*, quartic: float = 0.0, t_end: float = 200.0) -> Problem:
    """Return the free rigid body in body axes, or one with a quartic energy.

        B = [[0, -y3, y2], [y3, 0, -y1], [-y2, y1, 0]]
        H = sum_i y_i^2/(2 I_i) + quartic/4 sum_i y_i^4

    with the moments of inertia I = (2, 1, 2/3), from (cos 1.1, 0, sin 1.1). Tests a
    Casimir beside the energy: with ``quartic=0`` both are quadratic and every Gauss
    method keeps them; otherwise only methods that conserve the energy by design do.

    Parameters
    ----------
    quartic : float
        Strength of the quartic energy.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State: angular momentum ``[y1, y2, y3]``; parameters ``inertia``, ``quartic``;
        invariants: energy, and the Casimir |y|^2/2.
    """
    system = Poisson(
        _energy,
        _structure,
        dim=3,
        parameters={"inertia": (2.0, 1.0, 2 / 3), "quartic": quartic},
        invariants={"casimir": _casimir},
        name="rigid_body",
    )
    y0 = starts.nearest(lambda mp: [mp.cos(mp.mpf("1.1")), 0, mp.sin(mp.mpf("1.1"))])
    return Problem(system, y0=y0, t_end=t_end)
