"""The mean divergence of the field along a trajectory, which all Lyapunov exponents add up to."""

from dataclasses import replace

import numpy as np

from integrators.protocol import Array
from problems import targets
from problems.graph.nodes import STATE, T
from problems.problem import Problem, System

WORK = 1 << 24  # products of derivatives that are computed, about, where the Jacobian is not written down


class Divergence:
    """The divergence of a problem's field: the sum of the diagonal of the Jacobian.

    Parameters
    ----------
    problem : Problem
        Traced.

    Attributes
    ----------
    constant : float or None
        Its value, where it is known to be the same everywhere and always: 0 for canonical systems.
    """

    def __init__(self, problem: Problem):
        self._trace, self.constant = None, 0.0
        if problem.system.dof is None:
            trace = self._trace = _Trace(problem.system, problem.par)
            start = np.array([problem.t0]), problem.y0[:, np.newaxis]
            self.constant = float(trace(*start)[0]) if trace.constant else None

    def mean(self, times: Array, states: Array) -> float:
        """Return the mean over times, by trapezoids.

        Parameters
        ----------
        times, states : ndarray, shapes (m,) and (m, dim)
            Of a trajectory, ascending.
        """
        if self.constant is not None or self._trace is None:
            return self.constant or 0.0
        if not self._trace.known:  # fewer times, if there is much to do at each
            most = max(2, WORK // states.shape[1] ** 2)
            chosen = np.unique(np.linspace(0, times.size - 1, most).astype(int))
            times, states = times[chosen], states[chosen]
        return float(np.trapezoid(self._trace(times, states.T), times) / (times[-1] - times[0]))


class _Trace:
    """The trace of the Jacobian.

    Attributes
    ----------
    known : bool
        Whether there is a Jacobian; a system may be so large that it is not written down. Its diagonal is
        then that of the derivatives along unit vectors.
    constant : bool
        Whether it is known to be the same everywhere and always.
    """

    def __init__(self, system: System, par: Array):
        jacobian = system.jacobian()
        self._system, self._par = system, par
        self.known, self.constant = jacobian is not None, False
        if jacobian is None:
            self._along = targets.numpy_of(system.tangent("field", 1, parameters=False), "along")
            return
        diagonal = np.flatnonzero(jacobian.rows == jacobian.columns)
        function = jacobian.function
        if not function.loops:  # the other entries need not be computed
            function = replace(function, outputs=tuple(function.outputs[i] for i in diagonal))
            diagonal = np.arange(diagonal.size)
        self.constant = not any(node.flags & (T | STATE) for node in function.roots)
        self._diagonal = diagonal
        self._entries = targets.numpy_of(function, "divergence") if diagonal.size else None

    def __call__(self, t: Array, y: Array) -> Array:
        """Return it at times (n,) and states (dim, n), shape (n,)."""
        if self.known:
            if self._entries is None:
                return np.zeros_like(t)
            return np.sum(self._entries(t, y, self._par)[self._diagonal], axis=0)
        total = np.zeros_like(t)
        for i in range(self._system.dim):
            unit = np.zeros_like(y)
            unit[i] = 1.0
            total += self._along(t, np.concatenate([unit, y]), self._par)[i]
        return total
