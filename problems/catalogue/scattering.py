"""Three planets so close together that they scatter each other."""

from itertools import chain

from problems.bodies import gravity
from problems.catalogue._starts import nearest
from problems.checks import Positive
from problems.entry import Expected, entry
from problems.picture import Orbits
from problems.problem import Problem

ORBITS = ((1.0, 0, 0.0), (1.3, 45, 0.5), (1.7, 105, 1.0))
"""Of each planet: radius of the circle (au), angle from the node and inclination (degrees)."""


@entry(
    title="the scattering of three planets",
    references=(
        "S. Chatterjee, E. B. Ford, S. Matsumura, F. A. Rasio, Dynamical outcomes of planet-planet "
        "scattering, Astrophysical Journal 686 (2008) 580-602",
    ),
    notes="A dominant mass, and planets that meet within a few thousandths of an astronomical unit.",
    picture=Orbits(dimension=3, first=1, span=20.0, points=2500),
    expected=Expected(h=0.01, energy=3e-16, default=3.2e-15),
)
def scattering(*, mass: Positive = 1e-3, t_end: float = 60.0) -> Problem:
    """Return a star of one solar mass and three planets on neighbouring orbits; in years and au.

    Tests close encounters around a dominant mass, which codes for planets treat apart: at t = 17.5,
    17.8, 46.7 and 55.4 years two planets come within 0.012, 0.009, 0.003 and 0.006 au. Their Hill
    radius is 0.07 au times the distance from the star.

    Parameters
    ----------
    mass : float
        Of each planet, in solar masses; > 0.
    t_end : float
        End of the integration; 60 years by default.

    Returns
    -------
    Problem
        State: positions body by body (the star first), then momenta, relative to the barycentre.
        Invariants: energy, angular momentum.
    """
    masses = (1.0, mass, mass, mass)

    def start(m):
        attraction = 4 * m.pi**2
        q, v = [[m.mpf(0)] * 3], [[m.mpf(0)] * 3]
        for radius, angle, inclination in ORBITS:
            c, s = m.cos(m.radians(angle)), m.sin(m.radians(angle))
            up, across = m.sin(m.radians(inclination)), m.cos(m.radians(inclination))
            speed = m.sqrt(attraction / m.mpf(radius))
            q.append([radius * c, radius * s * across, radius * s * up])
            v.append([-speed * s, speed * c * across, speed * c * up])
        total = m.fsum(masses)
        for rows in (q, v):
            centre = [
                m.fsum(w * row[i] for w, row in zip(masses, rows, strict=True)) / total for i in range(3)
            ]
            rows[:] = [[x - mid for x, mid in zip(row, centre, strict=True)] for row in rows]
        p = [[w * x for x in row] for w, row in zip(masses, v, strict=True)]
        return [attraction, *chain.from_iterable(q), *chain.from_iterable(p)]

    attraction, *state = nearest(start)
    system = gravity.hamiltonian(masses, name="scattering", G=attraction, linear_momentum=False)
    return Problem(system, q0=state[:12], p0=state[12:], t_end=t_end)
