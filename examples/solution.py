"""A solution one can hold: states at any time, a file, another process."""

import tempfile
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import integrators
import problems


def energy(q, p, m, par):
    """Return the energy of a pendulum on a spring."""
    return (p[0] ** 2 + p[1] ** 2) / 2 + par.k * (m.sqrt(q[0] ** 2 + q[1] ** 2) - 1) ** 2 / 2 + q[1]


def run(problem: problems.Problem) -> integrators.Solution:
    """Integrate, in whatever process this is called."""
    return integrators.integrate(problem, integrators.HBVM(tol=1e-13), times=np.arange(0.0, 50.5, 0.5))


def main() -> None:
    """Show each of them."""
    system = problems.Hamiltonian(lambda q, p, m, par: energy(q, p, m, par), dof=2, parameters={"k": 20.0})
    swing = problems.Problem(system, q0=[0.3, -1.0], p0=[0.0, 0.1], t_end=50.0)
    solution = run(swing)
    print(solution)

    print("positions at t = 12.3456:", solution(12.3456)[:2])
    between = solution(np.linspace(12.0, 13.0, 101))
    print("error of the energy between samples:", swing.errors(between)["energy"].max())

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "swing.npz"
        solution.save(path)
        again = integrators.load(path)
    print("the same from a file:", bool((again.y == solution.y).all()), again.problem == swing)

    # The problem was made from a lambda: it is pickled as the formula that was traced.
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        there = pool.submit(run, swing).result()
    print("the same from another process:", bool((there.y == solution.y).all()))


if __name__ == "__main__":
    main()
