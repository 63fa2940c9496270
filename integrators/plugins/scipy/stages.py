"""The stage equations of HBVM(k, s) for a function in Python: fixed point, Newton, error estimate.

The unknowns are ``G_j = h gamma_j``, shape (s, n), real or complex, with the stages
``Y = y + (e + I G)`` and the equations ``G = h P' Omega f(t + c h, Y)``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.legendre import legendre, tables, x_matrix, xi

CONVERGED = 1e-16
STAGNATION = 1e-13  # above it, a change that stops decreasing is a failure
PATIENCE = 2  # changes that are no new smallest one, to end the iteration below STAGNATION
HOPELESS = 4  # the same above STAGNATION
MAX_ITERATIONS = 100
FLOOR = 1e-3  # of the largest size: where rounding of the field may hide a small component
MODES = 12  # P_j(2) grows like 5.8^j: beyond, extrapolation amplifies rounding more than it helps
FARTHEST = 2.0  # no extrapolation farther than this many previous steps
SQRT3 = float(np.sqrt(3.0))

Complex = NDArray[Any]
Function = Callable[[Any, Complex], Complex]


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
        By how much a change was smaller than the one before, at best.
    """

    G: Complex
    values: Complex
    converged: bool
    rate: float


class Stages:
    """HBVM(k, s) for one function; counts the states at which it was evaluated.

    Parameters
    ----------
    fun : callable
        ``fun(t, y) -> (n,)``.
    dtype : type
        float or complex.
    vectorized : bool
        Whether ``fun`` takes and returns columns, (n, m).
    """

    def __init__(self, fun: Function, dtype: type, k: int, s: int, *, vectorized: bool = False) -> None:
        self.fun, self.dtype, self.vectorized, self.together = fun, dtype, vectorized, False
        self.evaluations = 0
        self.k, self.s = k, s
        table = tables(k, s)
        self.nodes, self.integrals, self.projection = (
            table.nodes.hi,
            table.integrals.hi,
            table.projection.hi,
        )
        self.modes = min(s, MODES)
        # P_s at the nodes, where it vanishes with k = s.
        self.beyond = tables(k, s + 1).projection.hi[s] if k > s else None

    def with_nodes(self, k: int) -> "Stages":
        """Return the same with another number of nodes; the count goes on."""
        other = Stages(self.fun, self.dtype, k, self.s, vectorized=self.vectorized)
        other.together, other.evaluations = self.together, self.evaluations
        return other

    def try_together(self, t: float, h: float, y: Complex, f: Complex) -> None:
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

    def field(self, t: float, h: float, Y: Complex) -> Complex:
        """Return h f at the stages Y, shape (k, n)."""
        self.evaluations += len(Y)
        times = t + self.nodes * h
        if self.together:
            return h * np.asarray(self.fun(times, np.ascontiguousarray(Y.T)), dtype=self.dtype).T
        values = np.empty_like(Y)
        for i, time in enumerate(times.tolist()):
            if self.vectorized:
                values[i] = np.asarray(self.fun(time, Y[i][:, None]), dtype=self.dtype).ravel()
            else:
                values[i] = np.asarray(self.fun(time, Y[i]), dtype=self.dtype)
        return h * values

    def solve(
        self, t: float, h: float, y: Complex, e: Complex, G: Complex,
        correct: Callable[[Complex], Complex] | None = None, most: int = MAX_ITERATIONS,
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
            Iterations after which it has failed.
        """
        best, last, stalled, rate = np.inf, np.inf, 0, 0.0
        values = np.empty((self.k, y.size), self.dtype)
        size_y = np.abs(y)
        for iteration in range(most):
            values = self.field(t, h, y + (e + self.integrals @ G))
            residual = self.projection @ values - G
            if correct is not None and np.isfinite(residual).all():
                residual = correct(residual)
            new = G + residual
            moved = np.abs(new - G).max(axis=0)
            size = size_y + np.abs(new).max(axis=0)
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
                if stalled >= PATIENCE + iteration // 16:
                    return Solved(G, values, True, rate)
            elif stalled >= HOPELESS:
                return Solved(G, values, False, np.inf)
            if iteration and floored > STAGNATION:
                rate = floored / last if iteration == 1 else max(0.5 * rate, floored / last)
            last = floored
        return Solved(G, values, False, max(rate, 1.0))

    def guess(self, G: Complex, ratio: float) -> Complex:
        """Extrapolate the previous step's polynomial (coefficients G) to a step ``ratio`` times as long."""
        if not 0.0 < ratio <= FARTHEST:
            return np.zeros_like(G)
        beyond = legendre(1.0 + ratio * self.nodes, self.modes)
        return ratio * (self.projection @ (beyond @ G[: self.modes]))

    def within(self, G: Complex, part: float) -> Complex:
        """Return the coefficients of the first ``part`` of a step's polynomial, of coefficients G."""
        return part * (self.projection @ (legendre(part * self.nodes, self.s) @ G))

    def last_coefficient(self, solved: Solved, start: Complex | None) -> Complex:
        """Return the last Legendre coefficient by which a step may be judged, times h.

        gamma_s where k > s. With k = s the nodes do not show it, and gamma_{s-1} serves, as in the kernel:
        what the field at the start tells of gamma_s is too little at long steps. One node leaves nothing
        else: h f at the start of the step is then ``start``, and ``None`` otherwise.
        """
        if self.beyond is not None:
            return self.beyond @ solved.values
        if start is None:
            return solved.G[-1]
        return (solved.G[0] - start) / SQRT3  # P_1 is -sqrt(3) at the start

    def coefficients(self, values: Complex) -> Complex:
        """Return all k Legendre coefficients that k stage values determine, shape (k, n)."""
        return tables(self.k, self.k).projection.hi @ values


def polynomial(c: NDArray[np.float64], G: Complex) -> Complex:
    """Return ``sum_j G_j int_0^c P_j`` for points c, shape (points, n)."""
    s = len(G)
    P = legendre(c, s + 1)
    integrals = np.empty((c.size, s))
    integrals[:, 0] = c
    for j in range(1, s):
        integrals[:, j] = xi(j + 1) * P[:, j + 1] - xi(j) * P[:, j - 1]
    return integrals @ G


class Newton:
    """Simplified Newton for the stage equations: ``I - h X_s x J``, after diagonalising X_s.

    X_s has conjugate pairs of eigenvalues, so a real problem takes ceil(s/2)
    factorisations of size n, a complex one s.

    Parameters
    ----------
    s : int
        Degree.
    real : bool
        Whether the problem is real.

    Attributes
    ----------
    h : float
        The step of the factorisations, 0 if there are none.
    """

    def __init__(self, s: int, *, real: bool) -> None:
        eigenvalues, vectors = np.linalg.eig(x_matrix(s))
        inverse = np.linalg.inv(vectors)
        self.real = real
        if real:
            # One of each pair; a pair's two terms are conjugate, so it counts twice.
            kept = np.imag(eigenvalues) >= 0.0
            weight = np.where(np.imag(eigenvalues)[kept] > 0.0, 2.0, 1.0)
        else:
            kept, weight = np.full(s, True), np.ones(s)
        self.eigenvalues = eigenvalues[kept]
        self.vectors, self.inverse = vectors[:, kept] * weight, inverse[kept]
        self._solvers: list[Callable[[Complex], Complex]] = []
        self.h = 0.0

    def factorize(self, h: float, factor: Callable[[complex], Callable[[Complex], Complex]]) -> None:
        """Factorise ``I - h lambda J`` for the eigenvalues; ``factor(z)`` solves with ``I - z J``."""
        self.h = h
        self._solvers = [factor(h * z) for z in self.eigenvalues.tolist()]

    def correct(self, residual: Complex) -> Complex:
        """Return the correction of G for a residual (s, n)."""
        parts = self.inverse @ residual
        parts = np.array([solve(part) for solve, part in zip(self._solvers, parts, strict=True)])
        change = self.vectors @ parts
        return np.real(change) if self.real else change
