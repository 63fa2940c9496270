"""SUNDIALS' CVODE through scikit-sundae, with compiled vector fields and Jacobians."""

import warnings
from dataclasses import dataclass
from time import perf_counter
from typing import Any, Literal

import numpy as np

from integrators.options import NotNegative, Share
from integrators.peers import cvode, load
from integrators.protocol import Array, MethodBase, Status, UserError, cite
from integrators.running.watchdog import StallDetector, stall_detector
from integrators.stepping import ProgramBase, StepperBase
from problems.problem import System

UNMOVED = 100  # steps in succession that leave t as it is, after which CVODE would go on for ever
ENDLESS = 2**31 - 1  # steps of one call, which the watchdog ends instead
DENSE, SPARSE = 64, 0.1  # a Jacobian of more rows, of which a smaller part is not zero, is a sparse matrix


@dataclass(frozen=True, kw_only=True, repr=False)
class CVODE(MethodBase):
    """SUNDIALS' CVODE: multistep formulas of variable order and step size, with Newton iterations.

    Parameters
    ----------
    rtol : float
        Relative tolerance of the local error, > 0.
    atol : float
        Absolute tolerance, >= 0.
    method : {"BDF", "Adams"}
        Backward differentiation formulas of order 1 to 5, for stiff systems; Adams' of order 1 to 12.

    Notes
    -----
    The Jacobian is the traced system's own, sparse where it is large; finite differences where there is none.
    It damps oscillations: no method for conserving energy. There are no checkpoints.

    Examples
    --------
    >>> import problems
    >>> from integrators import CVODE, integrate
    >>> integrate(problems.load("pendulum"), CVODE(rtol=1e-8, atol=1e-10), [0.0, 10.0]).status
    <Status.FINISHED: 'finished'>
    """

    rtol: Share
    atol: NotNegative
    method: Literal["BDF", "Adams"] = "BDF"

    library = "scikit-sundae"
    built = "generic wheel; vector field and Jacobian compiled on this machine by numba"
    computes_with = ("numpy", "numba")
    family = "multistep"
    citation = cite("HindmarshEtAl2005")
    to_end = "stop"

    def compile(self, system: System) -> "CVODEProgram":
        """Compile the vector field of ``system``, and its Jacobian."""
        return CVODEProgram(system, self)


class CVODEProgram(ProgramBase):
    """A vector field and a Jacobian compiled for CVODE."""

    def __init__(self, system: System, method: MethodBase):
        super().__init__(system, method)
        self._solver = load("scikit-sundae", "sksundae.cvode").CVODE
        from problems import targets

        started = perf_counter()
        self.field = targets.numba(system, "field")
        # The first call compiles for these types.
        self.field(0.0, np.ones(system.dim), system.pack({}), np.empty(system.dim))
        self.jacobian = system.jacobian()
        if self.jacobian is not None:
            self.entries = targets.numba(system, self.jacobian)
            self.entries(0.0, np.ones(system.dim), system.pack({}), np.empty(self.jacobian.rows.size))
        self.compiled: cvode.CompiledCVODE | None = None
        if system.traced and (loaded := cvode.library()) is not None:
            entries = None if self.jacobian is None else self.entries
            sparse = self.jacobian is not None and is_sparse(self.jacobian)
            self.compiled = cvode.CompiledCVODE(
                loaded, method, system.dim, self.field, self.jacobian, entries, sparse
            )
        self.from_cache = None
        self.compile_seconds = perf_counter() - started

    def solver(self, par: Array) -> Any:
        """Return CVODE for parameters, as its own documentation makes it."""
        method, field = self.method, self.field

        def right(t: float, y: Array, out: Array) -> None:
            try:
                field(t, y, par, out)
            except Exception as error:
                raise UserError(error) from error

        options = {
            "rtol": method.rtol,
            "atol": method.atol,
            "method": method.method,
            "max_num_steps": ENDLESS,
        }
        with warnings.catch_warnings(action="ignore"):  # that a sparsity is not used for differences
            return self._solver(right, **options, **self._jacobian(par))

    def _jacobian(self, par: Array) -> dict[str, Any]:
        jacobian = self.jacobian
        if jacobian is None:
            return {}
        entries = self.entries
        if is_sparse(jacobian):
            from scipy.sparse import csc_matrix

            numbers = csc_matrix(
                (np.arange(1, jacobian.rows.size + 1), (jacobian.rows, jacobian.columns)),
                jacobian.shape,
            )
            order, values = np.asarray(numbers.data, dtype=np.int64) - 1, np.empty(jacobian.rows.size)

            def fill(t: float, y: Array, slope: Array, out: Array) -> None:
                del slope
                entries(t, y, par, values)
                out[:] = values[order]

            pattern = numbers.astype(bool).astype(float)
            return {"jacfn": fill, "linsolver": "sparse", "sparsity": pattern}
        rows, columns, few = jacobian.rows, jacobian.columns, np.empty(jacobian.rows.size)

        def whole(t: float, y: Array, slope: Array, out: Array) -> None:
            del slope
            entries(t, y, par, few)
            out[rows, columns] = few

        return {"jacfn": whole}

    def stepper(self, y: Array, par: Array, t: float) -> "CVODEStepper":
        """Return a trajectory."""
        return CVODEStepper(self, y, par, t)


def is_sparse(jacobian: Any) -> bool:
    """Whether a Jacobian is worth a sparse matrix."""
    return jacobian.shape[0] > DENSE and jacobian.density < SPARSE


