"""A double pendulum on rods: HBVM beside RATTLE, its compositions of orders 4, 6 and 8, and others.

RATTLE (H. C. Andersen, J. Comput. Phys. 52 (1983) 24) is of order 2 and symplectic; composed with itself by
the weights in E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration, section V.3.2, it is of order
4 (Suzuki), 6 (Kahan and Li) or 8 (Suzuki and Umeno). DOP853 and heyoka integrate the field from which the
multipliers are eliminated, SUNDIALS' IDA the equations of index 2, with a residual in Python. Errors, at
t = 50, are those of the positions beside the same pendulum in angles, of the energy and of the rods.
"""

import time
from dataclasses import dataclass

import numba
import numpy as np

from integrators import DOP853, HBVM, Taylor, integrate
from integrators.stepping import FixedStep
from problems import Constrained, Lagrangian, Problem, targets

SUZUKI = 1 / (4 - 4 ** (1 / 3))
HALVES = {
    2: [],
    4: [SUZUKI, SUZUKI],
    6: [0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981, 0.08221359629355080023],
    8: [
        0.74167036435061295345, -0.40910082580003159400, 0.19075471029623837995, -0.57386247111608226666,
        0.29906418130365592384, 0.33462491824529818378, 0.31529309239676659663,
    ],
}  # fmt: skip
ANGLES, T_END = np.array([0.5, 0.5]), 50.0


@dataclass(frozen=True, kw_only=True, repr=False)
class Rattle(FixedStep):
    """Compositions of ``p += h/2 f - G' l, q += h C p`` with g(q) = 0, ``p += h/2 f - G' m``, G C p = 0."""

    composed: int = 2
    library, family, citation = "this example", "splitting", "H. C. Andersen, J. Comput. Phys. 52 (1983) 24"

    @property
    def order(self):
        return self.composed

    def accepts(self, problem):
        return None if isinstance(problem.system, Constrained) else "it needs constraints."

    def march(self, system):
        half = HALVES[self.composed]
        weights = np.array([*half, 1 - 2 * sum(half), *half[::-1]])
        slopes, dof = system.slopes("constraints"), system.dof
        rows, columns, n = slopes.rows, slopes.columns, slopes.shape[0]
        force, scale = targets.numba(system.free, "force"), targets.numba(system.free, "velocity_scale")
        constraints = targets.numba(system, system.invariants["constraints"])
        entries = targets.numba(system, slopes.function)

        @numba.njit(error_model="numpy")
        def jacobian(y, par):
            values, G = np.empty(rows.size), np.zeros((n, dof))
            entries(0.0, y, par, values)
            for i in range(rows.size):
                G[rows[i], columns[i]] = values[i]
            return G

        @numba.njit(error_model="numpy")
        def march(t, h, first, count, y, par):
            q, p, c, f, g = y[:dof], y[dof:], np.empty(dof), np.empty(dof), np.empty(n)
            scale(t, y, par, c)
            force(t, y, par, f)
            G = jacobian(y, par)
            for _ in range(count):
                for w in weights:
                    p += 0.5 * w * h * f
                    start, last = q.copy(), np.inf
                    q += w * h * c * p
                    G_start = G
                    for _ in range(50):
                        constraints(0.0, y, par, g)
                        off = np.abs(g).max()
                        if off == 0.0 or (off < 1e-14 and off >= last):
                            break
                        last = off
                        moved = np.linalg.solve(w * h * (jacobian(y, par) * c) @ G_start.T, g)
                        p -= G_start.T @ moved
                        q[:] = start + w * h * c * p
                    force(t, y, par, f)
                    p += 0.5 * w * h * f
                    G = jacobian(y, par)
                    p -= G.T @ np.linalg.solve((G * c) @ G.T, G @ (c * p))

        return march


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


def ida(rtol):
    """Return the state at the end by IDA, from ``q' = u, p' = f - G' l, G u = 0``, and its seconds."""
    from sksundae.ida import IDA

    def residual(t, y, slope, out):
        x, p, v = y[:4], y[4:8], y[8:]
        d = x[2:] - x[:2]
        out[:4] = slope[:4] - p
        out[4:6] = slope[4:6] - ([0.0, -1.0] - v[0] * x[:2] + v[1] * d)
        out[6:8] = slope[6:8] - ([0.0, -1.0] - v[1] * d)
        out[8:] = x[:2] @ p[:2], d @ (p[2:] - p[:2])

    problem = pendulum()
    y = np.concatenate([problem.y0, problem.multipliers(problem.y0)[0]])
    forces = problem.velocity(problem.y0)[0]
    field = targets.numpy(problem.system, "field")(0.0, problem.y0, problem.par)
    slope = np.concatenate([forces, field[4:], np.zeros(2)])
    # an error of the multipliers is one of the velocities divided by the step: it is not controlled
    tolerances = np.array([rtol] * 8 + [1e3] * 2)
    solver = IDA(residual, rtol=rtol, atol=tolerances, algebraic_idx=[8, 9], max_num_steps=10**6)
    began = time.perf_counter()
    found = solver.solve(np.array([0.0, T_END]), y, slope)
    return found.y[-1, :8], time.perf_counter() - began


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
    methods = [HBVM(), HBVM(tol=1e-8), *compositions, DOP853(rtol=1e-13, atol=1e-14), Taylor()]
    apart = []
    for method in methods:
        integrate(problem, method, [T_END])
        began = time.perf_counter()
        solution = integrate(problem, method, [T_END])
        apart.append(line(repr(method), solution.y[-1], time.perf_counter() - began))
    try:
        apart.append(line("IDA, rtol=1e-10", *ida(1e-10)))
    except ImportError:
        print("IDA: scikit-sundae is not installed")
    print("HBVM() is nearest to the problem in angles:", apart[0] == min(apart))


if __name__ == "__main__":
    main()
