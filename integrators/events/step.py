"""One step in which something may happen, looked at closely."""

from typing import Any

import numpy as np

from integrators.events import roots
from integrators.events.function import EventFunction
from integrators.protocol import Array, Stepper

FINEST = 256  # samples in a step, or in a part of one, that are not exceeded
DEEPEST = 8  # times that a step is halved where they do not resolve g
ISOLATED = 16  # changes of sign in a part that is not resolved: a pole, a jump or a corner makes fewer
LOST = 4.0  # times the rounding of one state: what many steps leave of a g that vanishes all along
SHORTEST = 1e-6  # of a step is more than a unit in the last place of time: else there is no place inside


class Unresolved(Exception):  # noqa: N818 -- it ends a search, with a status
    """An event's function that the samples do not show."""


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
    whole : Step, optional
        The step that this is a part of.
    """

    def __init__(
        self, probe: Stepper, before: Any, t: Array, y: Array, g: EventFunction, whole: "Step | None" = None
    ):
        self._probe, self._before = probe, before
        self._t, self._y, self._g = t, y, g
        self._whole = whole or self
        self.here: Any = None
        self._states: dict[float, tuple[float, Array]] = {}

    def events(
        self, places: Array, fine: Array, unresolved: bool, depth: int = 0
    ) -> list[tuple[float, Array, int]]:
        """Return times, states and directions of the zeros, from `roots.refined` values.

        Raises
        ------
        Unresolved
            If g varies too fast for as many samples as are taken in a step.
        """
        if self._vanishes(places, fine):
            return []
        degree = places.size // roots.FINE
        span = float(self._t[-1] - self._t[0])
        resolution = float(np.spacing(max(abs(self._t[0]), abs(self._t[-1])))) / abs(span)
        while unresolved and degree < FINEST and resolution < SHORTEST:
            degree = min(4 * degree, FINEST)
            places, fine, unresolved = self._closer(degree)
        if unresolved and depth < DEEPEST and resolution < SHORTEST:
            return self._halves(depth)
        if unresolved:  # at a pole, a jump or a corner the polynomial between the samples means nothing
            places, fine = places[:: roots.FINE], fine[:: roots.FINE]
            if np.count_nonzero(np.diff(np.sign(fine))) > ISOLATED:
                raise Unresolved(
                    f"the event {self._g.name!r} varies too fast to be followed between t = "
                    f"{float(self._t[0])!r} and {float(self._t[-1])!r}, where {FINEST} samples do not show "
                    "how: give the method shorter steps, or the event a smoother function."
                )
        if not roots.suspects(fine[np.newaxis])[0]:
            return []
        found = roots.Finder(places, fine, self._value, self._noise, resolution).zeros()
        return [(*self._state(zero.x), zero.direction) for zero in found]

    def _vanishes(self, places: Array, fine: Array) -> bool:
        """Whether g is no more than rounding all along: at both ends, and where the samples are largest."""
        size = np.where(np.isfinite(fine), np.abs(fine), 0.0)
        largest = float(places[1 + int(np.argmax(size[1:-1]))])
        return all(abs(self._value(x)) <= LOST * self._noise(x) for x in (0.0, 1.0, largest, 0.5))

    def _halves(self, depth: int) -> list[tuple[float, Array, int]]:
        """Return what `events` does from both halves."""
        middle, y = self._state(0.5)
        found: list[tuple[float, Array, int]] = []
        for t, states in (
            ([self._t[0], middle], [self._y[0], y]),
            ([middle, self._t[-1]], [y, self._y[-1]]),
        ):
            part = Step(self._probe, self._before, np.array(t), np.array(states), self._g, self._whole)
            found += part.events(*part._closer(FINEST), depth + 1)
        return found

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
        """Put the probe at the beginning of this step, the whole one."""
        if self._whole is not self:
            self._whole._go()
        elif self.here is None:
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
