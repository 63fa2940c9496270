"""Steps of the compiled kernel for a compiled field, and the states between them."""

import math
from functools import lru_cache
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DenseOutput, OdeSolver

import integrators
from integrators.kernel.fixed import FixedStepper
from integrators.kernel.varying import LATEST
from integrators.methods.automatic import QUADRATURE_ERROR, exact_k
from integrators.plugins.scipy.field import Field
from integrators.protocol import Samples, Status
from integrators.running.times import plan
from problems.analysis.structure import degree
from problems.systems.base import System

LANES = 8  # stages that the field takes at a time: fewer cost as much
FEWEST = 16  # nodes, by default
SNAP = 4.0  # ulps: a step that ends so close to the bound ends there
BEYOND = 2.0**100  # length of the steps of the method that makes partial steps: longer than any

Array = NDArray[np.float64]


class NativeSteps:
    """Steps of HBVM(k, s) by the kernel, for an `OdeSolver`.

    Parameters
    ----------
    solver : OdeSolver
        At its start, with ``rtol``, ``atol`` and ``max_step``.
    field : Field
        The field and its parameters.
    k : int or None
        Nodes of the quadrature; ``None``: a multiple of the stages that the field takes at a
        time, and steps short enough for them to see the energy to round-off.
    s : int
        Degree.
    h : float or None
        Length of all steps; ``None``: as long as the tolerance allows.
    first_step : float or None
        Length of the first step to try.
    every : int
        Steps of the kernel that count as one.

    Raises
    ------
    problems.errors.InputError
        If a numba function cannot be compiled for arrays of numbers; its cause is then a `numba.NumbaError`.
    """

    def __init__(
        self, solver: Any, field: Field, *, k: int | None, s: int, h: float | None,
        first_step: float | None, every: int,
    ) -> None:  # fmt: skip
        t, y, t_bound = solver.t, solver.y, float(np.clip(solver.t_bound, -LATEST, LATEST))
        quadrature_error = None
        if k is None:
            k, quadrature_error = nodes(field.system, s)
        self.k, self._field, self._every, self._longest = k, field, every, solver.max_step
        self._t_bound = t_bound
        if h is None:
            tol = float(np.min(solver.rtol))
            atol = tuple(solver.atol.tolist()) if solver.atol.ndim else float(solver.atol)
            program = _program(field.system, k, s, first_step, tol, quadrature_error, atol)
            self._program_between = _program(field.system, k, s, BEYOND)
        else:
            program = self._program_between = _program(field.system, k, s, h)
        self._stepper: Any = program.start(y, field.par, t)
        if np.isfinite(t_bound):
            self._stepper.destination = float(t_bound)
        self._between: Between | None = None
        self._started = False
        self._chosen = int(h is None and first_step is None)  # evaluations to choose the first step
        self._fixed = None if h is None else _Count(t, np.copysign(h, t_bound - t), t_bound)
        self._before = t, y
        self._made = Samples(np.empty(0), np.empty((0, y.size)), Status.RUNNING)

    @property
    def nfev(self) -> int:
        """States at which the field was evaluated."""
        between = 0 if self._between is None else self._between.evaluations
        return self._chosen + int(self._stepper.stats.evaluations) + between

    @property
    def njev(self) -> int:
        """Evaluations of the Jacobian."""
        return int(self._stepper.stats.extra.get("implicit", {}).get("jacobians", 0))

    @property
    def nlu(self) -> int:
        """Factorisations."""
        return int(self._stepper.stats.extra.get("implicit", {}).get("factorizations", 0))

    def take(self, t: float, y: Array) -> tuple[float, Array] | str:
        """Go on from (t, y), which is where the last call ended; return time and state, or why not."""
        if self._stepper.status.failed:
            return str(self._stepper.reason)
        samples = self._own()
        if not (samples.t.size or samples.status.failed):
            samples = self._stepper.advance(np.array([self._t_bound]), sample="partial")
        if not samples.t.size:
            underflow = samples.status is Status.STEP_UNDERFLOW  # SciPy has a sentence for that
            return (
                f"{OdeSolver.TOO_SMALL_STEP} At t = {t!r}: {samples.reason}" if underflow else samples.reason
            )
        self._before, self._made = (t, y), samples
        end = float(samples.t[-1])
        if abs(end - self._t_bound) <= SNAP * math.ulp(self._t_bound):
            end = samples.t[-1] = self._t_bound
        return end, samples.y[-1].copy()

    def _own(self) -> Samples:
        """Take steps, none beyond the bound."""
        if self._fixed is None:
            return self._stepper.take_steps(self._t_bound, limit=self._every, longest=self._longest)
        times = self._fixed.next(self._every)
        if not times.size:
            return Samples(times, np.empty((0, self._before[1].size)), Status.RUNNING)
        if self._started:
            return self._stepper.take(times.size)
        self._started = True  # and turned, if it goes back
        return self._stepper.advance(times, sample="partial")

    def dense_output(self) -> DenseOutput:
        """Return the states between the present one and the one before."""
        if self._between is None:
            self._between = Between(self._program_between, self._field.par)
        t, y = self._before
        times = np.concatenate([[t], self._made.t])
        return NativeOutput(self._between, times, np.concatenate([y[np.newaxis], self._made.y]))


