"""When a trajectory leaves: bulk steps in compiled code, looked at between stretches."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from integrators.protocol import Array, MethodBase, Stepper
from problems import Problem

Test = Callable[[Array], NDArray[np.bool_]]  # from states (n, dim) to whether they hold
GROWTH = 2.0  # of the stretches: short at first, so that an early departure costs little
LONGEST = 4096.0  # stretch, in units of the first


def departure(stepper: Stepper, t_end: float, departed: Test, *, stretch: float) -> float | None:
    """Integrate until a state has departed; return the time of the first such state, or ``None``.

    A trajectory that its method can follow no farther, as in a blow-up, has departed with its last state.
    A stretch of time is integrated without looking, the next ones are longer; then all steps are looked at.
    """
    longest = stretch * LONGEST
    ahead = stepper.t
    while ahead < t_end:
        ahead = min(ahead + stretch, t_end)
        samples = stepper.advance(np.array([ahead]), sample="steps")
        if samples.t.size and (time := first(samples.t, departed(samples.y))) is not None:
            return time
        if samples.status.failed:
            return stepper.t
        stretch = min(stretch * GROWTH, longest)
    return None


def first(t: Array, holds: NDArray[np.bool_]) -> float | None:
    """Return the first of the times at which something holds; ``None`` where it never does."""
    return float(t[np.argmax(holds)]) if holds.any() else None


def step_states(problem: Problem, method: MethodBase, y0: Array, span: float) -> tuple[Array, Array, Stepper]:
    """Return the times (n,) and states (n, dim) at the steps of a method, with the start, and its stepper."""
    stepper = method.compile(problem.system).start(y0, problem.par, 0.0)
    samples = stepper.advance(np.array([span]), sample="steps")
    return np.concatenate([[0.0], samples.t]), np.vstack([y0, samples.y]), stepper
