"""Programs and trajectories of SciPy's solvers."""

import copy
import math
from collections.abc import Callable
from functools import partial
from time import perf_counter
from types import FunctionType
from typing import Any

import numpy as np

from integrators.peers import load
from integrators.protocol import Array, MethodBase, Status, UserError
from integrators.running.watchdog import StallDetector, stall_detector
from integrators.stepping import ProgramBase, RestorableStepper, StepperBase
from problems.problem import System

QUIET = partial(np.errstate, all="ignore")  # once a call of ours, for it takes a quarter of a step of LSODA
DENSE, SPARSE = 64, 0.1  # a Jacobian of more rows, of which a smaller part is not zero, is a sparse matrix


class SciPyProgram(ProgramBase):
    """A vector field compiled for SciPy's solvers."""

    def __init__(self, system: System, method: MethodBase):
        super().__init__(system, method)
        integrate = load("scipy", "scipy.integrate")
        from problems import targets

        started = perf_counter()
        self.solver = getattr(integrate, self.method.solver)
        self.field = targets.numba(system, "field")
        if system.traced:  # the first call compiles for these types; a user's own function may not know t = 0
            self.field(0.0, np.ones(system.dim), system.pack({}), np.empty(system.dim))
        self.jacobian = system.jacobian() if self.method.implicit else None
        if self.jacobian is not None:
            self.entries = targets.numba(system, self.jacobian)
            self.entries(0.0, np.ones(system.dim), system.pack({}), np.empty(self.jacobian.rows.size))
        self.from_cache = None
        self.compile_seconds = perf_counter() - started

    def stepper(self, y: Array, par: Array, t: float) -> "SciPyStepper":
        """Return a trajectory."""
        return (LSODAStepper if self.method.solver == "LSODA" else RestorableSciPyStepper)(self, y, par, t)


class _Factored:
    """A sparse matrix with its factors, of which a copy or a file keeps the matrix: the factors follow."""

    def __init__(self, matrix: Any, factors: Any):
        self._matrix, self._factors = matrix, factors
        self.solve = factors.solve

    def __deepcopy__(self, memo: Any) -> "_Factored":
        return self  # nothing of it ever changes

    def __reduce__(self) -> tuple[Any, ...]:
        return _factored, (self._matrix,)


def _factored(matrix: Any) -> _Factored:
    from scipy.sparse.linalg import splu

    return _Factored(matrix, splu(matrix))


