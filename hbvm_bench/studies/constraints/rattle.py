"""RATTLE and its compositions: ``constraints.rattle:Rattle(composed=4, h=0.01)`` in a campaign."""

from dataclasses import dataclass
from typing import Literal

import numba
import numpy as np

from hbvm_bench.studies.constraints.equations import Equations, refusal
from integrators.stepping import FixedStep, March
from problems.problem import Problem, System

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
"""The first weights of the compositions, which are symmetric; the one in the middle makes their sum 1."""
ITERATIONS, ROUNDED = 50, 1e-14  # of the positions; what may be left of a constraint, if it grows then


@dataclass(frozen=True, kw_only=True, repr=False)
class Rattle(FixedStep):
    """RATTLE, composed with itself.

    ``p += h/2 f(q) - G(q)' l, q += h c p`` with l from g(q) = 0; then ``p += h/2 f(q) - G(q)' m`` with m from
    G c p = 0. Of order 2 and symplectic; composed of order 4 (Suzuki), 6 (Kahan and Li) or 8 (Suzuki and
    Umeno) by the weights in E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical Integration*, section
    V.3.2. The constraints are solved by Newton's method with the Jacobian at both ends, to rounding.

    Parameters
    ----------
    h : float
        Step, > 0.
    composed : {2, 4, 6, 8}
        Order.

    References
    ----------
    H. C. Andersen, J. Comput. Phys. 52 (1983) 24-34.
    """

    composed: Literal[2, 4, 6, 8] = 2

    library, family = "hbvm-bench-studies", "splitting"
    citation = "H. C. Andersen, J. Comput. Phys. 52 (1983) 24-34"
    computes_with = ("numpy", "numba")
    built = "compiled on this machine by numba"

    @property
    def order(self) -> int:
        """Order of the composition."""
        return self.composed

    def accepts(self, problem: Problem) -> str | None:
        """Say why it does not integrate a problem."""
        return refusal(problem)

    def march(self, system: System) -> March:
        """Return the compiled steps."""
        scale, force, constraints, entries, rows, columns, dof, n = Equations.of(system)
        half = HALVES[self.composed]
        weights = np.array([*half, 1 - 2 * sum(half), *half[::-1]])

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
                    before = G
                    for _ in range(ITERATIONS):
                        constraints(0.0, y, par, g)
                        off = np.abs(g).max()
                        if off == 0.0 or (off < ROUNDED and off >= last):
                            break
                        last = off
                        p -= before.T @ np.linalg.solve(w * h * (jacobian(y, par) * c) @ before.T, g)
                        q[:] = start + w * h * c * p
                    force(t, y, par, f)
                    p += 0.5 * w * h * f
                    G = jacobian(y, par)
                    p -= G.T @ np.linalg.solve((G * c) @ G.T, G @ (c * p))

        return march


METHODS = {"Rattle": Rattle}
