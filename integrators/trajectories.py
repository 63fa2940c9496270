"""What integrating many starts of one system at once returns, whoever does it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from integrators.protocol import Array, Status

Counts = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Trajectories of one system.

    Attributes
    ----------
    t : ndarray, shape (m,)
        Times.
    y : ndarray, shape (n, m, dim)
        States; NaN where a trajectory did not arrive.
    status, reason : list, length n
        How each trajectory ended, and one sentence where it failed.
    t_stop : ndarray, shape (n,)
        The last time, or that of the last own step before a failure.
    steps : ndarray of int, shape (n,)
        Own steps; accepted ones where lengths vary.
    """

    t: Array
    y: Array
    status: list[Status]
    reason: list[str]
    t_stop: Array
    steps: Counts
