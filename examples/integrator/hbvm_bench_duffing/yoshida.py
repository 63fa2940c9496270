"""Yoshida's composition of order 6, written as a guest of hbvm-bench.

    S(h) = Phi(w_3 h) Phi(w_2 h) Phi(w_1 h) Phi(w_0 h) Phi(w_1 h) Phi(w_2 h) Phi(w_3 h)

of Stoermer-Verlet steps Phi(h): q += h/2 c p, p += h F(q), q += h/2 c p.
"""

from dataclasses import dataclass

import numba
import numpy as np

from integrators.stepping import FixedStep
from problems import targets

W = (-1.17767998417887, 0.235573213359357, 0.784513610477560)  # solution A of the paper
WEIGHTS = (W[2], W[1], W[0], 1.0 - 2.0 * sum(W), W[0], W[1], W[2])


@dataclass(frozen=True, kw_only=True, repr=False)
class Yoshida6(FixedStep):
    """Yoshida's symplectic composition of seven Stoermer-Verlet steps, with a fixed step."""

    order, evaluations = 6, 7
    library, family = "hbvm-bench-duffing", "splitting"
    citation = (
        "H. Yoshida, Construction of higher order symplectic integrators, Phys. Lett. A 150 (1990) 262-268"
    )

    def accepts(self, problem):
        return None if problem.system.separable else "it needs H = sum of c p^2/2 + V(q, t)."

    def march(self, system):
        force, scale, dof = (
            targets.numba(system, "force"),
            targets.numba(system, "velocity_scale"),
            system.dof,
        )

        @numba.njit(error_model="numpy")
        def march(t, h, first, n, y, par):
            q, p, c, F = y[:dof], y[dof:], np.empty(dof), np.empty(dof)
            scale(t, y, par, c)
            for i in range(first, first + n):
                now = t + i * h
                for w in WEIGHTS:
                    q += 0.5 * w * h * (c * p)
                    force(now + 0.5 * w * h, q, par, F)
                    p += w * h * F
                    q += 0.5 * w * h * (c * p)
                    now += w * h

        return march
