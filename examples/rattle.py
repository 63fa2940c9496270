"""A double pendulum on rods: HBVM beside RATTLE, its compositions of orders 4, 6 and 8, and others.

RATTLE and SUNDIALS' IDA, on the equations of index 2, are methods of the study of constraints; DOP853 and
heyoka integrate the field from which the multipliers are eliminated. Errors, at t = 50, are those of the
positions beside the same pendulum in angles, of the energy and of the rods.
"""

import time

import numpy as np

from hbvm_bench.studies.constraints.ida import IDA
from hbvm_bench.studies.constraints.rattle import Rattle
from integrators import DOP853, HBVM, Taylor, integrate
from problems import Constrained, Lagrangian, Problem
from problems.errors import MissingLibraryError

ANGLES, T_END = np.array([0.5, 0.5]), 50.0


def pendulum() -> Problem:
    """Return the double pendulum of unit masses on rods of length 1, at rest."""

    def H(q, p):
        return sum(p[i] ** 2 for i in range(4)) / 2 + q[1] + q[3]

    def rods(q):
        return [(q[0] ** 2 + q[1] ** 2 - 1) / 2, ((q[2] - q[0]) ** 2 + (q[3] - q[1]) ** 2 - 1) / 2]

    return Problem(Constrained(H, constraints=[rods], dof=4), q0=places(ANGLES), p0=np.zeros(4), t_end=T_END)


def places(angles):
    """Return the positions of both masses."""
    return np.cumsum(np.stack([np.sin(angles), -np.cos(angles)], axis=-1), axis=0).ravel()


def in_angles():
    """Return the positions at the end by the problem without constraints."""

    def L(q, v, m):
        coupled = v[0] * v[1] * m.cos(q[0] - q[1])
        return v[0] ** 2 + v[1] ** 2 / 2 + coupled + 2 * m.cos(q[0]) + m.cos(q[1])

    problem = Problem(Lagrangian(L, dof=2), q0=ANGLES, v0=np.zeros(2), t_end=T_END)
    return places(integrate(problem, HBVM(), [T_END]).q[-1])


def main() -> None:
    """Print a line for each method."""
    problem, end = pendulum(), in_angles()
    print(f"{'':34} {'time':>8} {'position':>9} {'energy':>8} {'rods':>8}")

    def line(name, y, seconds):
        errors = problem.errors(y[np.newaxis])
        apart = float(np.abs(y[:4] - end).max())
        rods = errors["constraints"].max()
        print(f"{name:34} {seconds:7.4f}s {apart:9.1e} {errors['energy'].max():8.1e} {rods:8.1e}")
        return apart

    steps = {2: [1e-2, 1e-3], 4: [5e-2, 5e-3], 6: [0.1, 0.02], 8: [0.2, 0.05]}
    compositions = [Rattle(composed=order, h=h) for order, both in steps.items() for h in both]
    methods = [
        HBVM(),
        HBVM(tol=1e-8),
        *compositions,
        DOP853(rtol=1e-13, atol=1e-14),
        Taylor(),
        IDA(rtol=1e-10),
    ]
    apart = []
    for method in methods:
        try:
            integrate(problem, method, [T_END])
        except MissingLibraryError as error:
            print(f"{method!r}: {error}")
            continue
        began = time.perf_counter()
        solution = integrate(problem, method, [T_END])
        apart.append(line(repr(method), solution.y[-1], time.perf_counter() - began))
    print("HBVM() is nearest to the problem in angles:", apart[0] == min(apart))


if __name__ == "__main__":
    main()
