"""Milliseconds per step of molecular dynamics with 32, 108 and 256 atoms, beside a plain Verlet in numba.

The boxes have the density of `molecular_dynamics.py`, and the cutoff is at most half a box. Each time is the
least of several runs; other work on the machine changes it.

    python examples/molecular_dynamics_sizes.py [cells ...]
"""

import sys
from time import perf_counter

from molecular_dynamics import BOX, CUT, crystal, verlet

import integrators

CELLS, STEP, STEPS, RUNS = (2, 3, 4), 0.005, 10, 5
METHODS = (integrators.HBVM(k=4, s=2, h=STEP), integrators.Gauss(s=2, h=STEP))


def milliseconds(run, steps: int) -> float:
    """Return the time of a step in ms, from the fastest of some runs; the first one compiles."""
    run()
    times = []
    for _ in range(RUNS):
        began = perf_counter()
        run()
        times.append(perf_counter() - began)
    return 1e3 * min(times) / steps


def row(cells: int) -> list[float]:
    """Return the number of atoms, then the times of the methods, then that of Verlet."""
    box = BOX * cells / 3
    cut = min(CUT, box / 2)
    problem = crystal(cells, box, cut)
    half = problem.y0.size // 2
    q0, p0 = problem.y0[:half], problem.y0[half:]
    times = [
        milliseconds(lambda method=method: integrators.integrate(problem, method, [STEPS * STEP]), STEPS)
        for method in METHODS
    ]
    plain = milliseconds(lambda: verlet(q0, p0, STEP, 100 * STEPS, box, cut), 100 * STEPS)
    return [half // 3, *times, plain]


if __name__ == "__main__":
    print("atoms", *METHODS, "Verlet", sep=" | ")
    for cells in map(int, sys.argv[1:] or CELLS):
        atoms, *times = row(cells)
        print(atoms, *(f"{time:.3g} ms" for time in times), sep=" | ", flush=True)
