"""States between the steps that `integrators.plugins.scipy.python` takes."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DenseOutput

from integrators.plugins.scipy.stages import Stages, polynomial

Array = NDArray[Any]


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
