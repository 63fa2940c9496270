"""Atoms with Lennard-Jones forces in the plane: the frozen argon crystal.

    H(q, p) = sum_i |p_i|^2/(2 m) + sum_{i<j} 4 eps ((sigma/r)^12 - (sigma/r)^6)

In the book's table: eps/k_B = 119.8 K, sigma = 0.341 nm, m = 66.34e-27 kg,
k_B = 1.380658e-23 J/K. Units here: nanometres, nanoseconds, and k_B times kelvin for
the energy, so that the mass is m/k_B in K ns^2/nm^2.
"""

from fractions import Fraction
from itertools import combinations
from typing import Annotated

from problems import limits
from problems.catalogue import _starts as starts
from problems.checks import Positive, at_least
from problems.entry import Expected, entry
from problems.picture import Orbits
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian

MASS = float(Fraction("66.34e-27") / Fraction("1.380658e-23"))
EPS = 119.8
SIGMA = 0.341
POSITIONS = (
    (0.00, 0.00),
    (0.02, 0.39),
    (0.34, 0.17),
    (0.36, -0.21),
    (-0.02, -0.40),
    (-0.35, -0.16),
    (-0.31, 0.21),
)
VELOCITIES = ((-30, -20), (50, -90), (-70, -60), (90, 40), (80, 90), (-40, 100), (-80, -60))


@entry(
    title="the frozen argon crystal",
    references=(
        "E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, 2nd edition, "
        "Springer 2006, section I.4, table 4.1",
    ),
    notes="Times in nanoseconds: steps are of the order 1e-5 to 1e-4.",
    shows=("rings",),
    picture=Orbits(span=0.02, points=800),
    expected=Expected(h=2e-4, energy=2e-15, default=2e-15),
)
def lennard_jones(
    *,
    rings: Annotated[int, at_least(1)] = 1,
    temperature: Positive = 20.0,
    seed: Annotated[int, at_least(0)] = 1,
    t_end: float = 0.2,
) -> Problem:
    """Return the frozen argon crystal, or a larger hexagonal one.

    Tests fast oscillations in stiff wells, whose energy a method must not heat.

    Parameters
    ----------
    rings : int
        Rings of atoms around the one in the middle: 1 is the book's crystal of 7
        atoms with its own start; with r rings there are 1 + 3 r (r + 1) atoms, in a
        hexagonal lattice of spacing 2^(1/6) sigma.
    temperature : float
        Of the larger crystals, in kelvin: momenta are random numbers of the variance
        ``2 m temperature``, less their mean; half of it goes into the bonds.
    seed : int
        Of the larger crystals' momenta.
    t_end : float
        End of the integration in nanoseconds; by default as in the book.
        The fastest oscillations take about 0.001.

    Returns
    -------
    Problem
        State: positions in the plane atom by atom, then momenta. Parameters
        ``m``, ``eps``, ``sigma``; invariants: energy, linear momentum (of the book's
        crystal only: of the others it is 0 but for rounding), angular momentum.
    """
    atoms = 3 * rings * (rings + 1) + 1
    limits.check_problem("lennard_jones", 4 * atoms, atoms * (atoms - 1) // 2, rings=rings)
    if rings == 1:
        q = [x for row in POSITIONS for x in row]
        p = [MASS * x for row in VELOCITIES for x in row]
    else:
        q = [x for row in _lattice(rings) for x in row]
        p = _thermal(atoms, temperature, seed)
    return Problem(_crystal(atoms, linear_momentum=rings == 1), q0=q, p0=p, t_end=t_end)


def _crystal(n: int, *, linear_momentum: bool) -> Hamiltonian:
    pairs = list(combinations(range(n), 2))

    def energy(q, p, par, m):
        def bond(i, j):
            x, y = q[2 * i] - q[2 * j], q[2 * i + 1] - q[2 * j + 1]
            u = (par.sigma * par.sigma) / (x * x + y * y)
            u3 = u * u * u
            return u3 * u3 - u3

        kinetic = m.sum(lambda i: (p[2 * i] * p[2 * i] + p[2 * i + 1] * p[2 * i + 1]) / (2 * par.m), range(n))
        return kinetic + 4 * par.eps * m.sum(bond, pairs)

    def momentum(p, m):
        return [m.sum(lambda i, c=c: p[2 * i + c], range(n)) for c in range(2)]

    def turn(q, p, m):
        return m.sum(lambda i: q[2 * i] * p[2 * i + 1] - q[2 * i + 1] * p[2 * i], range(n))

    return Hamiltonian(
        energy,
        dof=2 * n,
        parameters={"m": MASS, "eps": EPS, "sigma": SIGMA},
        invariants={**({"linear_momentum": momentum} if linear_momentum else {}), "angular_momentum": turn},
        name=f"lennard_jones_{n}",
    )


def _lattice(rings: int) -> list[tuple[float, float]]:
    spacing, height = starts.nearest(lambda mp: [SIGMA * mp.root(2, 6) * x for x in (1, mp.sqrt(3) / 2)])
    cells = range(-rings, rings + 1)
    return [(spacing * (i + j / 2), height * j) for j in cells for i in cells if abs(i + j) <= rings]


def _thermal(n: int, temperature: float, seed: int) -> list[float]:
    size = (2 * MASS * temperature) ** 0.5
    p = [size * draw for draw in starts.gaussians(seed, 2 * n)]
    mean = [sum(p[c::2]) / n for c in range(2)]
    return [x - mean[i % 2] for i, x in enumerate(p)]