class SciPyStepper(StepperBase):
    """A trajectory of one of SciPy's solvers.

    ``"partial"`` (default)
        The steps of the solver are untouched. A time between two of them is reached
        by a separate solver from the earlier one, with the same tolerances; its
        evaluations are counted apart, in ``stats.extra["side_evaluations"]``. The polynomial of a
        multistep method gives it, which is of the method's order.
    ``"steps"``
        The steps of the solver, up to the last time.
    ``"stop"``
        The last step before each time is shortened onto it, as `solve_ivp` does at its end.

    The interpolants of the Runge-Kutta methods are not offered: they are of lower order than the method.
    """

    samplings = ("partial", "steps", "stop")
    _sparse = True  # whether the solver takes sparse Jacobians

    def __init__(self, program: SciPyProgram, y: Array, par: Array, t: float):
        super().__init__(y, t)
        self._program, self._par = program, par
        self._stats.evaluations = 0
        self._stats.extra["side_evaluations"] = 0
        self._made: Any = None
        with QUIET():
            # Raises `UserError` where the field does so at the start; the solver's first evaluation.
            self._first: tuple[float, Array, Array] | None = (t, self._y, self._field(t, self._y))

    @property
    def _solver(self) -> Any:
        """The solver, which looks from its start to the end of the integration, if that is known by then."""
        if self._made is None:
            ahead = self.destination is None or self.destination >= self._t
            with QUIET():
                self._made = self._begin(self._t, self._y, 1.0 if ahead else -1.0)
        return self._made

    def _evaluate(self, t: float, y: Array) -> Array:
        # SciPy's own count, nfev, leaves out the evaluations of its finite differences.
        self._stats.evaluations = (self._stats.evaluations or 0) + 1
        first, self._first = self._first, None
        if first is not None and first[0] == t and np.array_equal(first[1], y):
            return first[2]
        return self._field(t, y)

    def _evaluate_aside(self, t: float, y: Array) -> Array:
        self._stats.extra["side_evaluations"] += 1
        return self._field(t, y)

    def _field(self, t: float, y: Array) -> Array:
        out = np.empty(y.size)
        try:
            self._program.field(t, y, self._par, out)
        except Exception as error:
            raise UserError(error) from error
        return out

    def _jacobian(self, t: float, y: Array) -> Any:
        from scipy.sparse import csc_matrix

        jacobian = self._program.jacobian
        assert jacobian is not None
        values = np.empty(jacobian.rows.size)
        self._program.entries(t, y, self._par, values)
        shape = jacobian.shape
        if self._sparse and jacobian.shape[0] > DENSE and jacobian.density < SPARSE:
            return csc_matrix((values, (jacobian.rows, jacobian.columns)), shape=shape)
        matrix = np.zeros(shape)
        matrix[jacobian.rows, jacobian.columns] = values
        return matrix

    def _make(
        self, fun: Callable[[float, Array], Array], t: float, y: Array, end: float, first: float | None = None
    ) -> Any:
        method = self._program.method
        known = {} if self._program.jacobian is None else {"jac": self._jacobian}
        return self._program.solver(
            fun, t, y, end, rtol=method.rtol, atol=method.atol, first_step=first, **known
        )

    def _begin(self, t: float, y: Array, sign: float) -> Any:
        solver = self._make(self._evaluate, t, y, self._end(sign))
        if hasattr(
            getattr(solver, "J", None), "tocsc"
        ):  # sparse: what it factors can be neither copied nor kept
            factored = solver.lu
            solver.lu = lambda matrix: _Factored(matrix, factored(matrix))
        self._note("jacobians", solver.njev)
        return solver

    def _end(self, sign: float) -> float:
        """Return the end of the integration in a direction; infinitely far where none is known."""
        end = self.destination
        return end if end is not None and (end - self._t) * sign > 0.0 else sign * math.inf

    def _bound(self, t: float) -> None:
        """Have no step pass ``t``."""
        self._solver.t_bound = t

    def _note(self, name: str, count: int) -> None:
        if count:
            self._stats.extra[name] = self._stats.extra.get(name, 0) + count

    @QUIET()
    def _serve(self, grid: Array, how: str) -> tuple[Array, Array]:
        sign = self._towards(float(grid[-1]))
        states = np.empty((grid.size, self._y.size))
        if not sign:
            return grid[:0], states[:0]
        watch = stall_detector(self, self._solver.t, float(grid[-1]))
        for i, t in enumerate(grid.tolist()):
            self._bound(t if how == "stop" else self._end(sign))
            while sign * (self._solver.t - t) < 0.0:
                if not self._step(watch):
                    return grid[:i], states[:i]
            try:
                states[i] = self._solver.y if self._solver.t == t else self._aside(t)
            except UserError as raised:
                self._broken(raised, float(self._solver.t_old), self._solver.y_old)
                return grid[:i], states[:i]
            if not np.isfinite(states[i]).all():
                return grid[: i + 1], states[: i + 1]
        return grid, states

    @QUIET()
    def _step_states(self, end: float) -> tuple[Array, Array]:
        sign = self._towards(end)
        if not sign:
            return np.empty(0), np.empty((0, self._y.size))
        self._bound(self._end(sign))
        watch = stall_detector(self, self._solver.t, end)
        times, states = [self._t], [self._y]
        while sign * (times[-1] - end) < 0.0 and (self._solver.t != times[-1] or self._step(watch)):
            if sign * (self._solver.t - end) > 0.0:
                break
            times.append(float(self._solver.t))
            states.append(self._solver.y)
        return np.array(times[1:]), np.array(states)[1:]

    @QUIET()
    def _one_step(self) -> tuple[float, Array] | None:
        try:
            self._bound(self._end(self._solver.direction))
        except UserError as raised:
            self._broken(raised, self._t, self._y)
            return None
        if self._solver.t == self._t and not self._step(StallDetector(self._t, self._t)):
            return None
        return float(self._solver.t), self._solver.y

    def _towards(self, end: float) -> float:
        """Return the sign of the direction to ``end``, with a solver that goes there; 0: the field raised."""
        sign = 1.0 if end > self._t else -1.0
        try:
            if self._solver.direction != sign:
                self._made = self._begin(self._t, self._y, sign)
        except UserError as raised:
            self._broken(raised, self._t, self._y)
            return 0.0
        return sign

    def _step(self, watch: "StallDetector") -> bool:
        """Take one step; return whether it succeeded."""
        solver, stats = self._solver, self._stats
        before, jacobians, factored = float(solver.t), solver.njev, solver.nlu
        solver.status = "running"  # also where it came to its bound
        try:
            message = solver.step()
        except UserError as raised:
            self._broken(raised, before, solver.y)
            return False
        self._note("jacobians", solver.njev - jacobians)
        self._note("factorizations", solver.nlu - factored)
        if solver.status == "failed":
            self._fail(Status.STEP_UNDERFLOW, before, solver.y, f"SciPy gave up at t = {before!r}: {message}")
            return False
        stats.steps += 1
        stalled = watch.update(float(solver.t))
        if stalled:
            self._fail(Status.STALLED, float(solver.t), solver.y, stalled)
        return not stalled

    def _broken(self, raised: UserError, t: float, y: Array) -> None:
        self.error = raised.error
        self._fail(Status.USER_ERROR, t, y, f"{raised} in the step from t = {t!r}.")

    def _aside(self, t: float) -> Array:
        """Return the state at ``t``, within the last step."""
        if self._program.method.multistep:
            return self._solver.dense_output()(t)
        start = float(self._solver.t_old)
        aside = self._make(self._evaluate_aside, start, self._solver.y_old, t, abs(t - start))
        while aside.status == "running":
            aside.step()
        return aside.y if aside.status == "finished" else np.full(self._y.size, np.nan)


class RestorableSciPyStepper(SciPyStepper, RestorableStepper):
    """A trajectory whose solver is written in Python, and can be kept."""

    def _save(self) -> Any:
        # A solver's functions are bound to it, and K, K_extended hold nothing from step to step.
        held = {k: v for k, v in vars(self._solver).items() if not isinstance(v, FunctionType)}
        return copy.deepcopy({k: v for k, v in held.items() if k not in ("K", "K_extended")})

    def _load(self, inner: Any) -> None:
        vars(self._solver).update(copy.deepcopy(inner))


class LSODAStepper(SciPyStepper):
    """A trajectory of ODEPACK's LSODA, whose state SciPy does not give away: there are no checkpoints."""

    _sparse = False

    def _bound(self, t: float) -> None:
        super()._bound(t)
        self._solver._lsoda_solver._integrator.rwork[0] = t  # SciPy hands it over at the start only
