"""Ten thousand stars in a model of a galaxy, at once: which of their orbits are chaotic?

Hénon's and Heiles' potential, whose units have no names: a revolution takes about 6.
"""

import numpy as np
from side_by_side import clocked

import integrators
import problems

COUNT = 10_000
METHOD = integrators.Gauss(s=8, h=1.0)


def H(q, p):
    """Return the energy of a star."""
    x, y = q
    return (p[0] ** 2 + p[1] ** 2 + x**2 + y**2) / 2 + x**2 * y - y**3 / 3


def starts() -> np.ndarray:
    """Return states with x = 0 and energy 1/8 that fill the section, shape (COUNT, 4)."""
    y, py = np.random.default_rng(1).uniform([-0.4, -0.5], [0.7, 0.5], (20 * COUNT, 2)).T
    px = 0.25 - py**2 - y**2 + 2 * y**3 / 3
    inside = px > 0
    return np.stack([0 * y, y, np.sqrt(np.maximum(px, 0)), py], axis=1)[inside][:COUNT]


def main() -> None:
    """Integrate all of them, and their neighbours at a distance of 1e-8."""
    star = problems.Problem(problems.Hamiltonian(H, dof=2), q0=[0.0, 0.1], p0=[0.5, 0.0], t_end=200.0)
    first = starts()
    beside = first + np.array([0.0, 1e-8, 0.0, 0.0])
    ours = clocked(f"{METHOD!r}", lambda: integrators.integrate_many(star, METHOD, starts=first))
    clocked("heyoka", lambda: integrators.integrate_many(star, integrators.Taylor(tol=1e-15), starts=first))
    others = integrators.integrate_many(star, METHOD, starts=beside)
    apart = np.linalg.norm(others.y[:, -1] - ours.y[:, -1], axis=1)
    print(f"{(apart > 1e-4).mean():.0%} of {COUNT} orbits are chaotic")
    energies = star.invariants(ours.y[:, -1])["energy"]
    print(f"largest error of an energy: {np.abs(energies * 8 - 1).max():.1e}")


if __name__ == "__main__":
    main()
