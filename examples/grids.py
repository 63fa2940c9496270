"""Reactions on grids, a front and a network, written as loops, beside SciPy's BDF with the sparse pattern."""

import numpy as np
import scipy.sparse
from scipy.integrate import solve_ivp

import problems
from integrators import HBVM, integrate


def brusselator(n):
    """Return the Brusselator on n x n cells of a torus, with a source from t = 1.1 on, and its field."""
    cell = np.arange(n * n).reshape(n, n)
    near = [np.roll(cell, shift, axis) for axis in (0, 1) for shift in (1, -1)]
    stencil = np.stack([cell, *near], axis=-1).reshape(-1, 5)
    x, y = (axis.ravel() for axis in np.meshgrid(*[np.linspace(0.0, 1.0, n)] * 2, indexing="ij"))
    stirred = 5.0 * ((x - 0.3) ** 2 + (y - 0.6) ** 2 <= 0.1**2)
    start = np.concatenate([22.0 * (y * (1 - y)) ** 1.5, 27.0 * (x * (1 - x)) ** 1.5])

    def f(t, y, par, m):
        u, v, source = y[: n * n], y[n * n :], m.array(stirred)
        on = m.where(t > 1.1, 1.0, 0.0)

        def laplace(w, i, *near):
            return par.D * (sum(w[j] for j in near) - 4 * w[i])

        def first(i, *near):
            return 1 + u[i] ** 2 * v[i] - 4.4 * u[i] + laplace(u, i, *near) + source[i] * on

        def second(i, *near):
            return 3.4 * u[i] - u[i] ** 2 * v[i] + laplace(v, i, *near)

        return [m.each(first, stencil), m.each(second, stencil)]

    def by_hand(t, y):
        u, v = y.reshape(2, n, n)

        def laplace(w):
            return 10.0 * (n - 1) ** 2 * (sum(np.roll(w, s, a) for a in (0, 1) for s in (1, -1)) - 4 * w)

        source = stirred.reshape(n, n) * (t > 1.1)
        parts = (1 + u * u * v - 4.4 * u + laplace(u) + source, 3.4 * u - u * u * v + laplace(v))
        return np.concatenate([part.ravel() for part in parts])

    system = problems.VectorField(f, dim=2 * n * n, parameters={"D": 10.0 * (n - 1) ** 2})
    return problems.Problem(system, y0=start, t_end=11.5), by_hand


def medical_akzo_nobel(n):
    """Return a reaction that diffuses into tissue, n points: the inflow ends at t = 5."""
    zeta = np.arange(1, n + 1) / n
    alpha, beta = (zeta - 1.0) ** 3 / 8.0, (zeta - 1.0) ** 4 / 16.0

    def f(t, y, m):
        u, v = y[::2], y[1::2]
        inflow, drift, spread = m.where(t > 5.0, 0.0, 2.0), m.array(alpha), m.array(beta)

        def change(i, left, here, right):
            return (
                drift[i] * (right - left) * (n / 2)
                + spread[i] * (left - 2 * here + right) * n**2
                - 100.0 * here * v[i]
            )

        first = [change(0, inflow, u[0], u[1]), -100.0 * u[0] * v[0]]
        inside = m.each(
            lambda i: (change(i, u[i - 1], u[i], u[i + 1]), -100.0 * u[i] * v[i]), range(1, n - 1)
        )
        last = [-100.0 * u[n - 1] * v[n - 1]] * 2
        return [*first, inside, *last]

    def by_hand(t, y):
        u, v = y[::2], y[1::2]
        padded = np.concatenate([[0.0 if t > 5.0 else 2.0], u, u[-1:]])
        left, right = padded[:-2], padded[2:]
        out = np.empty(2 * n)
        out[1::2] = -100.0 * u * v
        out[::2] = alpha * (right - left) * (n / 2) + beta * (left - 2 * u + right) * n**2 + out[1::2]
        return out

    return problems.Problem(
        problems.VectorField(f, dim=2 * n), y0=np.tile([0.0, 1.0], n), t_end=20.0
    ), by_hand


def fitzhugh_nagumo(n):
    """Return waves in n x n cells of an excitable medium, whose boundary is closed."""
    line = scipy.sparse.diags_array([np.ones(n - 1), np.ones(n - 1)], offsets=(-1, 1))
    line = line - scipy.sparse.diags_array(line.sum(axis=0))
    laplace = scipy.sparse.csr_array(0.5 * scipy.sparse.kronsum(line, line))
    x, y = np.meshgrid(np.arange(n), np.arange(n))
    start = np.concatenate([np.where(x < n // 8, 1.5, -1.2).ravel(), np.where(y < n // 2, 0.6, -0.6).ravel()])

    def f(y, m):
        u, v = y[: n * n], y[n * n :]
        flow = m.dot(laplace, u)
        return [
            m.each(lambda i: flow[i] + u[i] - u[i] ** 3 / 3 - v[i], range(n * n)),
            m.each(lambda i: 0.08 * (u[i] + 0.7 - 0.8 * v[i]), range(n * n)),
        ]

    def by_hand(t, y):
        u, v = y.reshape(2, -1)
        return np.concatenate([laplace @ u + u - u**3 / 3 - v, 0.08 * (u + 0.7 - 0.8 * v)])

    return problems.Problem(problems.VectorField(f, dim=2 * n * n), y0=start, t_end=20.0), by_hand


def kuramoto(n):
    """Return n oscillators, each of which is pulled by ten others."""
    rng = np.random.default_rng(1)
    neighbours = np.array([rng.choice(n, 10, replace=False) for _ in range(n)])
    omega, start = rng.normal(size=n), rng.uniform(-3.0, 3.0, n)

    def f(y, par, m):
        def term(i, near):
            return par.omega[i] + 0.2 * m.sum(lambda j: m.sin(y[j] - y[i]), near)

        return m.each(term, enumerate(neighbours.tolist()))

    def by_hand(t, y):
        return omega + 0.2 * np.sin(y[neighbours] - y[:, np.newaxis]).sum(axis=1)

    system = problems.VectorField(f, dim=n, parameters={"omega": omega})
    return problems.Problem(system, y0=start, t_end=10.0), by_hand


def pattern(system):
    """Return where the Jacobian of a system is not zero, for SciPy."""
    entries = system.jacobian()
    return scipy.sparse.csr_array(
        (np.ones(entries.rows.size), (entries.rows, entries.columns)), shape=(system.dim, system.dim)
    )


def main(sizes=(6, 20, 8, 100)) -> None:
    """Integrate each with a tolerance of 1e-6; errors are those beside a run with 1e-10."""
    makers = (brusselator, medical_akzo_nobel, fitzhugh_nagumo, kuramoto)
    for make, n in zip(makers, sizes, strict=True):
        problem, by_hand = make(n)
        ours, exact = (integrate(problem, HBVM(tol=tol), [problem.t_end]) for tol in (1e-6, 1e-10))
        options = {"rtol": 1e-6, "atol": 1e-9, "jac_sparsity": pattern(problem.system)}
        bdf = solve_ivp(by_hand, (0.0, problem.t_end), problem.y0, "BDF", **options)
        print(f"{make.__name__}({n}), {problem.system.dim} unknowns")
        for name, y, steps in (("HBVM", ours.y[-1], ours.stats.steps), ("BDF", bdf.y[:, -1], bdf.t.size - 1)):
            print(f"  {name}(1e-6): {steps} steps, error {abs(y - exact.y[-1]).max():.1e}")


if __name__ == "__main__":
    main()
