"""Steps that are the same backwards: their lengths follow the field's time scale along the trajectory."""

import numpy as np

from integrators.kernel.adaptive import Adaptive
from integrators.kernel.context import Context, Shape
from integrators.kernel.native import field as fields
from integrators.kernel.plan import Plan
from integrators.kernel.step.rule import LOG_RESIDUAL
from integrators.kernel.stepper import Program
from integrators.protocol import Array
from problems import targets
from problems.problem import System
from problems.targets.time_scale import time_scale

SCOUTED = 256
"""Ordinary adaptive steps that tell how long reversible ones are."""

MOST_EPSILON = 0.2
"""Reversible steps are no longer than this part of the field's time scale, whose density longer ones lose."""


class Reversible(Adaptive):
    """What reversible steps of a plan have besides.

    Parameters
    ----------
    system : System
        Traced, not of the time.
    plan, shape
        As for `Adaptive`, k = s.
    ordinary : Program
        The same with adaptive steps: `SCOUTED` of them tell how long these are.
    """

    def __init__(self, system: System, plan: Plan, shape: Shape, ordinary: Program):
        super().__init__(system, plan, shape)
        self._scale = time_scale(system.function("field"), system.n_par)
        self._pace = fields.compile_field(system, self._scale, shape.constants.lanes)
        self._ordinary = ordinary
        self.more = {"pace.rows": system.dim, "pace.parameters": system.n_par + 1}

    @property
    def free(self) -> bool:
        """Whether nothing but the tolerance limits the steps: lanes have no such steps."""
        return False

    def description(self, solver: str, kept: str) -> str:
        """Return the method with all that steps depend on, as text."""
        return f"Gauss(s={self.plan.s}, tol={self.tol!r}, steps='reversible')"

    def set(self, context: Context) -> None:
        """Set what fresh memory has of such steps."""
        super().set(context)
        context.solver.log_residual = LOG_RESIDUAL

    def renew(self, own: Context, par: Array) -> None:
        """Put what follows from parameters into the memory of a trajectory."""
        own.pace.par[:-1] = par

    def begin(self, own: Context, y: Array, par: Array, t0: float) -> None:
        """Put what a trajectory from (t0, y) begins with into its memory."""
        super().begin(own, y, par, t0)
        own.pace.code = self._pace
        ahead = self._ordinary.start(y, par, t0).take(SCOUTED)
        states = np.concatenate([y[np.newaxis], ahead.y]).T
        times = np.append(t0, ahead.t)
        rate = targets.numpy(self.system, self._scale)
        bare = rate(t0, states, np.append(par, 0.0))[0]
        order = np.argsort(bare)
        elapsed = np.cumsum(np.abs(np.gradient(times))[order])
        median = bare[order][np.searchsorted(elapsed, 0.5 * elapsed[-1])]  # over the time
        own.pace.par[:] = np.append(par, median)
        rates = rate(t0, states, own.pace.par)[0] ** 0.25
        lengths = np.diff(times) * (rates[:-1] + rates[1:]) / 2.0
        own.pace.epsilon = min(float(np.median(lengths[len(lengths) // 8 :])), MOST_EPSILON)
