"""Where and how often one event happened along a trajectory."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.protocol import Array


@dataclass(frozen=True, eq=False)
class Occurrences:
    """Occurrences of one event.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times, in the order of integration.
    y : ndarray, shape (n, dim)
        States at these times, each the end of a partial step.
    direction : ndarray of int, shape (n,)
        1 where g increases, -1 where it decreases, 0 where it touches zero without a change of sign.
    after : ndarray, shape (n, dim), optional
        The states after the event's action; ``None`` for an event without one.
    par : ndarray, shape (n, n_par), optional
        The parameters from then on, as `System.unpack` takes them; ``None`` for an event without an action.
    """

    t: Array
    y: Array
    direction: NDArray[np.int64]
    after: Array | None = None
    par: Array | None = None

    def __len__(self) -> int:
        return self.t.size

    def select(self, which: NDArray[Any]) -> "Occurrences":
        """Return some of them, by a mask or indices."""
        after = None if self.after is None else self.after[which]
        par = None if self.par is None else self.par[which]
        return Occurrences(self.t[which], self.y[which], self.direction[which], after, par)