class CVODEStepper(StepperBase):
    """A trajectory of CVODE.

    ``"partial"`` (default)
        CVODE's steps. A time between two of them is given by its polynomial, of the formula's order.
    ``"steps"``
        Its steps, up to the last time.
    ``"stop"``
        The last step before each time is shortened onto it. From the start to one time CVODE's C functions go
        without Python, see `integrators.peers.cvode`.
    """

    samplings = ("partial", "steps", "stop")

    def __init__(self, program: CVODEProgram, y: Array, par: Array, t: float):
        super().__init__(y, t)
        self._program, self._par = program, par
        self._sign = self._evaluated = 0
        self._solver: Any = None  # scikit-sundae's, where single steps are taken
        self._tn, self._yn = t, y  # the last of its steps, which may be ahead of the present
        self._compiled = program.compiled and program.compiled.start(t, y, par)

    def _towards(self, end: float) -> float:
        """Return the sign of the direction to ``end``, with a solver that goes that way."""
        sign = 1 if end > self._t else -1
        if self._sign != sign or self._solver is None:
            self._begin()
            self._sign = sign
        return float(sign)

    def _begin(self) -> None:
        self._solver = self._solver or self._program.solver(self._par)
        self._tn, self._yn = self._t, self._y
        self._evaluated = self._stats.evaluations or 0
        self._solver.init_step(self._t, self._y)

    def _serve(self, grid: Array, how: str) -> tuple[Array, Array]:
        end = float(grid[-1])
        alone = grid.size == 1 and self.destination in (None, end)
        run, self._compiled = self._compiled, None
        if how == "stop" and alone and run is not None:
            return self._whole(run, end)
        sign, watch = self._towards(end), stall_detector(self, self._tn, end)
        states = np.empty((grid.size, self._y.size))
        for i, t in enumerate(grid.tolist()):
            while sign * (self._tn - t) < 0.0:
                if not self._step(watch, t if how == "stop" else self._bound()):
                    return grid[:i], states[:i]
            states[i] = self._yn if self._tn == t else self._solver.step(t, "normal").y
        return grid, states

    def _whole(self, run: cvode.Integration, end: float) -> tuple[Array, Array]:
        """Go from the start to one time, in compiled code."""
        start, ended = self._t, run.go(end)
        self._stats.steps, self._stats.evaluations = ended.steps, ended.evaluations
        self._stats.extra["jacobians"] = ended.jacobians
        self._sign = 1 if end > start else -1
        self._tn, self._yn = ended.t, ended.y
        if ended.failed:
            reason = f"CVODE gave up at t = {ended.t!r}: {ended.failed}"
            self._fail(Status.STEP_UNDERFLOW, ended.t, ended.y, reason)
            return np.empty(0), np.empty((0, self._y.size))
        return np.array([ended.t]), ended.y[None]

    def _step_states(self, end: float) -> tuple[Array, Array]:
        sign, watch = self._towards(end), stall_detector(self, self._tn, end)
        times, states = [self._t], [self._y]
        while self._tn != times[-1] or (sign * (self._tn - end) < 0.0 and self._step(watch, self._bound())):
            if sign * (self._tn - end) > 0.0:
                break
            times.append(self._tn)
            states.append(self._yn)
        return np.array(times[1:]), np.array(states).reshape(len(times), -1)[1:]

    def _one_step(self) -> tuple[float, Array] | None:
        self._towards(self._t + (self._sign or 1) * self._far(self._t))
        if self._tn == self._t and not self._step(StallDetector(self._t, self._t)):
            return None
        return self._tn, self._yn

    def _bound(self) -> float | None:
        """Return the end of the whole integration, if that is ahead: no step passes it."""
        end = self.destination
        return None if end is None or self._sign * (end - self._tn) <= 0.0 else end

    @staticmethod
    def _far(t: float) -> float:
        """Return how far CVODE is told to go: its first step depends on that, and must not on samples."""
        return max(1.0, abs(t))

    def _step(self, watch: StallDetector, stop: float | None = None) -> bool:
        """Take one step, not beyond ``stop``; return whether it succeeded."""
        before = self._tn
        end = before + self._sign * self._far(before)
        if stop is not None and self._sign * (end - stop) > 0.0:
            end = stop
        try:
            # After a time within a step CVODE returns that step once more.
            result = self._solver.step(end, "onestep", stop)
            for _ in range(UNMOVED):
                if result.t != before or not result.success:
                    break
                result = self._solver.step(end, "onestep", stop)
        except UserError as raised:
            self._broken(raised, before, self._yn)
            return False
        self._note(result)
        if self._refused(result, before):
            return False
        if result.t == before:
            self._fail(
                Status.STEP_UNDERFLOW,
                before,
                self._yn,
                f"CVODE's steps at t = {before!r} are too short to change t.",
            )
            return False
        self._stats.steps += 1
        self._tn, self._yn = float(result.t), np.array(result.y, dtype=np.float64)
        if stalled := watch.update(self._tn):
            self._fail(Status.STALLED, self._tn, self._yn, stalled)
        return not stalled

    def _note(self, result: Any) -> None:
        self._stats.evaluations = self._evaluated + int(result.nfev)
        self._stats.extra["jacobians"] = int(result.njev)

    def _refused(self, result: Any, t: float) -> bool:
        if result.success:
            return False
        self._fail(Status.STEP_UNDERFLOW, t, self._yn, f"CVODE gave up at t = {t!r}: {result.message}")
        return True

    def _broken(self, raised: UserError, t: float, y: Array) -> None:
        self.error = raised.error
        self._fail(Status.USER_ERROR, t, y, f"{raised} in the step from t = {t!r}.")
