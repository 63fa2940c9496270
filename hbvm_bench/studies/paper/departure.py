"""When a trajectory leaves: bulk steps in compiled code, looked at between stretches."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from integrators.protocol import Array, Stepper

Test = Callable[[Array], NDArray[np.bool_]]

GROWTH = 2.0  # of the stretches: short at first, so that an early departure costs little
LONGEST = 4096.0  # stretch, in units of the first


def departure(
    stepper: Stepper, t_end: float, departed: Test, *, stretch: float, every: float | None = None
) -> float | None:
    """Integrate until a state has departed; return the time of the first such state.

    Parameters
    ----------
    stepper : Stepper
        A trajectory under way.
    t_end : float
        How far to look.
    departed : callable
        From states (n, dim) to booleans (n,).
    stretch : float
        Length of the first stretch of time that is integrated without looking;
        the next ones are longer.
    every : float, optional
        Look at states so far apart; by default at every step of the method, which
        costs some libraries dear.

    Returns
    -------
    float or None
        ``None`` where nothing departed up to ``t_end``. A trajectory that its method
        can follow no farther, as in a blow-up, has departed with its last state.
    """
    longest = stretch * LONGEST
    ahead = stepper.t
    while ahead < t_end:
        start, ahead = ahead, min(ahead + stretch, t_end)
        if every is None:
            samples = stepper.advance(np.array([ahead]), sample="steps")
        else:
            samples = stepper.advance(
                np.linspace(start, ahead, max(2, round((ahead - start) / every) + 1))[1:]
            )
        if samples.t.size:
            found = np.flatnonzero(departed(samples.y))
            if found.size:
                return float(samples.t[found[0]])
        if samples.status.failed:
            return stepper.t
        stretch = min(stretch * GROWTH, longest)
    return None
