"""Molecular dynamics: 108 Lennard-Jones atoms in a periodic box, beside a plain velocity Verlet in numba.

Units are the atoms' own: mass, diameter and depth of the potential are 1. Each pair takes the nearest of its
periodic images, by `m.round`; potential and force vanish at the cutoff, so that the energy is conserved.
"""

from functools import partial

import numba
import numpy as np
from side_by_side import Comparison, settings

import integrators
import problems

ATOMS, BOX, CUT, END = 108, 5.2, 2.5, 0.25
STEPS = (10, 20, 50, 100)


def energy_of(atoms, box, cut):
    """Return H; the potential of a pair is (4/r^12 - 4/r^6) (1 - r^2/cut^2)^3 up to the cutoff."""

    def H(q, p, m):
        def pair(i, j):
            apart = [q[3 * i + c] - q[3 * j + c] for c in range(3)]
            nearest = [d - box * m.round(d / box) for d in apart]
            r2 = sum(d**2 for d in nearest)
            faded = m.where(r2 < cut**2, (1 - r2 / cut**2) ** 3, 0.0)
            return 4 * (1 / r2**6 - 1 / r2**3) * faded

        kinetic = m.sum(lambda i: p[i] ** 2 / 2, range(3 * atoms))
        return kinetic + m.sum(pair, [(i, j) for i in range(atoms) for j in range(i)])

    return H


@numba.njit(error_model="numpy")
def forces(q, f, box, cut):
    """Write the forces."""
    f[:] = 0.0
    for i in range(q.size // 3):
        for j in range(i):
            d = q[3 * i : 3 * i + 3] - q[3 * j : 3 * j + 3]
            d -= box * np.rint(d / box)
            r2 = d[0] ** 2 + d[1] ** 2 + d[2] ** 2
            if r2 < cut**2:
                fading = 1.0 - r2 / cut**2
                r6 = r2**-3
                pull = 4.0 * ((-12.0 * r6**2 + 6.0 * r6) / r2 * fading - 6.0 / cut**2 * (r6**2 - r6))
                for c in range(3):
                    f[3 * i + c] -= pull * fading**2 * d[c]
                    f[3 * j + c] += pull * fading**2 * d[c]


@numba.njit
def verlet(q, p, h, steps, box, cut):
    """Return the state after so many steps."""
    q, p, f = q.copy(), p.copy(), np.empty_like(q)
    forces(q, f, box, cut)
    for _ in range(steps):
        p += 0.5 * h * f
        q += h * p
        forces(q, f, box, cut)
        p += 0.5 * h * f
    return np.concatenate((q, p))


def crystal(cells, box, cut) -> problems.Problem:
    """Return a crystal of 4 atoms in each of cells^3 cells, which melts."""
    cell = np.array([(0, 0, 0), (1, 1, 0), (1, 0, 1), (0, 1, 1)]) / 2
    corner = np.argwhere(np.ones((cells, cells, cells)))
    q0 = (box / cells * (corner[:, None] + cell)).ravel()
    atoms = q0.size // 3
    p0 = np.random.default_rng(1).standard_normal((atoms, 3))
    system = problems.Hamiltonian(energy_of(atoms, box, cut), dof=3 * atoms, name="box")
    return problems.Problem(system, q0=q0, p0=(p0 - p0.mean(axis=0)).ravel(), t_end=END)


def compare() -> Comparison:
    """Integrate the melting crystal with ours, and with Verlet's method."""
    problem = crystal(3, BOX, CUT)
    q0, p0 = problem.y0[: 3 * ATOMS], problem.y0[3 * ATOMS :]

    def run(method) -> np.ndarray:
        return integrators.integrate(problem, method, [END]).y[-1]

    exact = run(integrators.Gauss(s=6, h=0.0025))

    def error(y: np.ndarray) -> float:
        return np.abs(y - exact)[: 3 * ATOMS].max()

    def energy(y: np.ndarray) -> float:
        return problem.errors(y)["energy"].max()

    made = Comparison(
        "Molecular dynamics: 108 atoms in a periodic box", "positions, of a diameter of 1", 1e-3
    )
    methods = [integrators.HBVM(k=4, s=2, h=END / steps) for steps in STEPS]
    made.add("HBVM", settings(run, *methods), error, energy)
    steps = {f"h={END / n:g}": partial(verlet, q0, p0, END / n, n, BOX, CUT) for n in STEPS}
    made.add("Verlet in numba", steps, error, energy)
    return made


if __name__ == "__main__":
    print(compare())