class _Count:
    """The times t0 + n h, n = 1, 2, ... up to a bound."""

    def __init__(self, t0: float, h: float, t_bound: float) -> None:
        self._t0, self._h, self._n = t0, h, 0
        self._last: float = np.inf
        if abs(t_bound) < LATEST:
            steps, _ = plan(np.array([t_bound]), np.array([t0]), h)
            self._last = int(steps[0])

    def next(self, most: int) -> Array:
        """Return the times of the next steps, ``most`` of them or what is left."""
        first, self._n = self._n + 1, int(min(self._n + most, self._last))
        return self._t0 + self._h * np.arange(first, self._n + 1, dtype=np.float64)


class Between:
    """States between steps, each by one partial step from the step before it.

    Parameters
    ----------
    program : Program
        HBVM(k, s) with steps that are longer than those to be made.
    par : ndarray, shape (n_par,)
        Parameters.
    """

    def __init__(self, program: "integrators.protocol.Program", par: Array) -> None:
        self._program, self._par = program, par
        self._stepper: Any = None
        self._lock = Lock()  # dense output may be evaluated in several threads
        self._earlier = 0

    @property
    def evaluations(self) -> int:
        """States at which the field was evaluated."""
        return self._earlier + (0 if self._stepper is None else int(self._stepper.stats.evaluations))

    def state(self, t0: float, y: Array, t: float) -> Array:
        """Return the state at t from that at t0; not a number where the step cannot be solved."""
        with self._lock:
            if not isinstance(self._stepper, FixedStepper):
                self._earlier = self.evaluations
                self._stepper = self._program.start(y, self._par, t0)
            if isinstance(self._stepper, FixedStepper):
                samples = self._stepper.single(y, t0, t)
            else:
                samples = self._stepper.advance(np.array([t]), sample="stop")
            return samples.y[0] if samples.t.size else np.full(y.size, np.nan)


class NativeOutput(DenseOutput):
    """States between steps: of order 2s, and the energy is conserved.

    Parameters
    ----------
    between : Between
        What makes them.
    times, states : ndarray, shapes (m,), (m, n)
        Steps.
    """

    def __init__(self, between: Between, times: Array, states: Array) -> None:
        super().__init__(float(times[0]), float(times[-1]))
        self._between, self._times, self._states = between, times, states
        self._sign = 1.0 if times[-1] >= times[0] else -1.0

    def _call_impl(self, t: Array) -> Array:
        times = np.atleast_1d(t).astype(float)
        places = np.searchsorted(self._sign * self._times, self._sign * times, side="right") - 1
        places = np.clip(places, 0, self._times.size - 1)
        states_ = [self._at(i, time) for i, time in zip(places.tolist(), times.tolist(), strict=True)]
        states = np.array(states_).reshape(times.size, -1).T
        return states[:, 0] if t.ndim == 0 else states

    def _at(self, i: int, t: float) -> Array:
        start = float(self._times[i])
        return self._states[i] if t == start else self._between.state(start, self._states[i], t)


def nodes(system: System, s: int) -> tuple[int, float | None]:
    """Return k, and what the error of a step's quadrature is bounded by, for adaptive steps.

    A function that is not traced may have an energy; one that is tells whether it has.
    """
    k = max(FEWEST, -(-2 * s // LANES) * LANES)
    if not system.traced:
        return k, QUADRATURE_ERROR
    if system.kind == "poisson" or system.energy is None:
        return k, None
    nu = degree(system)
    return k, None if nu is not None and exact_k(nu, s) <= k else QUADRATURE_ERROR


@lru_cache(maxsize=32)
def _program(
    system: System,
    k: int,
    s: int,
    h: float | None,
    tol: float | None = None,
    quadrature_error: float | None = None,
    atol: float | tuple[float, ...] | None = None,
) -> "integrators.protocol.Program":
    if quadrature_error is not None:
        from integrators.kernel.plan import Plan
        from integrators.kernel.program import HBVMProgram

        assert tol is not None
        plan = Plan(k=k, s=s, tol=tol, quadrature_error=quadrature_error, h=h, atol=atol)
        return HBVMProgram(system, plan)
    if k == s:
        return integrators.Gauss(s=s, h=h, tol=tol, atol=atol).compile(system)
    return integrators.HBVM(k=k, s=s, h=h, tol=tol, atol=atol).compile(system)
