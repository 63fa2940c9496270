"""The segments of a trajectory between events that change the state or the parameters."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.protocol import Array
from problems.analysis import deviations, invariants
from problems.problem import System

CLOSE = 2.0**-48  # relative difference up to which a sample's time may be that of an event


@dataclass(frozen=True, eq=False)
class Segments:
    """Where the segments of a trajectory begin.

    Attributes
    ----------
    t : ndarray, shape (k,)
        Times, the first of which is the start of the trajectory.
    y : ndarray, shape (k, dim)
        States: what the events there have made.
    par : ndarray, shape (k, n_par)
        Parameters along the segments.
    before : ndarray, shape (k, dim)
        States that the events have changed.
    sign : {1.0, -1.0}
        The direction of time.
    """

    t: Array
    y: Array
    par: Array
    before: Array
    sign: float

    @classmethod
    def from_events(
        cls, t0: float, y0: Array, par: Array, events: Mapping[str, Any], sign: float
    ) -> "Segments":
        """Return those of a trajectory from (t0, y0), whose events have `Occurrences` by their names.

        Of events at one time, the last one counts.
        """
        t, y, before = [np.array([t0])], [y0[np.newaxis]], [y0[np.newaxis]]
        parameters = [par[np.newaxis]]
        for happened in events.values():
            if happened.after is None:
                continue
            t.append(happened.t)
            y.append(happened.after)
            before.append(happened.y)
            same = np.broadcast_to(par, (happened.t.size, par.size))
            parameters.append(same if happened.par is None else happened.par)
        times = np.concatenate(t)
        order = np.argsort(sign * times, kind="stable")
        last = np.append(times[order][1:] != times[order][:-1], True)
        chosen = order[last]
        states, pars, changed = (np.concatenate(parts)[chosen] for parts in (y, parameters, before))
        return cls(times[chosen], states, pars, changed, sign)

    def places(self, t: Array, y: Array) -> NDArray[np.int64]:
        """Return the numbers of the segments that samples (m,), (m, dim) belong to.

        A sample at the time of an event but for rounding is before or after it, as its state tells.
        """
        places = np.searchsorted(self.sign * self.t, self.sign * t, side="right") - 1
        following = np.minimum(places + 1, self.t.size - 1)
        close = np.abs(self.t[following] - t) <= CLOSE * np.abs(t)
        after = np.abs(y - self.y[following]).max(axis=1, initial=0.0)
        before = np.abs(y - self.before[following]).max(axis=1, initial=0.0)
        return np.where(close & (after <= before), following, np.maximum(places, 0))

    def invariants(self, system: System, t: Array, y: Array) -> dict[str, Array]:
        """Return the invariants at samples (m,), (m, dim), with the parameters of each, by name."""
        par = self.par[0] if self.t.size == 1 else self.par[self.places(t, y)].T
        return invariants.invariants(system, par, y, t)

    def errors(self, system: System, t: Array, y: Array) -> dict[str, Array]:
        """Return how far they are from those at the start of the segment of each sample, shape (m,)."""
        starts, owner = (self.t, self.y), self.places(t, y)
        return deviations.errors(system, self.par.T, y, t, starts=starts, owner=owner)
