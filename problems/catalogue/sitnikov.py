"""Sitnikov's problem: two equal primaries on ellipses, a planetoid on the axis between them.

In the paper's section "Sitnikov's problem": G = 1, masses 1, 1, 1e-5, e = 0.75, d = 5, h = 0.5,
t in [0, 1500].
"""

from decimal import Decimal, localcontext
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from problems.checks import Must, Positive
from problems.entry import Expected, entry
from problems.picture import Curves
from problems.problem import Problem
from problems.systems.hamiltonian import Bodies, Hamiltonian


def _energy(q, p, par, m):
    kinetic = sum((p[3 * i] ** 2 + p[3 * i + 1] ** 2 + p[3 * i + 2] ** 2) / (2 * par.m[i]) for i in range(3))
    potential = 0
    for i, j in ((0, 1), (0, 2), (1, 2)):
        x, y, z = (q[3 * i + c] - q[3 * j + c] for c in range(3))
        # The squares in the same order for every pair: the symmetry depends on it.
        potential -= par.m[i] * par.m[j] / m.sqrt(x * x + y * y + z * z)
    return kinetic + potential


def _linear_momentum(p):
    return [p[c] + p[3 + c] + p[6 + c] for c in range(3)]


def _angular_momentum(q, p):
    def total(a: int, b: int) -> Any:
        return sum(q[3 * i + a] * p[3 * i + b] - q[3 * i + b] * p[3 * i + a] for i in range(3))

    return [total(1, 2), total(2, 0), total(0, 1)]


def _off_axis(q, m):
    return m.sqrt(q[6] ** 2 + q[7] ** 2)


def _apart(y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of the primaries in some states."""
    return np.hypot(y[:, 0] - y[:, 3], y[:, 1] - y[:, 4])


@entry(
    title="Sitnikov's problem",
    references=(
        "L. Brugnano, F. Iavernaro, T. Susca: Numerical comparisons between Gauss-Legendre "
        "methods and Hamiltonian BVMs defined over Gauss points",
    ),
    notes="The planetoid stays on the axis only while rounding keeps the symmetry of a half turn "
    "with the primaries swapped bit for bit; energy and angular momentum hardly see an ejection. "
    "The barycentre drifts along the axis and is not moved to the origin.",
    shows=("e",),
    picture=Curves(
        curves=((8, "height of the planetoid"), (_apart, "primaries apart")), span=200.0, points=2000
    ),
    expected=Expected(h=0.1, energy=2e-15, default=1e-14),
)
def sitnikov(
    *,
    e: Annotated[float, Must("an eccentricity, 0 <= e < 1", lambda e: 0 <= e < 1)] = 0.75,
    d: Positive = 5.0,
    m3: Positive = 1e-5,
    v3: float = 0.5,
    z3: float = 1e-9,
    t_end: float = 1500.0,
) -> Problem:
    """Return Sitnikov's problem as three bodies with G = 1.

    Tests whether rounding keeps a symmetry on which everything depends, and steps
    that must resolve the primaries' pericentres.

    Parameters
    ----------
    e : float
        Eccentricity of the primaries' orbits, 0 <= e < 1. The original paper calls the
        motion chaotic above about 0.725; from this start it was found regular along
        the axis up to about 0.8 (``hbvm-bench paper``).
    d : float
        Distance of the primaries at the start, when they are farthest apart.
    m3 : float
        Mass of the planetoid; the primaries have mass 1.
    v3 : float
        Velocity of the planetoid along the axis at the start. (The paper prints
        1/2 among the momenta; read as a momentum it would mean a velocity of
        5e4 and escape.)
    z3 : float
        Height of the planetoid at the start.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State ``[q1 q2 q3 p1 p2 p3]``, each x, y, z; invariants: energy, linear
        and angular momentum; guard: the planetoid's distance from the axis.
    """
    system = Hamiltonian(
        _energy,
        dof=9,
        parameters={"m": (1.0, 1.0, m3)},
        invariants={"linear_momentum": _linear_momentum, "angular_momentum": _angular_momentum},
        guards={"off_axis": _off_axis},
        bodies=Bodies(masses="m", G=1.0, dimension=3),
        name="sitnikov",
    )
    with localcontext(prec=60):  # rounded once: for e = 3/4, d = 5 it is sqrt(10)/20
        momentum = float((2 * (1 - Decimal(e)) / Decimal(d)).sqrt() / 2)
    return Problem(
        system,
        q0=[-d / 2, 0.0, 0.0, d / 2, 0.0, 0.0, 0.0, 0.0, z3],
        p0=[0.0, -momentum, 0.0, 0.0, momentum, 0.0, 0.0, 0.0, m3 * v3],
        t_end=t_end,
    )
