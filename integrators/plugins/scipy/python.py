"""Steps in Python for a function in Python: length, solver and number of nodes are found as they go.

The kernel can call such a function back (`problems.systems.opaque.Opaque`), and these steps stay apart
from it because that was measured. For the same call the kernel takes 1.3 to 2.5 times as long on ten
periods of Kepler's orbit (with the leanest callback that can be written, two thirds), 4 to 6 times on a
short integration, since each new function makes a new program, 2 to 3 times for 1,000 components, whose
stages a vectorized function takes in one call, and 10 to 20 times for stiff problems, whose Jacobian the
user may know. Besides, in the kernel states are real, tolerances are relative to the state, and what the
function raises does not arrive as it is.

The order of the error and its estimate are the kernel's (`integrators.kernel.tolerance`). The factors by
which lengths change are not: those of `integrators.kernel.step.control` were measured with errors of order 25
and more, and the degree is the user's here.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DenseOutput, OdeSolver

from integrators.coefficients.legendre import legendre_integrals
from integrators.kernel.tolerance import degree_of_error, error_order, left_out
from integrators.plugins.scipy.newton import Newton
from integrators.plugins.scipy.stages import Solved, Stages

SAFETY = 0.9
SHRINK, GROW = 0.2, 10.0  # bounds of the change of the step
CONTRACTION = (
    0.2  # of the fixed-point iteration that a step aims at; 1/e would be cheapest if rates were sure
)
TOO_SLOW = 0.85  # at which it is broken off, where the step may be shorter
STIFF = 4.0  # Newton when the tolerance permits steps so much longer than the fixed point does
STIFF_STEPS = 3  # for so many steps in a row
MILD = (
    0.15  # the fixed point again when it contracts by this at least; below `CONTRACTION`, or they alternate
)
SLOW = 0.1  # rate of Newton's iteration above which the Jacobian is too old
KEEP = 1.2  # Newton's factorisations are kept when the step could only grow by less
NEWTON_ITERATIONS = 12
FEW_NODES, MOST_NODES = 16, 64  # more than few only where Newton takes long steps: shorter ones cost less
HIDDEN = 10.0  # times what may be hidden from the nodes, above which a step is taken again, shorter
# After so many cuts that do not let the coefficients fall off, they are rounding: for so many steps, those
# below such a part of `atol` are no reason to cut.
CUTS, NOISY_STEPS, NOISE = 3, 64, 1e-3
SEEN = 1e-8  # size of the last two coefficients that k nodes determine, relative, for an automatic k

CLOSE = 1e-9  # part of a constant step that is not made for its own sake

Array = NDArray[Any]


class PythonSteps:
    """Steps of HBVM(k, s) for an `OdeSolver`.

    Parameters
    ----------
    solver : OdeSolver
        At its start, with ``rtol``, ``atol`` and ``max_step``; its counters count.
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
    """

    def __init__(
        self, solver: Any, *, k: int | None, s: int, h: float | None, first_step: float | None,
        jac: Any, jac_sparsity: Any, interpolant: str,
    ) -> None:  # fmt: skip
        self._solver, self._s, self._automatic = solver, s, k is None
        self._by_a_step = interpolant == "step"
        self._stages = Stages(solver, 2 * s if k is None else k, s)
        # One node knows gamma_1 from the field at the start of the step.
        self._order = error_order(degree_of_error(self.k, s) if s > 1 else 1)
        self._newton = Newton(solver, s, jac, jac_sparsity)
        self._stiff = False
        self._limited = 0  # steps in a row that only the fixed point keeps so short
        self._noisy = 0  # steps for which small coefficients are taken for rounding
        self._constant = None if h is None else h * solver.direction
        self._start, self._count = solver.t, 0  # of steps of constant length
        self._length = first_step
        self._f: Array | None = None
        self._e = np.zeros_like(solver.y)
        self._G = np.zeros((s, solver.n), solver.y.dtype)
        self._h = self._error_old = 0.0
        self._output: DenseOutput | None = None
        self._errors = np.geterr()

    @property
    def k(self) -> int:
        """Nodes in use."""
        return self._stages.k

    def take(self, t: float, y: Array) -> tuple[float, Array] | str:
        """Take a step from (t, y), which is where the last one ended; return time and state, or why not.

        What NumPy says of floating-point errors is kept back: an iteration that diverges meets states that
        are none of the solution's, and is dealt with. At the solution's (`_slope`) it is the user's matter.
        """
        with np.errstate(all="ignore"):
            if self._output is None and self._solver.vectorized:
                self._stages.try_together(t, self._first(t, y), y, self._slope(t, y))
            step = self._varying(t, y) if self._constant is None else self._of_constant_length(t, y)
            return step if isinstance(step, str) else (step[0], self._add(t, *step, y))

    def _varying(self, t: float, y: Array) -> tuple[float, Solved] | str:
        """Solve for a step that the tolerances allow; return its end and solution, or why there is none."""
        solver = self._solver
        least = 10 * abs(np.nextafter(t, solver.direction * np.inf) - t)
        h_abs = self._first(t, y)
        h_abs = solver.max_step if h_abs > solver.max_step else max(h_abs, least)
        rejected, cuts, uncut, unseen_uncut = False, 0, h_abs, 0.0
        while h_abs >= least:
            t_new = t + h_abs * solver.direction
            if solver.direction * (t_new - solver.t_bound) > 0.0:
                t_new = solver.t_bound
            h = t_new - t
            h_abs = abs(h)
            solved = self._solve(t, h, y)
            if not solved.converged:
                h_abs, rejected = h_abs * min(0.5, max(SHRINK, CONTRACTION / solved.rate)), True
                continue
            error = self._error(t, h, y, solved)
            if not error <= 1.0:
                wanted = SAFETY * error ** (-1.0 / self._order) if np.isfinite(error) else SHRINK
                h_abs, rejected = h_abs * max(SHRINK, wanted), True
                continue
            unseen = self._unseen(solved) if self._automatic else 0.0
            if unseen > 1.0 and self.k < (MOST_NODES if self._stiff else FEW_NODES):
                self._stages = self._stages.with_nodes(self.k + max(2, self.k // 4))
            elif unseen > HIDDEN and not self._stiff:
                if cuts == 0:
                    uncut, unseen_uncut = h_abs, unseen
                cuts, rejected = cuts + 1, True
                if cuts == CUTS and self._noisy == 0 and unseen > SHRINK * unseen_uncut:
                    h_abs, self._noisy = uncut, NOISY_STEPS
                else:
                    h_abs *= max(SHRINK, self._until_seen(unseen))
            else:
                self._noisy = max(self._noisy - 1, 0)
                factor = self._factor(h_abs, error, solved.rate, rejected)
                if unseen > 0.0 and not self._stiff and self.k >= FEW_NODES:
                    factor = max(SHRINK, min(factor, self._until_seen(unseen)))
                self._length = h_abs * factor
                self._error_old = error
                return t_new, solved
        return OdeSolver.TOO_SMALL_STEP

    def _of_constant_length(self, t: float, y: Array) -> tuple[float, Solved] | str:
        """Solve for a step of the length given, or what is left of it; return as `_varying`."""
        h, bound = self._constant, self._solver.t_bound
        assert h is not None
        t_new = self._start + (self._count + 1) * h
        if self._solver.direction * (t_new - bound) > -CLOSE * abs(h):
            t_new = bound
        solved = self._solve(t, t_new - t, y)
        if not solved.converged:
            return (
                f"the stage equations have not been solved in the step from t = {t!r}, "
                f"h = {abs(h)!r}; take a smaller h."
            )
        self._count += 1
        return t_new, solved

    def _add(self, t: float, t_new: float, solved: Solved, y: Array) -> Array:
        """Return the state at the end of a solved step, with what rounding leaves of it kept."""
        increment = solved.G[0] + self._e
        new = y + increment
        part = new - y
        self._output = Output(self._stages, t, t_new, y, self._e, solved.G, new, by_a_step=self._by_a_step)
        self._e = (y - (new - part)) + (increment - part)
        self._G, self._h, self._f = solved.G, t_new - t, None
        return new

    def _first(self, t: float, y: Array) -> float:
        """Return the length of the next step to try, which at the start is chosen.

        By E. Hairer, S. P. Nørsett, G. Wanner, *Solving Ordinary Differential Equations I*, section II.4.
        """
        if self._constant is not None:
            return abs(self._constant)
        if self._length is not None:
            return self._length
        solver, f = self._solver, self._slope(t, y)
        span, scale = abs(solver.t_bound - t), solver.atol + np.abs(y) * solver.rtol
        size, slope = norm(y / scale), norm(f / scale)
        h = min(0.01 * size / slope if min(size, slope) >= 1e-5 else 1e-6, span)
        signed = h * solver.direction
        second_derivative = norm((solver.fun(t + signed, y + signed * f) - f) / scale) / h
        fastest = max(slope, second_derivative)
        wanted = (0.01 / fastest) ** (1.0 / error_order(self._s)) if fastest > 1e-15 else max(1e-6, 1e-3 * h)
        self._length = min(100.0 * h, wanted, span, solver.max_step)
        return self._length

    def _until_seen(self, unseen: float) -> float:
        """Return by how much a step is longer of whose coefficients k nodes miss nothing; see `_unseen`."""
        return SAFETY * unseen ** (-1.0 / self.k)

    def _factor(self, h_abs: float, error: float, rate: float, rejected: bool) -> float:
        """Return by how much the next step is longer: predictive control, and what the solver needs."""
        order = self._order
        factor = SAFETY * error ** (-1.0 / order) if error > 0.0 else GROW
        if self._error_old > 0.0 and error > 0.0 and self._h:
            factor = min(factor, factor * h_abs / abs(self._h) * (self._error_old / error) ** (1.0 / order))
        factor = min(GROW, max(SHRINK, factor), 1.0 if rejected else GROW)
        newton = self._newton
        if self._stiff:
            newton.current = newton.constant
            newton.old = rate > SLOW and not newton.constant
            return 1.0 if not newton.old and 1.0 <= factor < KEEP else factor
        permitted = CONTRACTION / rate if rate > 0.0 else GROW
        self._limited = self._limited + 1 if factor > STIFF * permitted else 0
        return max(SHRINK, min(factor, permitted))

    def _solve(self, t: float, h: float, y: Array) -> Solved:
        """Solve the stage equations of a step, by the solver that suits."""
        stages, newton, e = self._stages, self._newton, self._e
        guess = stages.guess(self._G, h / self._h if self._h else 0.0)
        if not self._stiff and self._limited < STIFF_STEPS:
            slowest = TOO_SLOW if self._constant is None else np.inf
            solved = stages.solve(t, h, y, e, guess, slowest=slowest)
            if solved.converged or not self._h or solved.rate < np.inf:
                return solved
            return stages.solve(t, h, y, e, np.zeros_like(guess), slowest=slowest)
        newton.old, self._stiff = newton.old or not self._stiff, True
        while True:
            if newton.old:
                newton.linearize(t, y, self._slope(t, y), h)
            if newton.stiffness(h) < MILD:
                self._stiff, self._limited = False, 0
                return stages.solve(t, h, y, e, guess)
            newton.factorize(h)
            solved = stages.solve(t, h, y, e, guess, newton.correct, NEWTON_ITERATIONS)
            if solved.converged or newton.current:
                return solved
            newton.old = True

    def _slope(self, t: float, y: Array) -> Array:
        """Return f at the start of the step, evaluated at most once."""
        f = self._f
        if f is None:
            with np.errstate(**self._errors):
                f = self._f = self._solver.fun(t, y)
        return f

    def _error(self, t: float, h: float, y: Array, solved: Solved) -> float:
        """Return the size of ``h |gamma|^2 / |gamma_0|``, gamma the last known, in units of the tolerance."""
        last = self._stages.last_coefficient(solved, h * self._slope(t, y) if self.k == 1 else None)
        largest = np.maximum(np.abs(y), np.abs(y + solved.G[0]))
        scale = self._solver.atol + largest * self._solver.rtol
        top, bottom = norm(last / scale), norm(solved.G[0] / scale)
        return 0.0 if top == 0.0 else float(left_out(top, top, np.float64(bottom)))

    def _unseen(self, solved: Solved) -> float:
        """Return how much of the field k nodes do not see: up to 1, the energy is conserved to round-off.

        The coefficients must have decayed to the root of that; what moves a component by less than ``atol``
        counts as moving it by so much, else a field whose rounding is all there is at first had no step.
        Where steps were cut in vain the coefficients are rounding: what ``atol`` allows is let be.
        """
        sizes = np.abs(self._stages.coefficients(solved.values))
        top = sizes.max(axis=0)
        floor = SEEN * np.maximum(np.maximum(top, 1e-3 * top.max()), self._solver.atol)
        if self._noisy:
            floor = np.maximum(floor, NOISE * self._solver.atol)
        return float((sizes[-2:] / np.where(floor > 0.0, floor, 1.0)).max())

    def dense_output(self) -> DenseOutput:
        """Return the states between the present one and the one before."""
        assert self._output is not None
        return self._output


class Output(DenseOutput):
    """States within a step from (t_old, y) to (t, end), e the compensation and G the coefficients.

    ``by_a_step``, a partial step from the start of the step to each time: order 2s, and the energy is
    conserved. Otherwise the polynomial of the step: free, of order s + 1 inside the step, where it does
    not conserve the energy.
    """

    def __init__(
        self, stages: Stages, t_old: float, t: float, y: Array, e: Array, G: Array, end: Array, *,
        by_a_step: bool,
    ) -> None:  # fmt: skip
        super().__init__(t_old, t)
        self._stages, self._y, self._e, self._G, self._end = stages, y, e, G, end
        self._by_a_step = by_a_step

    def _call_impl(self, t: Array) -> Array:
        with np.errstate(all="ignore"):  # as in `PythonSteps.take`
            states = np.array([self._at(time) for time in np.atleast_1d(t).tolist()]).reshape(t.size, -1).T
        return states[:, 0] if t.ndim == 0 else states

    def _at(self, t: float) -> Array:
        if t in (self.t_old, self.t):
            return self._y if t == self.t_old else self._end
        c = (t - self.t_old) / (self.t - self.t_old)
        if self._by_a_step:
            guess = self._stages.within(self._G, c)
            solved = self._stages.solve(self.t_old, t - self.t_old, self._y, self._e, guess)
            if solved.converged:
                return self._y + (self._e + solved.G[0])
        return self._y + (self._e + (legendre_integrals(np.array([c]), len(self._G)) @ self._G)[0])


def norm(x: Array) -> float:
    """Return the root of the mean square."""
    return float(np.linalg.norm(x)) / x.size**0.5
