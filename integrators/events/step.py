"""One step in which something may happen, looked at closely."""

from typing import Any

import numpy as np

from integrators.events import roots
from integrators.events.function import EventFunction
from integrators.protocol import Array, Stepper

FINEST = 256  # samples in a step that are not exceeded


class Step:
    """An own step, or the beginning of one, in which something may happen.

    Parameters
    ----------
    probe : Stepper
        For partial steps.
    before : checkpoint
        An own step at or before this one.
    t, y : ndarray, shapes (degree + 1,), (degree + 1, dim)
        Samples of the step's polynomial.
    g : EventFunction
        What may vanish.
    """

    def __init__(self, probe: Stepper, before: Any, t: Array, y: Array, g: EventFunction):
        self._probe, self._before = probe, before
        self._t, self._y, self._g = t, y, g
        self.here: Any = None
        self._states: dict[float, tuple[float, Array]] = {}

    def events(self, places: Array, fine: Array, unresolved: bool) -> list[tuple[float, Array, int]]:
        """Return times, states and directions of the zeros, from `roots.refined` values."""
        degree = self._t.size - 1
        while unresolved and degree < FINEST:
            degree = min(4 * degree, FINEST)
            places, fine, unresolved = self._closer(degree)
        if unresolved:  # at a pole, a jump or a corner the polynomial between the samples means nothing
            places, fine = places[:: roots.FINE], fine[:: roots.FINE]
        if not roots.suspects(fine[np.newaxis])[0]:
            return []
        span = float(self._t[-1] - self._t[0])
        resolution = float(np.spacing(max(abs(self._t[0]), abs(self._t[-1])))) / abs(span)
        found = roots.Finder(places, fine, self._value, self._noise, resolution).zeros()
        return [(*self._state(zero.x), zero.direction) for zero in found]

    def _closer(self, degree: int) -> tuple[Array, Array, bool]:
        """Return what `roots.refined` does for more samples."""
        self._go()
        times = self._t[0] + roots.nodes(degree) * (self._t[-1] - self._t[0])
        made = self._probe.advance(times[1:-1], sample="dense")
        values = np.full(degree + 1, np.nan)
        values[[0, -1]] = self._g(self._t[[0, -1]], self._y[[0, -1]])
        values[1 : made.t.size + 1] = self._g(made.t, made.y)
        places, fine, unresolved = roots.refined(values[np.newaxis])
        return places, fine[0], bool(unresolved[0])

    def _go(self) -> None:
        """Put the probe at the beginning of this step."""
        if self.here is None:
            self._probe.restore(self._before)
            if self._probe.t != self._t[0]:
                self._probe.advance(self._t[:1], sample="side")
            self.here = self._probe.checkpoint()
        elif self._probe.t != self._t[0] or self._probe.status.failed:  # partial steps leave it there
            self._probe.restore(self.here)

    def _state(self, x: float) -> tuple[float, Array]:
        """Return the time and the state at a part of the step, by a partial step."""
        if x in (0.0, 1.0):
            end = -1 if x else 0
            return float(self._t[end]), self._y[end]
        if x not in self._states:
            t = float(self._t[0] + x * (self._t[-1] - self._t[0]))
            self._go()
            made = self._probe.advance(np.array([t]), sample="side")
            self._states[x] = (t, made.y[0] if made.t.size else np.full(self._y.shape[1], np.nan))
        return self._states[x]

    def _value(self, x: float) -> float:
        t, y = self._state(x)
        return float(self._g(np.array([t]), y[np.newaxis])[0])

    def _noise(self, x: float) -> float:
        return self._g.noise(*self._state(x))
