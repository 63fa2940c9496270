"""Steps in Python for a function in Python: length, solver and number of nodes are found as they go."""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DenseOutput, OdeSolver
from scipy.integrate._ivp import common

from integrators.legendre import x_matrix
from integrators.plugins.scipy.jacobian import Jacobian, size
from integrators.plugins.scipy.output import PolynomialOutput, StepOutput
from integrators.plugins.scipy.stages import Newton, Solved, Stages

SAFETY = 0.9
SHRINK, GROW = 0.2, 10.0  # bounds of the change of the step
CONTRACTION = 0.35  # of the fixed-point iteration: beyond it, shorter steps cost less
STIFF = 4.0  # Newton when the tolerance permits steps so much longer than the fixed point does
STIFF_STEPS = 3  # for so many steps in a row
MILD = 0.25  # the fixed point again when h ||J|| times the largest eigenvalue of X_s is below
SLOW = 0.1  # rate of Newton's iteration above which the Jacobian is too old
KEEP = 1.2  # Newton's factorisations are kept when the step could only grow by less
NEWTON_ITERATIONS = 12
MOST_NODES = 64
UNSEEN = 1e-8  # size of the last two coefficients that k nodes determine, relative, for an automatic k

CLOSE = 1e-9  # part of a constant step that is not made for its own sake

Array = NDArray[Any]


