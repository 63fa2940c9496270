"""The stage equations of HBVM(k, s) for a function in Python, solved to round-off.

The unknowns are ``G_j = h gamma_j``, shape (s, n), real or complex, with the stages
``Y = y + (e + I G)`` and the equations ``G = h P' Omega f(t + c h, Y)``. They are solved here for states
that may be complex, and with the user's Jacobian; see `integrators.plugins.scipy.python` for what the kernel
would take. What counts as rounding is the kernel's rule.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import OdeSolver

from integrators.coefficients.legendre import legendre, tables
from integrators.plugins.rule import (
    CONVERGED,
    FARTHEST,
    FLOOR,
    MAX_ITERATIONS,
    MODES,
    STAGNATION,
    STAGNATION_LIMIT,
    is_rounding,
)

HOPELESS = 4  # changes that are no new smallest one, above STAGNATION, after which the iteration has failed
SURE = 10  # iterations after which their rate is believed
SQRT3 = float(np.sqrt(3.0))

Array = NDArray[Any]


@dataclass
class Solved:
    """How an iteration ended.

    Attributes
    ----------
    G : ndarray, shape (s, n)
        The coefficients.
    values : ndarray, shape (k, n)
        h times the field at the stages.
    converged : bool
        Whether the equations are solved to round-off.
    rate : float
        The largest ratio of a change to the one before it, old ratios counting half as much each time.
    """

    G: Array
    values: Array
    converged: bool
    rate: float


class Stages:
    """HBVM(k, s) for the function of a solver.

    Parameters
    ----------
    solver : OdeSolver
        Whose function it is; its ``nfev`` counts the states at which it is evaluated.
    k, s : int
        Nodes of the quadrature and degree.
    together : bool
        Whether the function takes all stages, as columns, and their times in one call.
    """

    def __init__(self, solver: OdeSolver, k: int, s: int, *, together: bool = False) -> None:
        self.solver, self.k, self.s, self.together = solver, k, s, together
        table = tables(k, s)
        self.nodes, self.integrals = table.nodes.hi, table.integrals.hi
        self.projection = table.projection.hi
        # P_s at the nodes, where it vanishes with k = s; then P_{s-1}.
        self.beyond = tables(k, min(s + 1, k)).projection.hi[-1]

    def with_nodes(self, k: int) -> "Stages":
        """Return the same with another number of nodes."""
        return Stages(self.solver, k, self.s, together=self.together)

    def try_together(self, t: float, h: float, y: Array, f: Array) -> None:
        """Find out whether a vectorized function takes k times with k columns, and use it if so."""
        Y = y + np.outer(self.nodes * h, f)
        apart = self.field(t, h, Y)
        self.together = True
        try:
            values = self.field(t, h, Y)
            # The same operations on arrays may round differently, in the vectors' tails for one.
            self.together = values.shape == apart.shape and np.allclose(values, apart, rtol=1e-12, atol=0.0)
        except Exception:  # whatever the function makes of times that it was not promised
            self.together = False

    def field(self, t: float, h: float, Y: Array) -> Array:
        """Return h f at the stages Y, shape (k, n)."""
        self.solver.nfev += len(Y)
        times = t + self.nodes * h
        if self.together:
            return h * self.solver.fun_vectorized(times, np.ascontiguousarray(Y.T)).T
        values, fun = np.empty_like(Y), self.solver.fun_single
        for i, time in enumerate(times.tolist()):
            values[i] = fun(time, Y[i])
        return h * values

    def solve(
        self, t: float, h: float, y: Array, e: Array, G: Array,
        correct: Callable[[Array], Array] | None = None, most: int = MAX_ITERATIONS, slowest: float = np.inf,
    ) -> Solved:  # fmt: skip
        """Solve the stage equations from a first guess ``G``.

        Parameters
        ----------
        t, h : float
            Start and length of the step.
        y, e : ndarray, shape (n,)
            State and its compensation.
        G : ndarray, shape (s, n)
            First guess.
        correct : callable, optional
            Newton's correction for a residual (s, n); ``None``: fixed point.
        most : int
            Iterations after which it has failed if changes are still above `STAGNATION`.
        slowest : float
            Rate above which changes shrink too slowly to go on.
        """
        best, last, stalled, rate = np.inf, np.inf, 0, 0.0
        values = np.empty((self.k, y.size), y.dtype)
        size_y = np.abs(y)
        for iteration in range(MAX_ITERATIONS):
            values = self.field(t, h, y + (e + self.integrals @ G))
            residual = self.projection @ values - G
            if correct is not None and np.isfinite(residual).all():
                residual = correct(residual)
            new = G + residual
            moved = np.abs(new - G).max(axis=0)
            size = np.maximum(size_y + np.abs(new).max(axis=0), moved)  # new may be 0
            top = size.max()
            if not np.isfinite(top):
                return Solved(G, values, False, np.inf)
            moving = moved > 0.0
            strict = float((moved[moving] / size[moving]).max()) if moving.any() else 0.0
            floored = float((moved / np.maximum(size, FLOOR * top)).max()) if top > 0.0 else 0.0
            G = new
            if strict <= CONVERGED:
                return Solved(G, values, True, rate)
            if floored < best:
                best, stalled = floored, 0
            else:
                stalled += 1
            if best < STAGNATION:
                if stalled and is_rounding(best, stalled >= STAGNATION_LIMIT, STAGNATION):
                    return Solved(G, values, True, rate)
            elif stalled >= HOPELESS or iteration + 1 == most:
                return Solved(G, values, False, np.inf)
            if iteration and floored > STAGNATION:
                rate = floored / last if iteration == 1 else max(0.5 * rate, floored / last)
                if iteration >= SURE and rate > slowest:
                    return Solved(G, values, False, rate)
            last = floored
        return Solved(G, values, False, max(rate, 1.0))

    def guess(self, G: Array, ratio: float) -> Array:
        """Extrapolate the previous step's polynomial (coefficients G) to a step ``ratio`` times as long."""
        if not 0.0 < ratio <= FARTHEST:
            return np.zeros_like(G)
        modes = min(self.s, MODES)
        return ratio * (self.projection @ (legendre(1.0 + ratio * self.nodes, modes) @ G[:modes]))

    def within(self, G: Array, part: float) -> Array:
        """Return the coefficients of the first ``part`` of a step's polynomial, of coefficients G."""
        return part * (self.projection @ (legendre(part * self.nodes, self.s) @ G))

    def last_coefficient(self, solved: Solved, start: Array | None) -> Array:
        """Return the last Legendre coefficient by which a step may be judged, times h.

        gamma_s where k > s. With k = s the nodes do not show it, and gamma_{s-1} serves, as in the kernel:
        what the field at the start tells of gamma_s is too little at long steps. One node leaves nothing
        else: h f at the start of the step is then ``start``, and ``None`` otherwise.
        """
        if start is None:
            return self.beyond @ solved.values
        return (solved.G[0] - start) / SQRT3  # P_1 is -sqrt(3) at the start

    def coefficients(self, values: Array) -> Array:
        """Return all k Legendre coefficients that k stage values determine, shape (k, n)."""
        return tables(self.k, self.k).projection.hi @ values
