"""The mean divergence of the field along a trajectory, which all Lyapunov exponents add up to.

Where the divergence is not constant, its integral is that of a further component, ``z' = div f(t, y)``, by
the Runge-Kutta method of the steps: ``h sum_i b_i div f(t_i, Y_i)``, with the stages ``Y_i`` of each step. It
does not change the steps. The logarithm of the determinant of a step's derivative differs from it by the
local error of the vectors.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from integrators.protocol import Array, Status
from problems import emit
from problems.problem import Problem, System
from problems.trace.graph import STATE, T

ROOM = 1 << 22  # bytes of recorded stages, at most

Divergence = Callable[[Array, Array], Array]
"""Times (n,) and states (dim, n) to the divergence there, (n,)."""


def mean_divergence(problem: Problem, stepper: Any, start: float, end: float, marks: Array) -> float | None:
    """Return the mean of the field's divergence between the ends of two steps.

    Parameters
    ----------
    problem : Problem
        Traced.
    stepper : Stepper
        At the problem's start, of a method that has gradients; it takes the steps again.
    start, end : float
        Times at which steps end.
    marks : ndarray, shape (m,)
        The times up to which steps were taken, one after another: adaptive steps of a field that depends on
        the time depend on how far they go.

    Returns
    -------
    float or None
        0 for canonical systems; ``None`` where the Jacobian of the field is too large to be written down, and
        where the steps do not get to the end.
    """
    system = problem.system
    if system.dof is not None:
        return 0.0
    trace = _Trace(system, problem.par)
    if not trace.known:
        return None
    if trace.constant:
        return float(trace(np.array([problem.t0]), problem.y0[:, np.newaxis])[0])
    integral = _integral(trace, stepper, start, end, marks)
    return None if integral is None else integral / (end - start)


class _Trace:
    """The divergence: the sum of the diagonal of the Jacobian.

    Attributes
    ----------
    known : bool
        Whether there is a Jacobian.
    constant : bool
        Whether it is the same everywhere and always.
    """

    def __init__(self, system: System, par: Array):
        jacobian = system.jacobian()
        self.known, self.constant = jacobian is not None, False
        if jacobian is None:
            return
        diagonal = np.flatnonzero(jacobian.rows == jacobian.columns)
        function = jacobian.function
        if not function.loops:  # the other entries need not be computed
            function = replace(function, outputs=tuple(function.outputs[i] for i in diagonal))
            diagonal = np.arange(diagonal.size)
        self.constant = not any(node.flags & (T | STATE) for node in function.roots)
        self._diagonal, self._par = diagonal, par
        self._entries = emit.numpy_of(function, "divergence") if diagonal.size else None

    def __call__(self, t: Array, y: Array) -> Array:
        if self._entries is None:
            return np.zeros_like(t)
        return np.sum(self._entries(t, y, self._par)[self._diagonal], axis=0)


def _integral(trace: Divergence, stepper: Any, start: float, end: float, marks: Array) -> float | None:
    """Return the integral of a function of time and state, by the quadrature of the steps."""
    capacity = int(max(1, ROOM // stepper.recorder(1).bytes))
    parts, ends = [], []
    records, left = stepper.recorder(capacity), list(marks.tolist()[::-1])
    stepper.record(records)
    while left:
        asked = capacity - len(records)
        samples = stepper.march(left[-1], asked)
        ends.append(samples.t)
        if samples.t.size < asked:
            left.pop()
        failed = samples.status is not Status.FINISHED
        if failed or not left or len(records) == capacity:
            t = np.concatenate(ends)
            parts.append(_quadrature(trace, records, (t > start) & (t <= end)))
            if failed or not left:
                break
            ends, records = [], stepper.recorder(capacity)
            stepper.record(records)
    return float(np.sum(parts)) if stepper.t == end else None


def _quadrature(trace: Divergence, records: Any, counted: Any) -> float:
    """Return the sum over those steps of some that are counted."""
    heads, stages, _ = records.read()
    heads, stages = heads[counted], stages[counted].swapaxes(0, 1)
    arrays = records.shape.constants.arrays
    nodes, weights = arrays["nodes"].reshape(-1), arrays["weights"].reshape(-1)
    t0, low, n, h = heads[:, :4].T[..., np.newaxis]
    t = t0 + n * h + (h * nodes + low)
    values = trace(t.reshape(-1), stages.reshape(len(stages), -1)).reshape(t.shape)
    return float(np.sum(h[:, 0] * (values @ weights)))