class PythonSteps:
    """Steps of HBVM(k, s) for an `OdeSolver`.

    Parameters
    ----------
    solver : OdeSolver
        At its start, with ``rtol``, ``atol`` and ``max_step``.
    fun : callable
        As the user gave it.
    k : int or None
        Nodes of the quadrature; ``None``: 2s, and more as soon as that would not see the
        energy to round-off.
    s : int
        Degree.
    h : float or None
        Length of all steps; ``None``: as long as the tolerances allow.
    first_step, jac, jac_sparsity
        As for `scipy.integrate.Radau`.
    interpolant : {"step", "polynomial"}
        How states between the steps are made.

    Attributes
    ----------
    k : int
        Nodes in use.
    """

    def __init__(
        self, solver: Any, fun: Any, *, k: int | None, s: int, h: float | None, first_step: float | None,
        jac: Any, jac_sparsity: Any, interpolant: str,
    ) -> None:  # fmt: skip
        t, y = solver.t, solver.y
        self.k, self._s, self._automatic, self._interpolant = (
            2 * s if k is None else k,
            s,
            k is None,
            interpolant,
        )
        self._given, self._fun, self._vectorized = fun, solver.fun, solver.vectorized
        self._direction, self._t_bound, self._max_step = solver.direction, solver.t_bound, solver.max_step
        self._rtol, self._atol = solver.rtol, solver.atol
        self._dtype = complex if np.iscomplexobj(y) else float
        self._start, self._count = t, 0
        self._constant = 0.0 if h is None else h * self._direction
        self._f: Array | None = self._fun(t, y)
        if h is not None:
            self.h_abs = h
        elif first_step is None:
            self.h_abs = common.select_initial_step(
                self._fun, t, y, self._t_bound, self._max_step, self._f, self._direction, 2 * s,
                self._rtol, self._atol,
            )  # fmt: skip
        else:
            self.h_abs = first_step
        # Of the estimate of a step's error; without gamma_s it is one of a lower order.
        self._order = 2 * s - 1 if self.k == s > 1 else 2 * s + 1
        self._stages: Stages | None = None
        self._jacobian = Jacobian(solver.fun_vectorized, y.size, self._dtype, self._atol, jac, jac_sparsity)
        self._newton: Newton | None = None
        self._J: Any = None
        self._J_current = False
        self._limited = 0
        self._radius = float(np.abs(np.linalg.eigvals(x_matrix(s))).max())
        self._e = np.zeros_like(y)
        self._G = np.zeros((s, y.size), self._dtype)
        self._h = 0.0
        self._error_old = 0.0
        self._step: tuple[float, float, Array, Array, Array, Array] | None = None

    @property
    def evaluations(self) -> int:
        """States at which the function was evaluated besides those that the solver counts."""
        return 0 if self._stages is None else self._stages.evaluations

    @property
    def jacobians(self) -> int:
        """Evaluations of the Jacobian."""
        return self._jacobian.evaluations

    @property
    def factorizations(self) -> int:
        """Factorisations."""
        return self._jacobian.factorizations

    def take(self, t: float, y: Array) -> tuple[float, Array] | str:
        """Take a step from (t, y), which is where the last one ended; return time and state, or why not."""
        e = self._e
        if self._constant:
            return self._take_constant(t, y, e)
        least = 10 * abs(np.nextafter(t, self._direction * np.inf) - t)
        h_abs = self._max_step if self.h_abs > self._max_step else max(self.h_abs, least)
        rejected = False
        while True:
            if not h_abs >= least:
                return OdeSolver.TOO_SMALL_STEP
            t_new = t + h_abs * self._direction
            if self._direction * (t_new - self._t_bound) > 0.0:
                t_new = self._t_bound
            h = t_new - t
            h_abs = abs(h)
            solved = self._solve(t, h, y, e)
            if not solved.converged:
                h_abs, rejected = 0.5 * h_abs, True
                continue
            error = self._error(t, h, y, solved)
            if not error <= 1.0:
                wanted = SAFETY * error ** (-1.0 / self._order) if np.isfinite(error) else SHRINK
                h_abs, rejected = h_abs * max(SHRINK, wanted), True
                continue
            if self._automatic and not self._seen(solved):
                self._raise_k(t, h)
                continue
            break
        self.h_abs = h_abs * self._factor(h_abs, error, solved.rate, rejected)
        self._error_old = error
        return t_new, self._add(t, t_new, y, e, solved)

    def _take_constant(self, t: float, y: Array, e: Array) -> tuple[float, Array] | str:
        """Take a step of the length given, or what is left of it."""
        t_new = self._start + (self._count + 1) * self._constant
        if self._direction * (t_new - self._t_bound) > -CLOSE * abs(self._constant):
            t_new = self._t_bound
        solved = self._solve(t, t_new - t, y, e)
        if not solved.converged:
            return (
                f"the stage equations have not been solved in the step from t = {t!r}, "
                f"h = {abs(self._constant)!r}; take a smaller h."
            )
        self._count += 1
        return t_new, self._add(t, t_new, y, e, solved)

    def _add(self, t: float, t_new: float, y: Array, e: Array, solved: Solved) -> Array:
        """Return the state at the end of a solved step, with what rounding leaves of it kept."""
        increment = solved.G[0] + e
        new = y + increment
        part = new - y
        self._step = (t, t_new, y, e, solved.G, new)
        self._e = (y - (new - part)) + (increment - part)
        self._G, self._h, self._f = solved.G, t_new - t, None
        return new

    def _factor(self, h_abs: float, error: float, rate: float, rejected: bool) -> float:
        """Return by how much the next step is longer: predictive control, and what the solver needs."""
        order = self._order
        factor = SAFETY * error ** (-1.0 / order) if error > 0.0 else GROW
        if self._error_old > 0.0 and error > 0.0 and self._h:
            factor = min(factor, factor * h_abs / abs(self._h) * (self._error_old / error) ** (1.0 / order))
        factor = min(GROW, max(SHRINK, factor), 1.0 if rejected else GROW)
        if self._newton is not None:
            self._J_current = self._jacobian.constant
            if rate > SLOW and not self._jacobian.constant:
                self._J = None
            elif 1.0 <= factor < KEEP:
                factor = 1.0
            return factor
        permitted = CONTRACTION / rate if rate > 0.0 else GROW
        self._limited = self._limited + 1 if factor > STIFF * permitted else 0
        return max(SHRINK, min(factor, permitted))

    def _solve(self, t: float, h: float, y: Array, e: Array) -> Solved:
        """Solve the stage equations of a step, by the solver that suits."""
        stages = self._ready(t, h, y)
        guess = stages.guess(self._G, h / self._h if self._h else 0.0)
        if self._newton is None and self._limited < STIFF_STEPS:
            solved = stages.solve(t, h, y, e, guess)
            if solved.converged or not self._h:
                return solved
            return stages.solve(t, h, y, e, np.zeros_like(guess))
        if self._newton is None:
            self._newton, self._J = Newton(self._s, real=self._dtype is float), None
        while True:
            if self._J is None:
                self._J, self._J_current = self._jacobian(t, y, self._slope(t, y)), True
                self._newton.h = 0.0
            if abs(h) * size(self._J) * self._radius < MILD:
                self._newton, self._limited = None, 0
                return stages.solve(t, h, y, e, guess)
            if self._newton.h != h:
                self._newton.factorize(h, partial(self._jacobian.factorize, self._J))
            solved = stages.solve(t, h, y, e, guess, self._newton.correct, NEWTON_ITERATIONS)
            if solved.converged or self._J_current:
                return solved
            self._J = None

    def _ready(self, t: float, h: float, y: Array) -> Stages:
        """Return the stages, made at the first step, which tells where the function may be tried."""
        if self._stages is None:
            self._stages = Stages(self._given, self._dtype, self.k, self._s, vectorized=self._vectorized)
            if self._vectorized:
                self._stages.try_together(t, h, y, self._slope(t, y))
        return self._stages

    def _slope(self, t: float, y: Array) -> Array:
        """Return f at the start of the step, evaluated at most once."""
        f = self._fun(t, y) if self._f is None else self._f
        self._f = f
        return f

    def _error(self, t: float, h: float, y: Array, solved: Solved) -> float:
        """Return the size of ``h |gamma|^2 / |gamma_0|``, gamma the last known, in units of the tolerance."""
        stages = self._stages
        assert stages is not None
        last = stages.last_coefficient(solved, h * self._slope(t, y) if self.k == 1 else None)
        scale = self._atol + np.maximum(np.abs(y), np.abs(y + solved.G[0])) * self._rtol
        with np.errstate(divide="ignore", invalid="ignore"):
            top, bottom = common.norm(last / scale), common.norm(solved.G[0] / scale)
            return 0.0 if top == 0.0 else float(top * top / bottom)

    def _seen(self, solved: Solved) -> bool:
        """Whether k nodes see the energy to round-off: the coefficients have decayed to the root of it."""
        assert self._stages is not None
        if self.k + 2 > MOST_NODES:
            return True
        sizes = np.abs(self._stages.coefficients(solved.values))
        top = sizes.max(axis=0)
        return bool((sizes[-2:] <= UNSEEN * np.maximum(top, 1e-3 * top.max())).all())

    def _raise_k(self, t: float, h: float) -> None:
        """Go on with more nodes."""
        assert self._stages is not None
        self.k = min(self.k + max(2, self.k // 4), MOST_NODES)
        self._stages = self._stages.with_nodes(self.k)

    def dense_output(self) -> DenseOutput:
        """Return the states between the present one and the one before."""
        assert self._stages is not None
        assert self._step is not None
        output = StepOutput if self._interpolant == "step" else PolynomialOutput
        t_old, t, y, e, G, new = self._step
        return output(self._stages, t_old, t, y, e, G, new)
