"""A sparse network of oscillators and a grid of reacting cells, written as loops, beside SciPy."""

import numpy as np
import scipy.sparse
from scipy.integrate import solve_ivp
from side_by_side import clocked

import integrators
import problems


def network(n):
    """Return oscillators that pull at ten others each, and the same right-hand side for SciPy."""
    rng = np.random.default_rng(1)
    neighbours = [rng.choice(n, 10, replace=False) for _ in range(n)]
    omega, start = rng.normal(size=n), rng.uniform(-3.0, 3.0, n)

    def f(y, par, m):
        def term(i, near):
            return par.omega[i] + 0.1 * m.sum(lambda j: m.sin(y[j] - y[i]), near)

        return m.each(term, enumerate(neighbours))

    system = problems.VectorField(f, dim=n, parameters={"omega": omega})
    columns = np.array(neighbours)

    def by_hand(t, y):
        return omega + 0.1 * np.sin(y[columns] - y[:, np.newaxis]).sum(axis=1)

    return problems.Problem(system, y0=start, t_end=10.0), by_hand


def grid(n):
    """Return a reaction with diffusion on n x n cells, the diffusion a sparse matrix."""
    line = scipy.sparse.diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(n, n)).tolil()
    line[0, n - 1] = line[n - 1, 0] = 1.0
    laplace = scipy.sparse.kronsum(line, line).tocsr()
    start = np.random.default_rng(2).uniform(-1.0, 1.0, n * n)

    def f(y, m):
        flow = m.dot(laplace, y)
        return m.each(lambda i: flow[i] + y[i] - y[i] ** 3, range(n * n))

    def by_hand(t, y):
        return laplace @ y + y - y**3

    return problems.Problem(problems.VectorField(f, dim=n * n), y0=start, t_end=5.0), by_hand


def main() -> None:
    """Integrate both, and compare with SciPy."""
    for name, (problem, by_hand) in {"network": network(200), "grid": grid(12)}.items():
        method, span = integrators.HBVM(), (0.0, problem.t_end)
        solution = clocked(
            f"HBVM(), {name}", lambda p=problem, m=method, s=span: integrators.integrate(p, m, [s[1]])
        )
        scipys = clocked(
            "SciPy's DOP853",
            lambda f=by_hand, p=problem, s=span: solve_ivp(f, s, p.y0, "DOP853", rtol=1e-12, atol=1e-13),
        )
        apart = abs(solution.y[-1] - scipys.y[:, -1]).max()
        print(f"{name}: the same state as SciPy's: {apart < 1e-10}")


if __name__ == "__main__":
    main()
