"""Rigid molecules of water as point charges on bonds: energy and 81 constraints at round-off.

27 molecules of SPC/E (H. J. C. Berendsen, J. R. Grigera, T. P. Straatsma, J. Phys. Chem. 91 (1987) 6269)
in open space, as a small crystal that falls together: no box, no minimum image, no cutoff. Units: angstrom,
atomic mass unit, kJ/mol; that of time is 0.1 ps. Bonds, charges and Lennard-Jones terms are loops, so that
the time to compile does not grow with the number of molecules.
"""

import numpy as np

from integrators import DOP853, HBVM, integrate
from problems import Constrained, Problem

MASSES, CHARGES = (15.9994, 1.008, 1.008), (-0.8476, 0.4238, 0.4238)
BOND, ANGLE = 1.0, np.deg2rad(109.47)
COULOMB, EPSILON, SIGMA = 1389.35, 0.650, 3.166
MOLECULE = np.array([[0.0, 0.0, 0.0], [BOND, 0.0, 0.0], [BOND * np.cos(ANGLE), BOND * np.sin(ANGLE), 0.0]])


def water(side: int, t_end: float = 1.0) -> Problem:
    """Return side**3 molecules, 3.1 apart, at rest, each turned at random."""
    n = side**3
    sites = [(i, j) for i in range(n) for j in range(i)]
    mass = np.tile(np.repeat(MASSES, 3), n)

    def H(q, p, m):
        def square(a, b):
            return sum((q[3 * a + c] - q[3 * b + c]) ** 2 for c in range(3))

        def pair(i, j):
            six = (SIGMA**2 / square(3 * i, 3 * j)) ** 3
            charges = sum(
                COULOMB * CHARGES[a] * CHARGES[b] / m.sqrt(square(3 * i + a, 3 * j + b))
                for a in range(3)
                for b in range(3)
            )
            return 4 * EPSILON * (six**2 - six) + charges

        light = m.array(1 / (2 * mass))
        return m.sum(lambda i: light[i] * p[i] ** 2, range(9 * n)) + m.sum(pair, sites)

    def bonds(q, m):
        def of(i):
            for a, b in ((0, 1), (0, 2), (1, 2)):
                length = float(np.sum((MOLECULE[a] - MOLECULE[b]) ** 2))
                yield sum((q[9 * i + 3 * a + c] - q[9 * i + 3 * b + c]) ** 2 for c in range(3)) - length

        return m.each(lambda i: list(of(i)), range(n))

    random = np.random.default_rng(0)
    corners = 3.1 * np.indices((side,) * 3).reshape(3, -1).T[:, np.newaxis]
    turns = np.stack([np.linalg.qr(random.standard_normal((3, 3)))[0] for _ in range(n)])
    places = corners + MOLECULE @ turns
    system = Constrained(H, constraints=[bonds], dof=9 * n, name="water")
    return Problem(system, q0=places.ravel(), p0=np.zeros(9 * n), t_end=t_end, project=True)


def main() -> None:
    """Print the errors of both after 0.1 ps."""
    problem = water(3)
    kept: list[bool] = []
    for method in (HBVM(), DOP853(rtol=1e-8, atol=1e-8)):
        solution = integrate(problem, method, [problem.t_end])
        errors = {name: f"{error.max():.0e}" for name, error in solution.errors().items()}
        print(f"{method!r:32} {solution.stats.steps:5} steps", errors)
        kept.append(max(float(error.max()) for error in solution.errors().values()) < 1e-14)
    print("HBVM() keeps energy and bonds at round-off:", kept[0])


if __name__ == "__main__":
    main()
