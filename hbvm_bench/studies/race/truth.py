"""Where the trajectories of the race truly end: 128-bit solutions, stored with their provenance."""

import numpy as np
from numpy.typing import NDArray

from hbvm_bench.measure import measured
from hbvm_bench.reference import solutions as reference
from problems.problem import Problem

INTERVALS = 10
"""The states are kept at this many equal parts of the span; ``--quick`` ends at the first."""


def known(problem: Problem) -> reference.Reference:
    """Return the true solution of a contest's problem: the stored one, or else one computed now.

    Parameters
    ----------
    problem : Problem
        The contest's problem over its whole span.

    Raises
    ------
    problems.errors.MissingLibraryError
        If it has to be computed and heyoka is missing.
    """
    stored = reference.find(problem)
    if stored is not None and stored.t[-1] == problem.t_end:
        return stored
    return reference.parse(reference.compute(problem, intervals=INTERVALS))


def nearest(true: reference.Reference, t: float) -> int:
    """Return which of the stored times after the start is nearest to ``t``."""
    return 1 + int(np.argmin(np.abs(true.t[1:] - t)))


def position_error(problem: Problem, true: reference.Reference, t: float, y: NDArray[np.float64]) -> float:
    """Return the error of the positions of a state, as `hbvm_bench.measure.measured.POSITION` says.

    Parameters
    ----------
    problem : Problem
        Says which part of the state is a position.
    true : Reference
        Must contain the time.
    t : float
        The time.
    y : ndarray, shape (dim,)
        The state.
    """
    row = int(np.flatnonzero(true.t == t)[0])
    # the truth is a pair of doubles, so that its own rounding does not enter the difference
    difference = (y - true.high[row]) - true.low[row]
    with np.errstate(over="ignore", invalid="ignore"):
        return float(measured.position_error(problem, difference[None], true.high)[0])
