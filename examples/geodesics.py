"""A star around a spinning black hole: a geodesic of Kerr's metric, written down as its Hamiltonian.

Lengths are in units of G M/c^2 and times in G M/c^3: 6.2e6 km and 20.7 s for the 4.2 million solar masses
in the centre of the Galaxy.
"""

import numpy as np
from side_by_side import clocked

import integrators
import problems

HOURS = 20.7 / 3600  # in a unit of time


SPIN, ENERGY, ROTATION, START, ACROSS = 0.9, 0.96, 2.5, 12.0, 1.5


def parts(r, sin2):
    """Return Sigma, Delta, and what E and L give, of the metric in Boyer-Lindquist coordinates."""
    sigma = r**2 + SPIN**2 * (1 - sin2)
    delta = r**2 - 2 * r + SPIN**2
    radial = (r**2 + SPIN**2) * ENERGY - SPIN * ROTATION
    polar = SPIN * ENERGY * sin2 - ROTATION
    return sigma, delta, radial**2 / delta, polar**2 / sin2


def H(q, p, m):
    """Return half of g^{ab} p_a p_b; t and phi do not occur, so that E = -p_t and L = p_phi are numbers."""
    sigma, delta, radial, polar = parts(q[0], m.sin(q[1]) ** 2)
    return (delta * p[0] ** 2 + p[1] ** 2 - radial + polar) / (2 * sigma)


def carter(q, p, m):
    """Return Carter's constant."""
    sin2 = m.sin(q[1]) ** 2
    return p[1] ** 2 + (1 - sin2) * (SPIN**2 * (1 - ENERGY**2) + ROTATION**2 / sin2)


def main() -> None:
    """Integrate 173 revolutions, from the equator; the radial momentum makes H = -1/2, for a mass of 1."""
    sigma, delta, radial, polar = parts(START, 1.0)
    kerr = problems.Hamiltonian(H, dof=2, invariants={"carter": carter})
    inwards = -np.sqrt((radial - polar - sigma - ACROSS**2) / delta)
    star = problems.Problem(kerr, q0=[START, np.pi / 2], p0=[inwards, ACROSS], t_end=50_000.0)
    times = np.linspace(0.0, 50_000.0, 2001)
    ours = clocked("HBVM()", lambda: integrators.integrate(star, integrators.HBVM(), times))
    heyokas = clocked("heyoka", lambda: integrators.integrate(star, integrators.Taylor(), times))
    r = ours.q[:, 0]
    print(f"from {r.min():.2f} to {r.max():.2f} G M/c^2, for {times[-1] * HOURS:.0f} h of the star's own")
    for name, solution in (("HBVM()", ours), ("heyoka", heyokas)):
        print(name, *(f"{key} {error.max():.1e}" for key, error in solution.errors().items()))
    print("energy kept:", bool(ours.errors()["energy"].max() < 1e-13))


if __name__ == "__main__":
    main()
