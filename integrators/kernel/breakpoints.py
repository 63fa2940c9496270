"""The times at which steps end: those given, and those at which formulas switch."""

import math
from collections.abc import Iterator

import numpy as np

from integrators.protocol import Array
from problems.analysis.switches import Switches

OVERLAP = 2.0**-40  # part of an interval by which more is looked at on both sides
RESOLUTION = 2.0**-50  # of the largest time: switches so close to the present time are there
MOST_INTERVALS = 64  # each at least as long as the last, that are looked at where there is no end


class Breakpoints:
    """Breakpoints of one trajectory, with certain parameters, from interval to interval.

    Parameters
    ----------
    given : ndarray, shape (n,)
        Times, ascending.
    switches : Switches
        Those of the field. Where there is no list of all, those of an interval ahead are known at a time.
    par : ndarray, shape (n_par,)
        Parameters.
    """

    def __init__(self, given: Array, switches: Switches, par: Array):
        self._given, self._switches, self._par = given, switches, par.copy()
        some = switches.any
        self.any = some or bool(given.size)
        self._points = np.empty(0)
        self._all = given  # with the switches that are known
        self._low, self._high = (math.nan, math.nan) if some else (-math.inf, math.inf)
        self._span, self._longest = 0.0, math.inf
        self._resolutions: dict[float, float] = {}

    def moved_by(self, par: Array) -> bool:
        """Whether other parameters move them."""
        return self._switches.any and self._switches.moved(self._par, par)

    def resolution(self, t: float) -> float:
        """Return how far from a breakpoint rounding may have the field switch, as far as that is known."""
        return self._resolutions.get(t, 0.0)

    def around(self, t: float, span: float) -> list[float]:
        """Return the breakpoints next to a time.

        Parameters
        ----------
        t : float
            The time.
        span : float
            Length of an interval to look at, with the sign of the direction of time; not 0.
        """
        self._see(t, span)
        i = int(np.searchsorted(self._all, t))
        return self._all[max(i - 1, 0) : i + 1].tolist()

    def ahead(self, t: float, end: float, span: float) -> Iterator[float]:
        """Yield the breakpoints beyond a time, one after another.

        Parameters
        ----------
        t, end : float
            Those up to ``end`` are wanted, which may be infinite.
        span : float
            As of `around`.
        """
        sign = math.copysign(1.0, span)
        self._see(t, span)
        last = t
        for _ in range(MOST_INTERVALS):
            edge = self._high if sign > 0.0 else self._low
            yield from _between(self._all, last, edge)
            if not (end - edge) * sign > 0.0:
                return
            last = edge
            self._span = max(self._span, abs(span))
            self._extend(t, edge, sign, abs(end - edge))
        yield from _between(self._given, last, sign * math.inf)

    def _see(self, t: float, span: float) -> None:
        """Let an interval be known that a time is in."""
        if not self._low <= t <= self._high:
            self._points, self._low, self._high, self._span = np.empty(0), t, t, abs(span)
            self._extend(t, t, math.copysign(1.0, span), math.inf)

    def _extend(self, t: float, edge: float, sign: float, rest: float) -> None:
        """Let more be known beyond an edge, by ``rest`` at most, and forget what is behind a time."""
        span = min(self._span, self._longest, rest)
        overlap = OVERLAP * max(span, abs(edge))
        ends = edge - sign * overlap, edge + sign * (span + overlap)
        times, resolutions, near, far = self._switches.times(self._par, *ends)
        if math.isinf(far):
            self._points, self._low, self._high = times, -math.inf, math.inf
            self._all = np.union1d(self._given, times)
            return
        here = np.abs(times - t) <= RESOLUTION * max(abs(near), abs(far))
        kept = self._points[(self._points - t) * sign >= 0.0]
        ahead = {time: at for time, at in self._resolutions.items() if (time - t) * sign >= 0.0}
        self._resolutions = ahead | resolutions
        for time in times[here].tolist():
            self._resolutions[t] = max(self.resolution(t), self.resolution(time))
        self._points = np.union1d(kept, np.where(here, t, times))
        self._all = np.union1d(self._given, self._points)
        self._low, self._high = (t, far) if sign > 0.0 else (far, t)
        self._span = 2.0 * span
        if abs(far - near) < 0.5 * span:  # there are too many
            self._longest = 2.0 * abs(far - edge)


def _between(points: Array, last: float, edge: float) -> Iterator[float]:
    """Yield ascending points beyond ``last`` up to ``edge``, found by bisection, one after another."""
    if edge > last:
        indices = range(*np.searchsorted(points, (last, edge), "right").tolist())
    else:
        indices = reversed(range(*np.searchsorted(points, (edge, last), "left").tolist()))
    return (float(points[i]) for i in indices)
