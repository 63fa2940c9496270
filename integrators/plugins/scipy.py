"""HBVM(k, s) and Gauss(s) as methods of ``scipy.integrate.solve_ivp``.

    from scipy.integrate import solve_ivp
    from integrators.plugins.scipy import HBVM

    solution = solve_ivp(fun, (0.0, 100.0), y0, method=HBVM, k=12, s=6, rtol=1e-8, atol=1e-8)

SciPy's tolerances choose the steps; the energy of a Hamiltonian system is kept to
round-off whatever the steps are.
"""

import operator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DenseOutput, OdeSolver
from scipy.integrate._ivp import common

from integrators.legendre import x_matrix
from integrators.plugins.jacobian import Jacobian, size
from integrators.plugins.stages import Newton, Solved, Stages, polynomial
from problems.errors import InputError

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

Array = NDArray[Any]


class _LineIntegral(OdeSolver):
    """What HBVM and Gauss share: a step, its control, and the output."""

    def __init__(
        self, fun: Any, t0: float, y0: Any, t_bound: float, max_step: Any, rtol: Any, atol: Any, jac: Any,
        jac_sparsity: Any, vectorized: bool, first_step: float | None, k: int | None, s: int,
        interpolant: str,
    ) -> None:  # fmt: skip
        self._stages: Stages | None = None
        self._calls = 0
        super().__init__(fun, t0, y0, t_bound, vectorized, support_complex=True)
        self.s = _whole("s", s)
        self.k = 2 * self.s if k is None else _whole("k", k)
        if self.k < self.s:
            raise InputError(f"HBVM needs k >= s; k={k} is less than s={s}: raise k or lower s.")
        if interpolant not in ("step", "polynomial"):
            raise InputError(f"interpolant must be 'step' or 'polynomial', not {interpolant!r}.")
        self.max_step = common.validate_max_step(max_step)
        self.rtol, self.atol = common.validate_tol(rtol, atol, self.n)
        self._automatic, self._interpolant, self._given = k is None, interpolant, fun
        self._dtype = complex if np.iscomplexobj(self.y) else float
        self._f: Array | None = self.fun(self.t, self.y)
        if first_step is None:
            self.h_abs = common.select_initial_step(
                self.fun, self.t, self.y, t_bound, max_step, self._f, self.direction,
                self.error_estimator_order, self.rtol, self.atol,
            )  # fmt: skip
        else:
            self.h_abs = common.validate_first_step(first_step, t0, t_bound)
        self._jacobian = Jacobian(self.fun_vectorized, self.n, self._dtype, self.atol, jac, jac_sparsity)
        self._newton: Newton | None = None
        self._J: Any = None
        self._J_current = False
        self._limited = 0
        self._radius = float(np.abs(np.linalg.eigvals(x_matrix(self.s))).max())
        self._e = np.zeros_like(self.y)
        self._G = np.zeros((self.s, self.n), self._dtype)
        self._h = 0.0
        self._error_old = 0.0
        self._step_start = (self.y, self._e)

    @property
    def error_estimator_order(self) -> int:
        """The error of a step is proportional to its length to the power of this plus 1: 2s."""
        return 2 * self.s

    @property
    def nfev(self) -> int:
        """States at which the function was evaluated."""
        return self._calls + (0 if self._stages is None else self._stages.evaluations)

    @nfev.setter
    def nfev(self, count: int) -> None:
        self._calls += count - self.nfev

    @property
    def njev(self) -> int:
        """Evaluations of the Jacobian."""
        return self._jacobian.evaluations if hasattr(self, "_jacobian") else 0

    @njev.setter
    def njev(self, count: int) -> None:
        """Leave it to the Jacobian to count."""

    @property
    def nlu(self) -> int:
        """Factorisations."""
        return self._jacobian.factorizations if hasattr(self, "_jacobian") else 0

    @nlu.setter
    def nlu(self, count: int) -> None:
        """Leave it to the Jacobian to count."""

    def _step_impl(self) -> tuple[bool, str | None]:
        t, y, e = self.t, self.y, self._e
        least = 10 * abs(np.nextafter(t, self.direction * np.inf) - t)
        h_abs = self.max_step if self.h_abs > self.max_step else max(self.h_abs, least)
        rejected = False
        while True:
            if not h_abs >= least:
                return False, self.TOO_SMALL_STEP
            t_new = t + h_abs * self.direction
            if self.direction * (t_new - self.t_bound) > 0.0:
                t_new = self.t_bound
            h = t_new - t
            h_abs = abs(h)
            solved = self._solve(t, h, y, e)
            if not solved.converged:
                h_abs, rejected = 0.5 * h_abs, True
                continue
            error = self._error(t, h, y, solved)
            if not error <= 1.0:
                wanted = SAFETY * error ** (-1.0 / (2 * self.s + 1)) if np.isfinite(error) else SHRINK
                h_abs, rejected = h_abs * max(SHRINK, wanted), True
                continue
            if self._automatic and not self._seen(solved):
                self._raise_k(t, h)
                continue
            break
        self.h_abs = h_abs * self._factor(h_abs, error, solved.rate, rejected)
        increment = solved.G[0] + e
        new = y + increment
        part = new - y
        self._step_start = (y, e)
        self._e = (y - (new - part)) + (increment - part)
        self.t, self.y = t_new, new
        self._G, self._h, self._f = solved.G, h, None
        self._error_old = error
        return True, None

    def _factor(self, h_abs: float, error: float, rate: float, rejected: bool) -> float:
        """Return by how much the next step is longer: predictive control, and what the solver needs."""
        order = 2 * self.s + 1
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
            self._newton, self._J = Newton(self.s, real=self._dtype is float), None
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
            self._stages = Stages(self._given, self._dtype, self.k, self.s, vectorized=self.vectorized)
            if self.vectorized:
                self._stages.try_together(t, h, y, self._slope(t, y))
        return self._stages

    def _slope(self, t: float, y: Array) -> Array:
        """Return f at the start of the step, evaluated at most once."""
        if self._f is None:
            self._f = self.fun(t, y)
        return self._f

    def _error(self, t: float, h: float, y: Array, solved: Solved) -> float:
        """Return the size of ``h |gamma_s|^2 / |gamma_0|`` in units of the tolerance."""
        stages = self._stages
        assert stages is not None
        beyond = stages.next_coefficient(solved, h * self._slope(t, y) if self.k == self.s else None)
        scale = self.atol + np.maximum(np.abs(y), np.abs(y + solved.G[0])) * self.rtol
        with np.errstate(divide="ignore", invalid="ignore"):
            top, bottom = common.norm(beyond / scale), common.norm(solved.G[0] / scale)
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

    def _dense_output_impl(self) -> DenseOutput:
        assert self._stages is not None
        assert self.t_old is not None
        output = StepOutput if self._interpolant == "step" else PolynomialOutput
        return output(self._stages, self.t_old, self.t, *self._step_start, self._G, self.y)


