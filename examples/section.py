"""A Poincaré section of Hénon and Heiles' problem: which orbits lie on curves, and which fill an area."""

from time import perf_counter

import numpy as np

import integrators
import problems

ENERGY = 0.125
STARTS = 12


def starts() -> np.ndarray:
    """Return states on the surface q_0 = 0 with p_0 > 0, all of the same energy: (n, 4)."""
    q1 = np.linspace(-0.35, 0.55, STARTS)
    p0 = np.sqrt(2.0 * ENERGY - q1**2 + 2.0 * q1**3 / 3.0)
    zero = np.zeros(STARTS)
    return np.column_stack([zero, q1, p0, zero])


def main() -> None:
    """Make the section of each orbit and say how large a part of the surface it visits."""
    problem = problems.load("henon_heiles")
    method = integrators.HBVM(k=8, s=4, h=0.25)
    surface = integrators.Event(lambda q: q[0], direction=1, terminal=300, name="section")

    def run() -> integrators.Solutions:
        return integrators.integrate_many(
            problem, method, starts=starts(), times=[1e5], events=surface, threads=2
        )

    run()  # compiles
    began = perf_counter()
    made = run()
    seconds = perf_counter() - began

    passages = [events["section"] for events in made.events]
    for start, found in zip(made.starts, passages, strict=True):
        points = np.floor(40.0 * found.y[:, [1, 3]])
        cells = len(np.unique(points, axis=0))
        print(f"q_1 = {start[1]:6.3f} at first: {len(found)} passages through {cells:3d} cells")

    states = np.concatenate([found.y for found in passages])
    print(f"{len(states)} passages in {seconds:.2f} s")
    # 2.3e-13 is the last digit of a time between 1024 and 2048
    print("each on the surface:", bool(np.abs(states[:, 0]).max() < 2.3e-13))
    energies = problem.invariants(states)["energy"]
    print("each at the energy:", bool(np.abs(energies / ENERGY - 1.0).max() < 1e-13))


if __name__ == "__main__":
    main()
