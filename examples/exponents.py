"""The largest Lyapunov exponents of Lorenz' system, beside two neighbours that SciPy follows."""

import numpy as np
from scipy.integrate import solve_ivp
from side_by_side import clocked

import integrators
import problems

END, SKIP, ROUND, APART = 400.0, 20.0, 0.5, 1e-7


def lorenz(y):
    """Return the derivative."""
    return [10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 * y[2] / 3]


def by_neighbours() -> float:
    """Return the largest exponent from a neighbour that is brought near again and again."""
    y = np.array([1.0, 2.0, 20.0])
    y = solve_ivp(lambda _, y: lorenz(y), (0.0, SKIP), y, method="DOP853", rtol=1e-10, atol=1e-10).y[:, -1]
    beside, grown = y + np.array([APART, 0.0, 0.0]), 0.0
    for _ in range(round((END - SKIP) / ROUND)):
        both = solve_ivp(
            lambda _, y: [*lorenz(y[:3]), *lorenz(y[3:])],
            (0.0, ROUND), np.append(y, beside), method="DOP853", rtol=1e-10, atol=1e-10,
        ).y[:, -1]  # fmt: skip
        y, gap = both[:3], both[3:] - both[:3]
        grown += np.log(np.linalg.norm(gap) / APART)
        beside = y + gap * (APART / np.linalg.norm(gap))
    return grown / (END - SKIP)


def main() -> None:
    """Compute all three from tangent vectors, and one from neighbours."""
    system = problems.VectorField(lorenz, dim=3)
    problem = problems.Problem(system, y0=[1.0, 2.0, 20.0], t_end=END)
    found = clocked("tangent vectors", lambda: integrators.lyapunov(problem, skip=SKIP))
    other = clocked("SciPy's DOP853, neighbours", by_neighbours)
    for exponent, (low, high) in zip(found.exponents, found.intervals, strict=True):
        print(f"{exponent:8.4f}, between {low:.3f} and {high:.3f}")
    print(f"by neighbours {other:.3f}")
    print("the interval holds 0.9056:", bool(found.intervals[0, 0] < 0.9056 < found.intervals[0, 1]))
    print("their sum is -41/3:", bool(abs(found.sum + 41 / 3) < 1e-8))


if __name__ == "__main__":
    main()