class PolynomialOutput(DenseOutput):
    """The polynomial of a step: free, of order s + 1 inside the step, where it does not keep the energy."""

    def __init__(
        self, stages: Stages, t_old: float, t: float, y: Array, e: Array, G: Array, end: Array
    ) -> None:
        super().__init__(t_old, t)
        self._stages, self._y, self._e, self._G, self._end = stages, y, e, G, end

    def _call_impl(self, t: Array) -> Array:
        times = np.atleast_1d(t).astype(float)
        states = np.array([self._at(time) for time in times.tolist()]).reshape(times.size, -1).T
        return states[:, 0] if t.ndim == 0 else states

    def _at(self, t: float) -> Array:
        if t == self.t_old:
            return self._y
        if t == self.t:
            return self._end
        return self._inside(t, (t - self.t_old) / (self.t - self.t_old))

    def _inside(self, t: float, c: float) -> Array:
        return self._y + (self._e + polynomial(np.array([c]), self._G)[0])


class StepOutput(PolynomialOutput):
    """A throw-away step from the start of the step to each time: order 2s, and the energy is kept."""

    def _inside(self, t: float, c: float) -> Array:
        guess = self._stages.within(self._G, c)
        solved = self._stages.solve(self.t_old, t - self.t_old, self._y, self._e, guess)
        if not solved.converged:
            return super()._inside(t, c)
        return self._y + (self._e + solved.G[0])


class HBVM(_LineIntegral):
    """HBVM(k, s), which conserves the energy: ``solve_ivp(fun, t_span, y0, method=HBVM)``.

    Equations and properties: see `integrators.HBVM`.

    Parameters
    ----------
    fun, t0, y0, t_bound, first_step, max_step, rtol, atol, jac, jac_sparsity
        As for `scipy.integrate.Radau`. The local error of a step is kept below
        ``atol + rtol * abs(y)``. The stage equations are solved to round-off
        whatever the tolerances: by fixed-point iteration, or by simplified Newton
        where that does not contract; only then ``jac`` is needed.
    vectorized : bool
        Whether ``fun`` takes y of shape (n, m). All stages are then evaluated in
        one call, provided that ``fun`` also takes the m times as an array, which
        is tried out once.
    k : int, optional
        Nodes of the quadrature, k >= s. By default 2s, and more as soon as that
        would not see the energy to round-off.
    s : int
        Degree of the polynomial; the order is 2s.
    interpolant : {"step", "polynomial"}
        How states between the steps (``t_eval``, ``dense_output``, ``events``) are made: by
        a throw-away step from the step's start, which keeps order 2s and energy, or
        by the step's polynomial, which is free but of order s + 1.

    Attributes
    ----------
    nfev : int
        States at which ``fun`` was evaluated, also where one call evaluates several.
    """

    def __init__(
        self, fun: Any, t0: float, y0: Any, t_bound: float, max_step: float = np.inf, rtol: Any = 1e-3,
        atol: Any = 1e-6, jac: Any = None, jac_sparsity: Any = None, vectorized: bool = False,
        first_step: float | None = None, k: int | None = None, s: int = 6, interpolant: str = "step",
        **extraneous: Any,
    ) -> None:  # fmt: skip
        common.warn_extraneous(extraneous)
        super().__init__(
            fun, t0, y0, t_bound, max_step, rtol, atol, jac, jac_sparsity, vectorized, first_step,
            k, s, interpolant,
        )  # fmt: skip


class Gauss(_LineIntegral):
    """Gauss(s), collocation at the Gauss nodes, which is HBVM(s, s): ``solve_ivp(..., method=Gauss)``.

    Symplectic with constant steps; these are adaptive, and with them it keeps the
    energy no better than other methods of its order. Parameters as for `HBVM`, without k.
    """

    def __init__(
        self, fun: Any, t0: float, y0: Any, t_bound: float, max_step: float = np.inf, rtol: Any = 1e-3,
        atol: Any = 1e-6, jac: Any = None, jac_sparsity: Any = None, vectorized: bool = False,
        first_step: float | None = None, s: int = 6, interpolant: str = "step", **extraneous: Any,
    ) -> None:  # fmt: skip
        common.warn_extraneous(extraneous)
        super().__init__(
            fun, t0, y0, t_bound, max_step, rtol, atol, jac, jac_sparsity, vectorized, first_step,
            s, s, interpolant,
        )  # fmt: skip


def _whole(name: str, value: Any) -> int:
    try:
        number = 0 if isinstance(value, bool) else operator.index(value)
    except TypeError:
        number = 0
    if number < 1:
        raise InputError(f"{name} must be a whole number of at least 1, not {value!r}.")
    return number
